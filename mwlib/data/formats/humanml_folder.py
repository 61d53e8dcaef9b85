"""Folders of HumanML3D and KIT-ML as users have them: features, captions and lists of splits.

Source: the loader published with HumanML3D (Guo et al. 2022), whose rules on lengths and time stamps are kept.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from mwlib.body.motion import Motion
from mwlib.data.archives import read_array
from mwlib.data.captions import CaptionedClip, TaggedCaption
from mwlib.data.errors import BrokenFilesWarning, MotionFormatError
from mwlib.data.formats.humanml import LAYOUTS, FeatureLayout, joints_of
from mwlib.data.hints import Hints
from mwlib.data.opening import open_regular
from mwlib.data.reading import SMALL_TEXT, bounded, number, read_text
from mwlib.data.stated import FORMAT, Reading, Stated

FEATURES, JOINTS, TEXTS = "new_joint_vecs", "new_joints", "texts"
SPLITS = ("train", "val", "test")
TOO_LONG = 200  # frames; clips have fewer
STAMP_FPS = 20.0  # at which time stamps are turned into frames, for KIT too though it has 12.5: as published
FIELDS = 4  # of a line of text: caption, its words with their parts of speech, start and end in seconds
BROKEN = ("no features", "no captions", "not finite")  # what should not be; a wrong length is no fault


class FolderContents(NamedTuple):
    """What a folder holds.

    Args:
        clips: those that training and evaluation see.
        left_out: name of a clip, or of a stretch of one -> why it is not among them.
    """

    clips: list[CaptionedClip]
    left_out: Mapping[str, str]

    def report(self) -> str:
        """How many clips there are, how many were left out for which reason, and some of their names."""
        counts = Counter(clip.split for clip in self.clips)
        lines = [f"{len(self.clips)} clips: {', '.join(f'{n} {split}' for split, n in counts.items()) or 'none'}"]
        for reason, count in Counter(self.left_out.values()).most_common():
            names = [name for name, why in self.left_out.items() if why == reason][:5]
            lines.append(f"  {count} left out, {reason}: {', '.join(names)}{' ...' if count > len(names) else ''}")
        return "\n".join(lines)


def read_folder(path: Path, layout: FeatureLayout | None = None, splits: Sequence[str] | None = None) -> list[CaptionedClip]:
    """The captioned clips of a folder; see `folder_contents`, which also says what was left out.

    Warns (`BrokenFilesWarning`) of clips that the lists name but that are missing or hold numbers that are not finite, as
    000021 and 007975 of most copies of HumanML3D.
    """
    contents = folder_contents(path, layout, splits)
    broken = {name: why for name, why in contents.left_out.items() if why in BROKEN}
    if broken:
        warnings.warn(f"{path}: {FolderContents([], broken).report().partition(chr(10))[2].strip()}", BrokenFilesWarning, 2)
    return contents.clips


def folder_contents(path: Path, layout: FeatureLayout | None = None, splits: Sequence[str] | None = None) -> FolderContents:
    """Read new_joint_vecs/ID.npy and texts/ID.txt of the IDs in train.txt, val.txt and test.txt. Nothing is unpickled.

    A clip has at least 40 frames (KIT: 24) and fewer than 200; others are left out with all their captions. Captions of a
    whole clip belong to one entry. A caption with times is an entry of its own, cut out at 20 frames per second. That is
    the published rule for KIT too, whose 12.5 frames per second make it cut later and longer stretches than were meant.
    Captions keep their words with parts of speech, see `TaggedCaption`.

    Args:
        path: of the folder.
        layout: HUMANML3D or KIT; None: told by the width of the first features.
        splits: which of "train", "val" and "test"; None: those that have a list.

    Raises:
        MotionFormatError: a list is missing, a text or an array is malformed, or the features have another width.
        ValueError: an unknown split.
    """
    if unknown := [split for split in splits or () if split not in SPLITS]:
        raise ValueError(f"splits has {unknown[0]!r}; expected some of {', '.join(SPLITS)}")
    wanted = splits or [split for split in SPLITS if (path / f"{split}.txt").is_file()]
    if not wanted:
        raise MotionFormatError(path, "folder", "no list of clips", f"one of {', '.join(f'{s}.txt' for s in SPLITS)}")
    clips: list[CaptionedClip] = []
    left_out: dict[str, str] = {}
    for split in wanted:
        for name in read_text(path / f"{split}.txt", SMALL_TEXT).split():
            file = path / FEATURES / f"{name}.npy"
            if not file.is_file():
                left_out[name] = BROKEN[0]
                continue
            if not (path / TEXTS / f"{name}.txt").is_file():
                left_out[name] = BROKEN[1]
                continue
            features = _features(file)
            layout = layout or _layout(features, file)
            if features.shape[1] != layout.width:
                expected = f"(T, {layout.width}) for {layout.name}"
                raise MotionFormatError(file, "array", f"shape {features.shape}", expected)
            if why := _fault(features, layout):
                left_out[name] = why
                continue
            for clip in _entries(features, _captions(path / TEXTS / f"{name}.txt"), name, split):
                if why := _length_fault(len(clip.features), layout):
                    left_out[clip.name] = why
                else:
                    clips.append(clip)
    return FolderContents(clips, left_out)


def read_features(array: Shaped[np.ndarray, "*shape"], file: Path, hints: Hints) -> Reading:
    """A motion from features (T, 263 or 251) of new_joint_vecs, in metres, y up.

    Raises:
        MotionFormatError: another shape, or numbers that are not finite.
    """
    layout = _layout(array, file)
    joints = joints_of(bounded(array, file, "array").astype(np.float64), layout)
    unit = hints.unit or Stated(layout.metres_per_unit, FORMAT)
    up, fps = Stated("y", FORMAT), hints.fps or Stated(layout.fps, FORMAT)
    motion = Motion((joints * unit.value).astype(np.float32), fps.value, layout.skeleton, up=up.value)
    return Reading(hints.label(motion, file), unit, up, fps)


def is_features(shape: tuple[int, ...], file: Path) -> bool:
    """Whether an array in a folder is a motion as features: by its width and the folder's name."""
    return len(shape) == 2 and shape[-1] in LAYOUTS and file.parent.name == FEATURES


