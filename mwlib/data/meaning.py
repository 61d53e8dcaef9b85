"""Meaning of a file's numbers: unit, up-axis, frame rate, and the provenance of each."""

import csv
import posixpath
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, Generic, NamedTuple, Self, TypeVar

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import AXES, bone_lengths
from mwlib.body.motion import FASTEST, Motion
from mwlib.body.rig import Rig
from mwlib.body.skeleton import Skeleton, is_cmu
from mwlib.data.collections import COLLECTIONS, SKELETONS
from mwlib.data.untrusted import PACKED, SMALL_TEXT, MotionFormatError, bare_name, check_names, number, read_text

Value = TypeVar("Value")

CALLER, TABLE, ENTRY, BESIDE = "the caller", "clips.csv", "its own entry", "skeleton.json"
FILE, FORMAT, SKELETON, SIZE, DEFAULT = "the file", "the format", "the skeleton", "the body's size", "the default"
BY_USER = (CALLER, TABLE, ENTRY, BESIDE)  # said by somebody who looked at these very data


@dataclass(frozen=True)
class Stated(Generic[Value]):
    """A value, and who says so: one of the words above."""

    value: Value
    source: str

    @property
    def is_users(self) -> bool:
        """Whether the user said it: it is believed even where the body looks odd then."""
        return self.source in BY_USER


def stated(value: Value | None, source: str) -> Stated[Value] | None:
    """A value and its source; None if there is no value."""
    return None if value is None else Stated(value, source)


NONE_ADDED = Stated(0, FORMAT)


@dataclass(frozen=True)
class Reading:
    """A motion as its file has it, in metres, and who said so: metres per unit, the up-axis, frames per second, first row."""

    motion: Motion
    unit: Stated[float]
    up: Stated[str]
    fps: Stated[float]
    first: Stated[int] = NONE_ADDED


UNITS = {"m": 1.0, "cmu": 0.0254 / 0.45, "inch": 0.0254, "cm": 0.01, "mm": 0.001}  # metres
METRIC = ("m", "cm", "mm")
# The unit of the files that known skeletons come from.
USUAL = {c.skeleton.name: c.unit for c in COLLECTIONS.values() if c.skeleton and c.unit}
LONGEST_UNIT = 1000.0
HEIGHT_BY_REACH = 1.7 / 2.4  # of an adult: standing height by the way from a toe to the fingers of the other side
SMALLEST, TALLEST = 0.5, 2.5  # metres, of a human
ADULT = 1.2, 2.3  # metres; heights of known skeletons come out as 1.3 to 1.8
SWING = 0.5  # a bone whose length varies by more of itself is none: it ties the body to the world's origin
STATE = "(of load_motions, as a setting or an option; or a column {0} in clips.csv, or for arrays {0} in skeleton.json)"
STATE_UNIT = f"unit= {STATE.format('unit')}"


def metres_per_unit(unit: float | str) -> float:
    """A unit's length in metres.

    Args:
        unit: a name, or metres per unit, as a number or in text.

    Raises:
        ValueError: an unknown name, or not a positive number of sensible size.
    """
    if isinstance(unit, str) and unit in UNITS:
        return UNITS[unit]
    try:
        metres = 0.0 if isinstance(unit, bool) else float(unit)
    except (TypeError, ValueError):
        metres = 0.0
    if not 0 < metres <= LONGEST_UNIT:
        raise ValueError(f"unit is {unit!r}; expected metres per unit up to {LONGEST_UNIT:g}, or one of {', '.join(UNITS)}")
    return metres


def height(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton) -> float:
    """Standing height of the body whatever its pose, in the unit of `positions`.

    Own choice: the body is measured along its bones, from the toe to the fingers of the other side, and an adult's
    proportions do the rest; that is right to a quarter for skeletons with and without fingers, toes and the top of the head.
    Bone lengths are medians over at most 100 frames.
    """
    if len(skeleton) < 2:
        return 0.0
    return float(heights(looked_at(positions, 100)[None], skeleton)[0])


def looked_at(positions: Float[np.ndarray, "T joints 3"], most: int = 200) -> Float[np.ndarray, "n joints 3"]:
    """Frames of a clip, at most so many, spread evenly."""
    return positions[np.linspace(0, len(positions) - 1, min(len(positions), most)).astype(int)]


