"""Motions as features with sentences that describe them: what text-to-motion is trained on and measured with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from jaxtyping import Float


class TaggedCaption(str):
    """A caption that keeps the words that its collection made of it, each with its part of speech.

    It is the caption itself wherever a sentence is asked for. Collections write the base form of most words.

    Args:
        text: the caption.
        tagged: words and parts of speech, in order.

    >>> TaggedCaption("a man walks", [("a", "DET"), ("man", "NOUN"), ("walk", "VERB")]).tagged[2]
    ('walk', 'VERB')
    """

    tagged: tuple[tuple[str, str], ...]

    def __new__(cls, text: str, tagged: Iterable[tuple[str, str]] = ()) -> Self:
        made = super().__new__(cls, text)
        made.tagged = tuple(tagged)
        return made


@dataclass(frozen=True, eq=False)
class CaptionedClip:
    """One clip as features, with sentences that describe it."""

    features: Float[np.ndarray, "T D"]  # raw (not normalised) HumanML3D or KIT features, float32
    captions: tuple[str, ...]  # at least one; `TaggedCaption` where the collection tells the parts of speech
    name: str = ""
    split: str = "train"  # "train", "val" or "test"
    attributes: Mapping[str, str | float] = field(default_factory=dict)  # ground truth where known (synthetic people)
