"""Bounded reading of untrusted files: bytes, text, numbers, and NumPy's archives, of which nothing is unpickled."""

import contextlib
import difflib
import io
import lzma
import math
import re
import stat
import warnings
import zipfile
import zlib
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from jaxtyping import Float, Shaped


class MotionFormatError(ValueError):
    """A motion file cannot be read.

    Args:
        file: the file at fault.
        place: where in it (line, key, column, frame).
        found: what stands there.
        expected: what should.
    """

    def __init__(self, file: object, place: str, found: str, expected: str) -> None:
        super().__init__(f"{file}, {place}: found {found}; expected {expected}")
        self.file, self.place, self.found, self.expected = str(file), place, found, expected


class BrokenFilesWarning(UserWarning):
    """Motion files of a folder cannot be read and are left out, or rows of a clips.csv match no file; the message says which."""


class DoubtfulDataWarning(UserWarning):
    """What the numbers of a motion mean was not said, and was likely assumed wrongly; the message says how to state it."""


Array = Shaped[np.ndarray, "*shape"]
PACKED = (".xz", ".gz")
# What a file of up to SMALL_FILE bytes on disk may unfold to; a larger one may in proportion. So many take less than 5 s and
# 1 GiB. Own choice, by measurement: a byte on disk holds at most 7.2 bytes of text and 0.23 points in 309 public files, so that
# 10 MB of them come to 72 MB and 2.3 million points; an hour of 22 joints at 30 Hz is 67 MB of BVH and 2.9 million points.
SMALL_FILE = 10_000_000
MOST_BYTES = 80_000_000
MOST_VALUES = 9_000_000
MOST_POINTS = 3_000_000  # frames times joints
MOST_STREAMS = 1000  # of packing one after another in one file
UNPACK_MEMORY = 2**27  # bytes that an .xz dictionary may ask for; the largest that `xz -9` writes is 2**26
PIECE = 2**12  # bytes that are unpacked at a time: they become 30 MB at most


def allowed(most: int, file: Path) -> int:
    """How many bytes, values or points a file may unfold to: `most` up to SMALL_FILE bytes on disk, in proportion beyond."""
    try:
        size = file.stat().st_size
    except OSError:  # who reads it says why
        size = 0
    return most * max(size, SMALL_FILE) // SMALL_FILE


def bare_name(path: Path) -> str:
    """The file name without .xz or .gz."""
    return path.stem if path.suffix.lower() in PACKED else path.name


def bare_suffix(path: Path) -> str:
    """The suffix in lower case, .xz or .gz left out: ".bvh" for "walk.BVH.xz"."""
    return Path(bare_name(path)).suffix.lower()


def without_twins(files: list[Path]) -> list[Path]:
    """The files, sorted; of walk.bvh beside walk.bvh.xz only the first, which is the plain one."""
    return sorted({(file.parent, bare_name(file)): file for file in sorted(files, reverse=True)}.values())


@contextlib.contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """The file as it is on disk. A pipe is never opened, as that would wait for someone to write.

    Raises:
        MotionFormatError: no regular file, or one that cannot be opened; or reading it fails.
    """
    expected = "a regular file that can be read"
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise MotionFormatError(path, "file", "a folder, pipe, socket or device", expected)
        with path.open("rb") as stream:
            yield stream
    except OSError as error:
        raise MotionFormatError(path, "file", error.strerror or type(error).__name__, expected) from error


def read_bytes(path: Path, limit: int | None = None) -> bytes:
    """The file's bytes, unpacked.

    Args:
        limit: bytes, at most; None: what the file's size allows.

    Raises:
        MotionFormatError: broken packing, or more bytes than that; or as `open_regular`.
    """
    limit = allowed(MOST_BYTES, path) if limit is None else limit
    data = read_head(path, limit + 1)
    if len(data) > limit:
        raise MotionFormatError(path, "size", f"more than {limit} bytes", "at most that")
    return data


def read_head(path: Path, count: int) -> bytes:
    """The first bytes of the file, unpacked; all of them if there are fewer.

    Raises:
        MotionFormatError: broken packing as far as it is read; or as `open_regular`.
    """
    kinds = {".xz": partial(lzma.LZMADecompressor, memlimit=UNPACK_MEMORY), ".gz": partial(zlib.decompressobj, wbits=31)}
    new = kinds.get(path.suffix.lower())
    with open_regular(path) as stream:
        if new is None:
            return stream.read(min(count, path.stat().st_size + 1))  # Python sets aside all that is asked for
        data = bytearray()
        try:
            for piece in _unpacked(stream, new):
                data += piece
                if len(data) >= count:
                    break
        except (lzma.LZMAError, EOFError, zlib.error) as error:
            raise MotionFormatError(path, "packing", str(error), f"a whole {path.suffix} file") from error
        return bytes(data[:count])


