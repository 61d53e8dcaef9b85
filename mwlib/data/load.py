"""load_motions: every reader behind one name."""

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pooch
from tqdm import tqdm

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections import NAMED_SOURCES, named_source
from mwlib.data.collections.cmu import BENCHMARK_COLUMNS

from mwlib.data.meaning import (  # isort: skip
    CALLER, ENTRY, LEVELS_UP, TABLE, UNKNOWN, Hints, Reading, Stated, check_rate, check_size, check_up, hints, hints_of,
    said_by,
)  # fmt: skip
from mwlib.data.untrusted import (  # isort: skip
    BrokenFilesWarning, DoubtfulDataWarning, MotionFormatError, archive_names, array_header, bare_suffix, near_name,
    open_regular, read_archive, read_array, read_bytes, read_head, single, without_twins,
)  # fmt: skip
from mwlib.settings import near, shown

HINTS = ("clips.csv", "skeleton.json")  # read along with motions that lie beside or below them
MODELS = "body_models"  # and a folder of body models
MANY_FILES = 20  # from here on a progress bar is worth its line
CONTENT = "content"  # the place of a failure that its reader did not foresee
MOST_REASONS = 12  # of a report on broken files
HEAD = 2**16  # bytes that say what a text or an array is
# Where the entry of an archive begins.
MOTION_ENTRY = re.compile(rb"PK\x03\x04.{26}(positions(_3d)?|mocap_frame_?rate)\.npy", re.DOTALL)
# What a reader may raise on a bad file. Anything else is a fault of the reader, and must be seen.
FAILURES = (ValueError, ArithmeticError, LookupError, EOFError, RecursionError, MemoryError, OSError)


def load_motions(
    source: str | Path,
    *,
    fps: float | None = None,
    skeleton: Skeleton | str | None = None,
    unit: float | str | None = None,
    up: str | None = None,
    file_fps: float | None = None,
    strict: bool = False,
) -> list[Motion]:
    """Read motions from a file, a folder or the built-in generator; positions in metres.

    Reads BVH, AMC (with the ASF beside it), the CMU benchmark's texts, Human3.6M and HumanEva-I as VideoPose3D stores them,
    HumanML3D's and KIT-ML's new_joints, or new_joint_vecs where those are missing, poses of SMPL's bodies as AMASS has them
    (`smpl.read_smpl`; their models lie in a folder body_models, see `model_folders`), and .npy/.npz arrays of one's own (see
    `arrays.read_positions`); .xz and .gz are read as they are. A folder is
    read whole, recursively, in the order of its paths; files of other kinds are passed over, and motions that cannot be read
    are left out with a warning that says why. Of walk.bvh beside walk.bvh.xz the plain one is taken. A clips.csv beside the
    files or above supplies true frame rates, units, up-axes, subjects and actions (see `hints.hints`). What the caller says goes
    before clips.csv, that before the file or a skeleton.json beside it, that before what is inferred (see `Hints`). A body of
    no human's size, or one that stands along another axis than the one said to be up, is refused unless `unit` or `up` was
    stated. Rows of a clips.csv that match no file are told in a warning; so is what was likely assumed wrongly, because nobody
    said it: the up-axis of a body of nameless joints that stands along another one, 120 Hz of a trial that CMU recorded at 60.

    Args:
        source: "synthetic", the name of a preset (its data at its frame rate), or a path; a relative one is looked up in the
            working folder, then in the `data_folder`.
        fps: resample to this rate, hertz.
        skeleton: carry over to this skeleton; the skeleton itself of an array that states none.
        unit: metres per unit of the files, or "m", "cm", "mm", "inch", "cmu"; None: as the file says, or inferred from
            the body's size.
        up: the axis that points up in the files, "y" or "z"; None: as the file or its format says.
        file_fps: the rate of the files themselves, hertz; None: as they say.
        strict: refuse a folder if any of its motion files cannot be read.

    Raises:
        FileNotFoundError: there is no such path; the message says where it was looked for.
        MotionFormatError: the file cannot be read; or the folder holds no motion that can be, or, if strict, any that cannot.
        ValueError: an argument makes no sense, or no way to `skeleton` is known.
    """
    check_rate("fps", fps)
    expect_source(source)
    source, own_fps = named_source(source)
    fps = fps or own_fps
    given = said_by(CALLER, unit, up, file_fps, skeleton)
    if source == "synthetic":
        from mwlib.synthetic.motions import synthetic_motions

        motions = synthetic_motions()
    else:
        motions = _read(find_source(source), given, strict)
    motions = [m.retarget(given.skeleton) for m in motions] if given.skeleton else motions
    return motions if fps is None else [m.resample(fps) for m in motions]


