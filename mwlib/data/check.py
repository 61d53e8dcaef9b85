"""Reports on folders of motions, with captions or without: contents, known counts, clips left out of training, doubts."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from mwlib.body.kinematics import bone_lengths
from mwlib.body.motion import Motion
from mwlib.data.captioned import CaptionsConfig
from mwlib.data.collections import COLLECTIONS, Protocol, h36m, named_source
from mwlib.data.doubts import MOST_NAMES, Clips, doubted, jump, other_axis, rows_without_files, some, told
from mwlib.data.load import expect_source, find_source, first_of, motion_files, passed_over, read_files, unread_entries
from mwlib.data.mirroring import unmirrored
from mwlib.data.untrusted import MotionFormatError, bare_suffix
from mwlib.data.windows import prepare, windows
from mwlib.hashing import sha256
from mwlib.synthetic.motions import synthetic_motions

from mwlib.data.formats.humanml import (  # isort: skip
    HUMANML3D, LAYOUTS, SPLITS, TEXTS, CaptionedClip, FeatureLayout, TaggedCaption, clip_lists, folder_contents, has_lists,
)  # fmt: skip
from mwlib.data.meaning import (  # isort: skip
    ADULT, CALLER, UNITS, UPRIGHT, Hints, Reading, Stated, clips_row, fitting, height, said_by, standing,
)  # fmt: skip
from mwlib.data.normalisation import Statistics
from mwlib.networks.text import words_of

MOST_FAULTS = 40  # of lists and captions, told one by one
STRETCH = " "  # in the name of a stretch of a clip, and in no name of a list
STATISTICS = ("Mean.npy", "Std.npy")
# Own choice: a mean may be off by half a deviation, deviations by a factor of 2. The evaluator's own, taken in place of the
# collection's, differ by a factor of 25 in root and contacts.
FAR, FACTOR = 0.5, 2.0
PUBLISHED_IDS = {HUMANML3D.name: (23_384, 1_460, 4_384)}  # in train, val and test; counted in the published lists


Line = tuple[str, str]  # of a report: a word and what is said of it


class CaptionedFolder(NamedTuple):
    """What is in a folder of captioned clips.

    Args:
        lines: of each property.
        left_out: what training and evaluation will not see, though nothing is wrong with it.
        wrong: faults of lists, captions, features and statistics.
    """

    lines: list[Line]
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
    lines = [("splits", _splits(path, contents.clips))]
    wrong = [*first_of([*map(str, faults)], MOST_FAULTS, "more faults of lists and captions"), *broken]
    if contents.clips:
        about, doubt = _statistics(path, contents.clips)
        lines += [*_clips(contents.clips), *_caption_lines(contents.clips), ("scale", about)]
        wrong += [doubt] if doubt else []
    return CaptionedFolder(lines, [reason for reason in contents.reasons() if reason not in broken], wrong)


def _layout(clips: Sequence[CaptionedClip]) -> FeatureLayout:
    return LAYOUTS[clips[0].features.shape[1]]


def _splits(path: Path, clips: Sequence[CaptionedClip]) -> str:
    lists = clip_lists(path, [])
    counts = [f"{len(lists[split])} ids in {split}.txt" if split in lists else f"no {split}.txt" for split in SPLITS]
    known = PUBLISHED_IDS.get(_layout(clips).name) if clips else None
    mirrored = sum(name.startswith("M") for names in lists.values() for name in names)
    told = f"{', '.join(counts)}; {mirrored} are mirror images (M before the ID)"
    return f"{told}; published {', '.join(map(str, known))}" if known else told


def _clips(clips: Sequence[CaptionedClip]) -> list[Line]:
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


def _caption_lines(clips: Sequence[CaptionedClip]) -> list[Line]:
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


STANDARD = Protocol(50.0, 25, 100, 25)


def _block(title: str, lines: Iterable[Line]) -> list[str]:
    """A paragraph of a report."""
    return [title, *(f"  {word:<9} {text}" for word, text in lines), ""]


def _protocol(motion: Motion) -> Protocol:
    """How papers cut such a clip into windows."""
    found = (c.protocol for c in COLLECTIONS.values() if c.protocol and c.skeleton and c.skeleton.name == motion.skeleton.name)
    return next(found, STANDARD)


def _window_count(motion: Motion, protocol: Protocol) -> int:
    fps, history, future, stride = protocol
    return len(range(0, _frames_at(motion, fps) - history - future, stride))


def _frames_at(motion: Motion, fps: float) -> int:
    """How many frames a clip has at another rate."""
    return len(replace(motion, rig=None).resample(fps))  # rotations would take far longer


def _frames_fault(row: dict[str, str], motion: Motion) -> str:
    """What differs between a clip's length and its row in clips.csv; "" if nothing does."""
    listed, added = _frames(row), row.get("first_frame") or row.get("tpose_frame0") or str(int("rows" in row))
    if not re.fullmatch(r"\d{1,12}", listed) or not (added in ("0", "1") or row.get("first_frame")):
        return f"{motion.name} has {len(motion)}, clips.csv says {listed[:40]!r} less {added[:40]!r}"
    expected = int(listed) - int(added)
    return "" if len(motion) == expected else f"{motion.name} has {len(motion)}, clips.csv says {expected}"


