"""One file over a line, or from a server, that fails in every way."""

from __future__ import annotations

import hashlib
import io
import random
import socket
import time
from dataclasses import replace
from pathlib import Path

import pytest
import requests

from mwlib.data.fetching.download import LONGEST_WAIT, download
from mwlib.data.fetching.errors import FetchError, NotOfferedError
from mwlib.version import __version__
from tests.data.fetching.publisher import HASTY

CONTENT = random.Random(0).randbytes(2**18)


def fault(file: Path) -> str:
    return "" if hashlib.sha256(file.read_bytes()).digest() == hashlib.sha256(CONTENT).digest() else "another content"


def get(publisher, file: Path, *, resume: bool = False, most: int = 10**6, patience=HASTY) -> None:
    publisher.files.setdefault("a.bin", CONTENT)
    download(f"{publisher.url}/a.bin", file, fault, most=most, resume=resume, patience=patience)


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize(
    "tricks",
    [
        [], ["drop"], ["stall"], ["more"], ["cut"], ["empty"], [503], [500, 429], ["slow"], ["drop", "drop", "drop", "drop"],
        ["drop", 503, "stall", 502, "drop"], ["drop", "whole"], ["drop", "elsewhere"], ["drop", 416],
    ],
    ids=str,
)  # fmt: skip
def test_a_line_that_fails_and_comes_back_gives_the_file(publisher, tmp_path, tricks, resume):
    publisher.tricks["a.bin"] = list(tricks)
    patience = HASTY if resume else replace(HASTY, tries=6)
    get(publisher, tmp_path / "part", resume=resume, patience=patience)
    assert (tmp_path / "part").read_bytes() == CONTENT
    assert publisher.agents == {f"mwlib/{__version__} (motion-wavelet-notebooks)"}
    assert (len(publisher.asked) > 1) == (tricks not in ([], ["slow"], ["more"]) or (tricks == ["more"] and not resume))


def test_a_broken_download_goes_on_where_it_was(publisher, tmp_path):
    (tmp_path / "part").write_bytes(CONTENT[: 2**16])
    publisher.tricks["a.bin"] = ["drop"]
    get(publisher, tmp_path / "part", resume=True)
    assert publisher.asked == [("a.bin", f"bytes={2**16}-"), ("a.bin", f"bytes={2**16 + 6 * 2**14}-")]
    get(publisher, tmp_path / "part", resume=True)
    assert len(publisher.asked) == 2, "what is whole is not asked for"


def test_without_resume_what_lies_there_is_not_used(publisher, tmp_path):
    (tmp_path / "part").write_bytes(CONTENT)
    get(publisher, tmp_path / "part")
    assert publisher.asked == [("a.bin", "")]


@pytest.mark.parametrize("left", [b"x" * 1000, CONTENT + b"more", b"x" * len(CONTENT)], ids=["other", "longer", "as long"])
def test_a_part_of_another_version_is_thrown_away(publisher, tmp_path, left):
    (tmp_path / "part").write_bytes(left)
    get(publisher, tmp_path / "part", resume=True)
    assert (tmp_path / "part").read_bytes() == CONTENT


@pytest.mark.parametrize(
    "trick, message, tries",
    [
        ("drop", "the connection ended early, after 131072 bytes; tried 3 times.*goes on from here", 3),
        ("stall", "nothing arrived for 1 s, after 131072 bytes; tried 3 times", 3),
        ("more", "the connection ended early, after 262144 bytes", 3),
        (503, "the server says 503 Service Unavailable; tried 3 times", 3),
        (404, "a.bin: the server says 404 Not Found$", 1),
        (403, "the server says 403 Forbidden$", 1),
        ("cut", "another content$", 2),
        ("page", "a web page arrived in place of the file; is there a login page", 2),
        ("pointer", r"a Git LFS pointer of \d+ bytes arrived in place of the file that it names", 2),
        ("empty", "an empty file arrived$", 2),
        ("endless", "more than 1000000 bytes arrived; expected at most that$", 1),
    ],
)
def test_a_line_that_stays_broken_is_given_up(publisher, tmp_path, trick, message, tries):
    publisher.tricks["a.bin"] = [trick] * 20
    with pytest.raises(FetchError, match=f"{publisher.url}/a.bin: .*{message}|{publisher.url}/{message}") as caught:
        get(publisher, tmp_path / "part")
    assert len(publisher.asked) == tries
    assert isinstance(caught.value, NotOfferedError) == (tries < 3)
    assert "HTTPConnectionPool" not in str(caught.value)


def test_progress_earns_patience(publisher, tmp_path):
    """Each try of a download that resumes halves what is missing: more tries than are allowed without progress."""
    publisher.tricks["a.bin"] = ["drop"] * 5
    get(publisher, tmp_path / "part", resume=True)
    assert len(publisher.asked) == 6 > HASTY.tries
    publisher.tricks["a.bin"] = ["drop"] * 5
    with pytest.raises(FetchError, match="ended early"):
        get(publisher, tmp_path / "whole")


def test_what_arrived_stays_for_the_next_command(publisher, tmp_path):
    publisher.tricks["a.bin"] = ["drop", 503, 503, 503]
    with pytest.raises(FetchError, match="503"):
        get(publisher, tmp_path / "part", resume=True)
    assert (tmp_path / "part").stat().st_size == len(CONTENT) // 2


def test_nobody_there_is_told(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(FetchError, match=f"127.0.0.1:{port}/a.bin: no connection .*refused.*tried 3 times"):
        download(f"http://127.0.0.1:{port}/a.bin", tmp_path / "part", fault, most=10, patience=HASTY)


def test_announced_bytes_are_counted_whatever_the_library_does(tmp_path, monkeypatch):
    """urllib3 before version 2 takes a connection that ends early for the end of the file."""

    class Careless:
        def __init__(self, hooks: dict, **_: object) -> None:
            self.begin = hooks["response"]

        def __call__(self, url: str, sink, pooch: None) -> None:
            response = requests.Response()
            response.raw = io.BytesIO()
            response.status_code, response.headers["Content-Length"] = 200, "10"
            self.begin(response)
            sink.write(b"five!")

    monkeypatch.setattr("pooch.HTTPDownloader", Careless)
    with pytest.raises(FetchError, match="5 of 10 announced bytes arrived; tried 3 times"):
        download("http://127.0.0.1/a.bin", tmp_path / "part", lambda _: "", most=10, patience=HASTY)


def test_tries_keep_a_growing_distance(publisher, tmp_path, monkeypatch):
    waits: list[float] = []
    monkeypatch.setattr(time, "sleep", waits.append)
    publisher.tricks["a.bin"] = [503] * 9
    with pytest.raises(FetchError):
        get(publisher, tmp_path / "part", patience=replace(HASTY, tries=9, pause=2.0))
    told = [wait for wait in waits if wait]
    assert told == [2, 4, 8, 16, 32, LONGEST_WAIT, LONGEST_WAIT, LONGEST_WAIT]
