"""check-data: what is in a folder of motions, what will be left out of training and what looks wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mwlib.body.kinematics import bone_lengths
from mwlib.body.motion import Motion
from mwlib.data.doubts import GLITCH, fastest, left_out, looks_wrong
from mwlib.data.errors import MotionFormatError
from mwlib.data.known import named_source
from mwlib.data.load import caller_says, find_source, motion_files, readings
from mwlib.data.opening import bare_suffix
from mwlib.data.published import MOST_NAMES, frames_differ, known_frames, known_protocol, line, protocol, window_count
from mwlib.data.stated import Reading, Stated
from mwlib.data.synthetic.script import synthetic_motions
from mwlib.data.units import height

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


class Check(NamedTuple):
    """A report on motions, whether every file could be read, and the clips."""

    report: str
    is_whole: bool
    clips: list[Clip]


def check_data(
    source: str | Path,
    *,
    fps: float | None = None,
    history: int | None = None,
    future: int | None = None,
    **stated: str | float | None,
) -> Check:
    """Look at motions before anything is trained on them.

    A table has one row for each kind of file: clips, frames, seconds, subjects; rate, up-axis and unit, each with who said so;
    skeleton, and the standing height of the bodies. Then, kind by kind: actions, windows, how constant the bones are, the
    fastest joint, and what is known of the same data. At the end: what will be left out of training and why, what looks wrong,
    and which files cannot be read.

    Args:
        source: as in `load_motions`.
        fps, history, future: the windows that training will cut; None: the papers' protocol, 25 + 100 frames at 50 Hz
            (HumanEva-I: 15 + 60 at 60 Hz).
        stated: unit, up, file_fps and skeleton, as in `load_motions`.

    Raises:
        FileNotFoundError: there is no such path.
        ValueError: an argument makes no sense.
    """
    clips, broken = _read(source, **stated)
    kinds: dict[tuple, list[Clip]] = {}
    for clip in clips:
        kinds.setdefault(_kind(clip), []).append(clip)
    lines = [*_table(kinds), ""] if kinds else []
    short = []
    for group in kinds.values():
        motions = [clip.reading.motion for clip in group]
        usual = protocol(motions)
        cut = (fps or usual[0], history or usual[1], future or usual[2], usual[3])
        differing = [text for clip in group if clip.file for text in frames_differ(clip.file, clip.reading.motion)]
        lines += [*_describe(motions, cut, _files(group[0])), *known_frames(differing), *known_protocol(motions), ""]
        short += left_out([(clip.name, clip.reading.motion) for clip in group], cut)
    doubts = looks_wrong([(clip.name, clip.reading) for clip in clips])
    lines += _list("left out of training", [*short, *broken]) + _list("looks wrong", doubts)
    lines += [f"{len(broken)} files cannot be read" if broken else "every file could be read"]
    return Check("\n".join(lines), not broken, clips)


def _read(source: str | Path, **stated) -> tuple[list[Clip], list[str]]:
    """Every clip, and the errors of the files that have none."""
    given = caller_says(**stated)
    source, _ = named_source(source)
    if source == "synthetic":
        maker = "the generator"
        made = (Reading(m, Stated(1.0, maker), Stated(m.up, maker), Stated(m.fps, maker)) for m in synthetic_motions())
        return [Clip(None, reading) for reading in made], []
    clips, broken = [], []
    try:
        files = motion_files(find_source(source))
    except MotionFormatError as error:
        return [], [str(error)]
    for file in files:
        try:
            clips += [Clip(file, reading) for reading in readings(file, **given)]
        except MotionFormatError as error:
            broken.append(str(error))
    return clips, broken


def _files(clip: Clip) -> str:
    return bare_suffix(clip.file)[1:] if clip.file else "synthetic"


def _kind(clip: Clip) -> tuple:
    r = clip.reading
    return _files(clip), r.motion.skeleton.name, r.fps, r.up, r.unit


def _table(kinds: dict[tuple, list[Clip]]) -> list[str]:
    """Rows of words, each column as wide as its widest."""
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
    widths = [max(len(row[i]) for row in rows) for i in range(len(COLUMNS))]
    return ["  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _describe(motions: list[Motion], cut: tuple[float, int, int, int], files: str) -> list[str]:
    """One line for each property of clips of one kind."""
    lengths = [bone_lengths(m.positions, m.skeleton) for m in motions]
    stretch = max(float(np.ptp(length, axis=0).max()) for length in lengths)
    speeds = [fastest(m) for m in motions]
    fps, history, future, stride = cut
    count = sum(window_count(m, cut) for m in motions)
    return [
        f"{files} with skeleton {motions[0].skeleton.name} at {motions[0].fps:g} Hz",
        line("subjects", _counts(m.subject for m in motions)),
        line("actions", _counts(m.action for m in motions)),
        line("windows", f"{count} of {history} + {future} frames at {fps:g} Hz, every {stride} frames"),
        line("bones", f"lengths change by up to {1000 * stretch:.1f} mm within a clip"),
        line("fastest", f"joint {max(speeds):.1f} m/s; {sum(s > GLITCH for s in speeds)} clips above {GLITCH:g} m/s"),
    ]


def _list(title: str, found: Sequence[str]) -> list[str]:
    return [f"{title}:", *(f"  {text}" for text in found), ""] if found else [f"{title}: nothing", ""]


def _counts(words: Iterable[str]) -> str:
    counts = Counter(word or "(unknown)" for word in words)
    rest = len(counts) - MOST_NAMES
    shown = ", ".join(f"{word} ({count})" for word, count in counts.most_common(MOST_NAMES))
    return f"{len(counts)}: {shown}{f' and {rest} more' if rest > 0 else ''}"