def _frames(row: dict[str, str]) -> str:
    return row.get("frames") or row.get("rows", "")


def _t_poses(clips: Sequence[Clip]) -> Iterator[Line]:
    """A line on the clips whose first row is left out without a word of the user's."""
    if names := [clip.name for clip in clips if clip.reading.first.value and not clip.reading.first.is_users]:
        yield "T-pose", f"row 0 of {some(names, 3)} is an added T-pose and left out; first_frame 0 in clips.csv keeps it"


def _known_frames(clips: Sequence[Clip]) -> Iterator[Line]:
    """Lines on how many clips are as long as clips.csv says."""
    rows = [(clips_row(clip.file)[0], clip.reading.motion) for clip in clips if clip.file]
    if faults := [_frames_fault(row, motion) for row, motion in rows if _frames(row)]:
        yield "known", f"frames as clips.csv says in {faults.count('')} of {len(faults)} clips"
        yield from (("DIFFERS", fault) for fault in faults if fault)


def _known_windows(motions: list[Motion]) -> Iterator[Line]:
    """Published counts beside those found, for data in VideoPose3D's layout."""
    found = {m.name: _window_count(m, _protocol(m)) for m in motions if m.subject in h36m.TEST_SUBJECTS}
    if motions[0].skeleton.name == "HUMANEVA15":
        test = sum(_window_count(m, _protocol(m)) for m in motions if m.subject.startswith("Validate/"))
        yield "known", f"{test} test windows in Validate/*; published never, at most {h36m.HUMANEVA_MOST_WINDOWS}"
    elif motions[0].skeleton.name == "H36M17" and (found or any(m.subject in h36m.TRAIN_SUBJECTS for m in motions)):
        for subject in (*h36m.TEST_SUBJECTS, ""):
            here, there = (sum(n for name, n in counts.items() if name.startswith(subject)) for counts in (found, h36m.WINDOWS))
            yield "known", f"{subject or 'S9 + S11'}: {here} test windows, published {there}"
        names = [name for name in h36m.WINDOWS | found if found.get(name) != h36m.WINDOWS.get(name)]
        wrong = [f"{n}: {found.get(n, 'none')}, published {h36m.WINDOWS.get(n, 'none')}" for n in names]
        yield from (("DIFFERS", text) for text in first_of(wrong, MOST_NAMES, "more sequences"))
        if not names:
            yield "known", _known_neighbours(motions)


def _known_neighbours(motions: list[Motion]) -> str:
    """How many test windows share their last observed pose with others, against what two published codes agree on."""
    _, history, future, stride = STANDARD
    test = [m for m in motions if m.subject in h36m.TEST_SUBJECTS]
    last = windows(test, history, future, stride).x_history[:, -1].numpy()
    others = KDTree(last).query_ball_point(last, h36m.THRESHOLD, return_length=True) - 1
    few = f"{np.sum(others == 0)} windows without a neighbour, {np.sum(others <= 9)} with at most nine"
    return f"{few}; published {h36m.ALONE}, {h36m.FEW}"