def heights(positions: Float[np.ndarray, "N T joints 3"], skeleton: Skeleton) -> Float[np.ndarray, " N"]:
    """The same of many clips, all their frames looked at."""
    every = bone_lengths(positions, skeleton)
    lengths = np.median(every, axis=1)
    low, high = np.percentile(every, (10, 90), axis=1)
    lengths = np.where(high - low > SWING * lengths, 0.0, lengths)
    deepest, longest = np.zeros((len(skeleton), len(positions))), np.zeros(len(positions))
    for (parent, child), length in reversed(list(zip(skeleton.bones, lengths.T, strict=True))):
        way = deepest[child] + length
        longest = np.maximum(longest, deepest[parent] + way)
        deepest[parent] = np.maximum(deepest[parent], way)
    return HEIGHT_BY_REACH * longest


def check_people(positions: Float[np.ndarray, "N T joints 3"], skeleton: Skeleton, names: Sequence[str]) -> None:
    """Refuse poses of no human's size among the arguments of a call, in metres as models take them.

    Args:
        positions: metres; so many frames of each clip as it takes to see how long its bones are.
        names: of the arguments, one each.

    Raises:
        ValueError: a body is too small or too large; the message names the first one and the likely unit.
    """
    tall = heights(np.asarray(positions, np.float64), skeleton) if len(skeleton) > 1 else np.ones(len(positions))
    if len(wrong := np.flatnonzero(~((tall >= SMALLEST) & (tall <= TALLEST)))):
        first = int(wrong[0])
        readings = _readings(tall[first], [name for name in METRIC if name in _fitting(tall[first])])
        size = f"{names[first]} shows a body of {tall[first]:.3g} m{readings}"
        raise ValueError(f"{size}; expected metres, and a human of {SMALLEST} to {TALLEST} m")


def infer_unit(
    positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, file: Path, usual: str | None = None
) -> Stated[float]:
    """Metres per unit, so that the body has the size of a human.

    The usual unit of the skeleton's or the format's files is taken if it makes an adult; of CMU's people, who all are adults,
    the one that does. Else exactly one unit must make a human of 0.5 to 2.5 m, and a metric one: inches and CMU's units are
    told from nothing but a known skeleton.

    Raises:
        MotionFormatError: no unit does, or several do; the message says how to state it.
    """
    found = height(positions, skeleton)
    usual = usual or USUAL.get(skeleton.name)
    if usual and ADULT[0] < found * UNITS[usual] < ADULT[1]:
        return Stated(UNITS[usual], SKELETON)
    adult = adults(found) if is_cmu(skeleton) else []  # published in CMU's units, inches and centimetres; no two make an adult
    if len(adult) == 1:
        return Stated(UNITS[adult[0]], SKELETON)
    fitting = _fitting(found)
    if len(fitting) == 1 and fitting[0] in METRIC:
        return Stated(UNITS[fitting[0]], SIZE)
    sizes = f"{found / HEIGHT_BY_REACH:.4g} units along the bones from end to end{_readings(found, fitting)}"
    raise MotionFormatError(file, "body size", sizes, f"a human of {SMALLEST} to {TALLEST} m in one unit only; say {STATE_UNIT}")


def check_size(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, unit: Stated[float], file: Path) -> None:
    """Refuse a body of no human's size, unless the user stated the unit.

    Args:
        positions: metres.

    Raises:
        MotionFormatError: it is too small or too large; the message names the likely unit.
    """
    tall = height(positions, skeleton)
    if unit.is_users or SMALLEST <= tall <= TALLEST:
        return
    readings = _readings(tall / unit.value, _fitting(tall / unit.value))
    sizes = f"a body of {tall:.3g} m in the unit of {unit.source}, {unit.value:.4g} m{readings}"
    raise MotionFormatError(
        file, "body size", sizes, f"a human of {SMALLEST} to {TALLEST} m; if the body is right, say {STATE_UNIT}"
    )


def _fitting(found: float) -> list[str]:
    """Units in which a height is a human's."""
    return [name for name, metres in UNITS.items() if SMALLEST <= found * metres <= TALLEST]


def adults(found: float) -> list[str]:
    """Units in which a height is an adult's."""
    return [name for name, metres in UNITS.items() if ADULT[0] <= found * metres <= ADULT[1]]


def _readings(found: float, names: list[str]) -> str:
    return f": a person of {' or '.join(f'{found * UNITS[n]:.2f} m if the unit is {n}' for n in names)}" if names else ""


