"""LaFAN1: one large zip in pieces, checked, unpacked, and only then there."""

from __future__ import annotations

import hashlib
import io
import json
import lzma
import os
import signal
import subprocess
import sys
import time
import zipfile
from dataclasses import asdict, replace
from pathlib import Path

import pytest

import mwlib as mw
from mwlib import MotionFormatError
from mwlib.data.fetching import lafan1
from mwlib.data.fetching.errors import FetchError
from mwlib.data.fetching.lafan1 import FOLDER, PROOF, Archive, fetch_lafan1
from mwlib.data.fetching.lists import Listed, clips_of, listed
from mwlib.data.sources import fingerprint
from tests.data.fetching.publisher import HASTY
from tests.sample_motions import BVH

ROOT = Path(__file__).parents[3]
NAMES = ("walk1_subject1.bvh", "walk1_subject2.bvh", "aiming2_subject5.bvh")
KILLED = """
import json, sys
from pathlib import Path
from mwlib.data.fetching.lafan1 import Archive, fetch_lafan1
from mwlib.data.fetching.download import Patience
fetch_lafan1(Path(sys.argv[1]), Archive(**json.loads(sys.argv[2])), Patience())
"""


def zipped(texts: dict[str, str]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:  # not packed, so that it is large enough to break
        for name, text in texts.items():
            archive.writestr(name, text)
    return content.getvalue()


def publish(publisher, content: bytes, **changes) -> Archive:
    """A zip of this content, and what is known of it."""
    publisher.files |= {"lafan1.zip": content, "license.txt": b"CC BY-NC-ND"}
    known = Archive(
        f"{publisher.url}/lafan1.zip", hashlib.sha256(content).hexdigest(), len(content), 3, 9,
        f"{publisher.url}/license.txt", hashlib.sha256(b"CC BY-NC-ND").hexdigest(),
    )  # fmt: skip
    return replace(known, **changes)


@pytest.fixture
def archive(publisher) -> Archive:
    return publish(publisher, zipped({name: BVH for name in NAMES} | {"__MACOSX/._a.bvh": "", "padding.txt": " " * 300_000}))


def visible(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()} if folder.exists() else set()


WHOLE = {*NAMES, "license.txt", PROOF}


def test_every_clip_comes_out_and_the_zip_goes(publisher, archive, tmp_path):
    folder = fetch_lafan1(tmp_path, archive, HASTY)
    assert folder == tmp_path / "lafan1" and visible(folder) == WHOLE and (folder / "license.txt").read_text() == "CC BY-NC-ND"
    assert {(m.subject, m.action, len(m)) for m in mw.load_motions(folder)} == {
        ("1", "walk", 3),
        ("2", "walk", 3),
        ("5", "aiming", 3),
    }
    assert {path.name for path in tmp_path.iterdir()} <= {"lafan1", ".fetch-lafan1.lock"}
    fetch_lafan1(tmp_path, archive, HASTY)
    assert publisher.paths() == ["license.txt", "lafan1.zip"], "what is there is not asked for again"


def test_a_broken_line_goes_on_where_it_was(publisher, archive, tmp_path):
    publisher.tricks["lafan1.zip"] = ["drop", "stall", 503, "drop"]
    assert visible(fetch_lafan1(tmp_path, archive, HASTY)) == WHOLE
    first, *others = [int(r[6:-1] or 0) if r else 0 for p, r in publisher.asked if p == "lafan1.zip"]
    assert first == 0 and len(others) == 4 and all(0 < a <= b for a, b in zip(others, others[1:], strict=False))


def test_what_a_command_that_failed_brought_is_used_by_the_next(publisher, archive, tmp_path):
    publisher.tricks["lafan1.zip"] = ["drop", 503, 503, 503]
    with pytest.raises(FetchError, match="lafan1.zip: the server says 503.*The same command goes on from here"):
        fetch_lafan1(tmp_path, archive, HASTY)
    assert visible(tmp_path / FOLDER) == set() and (tmp_path / ".fetch-lafan1" / "lafan1.zip").stat().st_size > 10**5
    fetch_lafan1(tmp_path, archive, HASTY)
    assert publisher.asked[-1][1] > "bytes=100000-" and visible(tmp_path / FOLDER) == WHOLE


@pytest.mark.parametrize(
    "trick, message",
    [
        ("pointer", r"lafan1.zip: a Git LFS pointer of \d+ bytes arrived .*media.githubusercontent.com/media/OWNER"),
        ("page", "lafan1.zip: a web page arrived in place of the file"),
        ("cut", "lafan1.zip: .* bytes arrived; expected"),
        (404, "lafan1.zip: the server says 404"),
        ("endless", "lafan1.zip: more than .* bytes arrived"),
    ],
)
def test_what_is_no_zip_is_told(publisher, archive, tmp_path, trick, message):
    publisher.tricks["lafan1.zip"] = [trick] * 2
    with pytest.raises(FetchError, match=message):
        fetch_lafan1(tmp_path, archive, HASTY)
    assert visible(tmp_path / FOLDER) == set()


def test_another_zip_of_the_same_size_is_refused(publisher, archive, tmp_path):
    publisher.files["lafan1.zip"] = bytes(archive.size)
    with pytest.raises(FetchError, match="its SHA-256 is .*; expected"):
        fetch_lafan1(tmp_path, archive, HASTY)


@pytest.mark.parametrize(
    "texts, changes, message",
    [
        ({"a1_subject1.bvh": BVH}, {}, "found 1 clips with 3 frames; expected 3 with 9"),
        ({name: BVH for name in NAMES}, {"frames": 10}, "found 3 clips with 9 frames; expected 3 with 10"),
        ({name: BVH for name in NAMES} | {"b1_subject1.bvh": BVH[:500]}, {}, "b1_subject1.bvh"),
        ({name: BVH for name in NAMES} | {"../c1_subject1.bvh": BVH}, {}, "a path that leaves its folder"),
        ({"d.txt": "x" * 10}, {}, "found 0 clips"),
    ],
)
def test_a_zip_with_other_things_is_refused_whole(publisher, tmp_path, texts, changes, message):
    with pytest.raises(MotionFormatError, match=message):
        fetch_lafan1(tmp_path, publish(publisher, zipped(texts), **changes), HASTY)
    assert visible(tmp_path / FOLDER) == set() and not (tmp_path.parent / "c1_subject1.bvh").exists()


def test_a_clip_that_is_not_the_listed_one_is_refused(publisher, archive, tmp_path, monkeypatch):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / NAMES[0]).write_text(BVH)
    (clip,) = clips_of(tmp_path / "there")
    monkeypatch.setattr(lafan1, "listed", lambda _: [clip])
    fetch_lafan1(tmp_path / "right", archive, HASTY)
    other: Listed = clip._replace(motion="0" * 16)
    monkeypatch.setattr(lafan1, "listed", lambda _: [other])
    with pytest.raises(FetchError, match=f"{NAMES[0]}: another motion .*expected 3 frames, 0000"):
        fetch_lafan1(tmp_path / "wrong", archive, HASTY)
    assert visible(tmp_path / "wrong" / FOLDER) == set()