def expect_source(source: object) -> None:
    """Refuse what names no motions; an empty text, which is also the path of the working folder, was meant for none.

    Raises:
        ValueError: it is neither a path nor a name.
    """
    if not isinstance(source, str | Path) or source == "":
        raise ValueError(f"source is {shown(source)}; expected a path, 'synthetic' or one of {', '.join(NAMED_SOURCES)}")


def data_folder() -> Path:
    """Where `mwlib fetch` puts data and relative sources are looked up: MWLIB_DATA, or this user's folder for such things."""
    return Path(os.environ.get("MWLIB_DATA") or pooch.os_cache("mwlib"))


def model_folders(source: Path) -> list[Path]:
    """Where models of SMPL's bodies are looked for: body_models beside a file, above it (3 levels), or in the `data_folder`."""
    return [folder / MODELS for folder in (*source.resolve().parents[:LEVELS_UP], data_folder().absolute())]


def find_source(source: str | Path) -> Path:
    """The path that a source stands for.

    Raises:
        FileNotFoundError: it is neither in the working folder nor in the folder of data.
    """
    path = Path(source).expanduser()
    places = [path] if path.is_absolute() else [Path.cwd() / path, data_folder().resolve() / path]
    for place in places:
        if os.path.lexists(place):  # a broken link is there, and its reader says what is wrong with it
            return place
    where = " nor ".join(map(str, dict.fromkeys(places)))
    hint = "" if os.environ.get("MWLIB_DATA") or path.is_absolute() else "; MWLIB_DATA, the folder of your data, is not set"
    hint += "; mwlib fetch lists what can be downloaded"
    expected = f"a path, 'synthetic' or one of {', '.join(NAMED_SOURCES)}{near(source, ['synthetic', *NAMED_SOURCES])}"
    raise FileNotFoundError(f"no motions at {where}{hint}; expected {expected}")


def motion_files(path: Path) -> list[Path]:
    """The motion files of a folder, recursively, sorted; or the file itself.

    Texts and arrays belong by how they begin, so that broken files of other kinds are passed over; BVH and AMC by their names.
    Of a plain and a packed file of one name only the plain one is taken, of HumanML3D's joints and features of a clip only the
    joints. Folders that cannot be listed are among the files.

    Raises:
        MotionFormatError: the folder holds none.
    """
    if not path.is_dir():
        return [path]
    from mwlib.data.formats.humanml import without_features

    unlisted: list[Path] = []
    files = _inside(path, lambda error: unlisted.append(Path(error.filename)))
    found = without_features(without_twins([*unlisted, *(file for file in files if _is_motion(file))]))
    if not found:
        expected = f"at least one file with motions ({', '.join(READERS)}, plain or as .xz or .gz)"
        seen = "".join(f" ({each})" for each in passed_over(path)[:1])
        raise MotionFormatError(path, "folder", f"{len(files)} files without motions{seen}", expected)
    return found


def _inside(path: Path, onerror: Callable[[OSError], None] | None = None) -> list[Path]:
    """The files of a folder, recursively, but for hidden ones; `onerror` is told of folders that cannot be listed."""
    walk = os.walk(path, onerror=onerror)
    return [Path(folder, name) for folder, _, names in walk for name in names if not name.startswith(".")]


def passed_over(path: Path) -> list[str]:
    """Arrays in a folder that are taken for no motions, and what they hold."""
    found = []
    for file in sorted(_inside(path) if path.is_dir() else []):
        if bare_suffix(file) in (".npy", ".npz") and not _is_motion(file):
            try:
                if bare_suffix(file) == ".npz":
                    holds = f"entries {', '.join(sorted(archive_names(file))[:8])}; expected positions or poses among them"
                else:
                    shape, _, _ = array_header(BytesIO(read_head(file, HEAD)), file, "array")
                    holds = f"an array of shape {shape}; expected (frames, joints, 3)"
            except MotionFormatError as error:
                holds = f"{error.found}; expected {error.expected}"
            found.append(f"{file}: {holds}")
    return found


def source_files(source: str | Path) -> Iterator[tuple[str, Path]]:
    """The files that reading a source may open, by their place relative to it; none if it is no path."""
    if source == "synthetic":
        return
    try:
        path = find_source(source)
    except FileNotFoundError:
        return
    if path.is_dir():
        found = [file for file in _inside(path) if bare_suffix(file) in (*READERS, ".asf") or file.name in HINTS]
    else:
        found = [path, *(file for file in path.parent.iterdir() if bare_suffix(file) == ".asf")]
    found += [folder / name for folder in path.absolute().parents[:LEVELS_UP] for name in HINTS]
    if any(_is_smpl(file) for file in found):
        found += [model for folder in model_folders(path) for model in folder.rglob("*.npz") if model not in found]
    yield from sorted((os.path.relpath(file, path), file) for file in found if file.is_file())


