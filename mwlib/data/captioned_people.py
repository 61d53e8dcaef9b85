"""The embedded captioned set: synthetic people on HumanML3D's skeleton who do what a sentence says. Licence-free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from mwlib.data.formats.humanml import CaptionedClip
from mwlib.data.formats.humanml_encoding import features_of
from mwlib.synthetic.acts import act_out
from mwlib.synthetic.person import draw_figure
from mwlib.synthetic.sentences import captions_of, draw_attributes

PEOPLE = 60
# people in turns of twenty: 80, 5 and 15 of 100 are for training, validation and test
_SPLITS = ("train",) * 16 + ("val",) + ("test",) * 3


@dataclass(frozen=True, eq=False)
class ActedClip:
    """One clip of a synthetic person as joint positions, and what it shows.

    Args:
        positions: (T, 22, 3) metres, y up, 20 frames a second, 41 to 121 of them; starts above the origin and faces +z.
        captions: three sentences.
        attributes: as `draw_attributes` gives them.
        name: "P7_0127": the person, the number of the clip.
        split: "train", "val" or "test".
    """

    positions: Float[np.ndarray, "T 22 3"]
    captions: tuple[str, ...]
    attributes: dict[str, str | float]
    name: str
    split: str


def captioned_positions(clips: int = 2400, seed: int = 0) -> list[ActedClip]:
    """Clips of synthetic people with sentences and true attributes, as positions.

    Sixty people take turns. Nobody is in two splits; about 80, 5 and 15 of 100 clips are "train", "val" and "test". A clip
    depends on the seed and its number only, not on how many others are made.

    Own choice throughout: the papers use recorded motion, which cannot be redistributed.

    Raises:
        ValueError: fewer than one clip.
    """
    if clips < 1:
        raise ValueError(f"clips is {clips}; expected at least 1")
    return [_clip(number, seed) for number in range(clips)]


def captioned_people(clips: int = 2400, seed: int = 0) -> list[CaptionedClip]:
    """The clips of `captioned_positions` as features of HumanML3D, 40 to 120 frames, a multiple of four.

    Raises:
        ValueError: fewer than one clip.

    >>> clip = captioned_people(1)[0]
    >>> clip.features.shape, clip.split, clip.captions[0]
    ((76, 263), 'train', 'an adult walks briskly forward')
    """
    return [
        CaptionedClip(features_of(clip.positions), clip.captions, clip.name, clip.split, clip.attributes)
        for clip in captioned_positions(clips, seed)
    ]


def _clip(number: int, seed: int) -> ActedClip:
    person = number % PEOPLE
    figure = draw_figure(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, person))))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, number)))
    attributes = draw_attributes(rng)
    captions = captions_of(attributes, rng)
    name = f"P{person + 1}_{number:04d}"
    return ActedClip(act_out(attributes, figure, rng), captions, attributes, name, _SPLITS[person % len(_SPLITS)])