def _unpacked(stream: BinaryIO, new: Callable[[], Any]) -> Iterator[bytes]:
    """What pieces of PIECE bytes unfold to; streams that follow each other, zeros between them, are one.

    Raises:
        EOFError: it ends too early, or holds too many streams.
        lzma.LZMAError, zlib.error: it is broken.
    """
    unpacker, streams = None, 0
    while packed := stream.read(PIECE):
        while packed := packed if unpacker else packed.lstrip(b"\0"):
            if unpacker is None:
                unpacker, streams = new(), streams + 1
            if streams > MOST_STREAMS:
                raise EOFError(f"more than {MOST_STREAMS} streams one after another")
            yield unpacker.decompress(packed)
            packed, unpacker = unpacker.unused_data, None if unpacker.eof else unpacker
    if unpacker or not streams:
        raise EOFError("a truncated file")


LARGEST = 1e7  # no position (in any unit) or angle is larger
MOST_JOINTS = 500  # of one skeleton; a body with fingers and face has about 200
BLOCK = 2**20  # characters of text that are taken apart at a time
LONGEST_WORD = 200  # characters of a number or of a joint's name
SMALL_TEXT = 4_000_000  # bytes of a skeleton or of a list of clips; the longest at hand has 0.4 million


def read_text(path: Path, limit: int | None = None) -> str:
    """The file as UTF-8 text, unpacked, line ends as they are; `limit` as in `read_bytes`.

    Raises:
        MotionFormatError: not UTF-8, broken packing, or absurdly large.
    """
    try:
        return read_bytes(path, limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MotionFormatError(path, f"byte {error.start}", f"0x{error.object[error.start]:02x}", "UTF-8 text") from error


def _blocks(text: str, start: int, file: Path, place: str) -> Iterator[str]:
    """The text from `start` on in pieces of about BLOCK characters, each cut at the end of a line.

    Raises:
        MotionFormatError: no line ends for BLOCK characters.
    """
    while start < len(text):
        stop = start + BLOCK
        if stop < len(text):
            stop = 1 + max(text.rfind("\r", start, stop), text.rfind("\n", start, stop))
            if stop <= start:
                raise MotionFormatError(file, place, f"more than {BLOCK} characters without a break", "shorter lines and words")
        yield text[start:stop]
        start = stop


def number_table(
    text: str, columns: int, file: Path, place: str, delimiter: str | None = None, start: int = 0
) -> Float[np.ndarray, "rows {columns}"]:
    """Lines of numbers as one array; the text before `start` is left out.

    Raises:
        MotionFormatError: no line, a word that is no number, another number of columns, a number out of bounds, or more numbers
            than the file's size allows.
    """
    expected = f"lines of {columns} numbers"
    tables: list[np.ndarray] = []
    rows, most = 0, allowed(MOST_VALUES, file)
    try:
        for block in _blocks(text, start, file, place):
            if not block.isspace():
                tables.append(np.loadtxt(io.StringIO(block), ndmin=2, comments=None, delimiter=delimiter))
                if tables[-1].shape[1] != columns:
                    raise MotionFormatError(file, place, f"{tables[-1].shape[1]} columns", expected)
                rows += len(tables[-1])
            if rows * columns > most:
                raise MotionFormatError(file, place, f"more than {most} numbers", "at most that in a file of this size")
    except (ValueError, OverflowError) as error:
        if isinstance(error, MotionFormatError):
            raise
        found = re.sub(r"(?<=row )\d+", lambda row: str(rows + int(row[0])), str(error).split(";")[0])
        raise MotionFormatError(file, place, found[:LONGEST_WORD], expected) from error
    if not tables:
        raise MotionFormatError(file, place, "no line", expected)
    return bounded(np.concatenate(tables), file, place)


def bounded(values: Array, file: Path, place: str) -> Array:
    """The same values, once they are known to be finite and of a size that a position or an angle can have.

    Raises:
        MotionFormatError: one of them is not.
    """
    known = values.astype(np.float32) if values.dtype == np.float16 else values  # which has no number of that size
    good = (known >= -LARGEST) & (known <= LARGEST)  # False for nan
    if not good.all():
        at = tuple(int(i) for i in np.unravel_index(np.argmin(good), good.shape))
        raise MotionFormatError(file, f"{place}, entry {at}", str(values[at]), f"a finite number up to {LARGEST:g}")
    return values


def numbers(array: Array, fits: bool, file: Path, place: str, expected: str) -> Float[np.ndarray, "*shape"]:
    """An array as float64, once its numbers are `bounded`.

    Raises:
        MotionFormatError: it does not fit, or holds something else than numbers of a sensible size.
    """
    if not fits or array.dtype.kind not in "fiu":
        raise MotionFormatError(file, place, f"{array.dtype} of shape {array.shape}", expected)
    return bounded(array, file, place).astype(np.float64)


def number(word: str, file: Path, place: str) -> float:
    """One word as a finite number of a size that makes sense.

    Raises:
        MotionFormatError: it is none.
    """
    try:
        value = float(word) if len(word) <= LONGEST_WORD and word.isascii() and "_" not in word else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST:
        point = ", with a point and no comma" * bool(re.fullmatch(r"[-+]?\d+,\d+", word))
        raise MotionFormatError(file, place, repr(word[:40]), f"a finite number up to {LARGEST:g}{point}")
    return value


def label(word: object, file: Path, place: str) -> str:
    """A name that can be written, printed and hashed.

    Raises:
        MotionFormatError: no text, one of absurd length, or half of a surrogate pair.
    """
    if not isinstance(word, str) or len(word) > LONGEST_WORD or any("\ud800" <= character <= "\udfff" for character in word):
        raise MotionFormatError(file, place, repr(word)[:60], f"a name of at most {LONGEST_WORD} characters")
    return word


MEANT = {  # words that people write for the names that are read
    "framerate": "fps", "rate": "fps", "hz": "fps", "frequency": "fps", "upaxis": "up", "axis": "up",
    "person": "subject", "actor": "subject", "path": "file", "name": "file", "label": "action",
}  # fmt: skip


def check_names(found: Iterable[object], valid: Sequence[str], what: str, file: Path, place: str) -> None:
    """Refuse a name that nothing is read from.

    Args:
        found: the names.
        what: they are, such as "column".

    Raises:
        MotionFormatError: the first unknown one, the likeliest that was meant, and all valid ones.
    """
    for name in found:
        if name not in valid:
            near = near_name(name, valid)
            hint = f" (did you mean {near!r}?)" if near else ""
            if ";" in str(name) and what == "column":  # as spreadsheets write where the comma is in numbers
                hint = ", semicolons between columns; commas separate them"
            raise MotionFormatError(file, place, f"unknown {what} {str(name)[:40]!r}{hint}", f"some of {', '.join(valid)}")


def near_name(name: object, valid: Sequence[str], cutoff: float = 0.6) -> str:
    """The valid name that was likely meant; "" if none is near enough."""
    plain = re.sub(r"[\W_]", "", str(name).lower())
    if (meant := MEANT.get(plain, "")) in valid:
        return meant
    near = difflib.get_close_matches(plain, valid, 1, cutoff)
    return near[0] if near else ""


MOST_DIMENSIONS = 4  # of any array of motions
LONGEST_HEADER = 10_000  # bytes; NumPy's own limit
HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}  # by version
LONGEST_TEXT = 1000  # characters of one entry of a text array
AT_ONCE = 2**20  # bytes; a list of contents, at a hundred bytes an entry, is far shorter
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # with which NumPy writes