def source_state(source: str | Path) -> tuple[tuple[str, int, int], ...]:
    """Names, times of change and sizes of those files: what is kept of them belongs to this state."""
    return tuple((name, file.stat().st_mtime_ns, file.stat().st_size) for name, file in source_files(source))


def _read(path: Path, given: Hints, strict: bool) -> list[Motion]:
    from mwlib.data.doubts import doubted, rows_without_files

    files = motion_files(path)
    for alone in rows_without_files(files) if path.is_dir() else ():
        warnings.warn(alone, BrokenFilesWarning, stacklevel=3)
    found, broken = read_files(files, given)
    reasons = [*dict.fromkeys(map(str, broken))]  # a body model that is missing is one, for however many files
    told = "\n  ".join(["", *first_of(reasons, MOST_REASONS, "more")])
    if broken and (strict or len(reasons) == 1 and not found):
        raise broken[0]
    if broken and not found:
        raise MotionFormatError(path, "folder", f"no file that can be read:{told}", "at least one")
    if broken:
        which = f"{len(broken)} of {len(files)} files in {path} cannot be read and are left out (strict=True refuses them):"
        warnings.warn(which + told, BrokenFilesWarning, stacklevel=3)
    for doubt in doubted([(file.name, reading) for file, reading in found]):
        warnings.warn(doubt, DoubtfulDataWarning, stacklevel=3)
    return [reading.motion for _, reading in found]


def first_of(items: Sequence[str], most: int, others: str) -> list[str]:
    """The first of many, and how many others there are."""
    return [*items[:most], *[f"and {len(items) - most} {others}"] * (len(items) > most)]


def read_files(files: list[Path], given: Hints) -> tuple[list[tuple[Path, Reading]], list[MotionFormatError]]:
    """Every clip of some files, and what is wrong with the files that cannot be read."""
    quiet = len(files) <= MANY_FILES or not sys.stderr.isatty()
    found: list[tuple[Path, Reading]] = []
    broken: list[MotionFormatError] = []
    for file in tqdm(files, "reading motions", unit="file", disable=quiet):
        try:
            found += [(file, reading) for reading in readings(file, given)]
        except MotionFormatError as error:
            broken.append(error)
    return found, broken


def read_motion_file(file: Path) -> list[Motion]:
    """The motions of one file, at their own rate, on their own skeleton; errors as in `readings`."""
    return [reading.motion for reading in readings(file)]


def readings(file: Path, given: Hints = UNKNOWN) -> list[Reading]:
    """The motions of one file, and who said what their numbers mean.

    Args:
        given: what the caller knows of it.

    Raises:
        MotionFormatError: it cannot be read (the cause is chained), the body is too large or too small for a human, or stands
            along another axis than the one that is said to be up.
    """
    if file.is_dir():
        raise MotionFormatError(file, "folder", "no list of its files", "a folder that may be listed")
    reader = READERS.get(bare_suffix(file))
    if reader is None:
        what = "a skeleton" if bare_suffix(file) == ".asf" else repr(file.name[-40:])
        raise MotionFormatError(file, "name", what, f"a motion file ({', '.join(READERS)})")
    try:
        with open_regular(file):
            pass
        known = hints(file, given)
        found = reader(file, known)
    except MotionFormatError:
        raise
    except FAILURES as error:
        raise MotionFormatError(file, CONTENT, f"{type(error).__name__}: {str(error)[:200]}", "another content") from error
    found = [_begun(reading, known, file) for reading in (found if isinstance(found, list) else [found])]
    for reading in found:
        motion = reading.motion
        check_size(motion.positions, motion.skeleton, reading.unit, file)
        check_up(motion.positions, motion.skeleton, reading.up, file)
    return found


def _begun(reading: Reading, known: Hints, file: Path) -> Reading:
    """The clip from the row on that clips.csv names."""
    if known.first_frame is None:
        return reading
    rows = len(reading.motion)
    if known.first_frame >= rows:
        expected = f"a row of the file, 0 to {rows - 1}"
        raise MotionFormatError(file, "first_frame", f"{known.first_frame} in clips.csv", expected)
    return replace(reading, motion=reading.motion.cut(known.first_frame, rows), first=Stated(known.first_frame, TABLE))


def _is_motion(file: Path) -> bool:
    """Whether a file in a folder is meant to be a motion: by its name, and texts and arrays by how they begin."""
    kind = bare_suffix(file)
    try:
        if kind == ".txt":
            return read_head(file, HEAD).split(b"\n", 1)[0].count(b",") + 1 == BENCHMARK_COLUMNS
        if kind == ".npy":
            from mwlib.data.formats.humanml import is_features

            shape, _, _ = array_header(BytesIO(read_head(file, HEAD)), file, "array")
            return is_features(shape, file) or (len(shape) == 3 and shape[-1] == 3)
        if kind == ".npz":
            return _archive_is_motion(file)
    except MotionFormatError:  # nothing says that it is one
        return False
    return kind in READERS


