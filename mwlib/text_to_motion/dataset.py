"""Clips with captions: which ones a configuration names, and who is held out."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mwlib.data.captioned_cmu import captioned_cmu
from mwlib.data.captions import CaptionedClip, TaggedCaption
from mwlib.data.formats.humanml import LAYOUTS, FeatureLayout
from mwlib.data.formats.humanml_folder import read_folder
from mwlib.data.load import data_folder, find_source
from mwlib.data.synthetic.captioned import captioned_people
from mwlib.settings import Count, Natural


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


def load_clips(source: CaptionsConfig) -> Parts:
    """The configured clips, parted as their collection parts them.

    Raises:
        ValueError: nothing is left to train or to test on.
        FileNotFoundError: there is no such folder.
        MotionFormatError: as the reader of the data.
    """
    clips = [_cut(clip, source.longest) for clip in _clips(source) if len(clip.features) >= source.shortest]
    train, val, test = ([clip for clip in clips if clip.split == split] for split in ("train", "val", "test"))
    if source.few:
        train = [train[i] for i in np.linspace(0, len(train) - 1, min(source.few, len(train))).round().astype(int)]
    if not train or not test:
        found = f"{source.data} has {len(train)} clips to train and {len(test)} to test on"
        raise ValueError(f"{found}, of {source.shortest} frames or more; expected some of both")
    return Parts(train, val, test)


def _clips(source: CaptionsConfig) -> list[CaptionedClip]:
    if source.data == "people":
        return _people(source.clips)
    if source.data == "cmu":
        return _cmu(data_folder().absolute())
    try:
        folder = find_source(source.data)
    except FileNotFoundError:
        found = f"data is {source.data!r}, which is neither here nor in {data_folder()}, the folder of data (MWLIB_DATA)"
        raise FileNotFoundError(f"{found}; expected people, cmu, or a folder laid out as HumanML3D or KIT") from None
    return _folder(folder)


@cache
def _people(clips: int) -> list[CaptionedClip]:
    return captioned_people(clips)


@cache
def _cmu(folder: Path) -> list[CaptionedClip]:
    return captioned_cmu(folder)


@cache
def _folder(folder: Path) -> list[CaptionedClip]:
    return read_folder(folder)


def _cut(clip: CaptionedClip, longest: int) -> CaptionedClip:
    """A clip that is cut may not show any more what was known of it."""
    if len(clip.features) <= longest:
        return clip
    return CaptionedClip(clip.features[:longest], clip.captions, clip.name, clip.split)


def fingerprint(clips: Sequence[CaptionedClip]) -> str:
    """Eight hex digits over names, captions, their parts of speech where these are told, and features."""
    digest = hashlib.sha256()
    for clip in clips:
        tagged = [caption.tagged for caption in clip.captions if isinstance(caption, TaggedCaption)]
        digest.update(f"{clip.name}/{clip.captions}/{clip.features.shape}{tagged or ''}".encode())
        digest.update(np.ascontiguousarray(clip.features, dtype=np.float32).tobytes())
    return digest.hexdigest()[:8]
