"""Archives that nobody vouches for: only plain files of expected names come out, into one folder, and no more than expected."""

from __future__ import annotations

import errno
import re
import stat
import zipfile
from pathlib import Path, PurePosixPath

from mwlib.data.untrusted import METHODS, MotionFormatError

PIECE = 2**20  # bytes
MOST_ENTRIES = 10_000


def unpack(archive: Path, into: Path, wanted: re.Pattern[str], *, most: int, together: int) -> list[Path]:
    """Unpack the files of a zip whose bare names match, whatever folder of the archive they lie in; others are passed over.

    Nothing is written before the whole list of contents was found good.

    Args:
        into: a folder; it is made.
        wanted: matches the whole name, without folders.
        most, together: bytes that one file, and all of them, may unfold to.

    Returns:
        The files, sorted.

    Raises:
        MotionFormatError: it is no zip or a broken one; an entry is a link or another special file, is encrypted, lies outside
            the archive's own folder, or has the name of another; or it unfolds to more than it may.
    """
    try:
        with zipfile.ZipFile(archive) as source:
            entries = _good(archive, source.infolist(), wanted)
            into.mkdir(parents=True, exist_ok=True)
            left = together
            for name, entry in sorted(entries.items()):
                left -= _write(archive, source, entry, into / name, min(most, left))
    except MotionFormatError:
        raise
    except Exception as error:  # on broken bytes zipfile raises nearly any
        if isinstance(error, OSError) and error.errno != errno.EINVAL:  # such as a full disk; EINVAL: a place before the start
            raise
        raise MotionFormatError(archive, "archive", str(error)[:80] or type(error).__name__, "a whole zip file") from error
    return [into / name for name in sorted(entries)]


def _good(archive: Path, found: list[zipfile.ZipInfo], wanted: re.Pattern[str]) -> dict[str, zipfile.ZipInfo]:
    """The wanted entries by their bare names, once every entry is known to be harmless."""
    if len(found) > MOST_ENTRIES:
        raise MotionFormatError(archive, "list of contents", f"{len(found)} entries", f"at most {MOST_ENTRIES}")
    chosen: dict[str, zipfile.ZipInfo] = {}
    for entry in found:
        path = PurePosixPath(entry.filename)
        if path.is_absolute() or ".." in path.parts or re.search(r"[\\:\0]", entry.orig_filename):
            raise MotionFormatError(archive, repr(entry.orig_filename[:80]), "a path that leaves its folder", "one inside it")
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise MotionFormatError(archive, entry.filename[:80], "a link or another special file", "plain files and folders")
        if entry.is_dir() or not wanted.fullmatch(path.name) or "__MACOSX" in path.parts:
            continue
        if entry.flag_bits & 1 or entry.compress_type not in METHODS:
            raise MotionFormatError(archive, entry.filename[:80], "encryption or another packing", "stored or deflated")
        if path.name.lower() in (name.lower() for name in chosen):
            raise MotionFormatError(archive, entry.filename[:80], "a second file of this name", "each once")
        chosen[path.name] = entry
    return chosen


def _write(archive: Path, source: zipfile.ZipFile, entry: zipfile.ZipInfo, file: Path, most: int) -> int:
    """Unpack one entry piece by piece, for what it says of its size proves nothing; the bytes that came."""
    size = 0
    with source.open(entry) as packed, file.open("wb") as stream:
        while piece := packed.read(PIECE):
            size += len(piece)
            if size > most:
                raise MotionFormatError(archive, entry.filename[:80], f"more than {most} bytes", "at most that")
            stream.write(piece)
    return size