def without_features(files: Sequence[Path]) -> list[Path]:
    """The files but for features whose joints are among them."""
    there = {*files}
    return [file for file in files if file.parent.name != FEATURES or file.parent.parent / JOINTS / file.name not in there]


def _features(file: Path) -> Float[np.ndarray, "T D"]:
    with open_regular(file) as stream:
        array = read_array(stream, file, "array")
    if array.dtype.kind != "f" or array.ndim != 2 or len(array) == 0:
        raise MotionFormatError(file, "array", f"{array.dtype} of shape {array.shape}", "numbers of shape (T, D) with T > 0")
    return array.astype(np.float32)


def _layout(array: Shaped[np.ndarray, "*shape"], file: Path) -> FeatureLayout:
    """The layout whose width an array has."""
    if array.ndim != 2 or array.shape[-1] not in LAYOUTS or array.dtype.kind != "f" or len(array) == 0:
        expected = " or ".join(f"(T, {width}) for {layout.name}" for width, layout in LAYOUTS.items())
        raise MotionFormatError(file, "array", f"{array.dtype} of shape {array.shape}", f"numbers of shape {expected}")
    return LAYOUTS[array.shape[-1]]


def _fault(features: Float[np.ndarray, "T D"], layout: FeatureLayout) -> str:
    return BROKEN[2] if not np.isfinite(features).all() else _length_fault(len(features), layout)


def _length_fault(frames: int, layout: FeatureLayout) -> str:
    if frames < layout.shortest:
        return f"shorter than {layout.shortest} frames"
    return f"{TOO_LONG} frames or longer" if frames >= TOO_LONG else ""


class _Caption(NamedTuple):
    """A line of a text: its number, what it says, and of which seconds; 0 and 0 is the whole clip."""

    line: int
    text: str
    start: float
    end: float


def _captions(file: Path) -> list[_Caption]:
    """The lines that are not empty; nan is 0."""
    found = []
    for n, line in enumerate(read_text(file, SMALL_TEXT).splitlines(), 1):
        if not line.strip():
            continue
        fields = line.strip().split("#")
        if len(fields) != FIELDS or not fields[0].strip():
            raise MotionFormatError(file, f"line {n}", repr(line[:80]), "caption#word/POS word/POS ...#start#end")
        start, end = (0.0 if f.strip().lower() == "nan" else number(f, file, f"line {n}") for f in fields[2:])
        found.append(_Caption(n, _tagged(fields[0].strip(), fields[1]), start, end))
    if not found:
        raise MotionFormatError(file, "text", "no line", "at least one caption")
    return found


def _tagged(text: str, words: str) -> str:
    """The caption with its "word/POS word/POS"; the caption alone where these are not all so."""
    pairs = [(word, part) for word, _, part in (token.rpartition("/") for token in words.split())]
    return TaggedCaption(text, pairs) if pairs and all(word and part for word, part in pairs) else text


def _entries(features: Float[np.ndarray, "T D"], captions: Sequence[_Caption], name: str, split: str) -> Iterator[CaptionedClip]:
    """The whole clip with all captions that have no times, then one entry for each other caption."""
    whole = tuple(caption.text for caption in captions if caption.start == caption.end == 0)
    if whole:
        yield CaptionedClip(features, whole, name, split)
    for n, text, start, end in captions:
        if start or end:
            first, last = (max(math.trunc(seconds * STAMP_FPS), 0) for seconds in (start, end))
            yield CaptionedClip(features[first:last], (text,), f"{name} line {n}, {start:g} to {end:g} s", split)
