"""Motions as features with sentences that describe them: what text-to-motion is trained on and measured with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class CaptionedClip:
    """One clip as features, with sentences that describe it."""

    features: Float[np.ndarray, "T D"]  # raw (not normalised) HumanML3D or KIT features, float32
    captions: tuple[str, ...]  # at least one
    name: str = ""
    split: str = "train"  # "train", "val" or "test"
    attributes: Mapping[str, str | float] = field(default_factory=dict)  # ground truth where known (synthetic people)
