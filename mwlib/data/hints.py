"""What is known about a motion file from outside it: clips.csv, its name, the caller."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import TypedDict, Unpack

from mwlib.body.kinematics import AXES
from mwlib.body.motion import FASTEST, Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.opening import PACKED, bare_name
from mwlib.data.reading import SMALL_TEXT, number, read_text
from mwlib.data.stated import CALLER, TABLE, Stated, stated
from mwlib.data.units import metres_per_unit

LEVELS_UP = 4  # folders above a file in which its clips.csv or skeleton.json may lie
SLOWEST = 1.0  # frames per second; a rate below looks like milliseconds taken for seconds
MOST_COLUMNS, MOST_ROWS = 100, 100_000  # of clips.csv; all of CMU are 2435 rows

# What file names of the known collections say: "05_12.amc", "walk4_subject1.bvh", "dataset-1_bow_normal_001.bvh". The last names
# no person: its style stands for one, so that whole styles can be held out.
NAMES = (
    re.compile(r"(?P<subject>\d+)_\d+"),
    re.compile(r"(?P<action>[A-Za-z]+?)\d*_subject(?P<subject>\d+)"),
    re.compile(r"dataset-\d+_(?P<action>[^_]+)_(?P<subject>[^_]+)_\d+"),
)


@dataclass(frozen=True)
class Hints:
    """What a reader may use beyond the file itself.

    One order holds for unit, up-axis and frame rate: what the caller says, else the file's row in clips.csv, else the file
    or the skeleton.json beside it, else what its format or skeleton implies; a unit that is still open is told from the
    body's size (`infer_unit`).

    Args:
        unit: metres per unit; None: neither caller nor clips.csv say.
        up: "y" or "z".
        fps: the true frame rate (cgspeed writes 120 Hz into 60 Hz files).
        subject, action: who and what, "" if unknown.
        fallback_skeleton: used where the file states none.
    """

    unit: Stated[float] | None = None
    up: Stated[str] | None = None
    fps: Stated[float] | None = None
    subject: str = ""
    action: str = ""
    fallback_skeleton: Skeleton | None = None

    def label(self, motion: Motion, file: Path) -> Motion:
        """The motion named like its file; subject and action from clips.csv, else as they are, else from the file's name."""
        stem = Path(bare_name(file)).stem
        said = next((m.groupdict() for pattern in NAMES if (m := pattern.fullmatch(stem))), {})
        subject = self.subject or motion.subject or said.get("subject", "").lstrip("0")
        return replace(motion, subject=subject, action=self.action or motion.action or said.get("action", ""), name=stem)


class Given(TypedDict, total=False):
    """What the caller says of all files of a source: metres per unit, up-axis, rate, and a skeleton where none is stated."""

    unit: float | None
    up: str | None
    fps: float | None
    fallback_skeleton: Skeleton | None


def hints(file: Path, **given: Unpack[Given]) -> Hints:
    """Hints for a file: what the caller gave, and its row in the nearest clips.csv that lists it.

    clips.csv has a column `file` (relative to its own folder or to one above) and any of fps, unit, up, subject, action (or
    content).

    Raises:
        MotionFormatError: clips.csv is malformed.
    """
    row, table = clips_row(file)
    place = f"row of {row.get('file')}"
    listed = {
        "unit": _unit(row["unit"], table, place) if row.get("unit") else None,
        "up": _up(row["up"], table, place) if row.get("up") else None,
        "fps": frame_rate(row["fps"], table, place) if row.get("fps") else None,
    }
    return Hints(
        unit=stated(given.get("unit"), CALLER) or stated(listed["unit"], TABLE),
        up=stated(given.get("up"), CALLER) or stated(listed["up"], TABLE),
        fps=stated(given.get("fps"), CALLER) or stated(listed["fps"], TABLE),
        subject=row.get("subject") or "",
        action=row.get("action") or row.get("content") or "",
        fallback_skeleton=given.get("fallback_skeleton"),
    )


def _unit(word: str, table: Path, place: str) -> float:
    try:
        return metres_per_unit(word)
    except ValueError as error:
        raise MotionFormatError(table, place, f"unit {word[:40]!r}", str(error).split("expected ")[-1]) from error


def _up(word: str, table: Path, place: str) -> str:
    if word not in AXES:
        raise MotionFormatError(table, place, f"up {word[:40]!r}", " or ".join(AXES))
    return word


def clips_row(file: Path) -> tuple[dict[str, str], Path]:
    """The file's row in the nearest clips.csv that lists it, and that clips.csv; an empty row if there is none."""
    path = file.resolve()
    for depth, folder in enumerate(path.parents[:LEVELS_UP]):
        table = folder / "clips.csv"
        rows = _clips(table, table.stat().st_mtime_ns) if table.is_file() else {}
        for start in range(len(path.parts) - depth - 1, 0, -1):
            if (key := _key(path.parts[start:])) in rows:
                return rows[key], table
    return {}, path


def frame_rate(word: str, file: Path, place: str) -> float:
    """A frame rate in hertz.

    Raises:
        MotionFormatError: not a number, or none that a camera has.
    """
    fps = number(word, file, place)
    if not SLOWEST <= fps <= FASTEST:
        raise MotionFormatError(file, place, f"{fps:g} frames per second", f"{SLOWEST:g} to {FASTEST:g}")
    return fps


def _key(parts: tuple[str, ...]) -> str:
    """A path as clips.csv is searched for it: packing left out."""
    whole = "/".join(parts)
    return whole[: -len(PACKED[0])] if whole.lower().endswith(PACKED) else whole


@lru_cache(maxsize=16)
def _clips(table: Path, changed: int) -> dict[str, dict[str, str]]:
    """Rows of one clips.csv by file; `changed` makes an edited file be read again."""
    try:
        reader = csv.DictReader(read_text(table, SMALL_TEXT).splitlines())
        if len(columns := reader.fieldnames or ()) > MOST_COLUMNS:
            raise MotionFormatError(table, "header", f"{len(columns)} columns", f"at most {MOST_COLUMNS}")
        rows = list(islice(reader, MOST_ROWS + 1))
    except csv.Error as error:
        raise MotionFormatError(table, "table", str(error), "comma-separated values with a header line") from error
    if len(rows) > MOST_ROWS:
        raise MotionFormatError(table, "table", f"more than {MOST_ROWS} rows", "at most that")
    if rows and "file" not in rows[0]:
        raise MotionFormatError(table, "header", f"columns {', '.join(map(str, rows[0]))[:200]}", "a column named file")
    return {_key(tuple(row["file"].replace("\\", "/").split("/"))): row for row in rows if row["file"]}
