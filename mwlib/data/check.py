"""check-data: what is in a folder of motions, beside what is known about it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from mwlib.body.kinematics import AXES, bone_lengths
from mwlib.body.motion import Motion
from mwlib.data import known
from mwlib.data.errors import MotionFormatError
from mwlib.data.hints import clips_row
from mwlib.data.load import find_source, motion_files, read_motion_file
from mwlib.data.opening import bare_suffix
from mwlib.data.synthetic.script import synthetic_motions
from mwlib.data.windowing import windows

PROTOCOLS = {"HUMANEVA15": (60.0, 15, 60, 15)}  # hertz, history, future, stride
STANDARD = (50.0, 25, 100, 25)
GLITCH = 25.0  # metres per second; above it are the marker glitches of CMU, below it its good clips
MOST_NAMES = 12


def check_data(source: str | Path) -> tuple[str, bool]:
    """A report on motions, and whether every file could be read.

    Per kind of file it lists clips, frames, subjects, actions, body height, windows at the papers' protocol, how constant
    the bones are, the fastest joint, and what is known of the same data: the frames in clips.csv, and for Human3.6M and
    HumanEva-I the published window counts.

    Raises:
        FileNotFoundError: there is no such path.
    """
    groups: dict[str, list[Motion]] = {}
    differing: dict[str, list[str]] = {}
    broken = []
    try:
        files = [None] if source == "synthetic" else motion_files(find_source(source))
    except MotionFormatError as error:
        return str(error), False
    for file in files:
        try:
            motions = read_motion_file(file) if file else synthetic_motions()
        except MotionFormatError as error:
            broken.append(f"  {error}")
            continue
        for motion in motions:
            title = f"{bare_suffix(file)[1:] if file else source} with skeleton {motion.skeleton.name} at {motion.fps:g} Hz"
            groups.setdefault(title, []).append(motion)
            differing.setdefault(title, []).extend(_frames_differ(file, motion) if file else [])
    lines = []
    for title, motions in groups.items():
        lines += [title, *_describe(motions), *_known_frames(differing[title]), *_known_protocol(motions), ""]
    lines += [f"{len(broken)} files cannot be read", *broken] if broken else ["every file could be read"]
    return "\n".join(lines), not broken


def fastest(motion: Motion) -> float:
    """Fastest joint between two frames, metres per second."""
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1)
    return float(steps.max(initial=0.0)) * motion.fps


def _describe(motions: list[Motion]) -> list[str]:
    """One line for each property of clips with one skeleton and rate."""
    frames = sum(map(len, motions))
    up = AXES[motions[0].up]
    heights = [np.percentile(np.ptp(m.positions[..., up], axis=1), 95) for m in motions]
    lengths = [bone_lengths(m.positions, m.skeleton) for m in motions]
    stretch = max(float(np.ptp(length, axis=0).max()) for length in lengths)
    speeds = [fastest(m) for m in motions]
    glitches = [m.name for m, speed in zip(motions, speeds, strict=True) if speed > GLITCH]
    fps, history, future, stride = _protocol(motions)
    return [
        _line("clips", f"{len(motions)}, {frames} frames, {frames / motions[0].fps:.0f} s, {motions[0].up} up"),
        _line("subjects", _counts(m.subject for m in motions)),
        _line("actions", _counts(m.action for m in motions)),
        _line("joints", f"{len(motions[0].skeleton)} with the root"),
        _line("height", f"{min(heights):.2f} to {max(heights):.2f} m, as tall as each clip stands"),
        _line(
            "windows", f"{sum(map(_window_count, motions))} of {history} + {future} frames at {fps:g} Hz, every {stride} frames"
        ),
        _line("bones", f"lengths change by up to {1000 * stretch:.1f} mm within a clip"),
        _line("fastest", f"joint {max(speeds):.1f} m/s; {len(glitches)} clips above {GLITCH:g} m/s{_names(glitches)}"),
    ]


def _line(word: str, text: str) -> str:
    return f"  {word:<9} {text}"


def _names(names: list[str]) -> str:
    shown = " ".join(names[:MOST_NAMES])
    return f": {shown}{' ...' if len(names) > MOST_NAMES else ''}" if names else ""


def _counts(words: Iterable[str]) -> str:
    counts = Counter(word or "(unknown)" for word in words)
    rest = len(counts) - MOST_NAMES
    shown = ", ".join(f"{word} ({count})" for word, count in counts.most_common(MOST_NAMES))
    return f"{len(counts)}: {shown}{f' and {rest} more' if rest > 0 else ''}"


def _protocol(motions: list[Motion]) -> tuple[float, int, int, int]:
    return PROTOCOLS.get(motions[0].skeleton.name, STANDARD)


def _window_count(motion: Motion) -> int:
    fps, history, future, stride = _protocol([motion])
    return len(range(0, len(motion.resample(fps)) - history - future, stride))


def _frames_differ(file: Path, motion: Motion) -> list[str]:
    """Empty if clips.csv lists no such file; else "" or what differs."""
    row, table = clips_row(file)
    listed = row.get("frames") or row.get("rows")
    if listed is None:
        return []
    added = row.get("tpose_frame0") or str(int("rows" in row))
    if not re.fullmatch(r"\d{1,12}", listed) or added not in ("0", "1"):
        return [f"{motion.name} has {len(motion)}, {table.name} says {listed[:40]!r} less {added[:40]!r}"]
    expected = int(listed) - int(added)
    return ["" if len(motion) == expected else f"{motion.name} has {len(motion)}, clips.csv says {expected}"]


def _known_frames(compared: list[str]) -> list[str]:
    wrong = [text for text in compared if text]
    if not compared:
        return []
    return [
        _line("known", f"frames as clips.csv says in {len(compared) - len(wrong)} of {len(compared)} clips"),
        *map(_wrong, wrong),
    ]


def _wrong(text: str) -> str:
    return _line("DIFFERS", text)


def _known_protocol(motions: list[Motion]) -> list[str]:
    """Published counts beside those found, for data in VideoPose3D's layout."""
    subjects = {m.subject for m in motions}
    if motions[0].skeleton.name == "HUMANEVA15":
        test = sum(_window_count(m) for m in motions if m.subject.startswith("Validate/"))
        return [_line("known", f"{test} test windows in Validate/*; published never, at most {known.HUMANEVA_MOST_WINDOWS}")]
    if motions[0].skeleton.name != "H36M17" or not subjects & set(known.H36M_SUBJECTS):
        return []
    found = {m.name: _window_count(m) for m in motions if m.subject in known.H36M_TEST_SUBJECTS}
    lines = []
    for subject in (*known.H36M_TEST_SUBJECTS, ""):
        here, there = (sum(n for name, n in counts.items() if name.startswith(subject)) for counts in (found, known.H36M_WINDOWS))
        lines.append(_line("known", f"{subject or 'S9 + S11'}: {here} test windows, published {there}"))
    names = [name for name in known.H36M_WINDOWS | found if found.get(name) != known.H36M_WINDOWS.get(name)]
    lines += [_wrong(f"{n}: {found.get(n, 'none')}, published {known.H36M_WINDOWS.get(n, 'none')}") for n in names[:MOST_NAMES]]
    lines += [_wrong(f"and {len(names) - MOST_NAMES} more sequences")] if len(names) > MOST_NAMES else []
    return lines + (_known_neighbours(motions) if not names else [])


def _known_neighbours(motions: list[Motion]) -> list[str]:
    """How many test windows share their last observed pose with others, against what two published codes agree on."""
    _, history, future, stride = STANDARD
    test = [m for m in motions if m.subject in known.H36M_TEST_SUBJECTS]
    last = windows(test, history, future, stride).x_history[:, -1].numpy()
    others = KDTree(last).query_ball_point(last, known.H36M_THRESHOLD, return_length=True) - 1
    counts = (int(np.sum(others == 0)), int(np.sum(others <= 9)))
    published = (known.H36M_ALONE, known.H36M_FEW)
    text = f"{counts[0]} windows without a neighbour, {counts[1]} with at most nine; published {published[0]}, {published[1]}"
    return [_line("known", text)]
