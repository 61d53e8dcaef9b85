"""load_motions: every reader behind one name."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Unpack

from tqdm import tqdm

from mwlib.body.kinematics import AXES
from mwlib.body.motion import Motion
from mwlib.body.skeleton import SKELETONS, Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.formats.amc import read_amc
from mwlib.data.formats.arrays import read_npy, read_positions
from mwlib.data.formats.bvh import read_bvh
from mwlib.data.formats.cmu_benchmark import COLUMNS, read_benchmark
from mwlib.data.formats.h36m import read_positions_3d
from mwlib.data.hints import Given, Hints, hints
from mwlib.data.known import NAMED_SOURCES
from mwlib.data.reading import ARRAY_LIMIT, archive_names, array_header, bare_suffix, read_archive, read_array, read_bytes
from mwlib.data.stated import Reading
from mwlib.data.synthetic.script import synthetic_motions
from mwlib.data.units import check_size, metres_per_unit
from mwlib.data.upright import check_up

MANY_FILES = 20  # from here on a progress bar is worth its line


def load_motions(
    source: str | Path,
    *,
    fps: float | None = None,
    skeleton: Skeleton | str | None = None,
    unit: float | str | None = None,
    up: str | None = None,
    file_fps: float | None = None,
) -> list[Motion]:
    """Read motions from a file, a folder or the built-in generator; positions in metres.

    Reads BVH, AMC (with the ASF beside it), the CMU benchmark's texts, Human3.6M and HumanEva-I as VideoPose3D stores them,
    and .npy/.npz arrays of one's own (see `arrays.read_positions`); .xz and .gz are read as they are. A folder is
    read whole, recursively, in the order of its paths; files of other kinds are passed over. A clips.csv beside the files
    or above supplies true frame rates, units, up-axes, subjects and actions (see `hints.hints`). What the caller says goes
    before clips.csv, that before the file or a skeleton.json beside it, that before what is inferred (see `Hints`). A body of
    no human's size, or one that stands along another axis than the one said to be up, is refused unless `unit` or `up` was
    stated.

    Args:
        source: "synthetic", the name of a preset (its data at its frame rate), or a path; a relative one is looked up in the
            working folder, then under MWLIB_DATA.
        fps: resample to this rate, hertz.
        skeleton: carry over to this skeleton; the skeleton itself of an array that states none.
        unit: metres per unit of the files, or "m", "cm", "mm", "inch", "cmu"; None: as the file says, or inferred from
            the body's size.
        up: the axis that points up in the files, "y" or "z"; None: as the file or its format says.
        file_fps: the rate of the files themselves, hertz; None: as they say.

    Raises:
        FileNotFoundError: there is no such path; the message says where it was looked for.
        MotionFormatError: a file cannot be read, or the folder holds no motion.
        ValueError: an argument makes no sense, or no way to `skeleton` is known.
    """
    if isinstance(source, str) and source in NAMED_SOURCES:
        source, own_fps = NAMED_SOURCES[source]
        fps = fps or own_fps
    _check_rate("fps", fps)
    given = caller_says(unit, up, file_fps, skeleton)
    wanted = given.get("fallback_skeleton")
    motions = synthetic_motions() if source == "synthetic" else _read(find_source(source), given)
    motions = motions if wanted is None else [m.retarget(wanted) for m in motions]
    return motions if fps is None else [m.resample(fps) for m in motions]


def caller_says(
    unit: float | str | None = None,
    up: str | None = None,
    file_fps: float | None = None,
    skeleton: Skeleton | str | None = None,
) -> Given:
    """What a caller says of all files, checked; arguments as in `load_motions`.

    Raises:
        ValueError: an unknown unit, axis or skeleton, or no rate.
    """
    _check_rate("file_fps", file_fps)
    if isinstance(skeleton, str):
        if skeleton not in SKELETONS:
            raise ValueError(f"skeleton is {skeleton!r}; expected one of {', '.join(sorted(SKELETONS))}")
        skeleton = SKELETONS[skeleton]
    if up is not None and up not in AXES:
        raise ValueError(f"up is {up!r}; expected {' or '.join(AXES)}")
    metres = None if unit is None else metres_per_unit(unit)
    return {"unit": metres, "up": up, "fps": file_fps, "fallback_skeleton": skeleton}


def _check_rate(name: str, rate: float | None) -> None:
    if rate is not None and not 0 < rate < float("inf"):
        raise ValueError(f"{name} is {rate}; expected a positive number")


def data_folder() -> Path:
    """Where relative data sources are looked up: MWLIB_DATA, or the working folder."""
    return Path(os.environ.get("MWLIB_DATA", "."))


def find_source(source: str | Path) -> Path:
    """The path that a source stands for.

    Raises:
        FileNotFoundError: it is neither in the working folder nor under MWLIB_DATA.
    """
    path = Path(source).expanduser()
    places = [path] if path.is_absolute() else [Path.cwd() / path, data_folder().resolve() / path]
    for place in places:
        if place.exists():
            return place
    where = " nor ".join(map(str, dict.fromkeys(places)))
    hint = "" if "MWLIB_DATA" in os.environ or path.is_absolute() else "; MWLIB_DATA, the folder of your data, is not set"
    raise FileNotFoundError(f"no motions at {where}{hint}; expected a path, 'synthetic' or one of {', '.join(NAMED_SOURCES)}")


def motion_files(path: Path) -> list[Path]:
    """The motion files of a folder, recursively, sorted; or the file itself.

    Raises:
        MotionFormatError: the folder holds none.
    """
    if not path.is_dir():
        return [path]
    files = sorted(Path(folder, name) for folder, _, names in os.walk(path) for name in names if not name.startswith("."))
    found = [file for file in files if _is_motion(file)]
    if not found:
        expected = f"at least one file with motions ({', '.join(READERS)}, plain or as .xz or .gz)"
        raise MotionFormatError(path, "folder", f"{len(files)} files without motions", expected)
    return found


def _read(path: Path, given: Given) -> list[Motion]:
    files = motion_files(path)
    quiet = len(files) <= MANY_FILES or not sys.stderr.isatty()
    files = tqdm(files, "reading motions", unit="file", disable=quiet)
    return [motion for file in files for motion in read_motion_file(file, **given)]


def read_motion_file(file: Path, **given: Unpack[Given]) -> list[Motion]:
    """The motions of one file, at their own rate, on their own skeleton; arguments and errors as in `readings`."""
    return [reading.motion for reading in readings(file, **given)]


def readings(file: Path, **given: Unpack[Given]) -> list[Reading]:
    """The motions of one file, and who said what their numbers mean.

    Args:
        given: what the caller knows of it.

    Raises:
        MotionFormatError: it cannot be read, the body is too large or too small for a human, or stands along another axis than
            the one that is said to be up.
    """
    reader = READERS.get(bare_suffix(file))
    if reader is None:
        what = "a skeleton" if bare_suffix(file) == ".asf" else repr(file.name[-40:])
        raise MotionFormatError(file, "name", what, f"a motion file ({', '.join(READERS)})")
    found = reader(file, hints(file, **given))
    found = found if isinstance(found, list) else [found]
    for reading in found:
        motion = reading.motion
        check_size(motion.positions, motion.skeleton, reading.unit, file)
        check_up(motion.positions, motion.skeleton, reading.up, file)
    return found


def _is_motion(file: Path) -> bool:
    """Whether a file in a folder is meant to be a motion: by its name, and texts and arrays by how they begin."""
    kind = bare_suffix(file)
    if kind == ".txt":
        line = read_bytes(file, ARRAY_LIMIT).split(b"\n", 1)[0]
        return line.count(b",") + 1 == COLUMNS
    if kind == ".npy":
        return _array_is_motion(file)
    if kind == ".npz":
        return bool({"positions", "positions_3d"} & archive_names(file))
    return kind in READERS


def _array_is_motion(file: Path) -> bool:
    shape, _, _ = array_header(BytesIO(read_bytes(file, ARRAY_LIMIT)), file, "array")
    return len(shape) == 3 and shape[-1] == 3


def _read_npy(file: Path, known: Hints) -> Reading:
    return read_npy(BytesIO(read_bytes(file, ARRAY_LIMIT)), file, known)


def _read_npz(file: Path, known: Hints) -> list[Reading] | Reading:
    """positions_3d: the VideoPose3D layout; positions: an array of one's own."""
    names = archive_names(file)
    if "positions_3d" in names:
        return read_positions_3d(read_archive(file, "positions_3d"), file, known)
    if "positions" not in names:
        found = f"entries {', '.join(sorted(names))[:120] or 'none'}"
        raise MotionFormatError(file, "archive", found, "positions (T, J, 3), or positions_3d (Human3.6M)")
    arrays = {name: read_array(read_archive(file, name), file, name) for name in sorted(names & ENTRIES)}
    return read_positions(arrays, file, known)


ENTRIES = {"positions", "fps", "unit", "up", "subject", "action", "skeleton"}
READERS: dict[str, Callable[[Path, Hints], Reading | list[Reading]]] = {
    ".bvh": read_bvh,
    ".amc": read_amc,
    ".txt": read_benchmark,
    ".npz": _read_npz,
    ".npy": _read_npy,
}
