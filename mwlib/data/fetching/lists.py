"""The lists of published clips that came with mwlib: by which each is recognised. They hold no motion."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mwlib.body.motion import Motion
from mwlib.data.load import motion_files, read_motion_file
from mwlib.data.untrusted import MOST_BYTES, PACKED, MotionFormatError, allowed, bare_name, read_bytes
from mwlib.files import write_atomic
from mwlib.hashing import sha256 as sha256_of

FINENESS = 1e-4  # metres


class Listed(NamedTuple):
    """One clip.

    Args:
        file: its place in the collection's folder, without packing.
        subject, action: who and what.
        fps: frames per second.
        frames: how many.
        motion: `motion_digest` of what is read from it.
        sha256: of the file's bytes, unpacked, as we have them; a publisher's may have other line ends or comments.
    """

    file: str
    subject: str
    action: str
    fps: float
    frames: int
    motion: str
    sha256: str


def motion_digest(motion: Motion) -> str:
    """Sixteen hex digits over skeleton, rate and positions, rounded to 0.1 mm.

    Own choice: the positions rather than the file's bytes, so that line ends and comments do not count; rounded, so that the
    last bits, which differ between machines' arithmetic, seldom do (`sources.fingerprint` sees every bit).
    """
    s = motion.skeleton
    head = f"{motion.fps:g}/{motion.up}/{s.joints}/{s.parents}/{motion.positions.shape}"
    return sha256_of([head, np.rint(motion.positions.astype(np.float64) / FINENESS).astype("<i4").tobytes()])[:16]


def list_file(name: str) -> Path:
    """Where the list of a collection lies in the package."""
    return Path(__file__).with_name(f"{name}.csv")


def listed(name: str) -> list[Listed]:
    """The clips of a collection, in the order of their files."""
    with list_file(name).open(encoding="utf-8", newline="") as table:
        return [Listed(**{**row, "fps": float(row["fps"]), "frames": int(row["frames"])}) for row in csv.DictReader(table)]


def clips_of(folder: Path) -> list[Listed]:
    """The clips of a folder as they would be listed: for whoever keeps the lists, and for tests."""
    clips = []
    for file in motion_files(folder):
        (motion,) = read_motion_file(file)
        place = file.relative_to(folder).with_name(bare_name(file)).as_posix()
        digest = sha256_of([read_bytes(file, allowed(MOST_BYTES, file))])
        clips.append(Listed(place, motion.subject, motion.action, motion.fps, len(motion), motion_digest(motion), digest))
    return clips


def write_list(name: str, folder: Path) -> None:
    """Make a collection's list again from a folder of the very files; CONTRIBUTING.md says when."""
    text = table_text(Listed._fields, [(*clip[:3], f"{clip.fps:g}", *clip[4:]) for clip in clips_of(folder)])
    write_atomic(list_file(name), text)


def table_text(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Comma-separated values with a header line."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()


def at(folder: Path, file: str) -> Path | None:
    """A file of a folder, plain or packed, as `load_motions` would choose; None if it is not there."""
    plain = folder / file
    return next((found for end in ("", *sorted(PACKED)) if (found := plain.with_name(plain.name + end)).is_file()), None)


def motion_fault(file: Path, clip: Listed) -> str:
    """Why a file does not hold the listed motion; "" if it does. Names the file only where it cannot be read."""
    try:
        (motion, *others) = read_motion_file(file)
    except MotionFormatError as error:
        return f"it cannot be read: {error}"
    found = motion_digest(motion)
    if found == clip.motion and not others:
        return ""
    return f"another motion ({len(motion)} frames, {found}); expected {clip.frames} frames, {clip.motion}"


def byte_fault(file: Path, sha256: str) -> str:
    """Why a file does not have the expected bytes, unpacked; "" if it does."""
    try:
        found = sha256_of([read_bytes(file, allowed(MOST_BYTES, file))])
    except MotionFormatError as error:
        return f"it cannot be read: {error}"
    return "" if found == sha256 else f"its SHA-256 is {found[:16]}…; expected {sha256[:16]}…"
