"""Reports on folders laid out as HumanML3D or KIT-ML: lists, captions, parts of speech, lengths, statistics."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mwlib.data.captioned import CaptionsConfig
from mwlib.data.doubts import some

from mwlib.data.formats.humanml import (  # isort: skip
    HUMANML3D, LAYOUTS, SPLITS, TEXTS, CaptionedClip, FeatureLayout, TaggedCaption, clip_lists, folder_contents, has_lists,
)  # fmt: skip
from mwlib.data.normalisation import Statistics
from mwlib.data.untrusted import MotionFormatError
from mwlib.networks.text import words_of

MOST_FAULTS = 40  # of lists and captions, told one by one
STRETCH = " "  # in the name of a stretch of a clip, and in no name of a list
STATISTICS = ("Mean.npy", "Std.npy")
# Own choice: a mean may be off by half a deviation, deviations by a factor of 2. The evaluator's own, taken in place of the
# collection's, differ by a factor of 25 in root and contacts.
FAR, FACTOR = 0.5, 2.0
PUBLISHED_IDS = {HUMANML3D.name: (23_384, 1_460, 4_384)}  # in train, val and test; counted in the published lists


class CaptionedFolder(NamedTuple):
    """What is in a folder of captioned clips.

    Args:
        lines: a word and what is said of it, of each property.
        left_out: what training and evaluation will not see, though nothing is wrong with it.
        wrong: faults of lists, captions, features and statistics.
    """

    lines: list[tuple[str, str]]
    left_out: list[str]
    wrong: list[str]


def is_captioned(path: Path) -> bool:
    """Whether a folder is laid out as HumanML3D or KIT-ML: with lists of clips and with texts."""
    return path.is_dir() and bool(has_lists(path)) and (path / TEXTS).is_dir()


def captioned_folder(path: Path) -> CaptionedFolder:
    """Look at all clips that the lists of a folder name, and at their captions.

    Clips in two lists, as they are or mirrored, in one list twice, malformed texts, arrays and statistics, features that are
    missing or not finite, and statistics far from those of the clips are wrong.
    """
    faults: list[MotionFormatError] = []
    try:
        contents = folder_contents(path, faults=faults)
    except MotionFormatError as error:
        return CaptionedFolder([], [], [str(error)])
    broken = contents.broken()
    more = [f"and {len(faults) - MOST_FAULTS} more faults of lists and captions"] if len(faults) > MOST_FAULTS else []
    lines, wrong = [("splits", _splits(path, contents.clips))], [*map(str, faults[:MOST_FAULTS]), *more, *broken]
    if contents.clips:
        about, doubt = _statistics(path, contents.clips)
        lines += [*_clips(contents.clips), *_captions(contents.clips), ("scale", about)]
        wrong += [doubt] if doubt else []
    return CaptionedFolder(lines, [reason for reason in contents.reasons() if reason not in broken], wrong)


def _layout(clips: Sequence[CaptionedClip]) -> FeatureLayout:
    return LAYOUTS[clips[0].features.shape[1]]


def _splits(path: Path, clips: Sequence[CaptionedClip]) -> str:
    lists = clip_lists(path, has_lists(path), [])
    counts = [f"{len(lists[split])} ids in {split}.txt" if split in lists else f"no {split}.txt" for split in SPLITS]
    known = PUBLISHED_IDS.get(_layout(clips).name) if clips else None
    mirrored = sum(name.startswith("M") for names in lists.values() for name in names)
    told = f"{', '.join(counts)}; {mirrored} are mirror images (M before the ID)"
    return f"{told}; published {', '.join(map(str, known))}" if known else told


def _clips(clips: Sequence[CaptionedClip]) -> list[tuple[str, str]]:
    """How many for what, and how long they are."""
    layout, longest = _layout(clips), CaptionsConfig().longest
    counts = ", ".join(f"{sum(clip.split == split for clip in clips)} {split}" for split in SPLITS)
    stretches = sum(STRETCH in clip.name for clip in clips)
    frames = np.array([len(clip.features) for clip in clips])
    low, high = frames.min(), frames.max()
    cut = f"{np.count_nonzero(frames >= longest)} have {longest} or more and are cut there"
    return [
        ("clips", f"{len(clips)} of {layout.name}: {counts}; {stretches} of them stretches with times of their own"),
        ("frames", f"{low} to {high}, {low / layout.fps:.1f} to {high / layout.fps:.1f} s at {layout.fps:g} Hz; {cut}"),
    ]


def _captions(clips: Sequence[CaptionedClip]) -> list[tuple[str, str]]:
    """How many there are, how long, and which lack parts of speech."""
    each = [len(clip.captions) for clip in clips]
    words = [words_of(caption) for clip in clips for caption in clip.captions]
    plain = [clip.name for clip in clips if not all(isinstance(text, TaggedCaption) and text.tagged for text in clip.captions)]
    counts = [len(row) for row in words]
    many = f"{sum(each)}, {min(each)} to {max(each)} a clip; {min(counts)} to {max(counts)} words"
    lacking = f"lacking in {len(plain)} clips, which the published evaluator refuses: {some(plain)}"
    return [
        ("captions", f"{many}, {len({word for row in words for word in row})} different"),
        ("speech", f"parts of speech {lacking if plain else 'of all captions, as the published evaluator reads them'}"),
    ]


def _statistics(path: Path, clips: Sequence[CaptionedClip]) -> tuple[str, str]:
    """What is said of Mean.npy and Std.npy, and what is wrong with them, or nothing."""
    mean, deviation = (path / name for name in STATISTICS)
    if missing := [file.name for file in (mean, deviation) if not file.is_file()]:
        return f"no {', no '.join(missing)}: training measures the clips (statistics=clips)", ""
    try:
        found = Statistics.read(mean, deviation)
    except MotionFormatError as error:
        return "Mean.npy and Std.npy are malformed", str(error)
    whole = [clip for clip in clips if STRETCH not in clip.name] or clips  # as published: of whole clips
    own = Statistics.measured([clip.features for clip in whole], _layout(clips))
    if found.layout != own.layout:
        return f"Mean.npy and Std.npy are of {found.layout.name}", f"{mean} and {deviation.name} are not of {own.layout.name}"
    off = float(((found.mean - own.mean) / own.deviation).abs().max())
    ratio = found.deviation / own.deviation
    low, high = float(ratio.min()), float(ratio.max())
    about = f"means at most {off:.2g} deviations from the clips' own, deviations {low:.2g} to {high:.2g} times theirs"
    is_far = off > FAR or low < 1 / FACTOR or high > FACTOR
    return f"Mean.npy and Std.npy: {about}", f"{' and '.join(STATISTICS)} are of other clips or another kind: {about}" * is_far