UPPER = [re.compile(words, re.I) for words in ("head|neck|skull|nose", "chest|thorax|torso|spine|clavicle|collar|shoulder")]
LOWER = [re.compile(words, re.I) for words in ("foot|feet|toe|ankle|heel|tibia|shin|calf", "knee|leg|thigh|femur")]
UPRIGHT = 0.5  # share of the way from feet to head along an axis, median over frames; people who stand or bend have 0.69 and more
OTHERWISE = 0.75  # along another axis; people who lie and roll have 0.42 at most
STEADY = 0.8  # how far the lowest joint wanders along it, by the body's length: over steps and boxes 0.6, in crawling far
STATE_AXIS = STATE.format("up")
LONGER = 2.0  # without names of joints: how much longer than along both others the body is


class Standing(NamedTuple):
    """What a clip says about its up-axis.

    Args:
        axis: the one that the body is stretched along, feet to head, as "y" or "-z"; of its extent, if no joint is known.
        share: how much of the way from feet to head is along the axis that is said to be up, 0 to 1; of the extent.
        is_clear: whether it stands along another axis for sure.
    """

    axis: str
    share: float
    is_clear: bool


def standing(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, up: str) -> Standing:
    """Along which axis the body stands.

    Own choice: the mean of head and neck above the mean of the feet, median over at most 200 frames. A short clip of
    somebody who lies still along an axis can look like another axis up; one who crawls or rolls does not.
    """
    places, here = looked_at(positions), AXES[up]
    ends = head_and_feet(skeleton)
    if all(ends):
        way = np.subtract(*(places[:, joints].mean(axis=1) for joints in ends))
        length = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
        lean = np.median(way / length[:, None], axis=0)
        axis = int(np.argmax(np.abs(lean)))
        low, high = np.percentile((places * np.sign(lean)).min(axis=1)[:, axis], (10, 90))
        is_clear = (axis != here or lean[axis] < 0) and abs(lean[axis]) > OTHERWISE and lean[here] < UPRIGHT
        is_clear = bool(is_clear and high - low < STEADY * length.max())
        return Standing("-" * bool(lean[axis] < 0) + "xyz"[axis], float(lean[here]), is_clear)
    extent = np.median(np.ptp(places, axis=1), axis=0)
    axis = int(np.argmax(extent))
    others = np.delete(extent, axis)
    is_clear = bool(axis != here and extent[axis] > LONGER * others.max())
    return Standing("xyz"[axis], float(extent[here] / max(extent[axis], 1e-9)), is_clear)


TURN = "turn the positions so that y or z points up, and say which by up="


def check_up(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, up: Stated[str], file: Path) -> None:
    """Refuse a body that clearly stands along another axis, unless the user stated which one is up.

    Raises:
        MotionFormatError: it does; the message names both axes, and how to state the right one.
    """
    found = standing(positions, skeleton, up.value)
    if up.is_users or not found.is_clear:
        return
    fits = found.axis in AXES
    say = f"say up={found.axis}" if fits else f"{TURN}, or put the joints' names into the order of the columns"
    expected = f"{up.value} up, as {up.source} has it; {say} {STATE_AXIS}; if somebody lies there, up={up.value}"
    raise MotionFormatError(file, "up-axis", f"a body that stands along {found.axis}", expected)


def head_and_feet(skeleton: Skeleton) -> tuple[list[int], list[int]]:
    """Joints of the upper and of the lower end, each named by the first of the patterns that names any."""

    def named(kinds: list[re.Pattern[str]]) -> list[int]:
        """The joints of the first kind of name that there is."""
        every = ([joint for joint, name in enumerate(skeleton.joints) if kind.search(name)] for kind in kinds)
        return next((joints for joints in every if joints), [])

    return named(UPPER), named(LOWER)


LEVELS_UP = 4  # folders above a file in which its clips.csv or skeleton.json may lie
SLOWEST = 1.0  # frames per second; a rate below looks like milliseconds taken for seconds
MOST_COLUMNS, MOST_ROWS = 100, 100_000  # of clips.csv; all of CMU are 2435 rows
# Columns of clips.csv that are read, and those that may stand there as well: notes, and what tables of known collections have.
COLUMNS = tuple("file fps unit up subject action content description frames rows tpose_frame0 first_frame".split())
MORE_COLUMNS = tuple(
    "note notes trial take split style dataset id format skeleton joints columns glitch duration_s file_header_fps "
    "height_frame0_cm max_joint_speed_cm_s windows_65_by_40 matched_cmu_subject_trial source_repo source_path".split()
)


