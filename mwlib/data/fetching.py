"""Downloads of published motions: from their publishers, checked, one process at a time."""

from __future__ import annotations

import csv
import io
import json
import shutil
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pooch
import requests
import urllib3
from filelock import FileLock, Timeout
from tqdm import tqdm

from mwlib.body.motion import Motion
from mwlib.data.collections import COLLECTIONS, Archive, Collection, Listed
from mwlib.data.formats.asf_amc import read_asf
from mwlib.data.load import data_folder, read_motion_file
from mwlib.data.meaning import clips_row
from mwlib.data.untrusted import PACKED, MotionFormatError, bare_name, read_bytes
from mwlib.files import write_atomic, write_json
from mwlib.hashing import file_hash, sha256
from mwlib.version import __version__

HEADERS = {"User-Agent": f"mwlib/{__version__} (motion-wavelet-notebooks)", "Accept-Encoding": "identity"}
PIECE = 2**14  # bytes
GLANCE = 0.1  # seconds between two looks at a file on its way
NO_REST = 416  # what a server says that has nothing after the bytes that are there
MOST = 40_000_000  # bytes of one file that is no archive; the longest listed has 3 million
MOST_FAULTS = 5  # clips that a publisher does not have as listed, before nothing more is asked of it
FINENESS = 1e-4  # metres
BUSY = (408, 429, 500, 502, 503, 504)  # a later try may succeed
POINTER = b"version https://git-lfs"  # how a stand-in of Git LFS begins
PROOF = "fetched.json"  # written last: SHA-256 of every file of an archive
SILENT = tqdm(disable=True)


class FetchError(OSError):
    """Data could not be had; the message says from where, what was found and what was expected."""


class NotOfferedError(FetchError):
    """The server answers, but not with the file: none there, another content, or a page in its place."""


class _BrokenError(ValueError):
    """The line broke; pooch tries again."""


@dataclass(frozen=True)
class Patience:
    """How a download waits. Own choice: what is usual, and no burden for a university's server.

    Args:
        silence: seconds without a byte after which a connection counts as broken.
        slowest: bytes a second that must come, so that the whole time has a limit, once `grace` seconds have passed since it
            was asked for.
        retries: of one file; pooch waits 1, 2, 3, ... seconds before them.
        between: seconds between two files.
    """

    silence: float = 30.0
    slowest: float = 2000.0
    grace: float = 60.0
    retries: int = 3
    between: float = 0.5


def _receive(url: str, file: str, _: pooch.Pooch, *, most: int, patience: Patience, bar: tqdm) -> None:
    """What brings pooch a file: no more bytes and no more time than it may take, and no stand-in.

    What came before a line broke stays beside the file, and is not asked for again.

    Raises:
        _BrokenError: the connection broke, or the server is busy.
        NotOfferedError: the server has no such file, or it is too large or too slow.
    """
    part = Path(file).with_name(f".{Path(url).name}.part")
    part.touch()
    with part.open("r+b") as stream:
        arrival = _Arrival(url, stream, most, patience.silence)
        begin, passed = time.monotonic(), 0.0
        arrival.start()
        while arrival.is_alive():
            if passed > (limit := patience.grace + arrival.size / patience.slowest):
                found = f"{arrival.size} bytes in {passed:.0f} s"
                raise NotOfferedError(f"{found}; expected at least {patience.slowest:g} a second")
            arrival.join(min(GLANCE, limit - passed))
            passed = time.monotonic() - begin
            bar.update(arrival.place - bar.n)
    if arrival.error is not None:
        raise arrival.error
    if fault := _stand_in(part.replace(Path(file))):
        raise ValueError(fault)
    time.sleep(patience.between)


