"""LaFAN1, whole, from GitHub: one zip of 144 MB."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pooch

from mwlib.data.fetching.download import Patience, download
from mwlib.data.fetching.errors import NotOfferedError
from mwlib.data.fetching.lists import byte_fault, listed, motion_fault
from mwlib.data.fetching.unpack import unpack
from mwlib.data.fetching.workplace import in_turn, progress, workplace
from mwlib.data.load import read_motion_file
from mwlib.data.untrusted import MotionFormatError
from mwlib.files import write_atomic, write_json

_REPOSITORY = "ubisoft/ubisoft-laforge-animation-dataset/94084601bacdf9cc3764b5c73daaeccae6035fac"
FOLDER = "lafan1"
PROOF = "fetched.json"  # written last: SHA-256 of every file
CLIP = re.compile(r"[A-Za-z]+\d+_subject\d\.bvh")
MOST, TOGETHER = 20_000_000, 600_000_000  # bytes of one BVH, and of all; ten of them have 3.5 million at most


@dataclass(frozen=True)
class Archive:
    """What is published, and how it is recognised.

    Args:
        url: of the zip; Git LFS keeps it, so that the repository's own address gives a pointer to it.
        sha256, size: of the zip, as that pointer says.
        clips, frames: in it, as the publisher's README says.
        licence, licence_sha256: of the text, and its bytes.
    """

    url: str = f"https://media.githubusercontent.com/media/{_REPOSITORY}/lafan1/lafan1.zip"
    sha256: str = "ea918082b500a5d158e9d3aa39039df04cd42e25f5c02fe8f7e88e8e9365a977"
    size: int = 144_051_503
    clips: int = 77
    frames: int = 496_672
    licence: str = f"https://raw.githubusercontent.com/{_REPOSITORY}/license.txt"
    licence_sha256: str = "e11244310739afea404794c9405967a13abdbe7e2492052e94d7c81fe27c8b66"


def fetch_lafan1(to: Path, archive: Archive = Archive(), patience: Patience = Patience()) -> Path:  # noqa: B008
    """Bring every clip and the licence into to/lafan1.

    A broken download goes on where it was. The zip is checked by its SHA-256, every clip by reading it, those in our list by
    their motions, and all by the publisher's counts of clips and frames; then the clips get their names and the zip is removed.

    Returns:
        The folder, which `load_motions` reads.

    Raises:
        FetchError: no connection, or the server sends something else.
        MotionFormatError: the zip holds what it should not.
        PermissionError: nothing can be written there.
    """
    folder = to / FOLDER
    if not is_whole(folder):
        with workplace(to, "lafan1") as staging:
            if not is_whole(folder):  # another process may have been here
                _bring(archive, folder, staging, patience)
    return folder


def is_whole(folder: Path) -> bool:
    """Whether every file that was brought is there, byte by byte."""
    try:
        files = json.loads((folder / PROOF).read_text(encoding="utf-8"))["files"]
        return all(pooch.file_hash(str(folder / name)) == sha256 for name, sha256 in files.items())
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return False


def _bring(archive: Archive, folder: Path, staging: Path, patience: Patience) -> None:
    text, packed = staging / "license.txt", staging / "lafan1.zip"
    download(archive.licence, text, partial(byte_fault, sha256=archive.licence_sha256), most=MOST, patience=patience)
    with progress("LaFAN1", archive.size, "B") as bar:
        check = partial(_zip_fault, archive)
        download(archive.url, packed, check, most=archive.size, resume=True, patience=patience, bar=bar)
    shutil.rmtree(staging / "bvh", ignore_errors=True)
    files = unpack(packed, staging / "bvh", CLIP, most=MOST, together=TOGETHER)
    _check(files, archive, packed)
    sums = {file.name: pooch.file_hash(str(file)) for file in [*files, text]}
    (folder / PROOF).unlink(missing_ok=True)
    write_atomic(folder / text.name, text.read_bytes())
    for file in files:
        with file.open("rb+") as stream:
            os.fsync(stream.fileno())
        os.replace(file, folder / file.name)
    write_json(folder / PROOF, {"url": archive.url, "sha256": archive.sha256, "files": sums})


def _zip_fault(archive: Archive, file: Path) -> str:
    if (size := file.stat().st_size) != archive.size:
        return f"{size} bytes arrived; expected {archive.size}"
    found = pooch.file_hash(str(file))
    return "" if found == archive.sha256 else f"its SHA-256 is {found[:16]}…; expected {archive.sha256[:16]}…"


def _check(files: list[Path], archive: Archive, packed: Path) -> None:
    """Read every clip.

    Raises:
        MotionFormatError: a clip that cannot be read, or other counts than published.
        NotOfferedError: a clip that is not the one in our list.
    """
    known = {clip.file: clip for clip in listed("lafan1")}
    frames = 0
    for file in in_turn(files, "reading clips"):
        frames += sum(map(len, read_motion_file(file)))
        if file.name in known and (fault := motion_fault(file, known[file.name])):
            raise NotOfferedError(f"{archive.url}, {file.name}: {fault}")
    if (len(files), frames) != (archive.clips, archive.frames):
        found, expected = f"{len(files)} clips with {frames} frames", f"{archive.clips} with {archive.frames}"
        raise MotionFormatError(packed, "clips", found, expected)
