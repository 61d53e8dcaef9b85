"""Captioned clips that a configuration names, in the parts that they may be used for."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mwlib.data.captions import CaptionedClip
from mwlib.data.formats.humanml_folder import read_folder
from mwlib.data.synthetic.captioned import captioned_people
from mwlib.settings import Count


@dataclass(frozen=True)
class CaptionsConfig:
    """Which captioned clips."""

    data: str = "people"  # "people", which are synthetic, or the folder of HumanML3D or KIT-ML
    clips: Count = 2400  # of "people"


class Parts(NamedTuple):
    """Clips by what they may be used for; no clip is in two parts."""

    train: list[CaptionedClip]
    val: list[CaptionedClip]
    test: list[CaptionedClip]

    def fingerprints(self) -> tuple[str, str]:
        """Of the clips that a model is trained on, and of those that it is tested on."""
        return fingerprint(self.train), fingerprint(self.test)


def load_clips(source: CaptionsConfig) -> Parts:
    """The configured clips in their splits.

    Raises:
        MotionFormatError: a file of the folder is malformed.
    """
    clips = captioned_people(source.clips) if source.data == "people" else read_folder(Path(source.data))
    return Parts(*([clip for clip in clips if clip.split == split] for split in ("train", "val", "test")))


def fingerprint(clips: Sequence[CaptionedClip]) -> str:
    """Eight hex digits over names, captions and features."""
    digest = hashlib.sha256()
    for clip in clips:
        digest.update("\n".join([clip.name, *clip.captions]).encode())
        digest.update(np.ascontiguousarray(clip.features, dtype=np.float32).tobytes())
    return digest.hexdigest()[:8]