class _Arrival(threading.Thread):
    """A file on its way, each piece written to its place in a stream; who closes the stream ends it.

    In a thread of its own, as a header's line that never ends keeps the one that reads it; that thread dies with the process.
    """

    def __init__(self, url: str, stream: BinaryIO, most: int, silence: float) -> None:
        super().__init__(daemon=True)
        self.url, self.stream, self.most, self.silence = url, stream, most, silence
        self.size, self.place, self.error = 0, 0, None

    def run(self) -> None:
        """Ask for what comes after the bytes that are there; `error` is how it ends."""
        try:
            done = self.stream.seek(0, io.SEEK_END)
            self._ask(done if done < self.most else 0)
        except requests.exceptions.SSLError as error:
            self.error = NotOfferedError(f"no safe connection ({_root(error)})")
        except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
            self.error = _BrokenError(f"no connection, or one that ended early ({_root(error)})")
        except Exception as error:
            self.error = error

    def _ask(self, done: int) -> None:
        rest = {"Range": f"bytes={done}-"} if done else {}
        with requests.get(self.url, headers=HEADERS | rest, timeout=self.silence, stream=True) as response:
            if response.status_code == NO_REST and done:
                return self._ask(0)
            if response.status_code not in (200, 206):
                found = f"the server says {response.status_code} {response.reason}"
                raise (_BrokenError if response.status_code in BUSY else NotOfferedError)(found)
            self.place = done if response.status_code == 206 else 0
            while piece := response.raw.read1(PIECE):
                if self.place + len(piece) > self.most:
                    raise NotOfferedError(f"more than {self.most} bytes arrived; expected at most that")
                self.stream.seek(self.place)
                self.stream.truncate()
                self.stream.write(piece)
                self.place += len(piece)
                self.size += len(piece)


def _root(error: BaseException) -> str:
    """What the first of a chain of errors says."""
    while (before := error.__cause__ or error.__context__) is not None:
        error = before
    return str(error)[:200] or type(error).__name__


def _stand_in(file: Path) -> str:
    """What came in place of the file: nothing, a page for people, or a pointer of Git LFS; "" if it is none."""
    with file.open("rb") as stream:
        head = stream.read(2**10).lstrip(b"\xef\xbb\xbf \t\r\n")
    if not head:
        return "an empty file arrived"
    if head.startswith(b"<"):
        return (
            "a web page arrived in place of the file; is there a login page between you and the network, or has the file moved?"
        )
    if head.startswith(POINTER):
        return (
            f"a Git LFS pointer of {file.stat().st_size} bytes arrived in place of the file that it names; the file itself is at "
            "https://media.githubusercontent.com/media/OWNER/REPOSITORY/COMMIT/PATH, or in a clone made with git-lfs installed"
        )
    return ""


@dataclass(frozen=True)
class _Staging:
    """Files on their way: a folder beside the one that they are for, kept by pooch."""

    folder: Path
    patience: Patience

    def get(self, url: str, name: str, digest: str | None = None, most: int = MOST, bar: tqdm = SILENT) -> Path:
        """The file under its name in the staging folder, brought unless it is there already.

        Raises:
            FetchError: no connection, or none that lasts.
            NotOfferedError: the server has no such file, or sends something else.
        """
        retries = self.patience.retries
        files = pooch.create(self.folder, "", registry={name: digest}, urls={name: url}, retry_if_failed=retries)
        try:
            receive: Any = partial(_receive, most=most, patience=self.patience, bar=bar)
            return Path(files.fetch(name, downloader=receive))
        except _BrokenError as error:
            raise FetchError(f"{url}: {error}; tried {retries + 1} times. The same command goes on from here") from error
        except (ValueError, NotOfferedError) as error:
            raise NotOfferedError(f"{url}: {error}") from error


def fetch(name: str, to: str | Path | None = None, *, accepted: bool = False) -> Path:
    """Download a published collection of motions, checked; what is there already stays.

    Args:
        name: of a collection that has a download.
        to: the folder of data; None: MWLIB_DATA, or where data lie when it is not set.
        accepted: whoever calls has read and accepted the collection's terms.

    Returns:
        The folder with the motions, for `load_motions` and the setting `data`.

    Raises:
        ValueError: an unknown name, one that people have to get by hand, or terms that nobody accepted.
        FetchError: it cannot be had; the message says why, and nothing half-written is left under a file's name.
        PermissionError: nothing can be written there.
    """
    if name not in COLLECTIONS:
        raise ValueError(f"name is {name!r}; expected one of {', '.join(n for n, c in COLLECTIONS.items() if c.download)}")
    collection = COLLECTIONS[name]
    if collection.download is None:
        raise ValueError(f"{name} cannot be downloaded by a program; mwlib fetch {name} says how people get it")
    if collection.download.terms and not accepted:
        raise ValueError(f"the licence of {name} has not been accepted:\n{collection.download.terms}")
    to = (data_folder() if to is None else Path(to).expanduser()).absolute()
    if to.exists() and not to.is_dir():
        raise FetchError(f"{to} is no folder; expected one to put the data into")
    return bring(collection, to)