@dataclass(frozen=True)
class Hints:
    """What a reader may use beyond the file itself.

    One order holds for unit, up-axis and frame rate: what the caller says, else the file's row in clips.csv, else the file
    or the skeleton.json beside it, which must agree, else what its format or skeleton implies; a unit that is still open is told
    from the body's size (`infer_unit`).

    Args:
        unit: metres per unit; None: neither caller nor clips.csv say.
        up: "y" or "z".
        fps: the true frame rate (cgspeed writes 120 Hz into 60 Hz files).
        subject, action: who and what, "" if unknown.
        first_frame: the row of the file at which the motion begins, from 0; None: an added T-pose is left out where it is found.
        skeleton: of an array.
    """

    unit: Stated[float] | None = None
    up: Stated[str] | None = None
    fps: Stated[float] | None = None
    subject: str = ""
    action: str = ""
    first_frame: int | None = None
    skeleton: Skeleton | None = None

    def over(self, others: Self) -> Self:
        """These, and what others say where these say nothing."""
        return replace(others, **{name: value for name, value in vars(self).items() if value not in (None, "")})

    def reading(
        self,
        file: Path,
        positions: Float[np.ndarray, "T joints 3"],
        skeleton: Skeleton,
        unit: Stated[float],
        up: Stated[str],
        fps: Stated[float],
        first: Stated[int] = NONE_ADDED,
        rig: Rig | None = None,
    ) -> Reading:
        """A clip named like its file; subject and action as they are said, else from the file's name; positions in metres."""
        stem = Path(bare_name(file)).stem
        patterns = (collection.file_name for collection in COLLECTIONS.values() if collection.file_name)
        said = next((m.groupdict() for pattern in patterns if (m := pattern.fullmatch(stem))), {})
        subject, action = self.subject or said.get("subject", "").lstrip("0"), self.action or said.get("action", "")
        motion = Motion(positions.astype(np.float32), fps.value, skeleton, subject, action, stem, up.value, rig)
        return Reading(motion, unit, up, fps, first)  # fmt: skip


UNKNOWN = Hints()


def hints(file: Path, given: Hints = UNKNOWN) -> Hints:
    """Hints for a file: what the caller gave, and its row in the nearest clips.csv that lists it.

    clips.csv has a column `file` (relative to its own folder or to one above) and any of fps, unit, up, subject, action (or
    content), first_frame; more may stand in columns such as notes. Blanks around a cell do not count.

    Raises:
        MotionFormatError: clips.csv is malformed, has an unknown column or one twice, a row without a file, or two rows for
            one file.
    """
    row, table = clips_row(file)
    place = f"row of {row.get('file')}"
    listed = hints_of({name: row[name] for name in ("unit", "up", "fps") if row.get(name)}, table, TABLE, f"{place}, ")
    first = row.get("first_frame", "")
    if first and not re.fullmatch(r"\d{1,9}", first):
        raise MotionFormatError(table, place, f"first_frame {first[:40]!r}", "a row of the file, from 0")
    subject, action = row.get("subject", ""), row.get("action") or row.get("content", "")
    return given.over(listed).over(Hints(subject=subject, action=action, first_frame=int(first) if first else None))


def hints_of(said: dict[str, Any], file: Path, source: str, place: str = "") -> Hints:
    """Check what a file says about its numbers, or those of another.

    Args:
        said: any of skeleton (a Skeleton, or the name of a known one), unit, up and fps.
        source: who says so.
        place: where in the file.

    Raises:
        MotionFormatError: a value makes no sense.
    """
    skeleton, unit, up, fps = (said.get(name) for name in ("skeleton", "unit", "up", "fps"))
    if isinstance(skeleton, str):
        skeleton = SKELETONS.get(skeleton, skeleton)
    if not isinstance(skeleton, Skeleton | None):
        raise MotionFormatError(file, f"{place}skeleton", repr(skeleton)[:40], f"one of {', '.join(sorted(SKELETONS))}")
    if up is not None and (not isinstance(up, str) or up not in AXES):
        raise MotionFormatError(file, f"{place}up", repr(up)[:40], " or ".join(map(repr, AXES)))
    if unit is not None:
        try:
            unit = metres_per_unit(unit)
        except ValueError as error:
            raise MotionFormatError(file, f"{place}unit", repr(unit)[:40], str(error).split("expected ")[-1]) from error
    if fps is not None:
        if not isinstance(fps, str | int | float):
            raise MotionFormatError(file, f"{place}fps", type(fps).__name__, "a number")
        fps = number(str(fps), file, f"{place}fps")
        if not SLOWEST <= fps <= FASTEST:
            raise MotionFormatError(file, f"{place}fps", f"{fps:g} frames per second", f"{SLOWEST:g} to {FASTEST:g}")
    return Hints(stated(unit, source), stated(up, source), stated(fps, source), skeleton=skeleton)