GLITCH = 25.0  # metres per second; above it are the marker glitches of CMU, below it its good clips


def fastest(motion: Motion) -> tuple[float, int, str]:
    """Highest speed of a joint between two frames, metres per second; the frame that it is reached in, and the joint."""
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1)
    if not steps.size:
        return 0.0, 0, ""
    frame, joint = np.unravel_index(steps.argmax(), steps.shape)
    return float(steps[frame, joint]) * motion.fps, int(frame) + 1, motion.skeleton.joints[joint]


def _left_out(clips: Sequence[Clip], protocol: Protocol) -> Iterator[str]:
    """One line on the clips, by name, that give no window."""
    fps, history, future, _ = protocol
    if short := [clip.name for clip in clips if _frames_at(clip.reading.motion, fps) <= history + future]:
        yield f"{len(short)} clips no longer than {history} + {future} frames at {fps:g} Hz: {some(short)}"


def _doubts(clips: Clips, people: bool) -> Iterator[str]:
    """A line for each kind of doubt, with the names of the clips: size, axis, speed, copies, people, sides, skeletons.

    Lists of clips part them already, whoever the `people` are.
    """
    for reason, sentence in DOUBTS:
        yield from told(clips, reason, sentence)
    same: dict[str, list[str]] = {}
    for name, reading in clips:
        content = np.ascontiguousarray(reading.motion.positions, dtype=np.float32)
        same.setdefault(sha256([content.tobytes()]), []).append(name)
    if twice := [" = ".join(names) for names in same.values() if len(names) > 1]:
        yield f"the same clip twice, perhaps in training and test: {some(twice)}"
    subjects = {reading.motion.subject for _, reading in clips}
    if people and len(subjects) == 1:
        who = "no clip has a subject" if subjects == {""} else f"one subject only, {min(subjects)!r}"
        yield f"{who}: test clips will be of people trained on. A column subject in clips.csv tells people apart"
    yield from _skeletons(clips)


def _size(reading: Reading) -> str:
    """The size of a body that is no adult's, and units in which it would be one's."""
    tall = height(reading.motion.positions, reading.motion.skeleton)
    if ADULT[0] <= tall <= ADULT[1]:
        return ""
    found = tall / reading.unit.value
    return ", ".join([f"{tall:.3g} m", *(f"{found * UNITS[unit]:.3g} m in {unit}" for unit in fitting(found, ADULT))])


def _other_way(reading: Reading) -> str:
    """Along which axis a body is stretched that is not upright; "" also where `doubted` tells of it."""
    m = reading.motion
    stands = standing(m.positions, m.skeleton, m.up)
    return f"along {stands.axis}" if (stands.is_clear or stands.share < UPRIGHT) and not other_axis(reading) else ""


def _glitch(reading: Reading) -> str:
    """How fast the fastest joint is, and where, if that is too fast."""
    speed, frame, joint = fastest(reading.motion)
    return f"{speed:.0f} m/s, {joint} in row {reading.first.value + frame}" if speed > GLITCH else ""


# What may be as it looks -> a sentence on the clips.
DOUBTS = (
    (_size, "no adult's height: {}. State the unit if that is wrong"),
    (_other_way, "not upright along the up-axis: {}. People who lie, or another axis is up"),
    (_glitch, f"faster than {GLITCH:g} m/s, so perhaps glitches: {{}}. The column first_frame in clips.csv cuts a beginning off"),
    (jump, "they begin with a jump, as after an added T-pose: {}; such a column in clips.csv cuts that off, or keeps it"),
)


