"""NumPy's .npz archives and .npy arrays from files that nobody vouches for; nothing is unpickled."""

from __future__ import annotations

import contextlib
import io
import math
import warnings
import zipfile
from collections.abc import Container, Iterator
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
from jaxtyping import Shaped

from mwlib.data.errors import MotionFormatError
from mwlib.data.opening import MOST_BYTES, MOST_VALUES, PACKED, allowed, open_regular, read_bytes

MOST_DIMENSIONS = 4  # of any array of motions
LONGEST_HEADER = 10_000  # bytes; NumPy's own limit
LONGEST_TEXT = 1000  # characters of one entry of a text array
AT_ONCE = 2**20  # bytes; a list of contents, at a hundred bytes an entry, is far shorter
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # with which NumPy writes


class _Short:
    """A stream that gives at most AT_ONCE bytes, so that an absurdly long list of contents breaks off."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self.seek, self.tell, self.seekable = stream, stream.seek, stream.tell, stream.seekable

    def read(self, size: int = -1) -> bytes:
        return self._stream.read(size if 0 <= size <= AT_ONCE else AT_ONCE)


@contextlib.contextmanager
def _archive(file: Path) -> Iterator[zipfile.ZipFile]:
    """The archive, opened; whatever goes wrong with it becomes a MotionFormatError."""
    is_packed = file.suffix.lower() in PACKED
    stream = io.BytesIO(read_bytes(file, allowed(MOST_BYTES, file))) if is_packed else None
    try:
        with contextlib.nullcontext(stream) if stream else open_regular(file) as source:
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
            parts = []
            with archive.open(entry) as stream:
                while left >= 0 and (part := stream.read(AT_ONCE)):
                    parts.append(part)
                    left -= len(part)
            if left < 0:
                raise MotionFormatError(file, name, f"more than {most} bytes", "at most that in a file of this size")
            streams[name] = io.BytesIO(b"".join(parts))
    return streams


def read_array(stream: BinaryIO, file: Path, place: str) -> Shaped[np.ndarray, "*shape"]:
    """One array in .npy format, numbers or strings; never unpickles, never allocates more than the file's size allows.

    Raises:
        MotionFormatError: another format, Python objects, or a size that does not fit the header.
    """
    shape, fortran, dtype = array_header(stream, file, place)
    if dtype.kind not in "biufU" or not 0 < dtype.itemsize <= 4 * LONGEST_TEXT:
        raise MotionFormatError(file, place, f"an array of dtype {str(dtype)[:40]}", "numbers or strings")
    count, most = math.prod(shape), allowed(MOST_VALUES if dtype.kind != "U" else LONGEST_TEXT, file)
    if max(count, *shape, 0) > most:
        raise MotionFormatError(file, place, f"shape {shape}", f"at most {most} values in a file of this size")
    wanted = count * dtype.itemsize
    data = stream.read(wanted + 1)
    if len(data) != wanted:
        found = f"{len(data)} bytes" if len(data) < wanted else f"more than {wanted} bytes"
        raise MotionFormatError(file, place, found, f"{wanted} bytes for shape {shape}")
    array = np.frombuffer(data, dtype) if wanted else np.empty(0, dtype)
    return array.reshape(shape, order="F" if fortran else "C")


def array_header(stream: BinaryIO, file: Path, place: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, Fortran order and dtype from the head of an .npy stream.

    Raises:
        MotionFormatError: it is no .npy header, or has more dimensions than arrays of motions have.
    """
    expected = "an array in NumPy's .npy format"
    start = stream.read(8)  # magic and version
    size = stream.read({b"\x93NUMPY\x01\x00": 2, b"\x93NUMPY\x02\x00": 4}.get(start, 0))
    length = int.from_bytes(size, "little")
    if not 0 < length <= LONGEST_HEADER:
        raise MotionFormatError(file, place, f"no array header ({length} bytes)", expected)
    parse = np.lib.format.read_array_header_1_0 if len(size) == 2 else np.lib.format.read_array_header_2_0
    try:
        with warnings.catch_warnings(action="ignore"):  # headers that Python 2 wrote are fine
            shape, fortran, dtype = parse(io.BytesIO(size + stream.read(length)))
    except Exception as error:  # on broken bytes NumPy's parser raises nearly any
        raise MotionFormatError(file, place, f"no array header ({str(error)[:80]})", expected) from error
    if len(shape) > MOST_DIMENSIONS or any(n < 0 for n in shape):
        raise MotionFormatError(file, place, f"shape {str(shape)[:80]}", f"at most {MOST_DIMENSIONS} lengths, none negative")
    return shape, fortran, dtype


def single(array: Shaped[np.ndarray, "*shape"], file: Path, name: str) -> float | int | bool | str:
    """The one value of an array.

    Raises:
        MotionFormatError: it has another number of them, or holds text that is none.
    """
    if array.size != 1:
        raise MotionFormatError(file, name, f"shape {array.shape}", "a single value")
    if array.dtype.kind != "U":
        return array.item()
    try:  # NumPy's own way fails on code points that do not exist
        return array.astype(array.dtype.newbyteorder("<")).tobytes().decode("utf-32-le").rstrip("\0")
    except UnicodeDecodeError as error:
        raise MotionFormatError(file, name, f"no character at byte {error.start}", "Unicode text") from error