class _Short:
    """A stream that gives at most AT_ONCE bytes, so that an absurdly long list of contents breaks off."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def read(self, size: int = -1) -> bytes:
        """At most so many bytes, and never more than `AT_ONCE`."""
        return self._stream.read(size if 0 <= size <= AT_ONCE else AT_ONCE)


@contextlib.contextmanager
def _archive(file: Path) -> Iterator[zipfile.ZipFile]:
    """The archive, opened; whatever goes wrong with it becomes a MotionFormatError."""
    is_packed = file.suffix.lower() in PACKED
    try:
        with io.BytesIO(read_bytes(file)) if is_packed else open_regular(file) as source:
            with zipfile.ZipFile(cast(BinaryIO, _Short(source))) as archive:
                yield archive
    except MotionFormatError:
        raise
    except Exception as error:  # on broken bytes zipfile raises nearly any
        raise MotionFormatError(file, "archive", str(error)[:80] or type(error).__name__, "NumPy's .npz format") from error


def archive_names(file: Path) -> set[str]:
    """Names of the arrays in an .npz file; only its list of contents is read.

    Raises:
        MotionFormatError: it is no archive.
    """
    with _archive(file) as archive:
        return {name.removesuffix(".npy") for name in archive.namelist()}


def read_archive(file: Path, wanted: Container[str]) -> dict[str, BinaryIO]:
    """Those arrays of an .npz file that are wanted and there, as .npy streams by name.

    Raises:
        MotionFormatError: it is no archive, or entries are broken or larger than the file's size allows.
    """
    streams: dict[str, BinaryIO] = {}
    left = most = allowed(MOST_BYTES, file)
    with _archive(file) as archive:
        for entry in archive.infolist():
            name = entry.filename.removesuffix(".npy")
            if name == entry.filename or name not in wanted or name in streams:
                continue
            if entry.compress_type not in METHODS:
                raise MotionFormatError(file, name, "another kind of packing", "stored or deflated, as NumPy writes it")
            data = bytearray()
            with archive.open(entry) as stream:
                while left >= 0 and (part := stream.read(AT_ONCE)):
                    data += part
                    left -= len(part)
            if left < 0:
                raise MotionFormatError(file, name, f"more than {most} bytes", "at most that in a file of this size")
            streams[name] = io.BytesIO(data)
    return streams


def read_array(stream: BinaryIO, file: Path, place: str) -> Array:
    """One array in .npy format, numbers or strings; never unpickles, never allocates more than the file's size allows.

    Raises:
        MotionFormatError: another format, Python objects, or a size that does not fit the header.
    """
    shape, fortran, dtype = array_header(stream, file, place)
    if dtype.kind not in "biufUS" or not 0 < dtype.itemsize <= 4 * LONGEST_TEXT:
        raise MotionFormatError(file, place, f"an array of dtype {str(dtype)[:40]}", "numbers or strings")
    count, most = math.prod(shape), allowed(LONGEST_TEXT if dtype.kind in "US" else MOST_VALUES, file)
    if max(count, *shape, 0) > most:
        raise MotionFormatError(file, place, f"shape {shape}", f"at most {most} values in a file of this size")
    wanted = count * dtype.itemsize
    data = stream.read(wanted + 1)
    if len(data) != wanted:
        found = f"{len(data)} bytes" if len(data) < wanted else f"more than {wanted} bytes"
        raise MotionFormatError(file, place, found, f"{wanted} bytes for shape {shape}")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")


def array_header(stream: BinaryIO, file: Path, place: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, Fortran order and dtype from the head of an .npy stream.

    Raises:
        MotionFormatError: it is no .npy header, or has more dimensions than arrays of motions have.
    """
    try:
        parse = HEADERS[np.lib.format.read_magic(stream)]
        with warnings.catch_warnings(action="ignore"):  # headers that Python 2 wrote are fine
            shape, fortran, dtype = parse(stream, max_header_size=LONGEST_HEADER)
    except Exception as error:  # on broken bytes NumPy's parser raises nearly any
        found = f"no array header ({str(error)[:80]})"
        raise MotionFormatError(file, place, found, "an array in NumPy's .npy format") from error
    if len(shape) > MOST_DIMENSIONS or any(n < 0 for n in shape):
        raise MotionFormatError(file, place, f"shape {str(shape)[:80]}", f"at most {MOST_DIMENSIONS} lengths, none negative")
    return shape, fortran, dtype


def single(array: Array, file: Path, name: str) -> float | int | bool | str:
    """The one value of an array.

    Raises:
        MotionFormatError: it has another number of them, or holds text that is none.
    """
    if array.size != 1:
        raise MotionFormatError(file, name, f"shape {array.shape}", "a single value")
    if array.dtype.kind != "U":
        value = array.item()
        return value.decode("latin1") if isinstance(value, bytes) else value  # Python 2 wrote bytes
    try:  # NumPy's own way fails on code points that do not exist
        return array.astype(array.dtype.newbyteorder("<")).tobytes().decode("utf-32-le").rstrip("\0")
    except UnicodeDecodeError as error:
        raise MotionFormatError(file, name, f"no character at byte {error.start}", "Unicode text") from error
