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
from mwlib.settings import real, shown

Value = TypeVar("Value")
Places = Float[np.ndarray, "T joints 3"]  # of a clip

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
SMALLEST, TALLEST = HUMAN = 0.5, 2.5  # metres
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
        raise ValueError(f"unit is {shown(unit)}; expected metres per unit up to {LONGEST_UNIT:g}, or one of {', '.join(UNITS)}")
    return metres


def height(positions: Places, skeleton: Skeleton) -> float:
    """Standing height of the body whatever its pose, in the unit of `positions`.

    Own choice: the body is measured along its bones, from the toe to the fingers of the other side, and an adult's
    proportions do the rest; that is right to a quarter for skeletons with and without fingers, toes and the top of the head.
    Bone lengths are medians over at most 100 frames.
    """
    return float(heights(looked_at(positions, 100)[None], skeleton)[0])


def looked_at(positions: Places, most: int = 200) -> Float[np.ndarray, "n joints 3"]:
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
    tall = heights(np.asarray(positions, np.float64), skeleton)
    if len(wrong := np.flatnonzero(~((tall >= SMALLEST) & (tall <= TALLEST)))):
        first = int(wrong[0])
        readings = _readings(tall[first], [name for name in METRIC if name in fitting(tall[first])])
        size = f"{names[first]} shows a body of {tall[first]:.3g} m{readings}"
        raise ValueError(f"{size}; expected metres, and a human of {SMALLEST} to {TALLEST} m")


def infer_unit(positions: Places, skeleton: Skeleton, file: Path, usual: str | None = None) -> Stated[float]:
    """Metres per unit, so that the body has the size of a human.

    The usual unit of the skeleton's or the format's files is taken if it makes an adult; of CMU's people, who all are adults,
    the one that does. Else exactly one unit must make a human of 0.5 to 2.5 m, and a metric one: inches and CMU's units are
    told from nothing but a known skeleton.

    Raises:
        MotionFormatError: no unit does, or several do; the message says how to state it.
    """
    found = height(positions, skeleton)
    usual = usual or USUAL.get(skeleton.name)
    adults = fitting(found, ADULT)
    if usual in adults:
        return Stated(UNITS[usual], SKELETON)
    adult = adults if is_cmu(skeleton) else []  # published in CMU's units, inches and centimetres; no two make an adult
    if len(adult) == 1:
        return Stated(UNITS[adult[0]], SKELETON)
    human = fitting(found)
    if len(human) == 1 and human[0] in METRIC:
        return Stated(UNITS[human[0]], SIZE)
    sizes = f"{found / HEIGHT_BY_REACH:.4g} units along the bones from end to end{_readings(found, human)}"
    raise MotionFormatError(file, "body size", sizes, f"a human of {SMALLEST} to {TALLEST} m in one unit only; say {STATE_UNIT}")


def check_size(positions: Places, skeleton: Skeleton, unit: Stated[float], file: Path) -> None:
    """Refuse a body of no human's size, unless the user stated the unit.

    Args:
        positions: metres.

    Raises:
        MotionFormatError: it is too small or too large; the message names the likely unit.
    """
    tall = height(positions, skeleton)
    if unit.is_users or SMALLEST <= tall <= TALLEST:
        return
    readings = _readings(tall / unit.value, fitting(tall / unit.value))
    sizes = f"a body of {tall:.3g} m in the unit of {unit.source}, {unit.value:.4g} m{readings}"
    raise MotionFormatError(
        file, "body size", sizes, f"a human of {SMALLEST} to {TALLEST} m; if the body is right, say {STATE_UNIT}"
    )


def fitting(found: float, span: tuple[float, float] = HUMAN) -> list[str]:
    """Units in which a height is a human's, or an `ADULT`'s."""
    return [name for name, metres in UNITS.items() if span[0] <= found * metres <= span[1]]


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


def standing(positions: Places, skeleton: Skeleton, up: str) -> Standing:
    """Along which axis the body stands.

    Own choice: the mean of head and neck above the mean of the feet, median over at most 200 frames. A short clip of
    somebody who lies still along an axis can look like another axis up; one who crawls or rolls does not.
    """
    places = looked_at(positions)
    ends = head_and_feet(skeleton)
    if all(ends):
        way = np.subtract(*(places[:, joints].mean(axis=1) for joints in ends))
        found = leaning(way, up)
        along = places[..., "xyz".index(found.axis[-1])]
        low, high = np.percentile(-along.max(axis=1) if found.axis[0] == "-" else along.min(axis=1), (10, 90))
        is_steady = high - low < STEADY * np.linalg.norm(way, axis=-1).max()
        return found._replace(is_clear=found.is_clear and bool(is_steady))
    extent = np.median(np.ptp(places, axis=1), axis=0)
    axis, here = int(np.argmax(extent)), AXES[up]
    is_clear = bool(axis != here and extent[axis] > LONGER * np.delete(extent, axis).max())
    return Standing("xyz"[axis], float(extent[here] / max(extent[axis], 1e-9)), is_clear)


def leaning(way: Float[np.ndarray, "T 3"], up: str) -> Standing:
    """Along which axis the way from a body's lower end to its upper one points, median over the frames."""
    lean = np.median(way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9), axis=0)
    axis, share = int(np.argmax(np.abs(lean))), float(lean[AXES[up]])
    is_other = abs(lean[axis]) > OTHERWISE and share < UPRIGHT
    return Standing("-" * bool(lean[axis] < 0) + "xyz"[axis], share, bool(is_other))


