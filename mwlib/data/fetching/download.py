"""One file over HTTP: patient with a slow or broken line, and never taken for whole before it was checked."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import pooch
import requests
from tqdm import tqdm

from mwlib.data.fetching.errors import FetchError, NotOfferedError
from mwlib.version import __version__

USER_AGENT = f"mwlib/{__version__} (motion-wavelet-notebooks)"
CHUNK = 2**14  # bytes; so many at most are lost where a connection ends
BUSY = (408, 429, 500, 502, 503, 504)  # a later try may succeed
LONGEST_WAIT = 60.0  # seconds between two tries, whatever the server asks for
MOST_WRONG = 2  # downloads of one file whose content is not the expected one
POINTER = b"version https://git-lfs"  # how a stand-in of Git LFS begins

Check = Callable[[Path], str]  # of a file that was received whole: what is wrong with it, or ""


@dataclass(frozen=True)
class Patience:
    """How a download waits. Own choice: what is usual, and no burden for a university's server.

    Args:
        silence: seconds without a byte after which a connection counts as broken.
        tries: in a row that bring nothing new, before giving up.
        pause: seconds before the second try; before each further one twice as long.
        between: seconds between two files.
    """

    silence: float = 30.0
    tries: int = 5
    pause: float = 2.0
    between: float = 0.5


class _Again(Exception):
    """This try failed; another may not. `after`: seconds that the server asks to wait."""

    def __init__(self, reason: str, after: float = 0.0) -> None:
        super().__init__(reason)
        self.after = after


class _Sink:
    """Where pooch's downloader puts the bytes: behind those that are there, or from the start if the server sends all."""

    def __init__(self, stream: BinaryIO, have: int, most: int, bar: tqdm | None) -> None:
        self._stream, self._most, self._bar = stream, most, bar
        self._have = self.size = have
        self._response: requests.Response | None = None
        self._start(have)

    def _start(self, size: int) -> None:
        self._stream.seek(size)
        self._stream.truncate()
        self.size = self._first = size
        if self._bar is not None:
            self._bar.n = size
            self._bar.refresh()

    def begin(self, response: requests.Response, **_: Any) -> None:
        """Called with each answer, redirections too, before its first byte."""
        self._response = response
        said = re.match(r"bytes (\d+)-", response.headers.get("Content-Range", ""))
        if response.status_code == 206 and said and int(said[1]) == self._have:
            return
        if response.status_code in (200, 206, 416):  # all of it; another part; the part at hand is longer than the file
            self._start(0)
        if response.status_code in (206, 416):
            raise _Again("the server does not go on where the last try ended")

    def check(self) -> None:
        """After the last byte: are there as many as the answer's head announced? Older versions of urllib3 do not look."""
        announced = self._response.headers.get("Content-Length", "") if self._response is not None else ""
        if announced.isdecimal() and self.size - self._first != int(announced):
            raise _Again(f"{self.size - self._first} of {announced} announced bytes arrived")

    def write(self, piece: bytes) -> None:
        """Take a piece.

        Raises:
            NotOfferedError: the file is larger than it can be.
        """
        self.size += len(piece)
        if self.size > self._most:
            raise NotOfferedError(f"more than {self._most} bytes arrived; expected at most that")
        self._stream.write(piece)
        if self._bar is not None:
            self._bar.update(len(piece))

    def flush(self) -> None:
        """What pooch calls after each piece; the file's own buffer is better."""

    def close(self) -> None:
        """Let go of the connection, which pooch leaves open where something goes wrong."""
        if self._response is not None:
            self._response.close()


def download(
    url: str,
    file: Path,
    check: Check,
    *,
    most: int,
    resume: bool = False,
    patience: Patience = Patience(),  # noqa: B008 (frozen)
    bar: tqdm | None = None,
) -> None:
    """Download one file under the name of a temporary one; whoever calls renames it.

    Args:
        check: says what is wrong with the content, "" if nothing; a content that is wrong is asked for once more.
        most: bytes that the file may have at most.
        resume: go on with what an earlier try left in `file`; only where `check` would notice a mixture of two versions.
        bar: counts bytes.

    Raises:
        FetchError: no connection, or none that lasts.
        NotOfferedError: the server has no such file, or sends something else.
    """
    failed = wrong = best = 0
    while not (resume and file.is_file() and check(file) == ""):
        try:
            _receive(url, file, most, resume, patience, bar)
            if not (fault := _stand_in(file) or check(file)):
                return
            wrong += 1
            file.unlink()
            if wrong == MOST_WRONG:
                raise NotOfferedError(fault)
            reason, after = fault, 0.0
        except NotOfferedError as error:
            file.unlink(missing_ok=True)
            raise NotOfferedError(f"{url}: {error}") from error
        except _Again as error:
            reason, after = str(error), error.after
        size = file.stat().st_size if resume and file.exists() else 0
        failed = 0 if size > best else failed + 1
        best = max(size, best)
        if failed >= patience.tries:
            raise FetchError(f"{url}: {reason}; tried {patience.tries} times. The same command goes on from here")
        time.sleep(min(max(after, patience.pause * 2 ** max(failed - 1, 0)), LONGEST_WAIT))


def _receive(url: str, file: Path, most: int, resume: bool, patience: Patience, bar: tqdm | None) -> None:
    """One try."""
    have = file.stat().st_size if resume and file.exists() else 0
    headers = {"User-Agent": USER_AGENT, "Accept-Encoding": "identity"} | ({"Range": f"bytes={have}-"} if have else {})
    with file.open("r+b" if have else "wb") as stream:
        sink = _Sink(stream, have, most, bar)
        get = pooch.HTTPDownloader(chunk_size=CHUNK, headers=headers, timeout=patience.silence, hooks={"response": sink.begin})
        try:
            get(url, sink, None)
            sink.check()
        except requests.HTTPError as error:
            assert error.response is not None  # `raise_for_status` hands it over
            raise _refusal(error.response) from error
        except requests.exceptions.SSLError as error:
            raise NotOfferedError(f"no safe connection ({_root(error)})") from error
        except requests.exceptions.ChunkedEncodingError as error:
            raise _Again(f"the connection ended early, after {sink.size} bytes") from error
        except requests.RequestException as error:
            silent = isinstance(error, requests.Timeout) or "timed out" in str(error)
            found = f"nothing arrived for {patience.silence:g} s" if silent else f"no connection ({_root(error)})"
            raise _Again(f"{found}, after {sink.size} bytes") from error
        finally:
            sink.close()


def _root(error: BaseException) -> str:
    """What the first of a chain of errors says."""
    while (before := error.__cause__ or error.__context__) is not None:
        error = before
    return str(error)[:200] or type(error).__name__


def _refusal(response: requests.Response) -> Exception:
    """What an answer other than the file means."""
    found = f"the server says {response.status_code} {response.reason}"
    if response.status_code not in BUSY:
        return NotOfferedError(found)
    after = response.headers.get("Retry-After", "")
    return _Again(found, float(after) if after.isdecimal() else 0.0)


def _stand_in(file: Path) -> str:
    """What came in place of the file: nothing, a page for people, or a pointer of Git LFS."""
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