@pytest.mark.parametrize("name", [NAMES[1], "license.txt", PROOF])
@pytest.mark.parametrize("how", ["half", "gone"])
def test_half_files_are_not_taken_for_whole_ones(publisher, archive, tmp_path, name, how):
    file = fetch_lafan1(tmp_path, archive, HASTY) / name
    whole = file.read_bytes()
    file.unlink() if how == "gone" else file.write_bytes(whole[: len(whole) // 2])
    fetch_lafan1(tmp_path, archive, HASTY)
    assert file.read_bytes() == whole and len(publisher.asked) == 4


def test_a_kill_at_any_rename_leaves_no_claim_to_be_whole(publisher, archive, tmp_path, monkeypatch):
    """As if the process ended there; then the zip is not asked for again."""
    for place in range(5):
        left, publisher.asked[:] = [place], []
        rename = os.replace

        def deadly(old, new, left=left, rename=rename):
            if left[0] == 0:
                raise KeyboardInterrupt
            left[0] -= 1
            rename(old, new)

        to = tmp_path / str(place)
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(os, "replace", deadly)
            fetch_lafan1(to, archive, HASTY)
        assert not lafan1.is_whole(to / FOLDER)
        assert visible(fetch_lafan1(to, archive, HASTY)) == WHOLE and publisher.paths().count("lafan1.zip") == 1


def test_a_kill_amid_the_download_goes_on_there(publisher, archive, tmp_path):
    publisher.tricks["lafan1.zip"] = ["hold"]
    words = [sys.executable, "-c", KILLED, str(tmp_path), json.dumps(asdict(archive))]
    part = tmp_path / ".fetch-lafan1" / "lafan1.zip"
    with subprocess.Popen(words, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}) as child:
        while not part.exists() or part.stat().st_size < 10**5:
            assert child.poll() is None
            time.sleep(0.01)
        os.kill(child.pid, signal.SIGKILL)
    there = part.stat().st_size
    assert there < archive.size and visible(tmp_path / FOLDER) == set()
    assert visible(fetch_lafan1(tmp_path, archive, HASTY)) == WHOLE
    assert publisher.asked[-1] == ("lafan1.zip", f"bytes={there}-")


def test_what_is_known_of_the_published_zip():
    known = Archive()
    assert known.url.startswith("https://media.githubusercontent.com/media/ubisoft/") and len(known.sha256) == 64
    assert (known.size, known.clips, known.frames) == (144_051_503, 77, 496_672)


def test_the_list_agrees_with_the_clips_at_hand(data_folder):
    assert clips_of(data_folder / FOLDER) == listed("lafan1")


def test_real_clips_come_out_as_they_are(publisher, data_folder, tmp_path):
    """Two of the originals, zipped as published: names and content alone give subjects, actions and rates."""
    names = ("push1_subject2.bvh", "fallAndGetUp3_subject1.bvh")
    texts = {name: lzma.open(data_folder / FOLDER / f"{name}.xz", "rt", newline="").read() for name in names}
    motions = mw.load_motions(fetch_lafan1(tmp_path, publish(publisher, zipped(texts), clips=2, frames=2 * 3066), HASTY))
    originals = [mw.load_motions(data_folder / FOLDER / f"{name}.xz")[0] for name in sorted(names)]
    assert fingerprint(motions) == fingerprint(originals)