TURN = "turn the positions so that y or z points up, and say which by up="


def check_up(positions: Places, skeleton: Skeleton, up: Stated[str], file: Path) -> None:
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
    every = ([[j for j, name in enumerate(skeleton.joints) if kind.search(name)] for kind in kinds] for kinds in (UPPER, LOWER))
    upper, lower = (next(filter(None, ends), []) for ends in every)
    return upper, lower


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
        positions: Places,
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
    if fps is not None:
        if not isinstance(fps, str | int | float):
            raise MotionFormatError(file, f"{place}fps", type(fps).__name__, "a number")
        fps = number(str(fps), file, f"{place}fps")
        if not SLOWEST <= fps <= FASTEST:
            raise MotionFormatError(file, f"{place}fps", f"{fps:g} frames per second", f"{SLOWEST:g} to {FASTEST:g}")
    try:
        return said_by(source, unit, up, fps, skeleton)
    except ValueError as error:
        name, _, found = str(error).partition(" is ")
        raise MotionFormatError(file, place + name, *found.split("; expected ", 1)) from error


def said_by(
    source: str,
    unit: float | str | None = None,
    up: str | None = None,
    file_fps: float | None = None,
    skeleton: Skeleton | str | None = None,
) -> Hints:
    """What somebody says of all numbers of a file, checked; arguments as in `load_motions`.

    Raises:
        ValueError: an unknown unit, axis or skeleton, or no rate; the message has the form "name is value; expected values".
    """
    check_rate("file_fps", file_fps)
    skeleton = SKELETONS.get(skeleton, skeleton) if isinstance(skeleton, str) else skeleton
    if not isinstance(skeleton, Skeleton | None):
        raise ValueError(f"skeleton is {shown(skeleton)}; expected one of {', '.join(sorted(SKELETONS))}, or one of your own")
    if up is not None and (not isinstance(up, str) or up not in AXES):
        raise ValueError(f"up is {repr(up)[:40]}; expected {' or '.join(map(repr, AXES))}")
    metres = None if unit is None else metres_per_unit(unit)
    return Hints(stated(metres, source), stated(up, source), stated(file_fps, source), skeleton=skeleton)


def check_rate(name: str, rate: float | None) -> None:
    """Refuse a rate that is none.

    Raises:
        ValueError: it is no positive number.
    """
    if rate is not None and not real(name, rate) > 0:
        raise ValueError(f"{name} is {rate}; expected a positive number")


def clips_row(file: Path) -> tuple[dict[str, str], Path]:
    """The file's row in the nearest clips.csv that lists it, and that clips.csv; an empty row if there is none."""
    path = file.resolve()
    for depth, folder in enumerate(path.parents[:LEVELS_UP]):
        table = folder / "clips.csv"
        rows = rows_of(table) if table.is_file() else {}
        keys = [_key(path.parts[start:]) for start in range(len(path.parts) - depth - 1, 0, -1)]
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
        lines = [(reader.line_num, [*map(_plain, cells)]) for cells in islice(reader, MOST_ROWS + 2)]
    except csv.Error as error:
        raise MotionFormatError(table, "table", str(error), "comma-separated values with a header line") from error
    if len(lines) > MOST_ROWS + 1:
        raise MotionFormatError(table, "table", f"more than {MOST_ROWS} rows", "at most that")
    (_, head), *lines = [(line, cells) for line, cells in lines if any(cells)] or [(0, [])]
    columns = _header(head, table)
    rows: dict[str, dict[str, str]] = {}
    first: dict[str, int] = {}
    for line, cells in lines:
        while len(cells) > len(columns) and not cells[-1]:
            cells.pop()
        if len(cells) != len(columns):
            expected = f"{len(columns)} cells, empty ones as well; a text with a comma stands in quotes"
            raise MotionFormatError(table, f"line {line}", f"{len(cells)} cells", expected)
        row = dict(zip(columns, cells, strict=True))
        if not row["file"]:
            raise MotionFormatError(table, f"line {line}", "no file", "a file in every row")
        key = _key(tuple(posixpath.normpath(row["file"].replace("\\", "/")).split("/")))
        if key in first:
            raise MotionFormatError(table, f"line {line}", f"{row['file']}, as in line {first[key]}", "one row for each file")
        first[key], rows[key] = line, row
    if not rows:
        found = "a header without rows" if columns else "nothing"
        raise MotionFormatError(table, "table", found, "a header with a column named file, and a row for each file")
    return rows


def _plain(cell: str) -> str:
    """A text in the one spelling of all that look alike, as René has two; without marks of no width and blanks around it."""
    whole = unicodedata.normalize("NFC", cell)
    return " ".join("".join(c for c in whole if unicodedata.category(c) != "Cf").split())


def _header(columns: list[str], table: Path) -> list[str]:
    if len(columns) > MOST_COLUMNS:
        raise MotionFormatError(table, "header", f"{len(columns)} columns", f"at most {MOST_COLUMNS}")
    while columns and not columns[-1]:  # spreadsheets end lines with commas
        columns.pop()
    check_names(columns, COLUMNS + MORE_COLUMNS, "column", table, "header")
    if twice := [name for name, count in Counter(columns).items() if count > 1]:
        raise MotionFormatError(table, "header", f"column {twice[0]!r} {columns.count(twice[0])} times", "each once")
    if columns and "file" not in columns:
        raise MotionFormatError(table, "header", f"columns {', '.join(columns)[:200]}", "a column named file")
    return columns
