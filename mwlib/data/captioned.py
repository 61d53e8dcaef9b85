"""Captioned clips: those that a configuration names, their split, and batches of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from mwlib.data.captioned_cmu import CAPTIONS, FOLDER, captioned_cmu
from mwlib.data.formats.humanml import LAYOUTS, CaptionedClip, FeatureLayout, TaggedCaption, read_folder
from mwlib.data.formats.humanml_encoding import features_of
from mwlib.data.load import data_folder, find_source, source_state
from mwlib.data.normalisation import Statistics
from mwlib.data.windows import JoinedClips
from mwlib.hashing import sha256
from mwlib.networks.matching import UNIT
from mwlib.settings import Count, Natural
from mwlib.synthetic.acts import captioned_positions


@dataclass(frozen=True)
class CaptionsConfig:
    """Which clips."""

    data: str = "people"  # "people", "cmu", or a folder laid out as HumanML3D or KIT, here or under MWLIB_DATA
    clips: Count = 2400  # of "people"; other data are what they are
    shortest: Count = 40  # frames: shorter clips are left out; at least 4. KIT's loader takes 24
    longest: Count = 196  # frames: longer clips are cut
    few: Natural = 0  # train on so many clips only, spread evenly; 0 = all


class Parts(NamedTuple):
    """Clips by what they may be used for; no clip, and where people are known no person, is in two parts."""

    train: list[CaptionedClip]
    val: list[CaptionedClip]
    test: list[CaptionedClip]

    def fingerprints(self) -> tuple[str, str]:
        """Of the clips that a model is trained on, and of those that it is tested on."""
        return fingerprint([*self.train, *self.val]), fingerprint(self.test)

    @property
    def layout(self) -> FeatureLayout:
        """What a row of features means."""
        return LAYOUTS[self.train[0].features.shape[1]]


def captioned_people(clips: int = 2400, seed: int = 0) -> list[CaptionedClip]:
    """The embedded captioned set, licence-free: the clips of `captioned_positions` as features of HumanML3D.

    Each has 40 to 120 frames, a multiple of four.

    Raises:
        ValueError: fewer than one clip.

    >>> clip = captioned_people(1)[0]
    >>> clip.features.shape, clip.split, clip.captions[0]
    ((76, 263), 'train', 'an adult walks briskly forward')
    """
    made = captioned_positions(clips, seed)
    return [CaptionedClip(features_of(x.positions), x.captions, x.name, x.split, x.attributes) for x in made]


def load_clips(source: CaptionsConfig) -> Parts:
    """The configured clips, parted as their collection parts them.

    Raises:
        ValueError: nothing is left to train or to test on.
        FileNotFoundError: there is no such folder.
        MotionFormatError: as the reader of the data.
    """
    clips = [_cut(clip, source.longest) for clip in _clips(source) if len(clip.features) >= source.shortest]
    train, val, test = ([clip for clip in clips if clip.split == split] for split in ("train", "val", "test"))
    train = thinned(train, source.few)
    if not train or not test:
        found = f"{source.data} has {len(train)} clips to train and {len(test)} to test on"
        raise ValueError(f"{found}, of {source.shortest} frames or more; expected some of both")
    return Parts(train, val, test)


def _clips(source: CaptionsConfig) -> list[CaptionedClip]:
    if source.data == "people":
        return _people(source.clips)
    if source.data == "cmu":
        folder = data_folder().absolute()
        return _cmu(folder, source_state(folder / FOLDER), source_state(folder / CAPTIONS))
    try:
        folder = find_source(source.data)
    except FileNotFoundError:
        found = f"data is {source.data!r}, which is neither here nor in {data_folder()}, the folder of data (MWLIB_DATA)"
        raise FileNotFoundError(f"{found}; expected people, cmu, or a folder laid out as HumanML3D or KIT") from None
    return _folder(folder.absolute(), source_state(folder))


_people = cache(captioned_people)


@lru_cache(maxsize=1)
def _cmu(folder: Path, *_state: object) -> list[CaptionedClip]:
    """The state of its files makes a changed folder be read again."""
    return captioned_cmu(folder)


@lru_cache(maxsize=2)
def _folder(folder: Path, *_state: object) -> list[CaptionedClip]:
    return read_folder(folder)


def _cut(clip: CaptionedClip, longest: int) -> CaptionedClip:
    """A clip that is cut may not show any more what was known of it."""
    if len(clip.features) <= longest:
        return clip
    return CaptionedClip(clip.features[:longest], clip.captions, clip.name, clip.split)


def thinned(items: Sequence[Item], count: int) -> list[Item]:
    """At most so many, spread evenly; 0 = all."""
    kept = min(count or len(items), len(items))
    return [items[i] for i in np.linspace(0, len(items) - 1, kept).round().astype(int)]


def fingerprint(clips: Sequence[CaptionedClip]) -> str:
    """Eight hex digits over names, captions, their parts of speech where these are told, and features."""
    return sha256(_contents(clips))[:8]


def _contents(clips: Sequence[CaptionedClip]) -> Iterator[bytes | str]:
    for clip in clips:
        tagged = [caption.tagged for caption in clip.captions if isinstance(caption, TaggedCaption)]
        yield f"{clip.name}/{clip.captions}/{clip.features.shape}{tagged or ''}"
        yield np.ascontiguousarray(clip.features, dtype=np.float32).tobytes()


SHORTENED = 1 / 3  # of the pieces
Item = TypeVar("Item")
BUCKETS = 8  # groups of clips of like lengths, one of which a batch comes from: own choice, a third less padding


class Batch(NamedTuple):
    """Normalised features, padded with zeros; which frames a sample has; its caption."""

    y: Float[Tensor, "B T D"]
    mask: Bool[Tensor, "B T"]
    lengths: Int[Tensor, " B"]
    captions: list[str]


def piece(
    full: Int[Tensor, " B"], shorter: Float[Tensor, " B"], place: Float[Tensor, " B"]
) -> tuple[Int[Tensor, " B"], Int[Tensor, " B"]]:
    """Lengths of pieces of clips, and where they start.

    Source: Guo et al., 2022, their loader: the length is cut to a multiple of 4, one time in three by 4 more; the piece starts
    anywhere.

    Args:
        full: frames of each clip, at least 4.
        shorter, place: random numbers between 0 and 1.
    """
    units = full // UNIT
    lengths = UNIT * torch.where(shorter < SHORTENED, units - 1, units).clamp_min(1)
    return lengths, (place * (full - lengths + 1)).long()


def joined(clips: Sequence[CaptionedClip], statistics: Statistics) -> JoinedClips:
    """Clips laid end to end, normalised, as a network sees them."""
    return JoinedClips([statistics.normalise(torch.from_numpy(clip.features)).float() for clip in clips])


class ClipBatches:
    """Random batches of clips of like lengths.

    Args:
        clips: at least one, none shorter than `UNIT` frames.
        statistics: normalises their features.
        padded: frames to which every batch is filled up; 0 = to its longest clip.
    """

    def __init__(self, clips: Sequence[CaptionedClip], statistics: Statistics, padded: int = 0) -> None:
        self.clips, self.frames, self.padded = clips, joined(clips, statistics), padded
        order = self.frames.lengths.argsort(stable=True)
        self.buckets = [part for part in order.tensor_split(min(BUCKETS, len(clips))) if len(part)]

    def to(self, device: torch.device) -> None:
        """Move the features."""
        self.frames.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Batch:
        """Random clips of like lengths, a random caption of each, and a random piece of it."""
        sizes = torch.tensor([len(bucket) for bucket in self.buckets], dtype=torch.float)
        bucket = self.buckets[int(torch.multinomial(sizes, 1, generator=generator))]
        picked = bucket[torch.randint(len(bucket), (batch,), generator=generator)]
        lengths, start = piece(self.frames.lengths[picked], *(torch.rand(batch, generator=generator) for _ in range(2)))
        words = torch.rand(batch, generator=generator).tolist()
        own = [self.clips[i].captions for i in picked.tolist()]
        return self._batch(picked, start, lengths, [texts[int(w * len(texts))] for texts, w in zip(own, words, strict=True)])

    def whole(self, numbers: Sequence[int], captions: Sequence[str]) -> Batch:
        """Given clips from their beginning, cut to a multiple of 4 frames."""
        picked = torch.tensor(numbers)
        return self._batch(picked, torch.zeros_like(picked), self.frames.lengths[picked] // UNIT * UNIT, list(captions))

    def _batch(self, clip: Tensor, start: Tensor, lengths: Int[Tensor, " B"], captions: list[str]) -> Batch:
        y = self.frames.take(clip, start, self.padded or int(lengths.max()))
        mask = (torch.arange(y.shape[1]) < lengths[:, None]).to(y.device)
        return Batch(y * mask[..., None], mask, lengths.to(y.device), captions)


def one_caption_each(clips: Sequence[CaptionedClip], seed: int) -> list[str]:
    """A random caption of every clip."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    return [clip.captions[int(rng.integers(len(clip.captions)))] for clip in clips]