def bring(collection: Collection, to: Path, patience: Patience = Patience()) -> Path:  # noqa: B008 (frozen)
    """Download what is missing of a collection into its place below `to`.

    A file gets its name only after it was checked: by its SHA-256, or a clip by the motion that is read from it. Those that
    are there, plain or packed, are checked in the same way and stay.

    Raises:
        FetchError, PermissionError: as `fetch`.
    """
    download, folder = collection.download, to / collection.place
    assert download is not None
    pooch.get_logger().setLevel("WARNING")
    clips, files = download.clips(), dict(download.files())
    is_whole = download.archive is None or _is_proven(folder)
    if is_whole and not _missing(folder, files) and not _missing_clips(folder, clips) and _labelled(folder, clips):
        return folder
    with _workplace(to, collection.name, patience) as staging:
        if clips:
            _bring_clips(download.url, clips, folder, staging)
        with _progress(collection.title.split(":")[0], len(files)) as bar:
            for name in _missing(folder, files):
                place, digest = files[name]
                part = staging.get(f"{download.url}/{place}", name, digest)
                folder.mkdir(parents=True, exist_ok=True)
                part.replace(folder / name)
                bar.update()
        if download.archive is not None and not is_whole:
            _bring_archive(download.archive, folder, staging)
    return folder


def _missing(folder: Path, files: dict[str, tuple[str, str]]) -> list[str]:
    """Files that are not there, or with other bytes."""
    return [n for n, (_, digest) in files.items() if (file := at(folder, n)) is None or _digest(file) != digest]


def _digest(file: Path) -> str:
    """SHA-256 of the file's bytes, unpacked; "" if it cannot be read."""
    try:
        return sha256([read_bytes(file)])
    except MotionFormatError:
        return ""


def _bring_archive(archive: Archive, folder: Path, staging: _Staging) -> None:
    """Unpack the clips of a zip that is known byte by byte, and write down what they are."""
    with _progress("the archive", archive.size, "B") as bar:
        packed = staging.get(archive.url, "clips.zip", archive.sha256, archive.size, bar)
    unpacked = staging.folder / "clips"
    shutil.unpack_archive(packed, unpacked)
    clips = [file for file in unpacked.rglob("*") if archive.wanted.fullmatch(file.name)]
    if len(clips) != archive.count:
        raise NotOfferedError(f"{archive.url}: {len(clips)} clips; expected {archive.count}")
    (folder / PROOF).unlink(missing_ok=True)
    digests = {file.name: file_hash(file) for file in clips}
    for file in clips:
        file.replace(folder / file.name)
    write_json(folder / PROOF, {"url": archive.url, "sha256": archive.sha256, "files": digests})


def _is_proven(folder: Path) -> bool:
    """Whether every clip of an archive is there, byte by byte."""
    try:
        files = json.loads((folder / PROOF).read_text(encoding="utf-8"))["files"]
        return all(file_hash(folder / name) == digest for name, digest in files.items())
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return False


def _bring_clips(url: str, clips: Sequence[Listed], folder: Path, staging: _Staging) -> None:
    """Clips that are known by their motions, their skeletons, and a clips.csv with subjects, actions and rates."""
    if not _labelled(folder, clips):
        if (table := folder / "clips.csv").exists():
            raise FetchError(f"{table} says other things of the clips than the list that came with mwlib; move it away")
        text, rows = io.StringIO(), [(clip.file, f"{clip.fps:g}", clip.subject, clip.action) for clip in clips]
        csv.writer(text, lineterminator="\n").writerows([("file", "fps", "subject", "action"), *rows])
        write_atomic(table, text.getvalue())
    missing, faults = _missing_clips(folder, clips), []
    with _progress("clips", len(clips)) as bar:
        bar.update(len(clips) - len(missing))
        for clip in missing:
            try:
                _bring_clip(url, clip, folder, staging)
            except NotOfferedError as error:
                faults.append(str(error))
                if len(faults) == MOST_FAULTS:
                    break
            bar.update()
    if faults:
        raise FetchError("\n  ".join([f"{len(faults)} of {len(clips)} clips could not be had as listed:", *faults]))