def _skeletons(clips: Clips) -> Iterator[str]:
    """Skeletons as training will have them: without pairs, or more than one."""
    kinds: dict[str, list[tuple[str, Motion]]] = {}
    for name, reading in clips:
        (m,) = prepare([reading.motion], reading.motion.fps)
        kinds.setdefault(m.skeleton.name, []).append((name, m))
    for group in kinds.values():
        if reason := unmirrored([m for _, m in group]):
            yield f"training will not mirror: {reason}"
    if len(kinds) > 1:
        groups = "; ".join(f"{kind} ({some([name for name, _ in group], 3)})" for kind, group in kinds.items())
        yield f"{len(kinds)} skeletons, and training takes one: {groups}"


COLUMNS = ("files", "clips", "frames", "seconds", "subjects", "Hz", "skeleton", "up", "metres per unit", "height in m")


class Clip(NamedTuple):
    """A clip as it was read, and the file that it is from; None for a synthetic one."""

    file: Path | None
    reading: Reading

    @property
    def name(self) -> str:
        """Of the file, and of the clip where a file holds several."""
        name = self.reading.motion.name
        return self.file.name if self.file and self.file.name.startswith(name) else name

    @property
    def files(self) -> str:
        """The kind of its file."""
        return bare_suffix(self.file)[1:] if self.file else "synthetic"


class Check(NamedTuple):
    """A report on motions, whether nothing in it needs a repair or a word of the user's, and the clips.

    It does where a file cannot be read, a row of a clips.csv has no file, lists and captions are faulty, or numbers likely mean
    something else than was assumed (`doubts.doubted`). What may be as it looks, such as a glitch, does not count.
    """

    report: str
    is_whole: bool
    clips: list[Clip]


def check_data(
    source: str | Path,
    *,
    fps: float | None = None,
    history: int | None = None,
    future: int | None = None,
    **stated: Any,
) -> Check:
    """Look at motions before anything is trained on them.

    A table has one row for each kind of file: clips, frames, seconds, subjects; rate, up-axis and unit, each with who said so;
    skeleton, and the standing height of the bodies. Then, kind by kind: actions, windows, how constant the bones are, the
    fastest joint, and what is known of the same data. At the end: what will be left out of training and why, what looks wrong
    (in lists and captions, too), and which files cannot be read. Of a folder laid out as HumanML3D or KIT-ML, which is for text
    to motion, it tells splits, captions, parts of speech, lengths and statistics (`captioned_folder`) in place of windows,
    unless these are asked for.

    Args:
        source: as in `load_motions`.
        fps, history, future: the windows that training will cut; None: the papers' protocol, 25 + 100 frames at 50 Hz
            (HumanEva-I: 15 + 60 at 60 Hz).
        stated: unit, up, file_fps and skeleton, as in `load_motions`.

    Raises:
        FileNotFoundError: there is no such path.
        ValueError: an argument makes no sense.
    """
    expect_source(source)
    given = said_by(CALLER, **stated)
    source, _ = named_source(source)
    path = None if source == "synthetic" else find_source(source)
    clips, broken, alone = _read(path, given)
    captioned = captioned_folder(path) if path and is_captioned(path) else None
    cuts = captioned is None or any(given is not None for given in (fps, history, future))
    kinds: dict[tuple, list[Clip]] = {}
    for clip in clips:
        r = clip.reading
        kinds.setdefault((clip.files, r.motion.skeleton.name, r.fps, r.up, r.unit), []).append(clip)
    lines = [*_table(kinds), ""] if kinds else []
    short = []
    for group in kinds.values():
        motions = [clip.reading.motion for clip in group]
        usual = _protocol(motions[0])
        protocol = Protocol(fps or usual.fps, history or usual.history, future or usual.future, usual.stride)
        about = [*_describe(motions, protocol if cuts else None), *_unread(group), *_t_poses(group)]
        about += [*_known_frames(group), *_known_windows(motions)]
        lines += _block(f"{group[0].files} with skeleton {motions[0].skeleton.name} at {motions[0].fps:g} Hz", about)
        short += _left_out(group, protocol) if cuts else []
    if captioned:
        lines += _block("lists and captions", captioned.lines)
        short += captioned.left_out
    named = [(clip.name, clip.reading) for clip in clips]
    lists, unsaid = captioned.wrong if captioned else [], doubted(named)
    lines += _list("left out of training", [*short, *dict.fromkeys(broken)])
    lines += _list("looks wrong", [*alone, *lists, *unsaid, *_doubts(named, people=captioned is None)])
    over = passed_over(path) if path and clips and not captioned else []
    lines += _list("passed over, as nothing says that they are motions", over) if over else []
    lines += [f"{len(broken)} files cannot be read" if broken else f"every {'other ' * bool(over)}file could be read"]
    return Check("\n".join(lines), not (broken or alone or lists or unsaid), clips)


