"""Reading bytes, text, number tables and plain arrays from files that nobody vouches for."""

from __future__ import annotations

import gzip
import io
import lzma
import math
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
from jaxtyping import Float, Shaped

from mwlib.data.errors import MotionFormatError

Answer = TypeVar("Answer")

PACKED = (".xz", ".gz")
TEXT_LIMIT = 2**28  # bytes; an hour of 120 Hz text is about 200 MB
ARRAY_LIMIT = 2**31  # bytes; the whole of Human3.6M is about 0.2 GB
UNPACK_MEMORY = 2**29  # bytes that an .xz dictionary may ask for
LARGEST = 1e7  # no position (in any unit) or angle is larger


def bare_name(path: Path) -> str:
    """The file name without .xz or .gz."""
    return path.stem if path.suffix.lower() in PACKED else path.name


def bare_suffix(path: Path) -> str:
    """The suffix in lower case, .xz or .gz left out: ".bvh" for "walk.BVH.xz"."""
    return Path(bare_name(path)).suffix.lower()


def read_bytes(path: Path, limit: int) -> bytes:
    """The file's bytes, unpacked, but no more than `limit` of them.

    Raises:
        MotionFormatError: broken packing, or more bytes than that.
    """
    try:
        if path.suffix.lower() == ".xz":
            data = _unxz(path.read_bytes(), limit)
        else:
            with gzip.open(path) if path.suffix.lower() == ".gz" else path.open("rb") as stream:
                data = stream.read(limit + 1)
    except (lzma.LZMAError, EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise MotionFormatError(path, "packing", str(error) or "a truncated file", f"a whole {path.suffix} file") from error
    if len(data) > limit:
        raise MotionFormatError(path, "size", f"more than {limit} bytes", "at most that")
    return data


def _unxz(packed: bytes, limit: int) -> bytes:
    """Like lzma.decompress, with bounds on the output and on the memory that the file may ask for."""
    parts, size = [], 0
    while packed and size <= limit:
        unpacker = lzma.LZMADecompressor(memlimit=UNPACK_MEMORY)
        parts.append(unpacker.decompress(packed, limit + 1 - size))
        size += len(parts[-1])
        if not unpacker.eof and size <= limit:
            raise EOFError("a truncated file")
        packed = unpacker.unused_data.lstrip(b"\0")
    return b"".join(parts)


def read_text(path: Path) -> str:
    """The file as UTF-8 text, unpacked, line ends as they are.

    Raises:
        MotionFormatError: not UTF-8, broken packing, or absurdly large.
    """
    try:
        return read_bytes(path, TEXT_LIMIT).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MotionFormatError(path, f"byte {error.start}", f"0x{error.object[error.start]:02x}", "UTF-8 text") from error


def number_table(
    text: str, columns: int, file: Path, place: str, delimiter: str | None = None
) -> Float[np.ndarray, "rows {columns}"]:
    """Lines of numbers as one array.

    Raises:
        MotionFormatError: no line, a word that is no number, another number of columns, or a number out of bounds.
    """
    expected = f"lines of {columns} numbers"
    if not text.strip():
        raise MotionFormatError(file, place, "no line", expected)
    try:
        table = np.loadtxt(io.StringIO(text), ndmin=2, comments=None, delimiter=delimiter)
    except (ValueError, OverflowError) as error:
        raise MotionFormatError(file, place, str(error).split(";")[0], expected) from error
    if table.shape[1] != columns:
        raise MotionFormatError(file, place, f"{table.shape[1]} columns", expected)
    return bounded(table, file, place)


def bounded(values: Shaped[np.ndarray, "*shape"], file: Path, place: str) -> Shaped[np.ndarray, "*shape"]:
    """The same values, once they are known to be finite and of a size that a position or an angle can have.

    Raises:
        MotionFormatError: one of them is not.
    """
    good = (values >= -LARGEST) & (values <= LARGEST)  # False for nan
    if not good.all():
        at = tuple(int(i) for i in np.argwhere(~good)[0])
        raise MotionFormatError(file, f"{place}, entry {at}", str(values[at]), f"a finite number up to {LARGEST:g}")
    return values


def number(word: str, file: Path, place: str) -> float:
    """One word as a finite number of a size that makes sense.

    Raises:
        MotionFormatError: it is none.
    """
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST:
        raise MotionFormatError(file, place, repr(word[:40]), f"a finite number up to {LARGEST:g}")
    return value


def archive_names(file: Path) -> set[str]:
    """Names of the arrays in an .npz file.

    Raises:
        MotionFormatError: it is no archive.
    """
    return set(_archive(file, lambda archive: [name.removesuffix(".npy") for name in archive.namelist()]))


def read_archive(file: Path, name: str) -> BinaryIO:
    """One array of an .npz file, as an .npy stream.

    Raises:
        MotionFormatError: it is no archive, has no such entry, or the entry is broken or too large.
    """
    data = _archive(file, lambda archive: archive.open(f"{name}.npy").read(ARRAY_LIMIT + 1))
    if len(data) > ARRAY_LIMIT:
        raise MotionFormatError(file, name, f"more than {ARRAY_LIMIT} bytes", "at most that")
    return io.BytesIO(data)


def _archive(file: Path, ask: Callable[[zipfile.ZipFile], Answer]) -> Answer:
    data = io.BytesIO(read_bytes(file, ARRAY_LIMIT))
    try:
        with zipfile.ZipFile(data) as archive:
            return ask(archive)
    except Exception as error:  # on broken bytes zipfile raises nearly any
        raise MotionFormatError(file, "archive", str(error)[:80] or type(error).__name__, "NumPy's .npz format") from error


def read_array(stream: BinaryIO, file: Path, place: str) -> Shaped[np.ndarray, "*shape"]:
    """One array in .npy format, numbers or strings; never unpickles, never allocates more than the file holds.

    Raises:
        MotionFormatError: another format, Python objects, or a size that does not fit the header.
    """
    shape, fortran, dtype = array_header(stream, file, place)
    if dtype.kind not in "biufU":
        raise MotionFormatError(file, place, f"an array of dtype {dtype}", "numbers or strings")
    data = stream.read(ARRAY_LIMIT + 1)
    wanted = math.prod(shape) * dtype.itemsize
    if len(data) != wanted or wanted > ARRAY_LIMIT:
        raise MotionFormatError(file, place, f"{len(data)} bytes", f"{wanted} bytes for shape {shape}, at most {ARRAY_LIMIT}")
    array = np.frombuffer(data, dtype) if wanted else np.empty(0, dtype)
    return array.reshape(shape, order="F" if fortran else "C")


def array_header(stream: BinaryIO, file: Path, place: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, Fortran order and dtype from the head of an .npy stream.

    Raises:
        MotionFormatError: it is no .npy header.
    """
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    try:
        with warnings.catch_warnings(action="ignore"):  # headers that Python 2 wrote are fine
            version = np.lib.format.read_magic(stream)
            shape, fortran, dtype = readers[version](stream)
    except Exception as error:  # on broken bytes NumPy's parser raises nearly any
        raise MotionFormatError(file, place, f"no array header ({error})", "an array in NumPy's .npy format") from error
    if any(n < 0 for n in shape):
        raise MotionFormatError(file, place, f"shape {shape}", "no negative length")
    return shape, fortran, dtype
