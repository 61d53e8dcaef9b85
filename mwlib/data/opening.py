"""Bytes of files that nobody vouches for: regular files only, unpacked piece by piece, never more than their size allows."""

from __future__ import annotations

import contextlib
import lzma
import stat
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, Protocol

from mwlib.data.errors import MotionFormatError

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
PIECE = 2**16


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
    first: dict[tuple[Path, str], Path] = {}
    for file in sorted(files):
        first.setdefault((file.parent, bare_name(file)), file)
    return list(first.values())


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


def read_bytes(path: Path, limit: int) -> bytes:
    """The file's bytes, unpacked, but no more than `limit` of them.

    Raises:
        MotionFormatError: broken packing, or more bytes than that; or as `open_regular`.
    """
    data = read_head(path, limit + 1)
    if len(data) > limit:
        raise MotionFormatError(path, "size", f"more than {limit} bytes", "at most that")
    return data


def read_head(path: Path, count: int) -> bytes:
    """The first bytes of the file, unpacked; all of them if there are fewer.

    Raises:
        MotionFormatError: broken packing as far as it is read; or as `open_regular`.
    """
    new = {".xz": _new_unxz, ".gz": _Gunzip}.get(path.suffix.lower())
    with open_regular(path) as stream:
        if new is None:
            return stream.read(min(count, path.stat().st_size + 1))  # Python sets aside all that is asked for
        parts, size = [], 0
        try:
            for piece in _unpacked(stream, new):
                parts.append(piece)
                size += len(piece)
                if size >= count:
                    break
        except (lzma.LZMAError, EOFError, zlib.error) as error:
            raise MotionFormatError(path, "packing", str(error), f"a whole {path.suffix} file") from error
        return b"".join(parts)[:count]


class _Unpacker(Protocol):
    """What lzma's unpacker offers."""

    @property
    def eof(self) -> bool: ...

    @property
    def unused_data(self) -> bytes: ...

    @property
    def needs_input(self) -> bool: ...

    def decompress(self, data: bytes, max_length: int) -> bytes: ...


def _new_unxz() -> _Unpacker:
    return lzma.LZMADecompressor(memlimit=UNPACK_MEMORY)


class _Gunzip:
    """zlib's unpacker, to be used like lzma's."""

    def __init__(self) -> None:
        self._inner = zlib.decompressobj(wbits=31)
        self.eof, self.unused_data, self.needs_input = False, b"", True

    def decompress(self, data: bytes, max_length: int) -> bytes:
        piece = self._inner.decompress(self._inner.unconsumed_tail + data, max_length)
        self.eof, self.unused_data = self._inner.eof, self._inner.unused_data
        self.needs_input = not self._inner.unconsumed_tail and len(piece) < max_length
        return piece


def _unpacked(stream: BinaryIO, new: Callable[[], _Unpacker]) -> Iterator[bytes]:
    """Pieces of at most PIECE bytes; streams that follow each other, zeros between them, are one.

    Raises:
        EOFError: it ends too early, or holds too many streams.
        lzma.LZMAError, zlib.error: it is broken.
    """
    packed = stream.read(PIECE)
    for _ in range(MOST_STREAMS):
        unpacker = new()
        while not unpacker.eof:
            if unpacker.needs_input:
                packed = packed or stream.read(PIECE)
                piece, packed = unpacker.decompress(packed, PIECE) if packed else None, b""
            else:
                piece = unpacker.decompress(b"", PIECE)
            if piece is None:
                raise EOFError("a truncated file")
            yield piece
        packed = unpacker.unused_data.lstrip(b"\0")
        while not packed and (more := stream.read(PIECE)):
            packed = more.lstrip(b"\0")
        if not packed:
            return
    raise EOFError(f"more than {MOST_STREAMS} streams one after another")