def _read(path: Path | None, given: Hints) -> tuple[list[Clip], list[str], list[str]]:
    """Every clip, the errors of the files that have none, and what is said of rows of a clips.csv without files."""
    if path is None:
        maker = "the generator"
        made = (Reading(m, Stated(1.0, maker), Stated(m.up, maker), Stated(m.fps, maker)) for m in synthetic_motions())
        return [Clip(None, reading) for reading in made], [], []
    try:
        files = motion_files(path)
    except MotionFormatError as error:
        return [], [str(error)], []
    found, broken = read_files(files, given)
    return [Clip(*each) for each in found], [*map(str, broken)], rows_without_files(files)


def in_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of words as lines, each column as wide as its widest."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _table(kinds: dict[tuple, list[Clip]]) -> list[str]:
    """A row for each kind of file."""
    rows: list[tuple[str, ...]] = [COLUMNS]
    for (files, skeleton, fps, up, unit), group in kinds.items():
        motions = [clip.reading.motion for clip in group]
        tall = [height(m.positions, m.skeleton) for m in motions]
        rows.append((
            files, str(len(motions)), str(sum(map(len, motions))), f"{sum(len(m) / m.fps for m in motions):.0f}",
            str(len({m.subject for m in motions})), f"{fps.value:g} ({fps.source})",
            f"{skeleton}, {len(motions[0].skeleton)} joints", f"{up.value} ({up.source})", f"{unit.value:.4g} ({unit.source})",
            f"{min(tall):.2f} to {max(tall):.2f}",
        ))  # fmt: skip
    return in_columns(rows)


def _describe(motions: list[Motion], protocol: Protocol | None) -> Iterator[Line]:
    """One line for each property of clips of one kind; one of windows, if a protocol cuts them."""
    yield "subjects", _counts(m.subject for m in motions)
    yield "actions", _counts(m.action for m in motions)
    if protocol:
        fps, history, future, stride = protocol
        count = sum(_window_count(m, protocol) for m in motions)
        yield "windows", f"{count} of {history} + {future} frames at {fps:g} Hz, every {stride} frames"
    stretch = max(float(np.ptp(bone_lengths(m.positions, m.skeleton), axis=0).max()) for m in motions)
    yield "bones", f"lengths change by up to {1000 * stretch:.1f} mm within a clip"
    speeds = [fastest(m)[0] for m in motions]
    yield "fastest", f"joint {max(speeds):.1f} m/s; {sum(s > GLITCH for s in speeds)} clips above {GLITCH:g} m/s"


def _unread(clips: Sequence[Clip]) -> Iterator[Line]:
    """Lines on entries of archives that nothing is read from."""
    found: dict[str, list[str]] = {}
    for file in dict.fromkeys(clip.file for clip in clips if clip.file and clip.files == "npz"):
        if names := unread_entries(file):
            found.setdefault(some(names), []).append(file.name)
    return (("unread", f"entries {names} of {some(holders, 3)}") for names, holders in found.items())


def _list(title: str, found: Sequence[str]) -> list[str]:
    return [f"{title}:", *(f"  {text}" for text in found), ""] if found else [f"{title}: nothing", ""]


def _counts(words: Iterable[str]) -> str:
    counts = Counter(word or "(unknown)" for word in words)
    return f"{len(counts)}: {some([f'{word} ({count})' for word, count in counts.most_common()])}"