def _bring_clip(url: str, clip: Listed, folder: Path, staging: _Staging) -> None:
    """One clip and its skeleton, asked for twice at most where what comes is not the listed motion."""
    names = _skeleton_of(clip), clip.file
    for _ in range(2):
        skeleton, part = (staging.get(f"{url}/{name}", name) for name in names)
        if not (fault := motion_fault(part, clip)):
            break
        part.unlink()
        try:
            read_asf(skeleton)
        except MotionFormatError:
            skeleton.unlink()
    else:
        raise NotOfferedError(f"{url}/{clip.file}: {fault}")
    for name, file in zip(names, (skeleton, part), strict=True):
        write_atomic(folder / name, file.read_bytes())
    part.unlink()


def _skeleton_of(clip: Listed) -> str:
    """05/05.asf for 05/05_01.amc."""
    subject = clip.file.split("/")[0]
    return f"{subject}/{subject}.asf"


def _missing_clips(folder: Path, clips: Sequence[Listed]) -> list[Listed]:
    """Clips that are not there, or not as listed."""
    checked = _progress("checking clips", len(clips), of=clips)
    return [clip for clip in checked if (file := at(folder, clip.file)) is None or motion_fault(file, clip)]


def _labelled(folder: Path, clips: Sequence[Listed]) -> bool:
    """Whether a clips.csv, of this folder or above, says of each clip what the list says."""
    rows = [clips_row(folder / clip.file)[0] for clip in clips]
    said = [(row.get("subject"), row.get("action"), row.get("fps")) for row in rows]
    return said == [(clip.subject, clip.action, f"{clip.fps:g}") for clip in clips]


def motion_digest(motion: Motion) -> str:
    """Sixteen hex digits over skeleton, rate and positions, rounded to 0.1 mm.

    Own choice: the positions rather than the file's bytes, so that line ends and comments do not count; rounded, so that the
    last bits, which differ between machines' arithmetic, seldom do (`sources.fingerprint` sees every bit).
    """
    s = motion.skeleton
    head = f"{motion.fps:g}/{motion.up}/{s.joints}/{s.parents}/{motion.positions.shape}"
    return sha256([head, np.rint(motion.positions.astype(np.float64) / FINENESS).astype("<i4").tobytes()])[:16]


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


def at(folder: Path, file: str) -> Path | None:
    """A file of a folder, plain or packed, as `load_motions` would choose; None if it is not there."""
    plain = folder / file
    return next((found for end in ("", *sorted(PACKED)) if (found := plain.with_name(plain.name + end)).is_file()), None)


def overview(to: Path) -> list[tuple[str, ...]]:
    """Rows of words, one for each collection, below a header: name, what, size, licence, what is there."""
    rows = [("name", "what", "download", "licence", "there")]
    for name, c in COLLECTIONS.items():
        size, there = "by hand", "yes" if (to / c.place).exists() else "no"
        if c.download:
            size, there = c.download.size, "{} of {} files".format(*brought(c, to / c.place))
        rows.append((name, c.title, size, c.licence, there))
    return rows


def brought(collection: Collection, folder: Path) -> tuple[int, int]:
    """How many of a collection's clips are there, and of how many; nothing is read."""
    download = collection.download
    assert download is not None
    if (archive := download.archive) is not None:
        names = {bare_name(file) for file in folder.glob("*")}
        return sum(archive.wanted.fullmatch(name) is not None for name in names), archive.count
    clips = [clip.file for clip in download.clips()] or [name for name in download.files() if name.endswith(".bvh")]
    return sum(at(folder, clip) is not None for clip in clips), len(clips)


@contextmanager
def _workplace(to: Path, name: str, patience: Patience) -> Iterator[_Staging]:
    """A folder for what is not whole yet, hidden, on the same disk; others wait until it is free.

    It is removed at a good end. What a broken end leaves there is never read as data.
    """
    to.mkdir(parents=True, exist_ok=True)
    lock, folder = FileLock(to / f".fetch-{name}.lock"), to / f".fetch-{name}"
    try:
        held = lock.acquire(timeout=0)
    except Timeout:
        print(f"another mwlib fetch {name} is at work in {to}; waiting for it", file=sys.stderr)
        held = lock.acquire()
    with held:
        folder.mkdir(exist_ok=True)
        yield _Staging(folder, patience)
        shutil.rmtree(folder)


def _progress(what: str, total: int, unit: str = "file", of: Iterable[Any] | None = None) -> tqdm:
    """A progress bar, of things that it gives or by itself, unless nobody watches or it is soon over."""
    return tqdm(of, what, total=total, unit=unit, unit_scale=unit == "B", disable=not sys.stderr.isatty() or total < 20)