def _archive_is_motion(file: Path) -> bool:
    try:
        return any(_positions_meant(name) for name in archive_names(file)) or _is_smpl(file)
    except MotionFormatError:  # without its list of contents, which stands at the end, it still has a beginning
        return MOTION_ENTRY.search(read_head(file, HEAD)) is not None


# Each reader is imported when the first of its files is met, so that a system opens without them.


def _read_words(file: Path, known: Hints) -> Reading:
    """Texts: BVH, AMC, or rows of the CMU benchmark."""
    from mwlib.data.formats import arrays, asf_amc, bvh

    of_text = {".bvh": bvh.read_bvh, ".amc": asf_amc.read_amc, ".txt": arrays.read_benchmark}
    return of_text[bare_suffix(file)](file, known)


def _read_npy(file: Path, known: Hints) -> Reading:
    """Joint positions; in a folder new_joint_vecs, rows of features."""
    from mwlib.data.formats.humanml import FEATURES, read_features

    array = read_array(BytesIO(read_bytes(file)), file, "array")
    if array.ndim == 2 and file.parent.name == FEATURES:
        return read_features(array, file, known)
    from mwlib.data.formats.arrays import read_positions

    return read_positions({"positions": array}, file, known)


def _read_npz(file: Path, known: Hints) -> list[Reading] | Reading:
    """positions_3d: the VideoPose3D layout; positions: an array of one's own; else poses of SMPL's bodies."""
    from mwlib.data.formats.arrays import read_positions

    if _is_smpl(file):
        from mwlib.data.formats.smpl import read_smpl

        return read_smpl(file, known, model_folders(file))
    streams = read_archive(file, ENTRIES)
    _check_entries(file)
    if "positions_3d" in streams:
        from mwlib.data.formats.h36m import read_positions_3d

        said = {name: single(read_array(streams[name], file, name), file, name) for name in MEANINGS if name in streams}
        return read_positions_3d(streams["positions_3d"], file, known.over(hints_of(said, file, ENTRY)))
    if "positions" not in streams:
        found = f"entries {', '.join(sorted(archive_names(file)))[:120] or 'none'}"
        expected = "positions (T, J, 3), positions_3d (Human3.6M), or poses and trans (AMASS, SMPL)"
        raise MotionFormatError(file, "archive", found, expected)
    return read_positions({name: read_array(stream, file, name) for name, stream in streams.items()}, file, known)


def _is_smpl(file: Path) -> bool:
    """Whether it is an archive of poses of SMPL's bodies."""
    from mwlib.data.formats.smpl import is_smpl

    try:
        return bare_suffix(file) == ".npz" and is_smpl(archive_names(file))
    except MotionFormatError:  # its reader says what is wrong
        return False


MEANINGS = ("fps", "unit", "up")
ENTRIES = ("positions", "positions_3d", *MEANINGS, "subject", "action", "skeleton")
NEAR = 0.75  # of an entry to one of these: "units", "Positions", "subject_id", but not "poses", "names" or "mocap_framerate"


def _check_entries(file: Path) -> None:
    """Refuse an entry that looks like a missing one of ours; what other programs keep there as well is only passed over."""
    names = archive_names(file)
    missing = [name for name in ENTRIES[2:] if name not in names and (name in MEANINGS or "positions_3d" not in names)]
    for name in sorted(names.difference(ENTRIES)):
        if near := near_name(name, missing, NEAR) or (names.isdisjoint(ENTRIES[:2]) and _positions_meant(name)):
            found = f"unknown entry {name[:40]!r} (did you mean {near!r}?)"
            raise MotionFormatError(file, "archive", found, f"some of {', '.join(ENTRIES)}, and others unlike these")


def _positions_meant(name: str) -> str:
    """Which of the two the name of an entry means; "" if none: positions_2d are no motion."""
    words = {"position": "positions", "positions": "positions", "positions3d": "positions_3d"}
    return words.get(re.sub(r"[\W_]", "", name.lower()), "")


def unread_entries(file: Path) -> list[str]:
    """What an archive of motions holds besides, of which nothing is read.

    Raises:
        MotionFormatError: it is no archive.
    """
    from mwlib.data.formats import smpl

    names = archive_names(file)
    read = smpl.ENTRIES if _is_smpl(file) else ("positions_3d", *MEANINGS) if "positions_3d" in names else ENTRIES
    return sorted(names.difference(read))


READERS: dict[str, Callable[[Path, Hints], Reading | list[Reading]]] = {
    ".bvh": _read_words,
    ".amc": _read_words,
    ".txt": _read_words,
    ".npz": _read_npz,
    ".npy": _read_npy,
}