def clips_row(file: Path) -> tuple[dict[str, str], Path]:
    """The file's row in the nearest clips.csv that lists it, and that clips.csv; an empty row if there is none."""
    path = file.resolve()
    for depth, folder in enumerate(path.parents[:LEVELS_UP]):
        table = folder / "clips.csv"
        rows = rows_of(table) if table.is_file() else {}
        keys = [_key(path.parts[start:]) for start in range(len(path.parts) - depth - 1, 0, -1)] if rows else []
        if listed := [rows[key] for key in keys if key in rows]:
            if len(listed) > 1:
                found = f"{' and '.join(row['file'] for row in listed)}, which are one file"
                raise MotionFormatError(table, "table", found, "one row for each file")
            return listed[0], table
    return {}, path


def rows_of(table: Path) -> dict[str, dict[str, str]]:
    """Rows of a clips.csv by the path of their file; an edited one is read again.

    Raises:
        MotionFormatError: see `hints`.
    """
    state = table.stat()
    return _clips(table, state.st_mtime_ns, state.st_size)


def _key(parts: tuple[str, ...]) -> str:
    """A path as clips.csv is searched for it: packing left out."""
    whole = "/".join(parts)
    return whole[: -len(PACKED[0])] if whole.lower().endswith(PACKED) else whole


@lru_cache(maxsize=16)
def _clips(table: Path, *_state: int) -> dict[str, dict[str, str]]:
    """Rows of one clips.csv by file; its time and size make an edited file be read again."""
    try:
        reader = csv.reader(read_text(table, SMALL_TEXT).splitlines(), strict=True)
        columns = _header(next((cells for cells in reader if any(cells)), []), table)
        lines = [(reader.line_num, cells) for cells in islice(reader, MOST_ROWS + 1)]
    except csv.Error as error:
        raise MotionFormatError(table, "table", str(error), "comma-separated values with a header line") from error
    if not columns or not any(any(cells) for _, cells in lines):
        found = "a header without rows" if columns else "nothing"
        raise MotionFormatError(table, "table", found, "a header with a column named file, and a row for each file")
    if len(lines) > MOST_ROWS:
        raise MotionFormatError(table, "table", f"more than {MOST_ROWS} rows", "at most that")
    rows: dict[str, dict[str, str]] = {}
    first: dict[str, int] = {}
    for line, cells in lines:
        cells = [" ".join(_visible(cell).split()) for cell in cells]
        if not any(cells):
            continue
        row = dict(zip(columns, cells, strict=False))
        there = len(cells) if any(cells[len(columns) :]) else min(len(cells), len(columns))
        if there != len(columns):
            expected = f"{len(columns)} cells, empty ones as well; a text with a comma stands in quotes"
            raise MotionFormatError(table, f"line {line}", f"{there} cells", expected)
        if not row.get("file"):
            raise MotionFormatError(table, f"line {line}", "no file", "a file in every row")
        key = _key(tuple(posixpath.normpath(row["file"].replace("\\", "/")).split("/")))
        if key in first:
            raise MotionFormatError(table, f"line {line}", f"{row['file']}, as in line {first[key]}", "one row for each file")
        first[key], rows[key] = line, row
    return rows


def _visible(cell: str) -> str:
    """A text in the one spelling of all that look alike, as René has two; without marks of no width."""
    whole = unicodedata.normalize("NFC", cell)
    return "".join(c for c in whole if unicodedata.category(c) != "Cf")


def _header(cells: list[str], table: Path) -> list[str]:
    if len(cells) > MOST_COLUMNS:
        raise MotionFormatError(table, "header", f"{len(cells)} columns", f"at most {MOST_COLUMNS}")
    columns = [" ".join(cell.split()) for cell in cells]
    while columns and not columns[-1]:  # spreadsheets end lines with commas
        columns.pop()
    check_names(columns, COLUMNS + MORE_COLUMNS, "column", table, "header")
    if twice := [name for name, count in Counter(columns).items() if count > 1]:
        raise MotionFormatError(table, "header", f"column {twice[0]!r} {columns.count(twice[0])} times", "each once")
    if columns and "file" not in columns:
        raise MotionFormatError(table, "header", f"columns {', '.join(columns)[:200]}", "a column named file")
    return columns
