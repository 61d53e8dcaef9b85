"""Downloads: only what was checked gets a name, whatever the publisher, the line or a kill does."""

from __future__ import annotations

import hashlib
import io
import json
import lzma
import os
import random
import re
import signal
import socket
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import mwlib as mw

from mwlib.data.collections import (  # isort: skip
    COLLECTIONS, Archive, Collection, Download, Listed, acknowledgement, list_file, listed, named_source,
)  # fmt: skip
from mwlib.data.fetching import PROOF, FetchError, NotOfferedError, at, bring, motion_digest, motion_fault
from mwlib.data.sources import fingerprint, split_motions
from mwlib.data.untrusted import BrokenFilesWarning, read_bytes
from mwlib.prediction.config import Config
from mwlib.synthetic.motions import synthetic_motions
from mwlib.version import __version__
from tests.data.lists import clips_of, write_list
from tests.data.publisher import HASTY, PAGE, Publisher, clip, publish_two_people, serving
from tests.data.real import real_clips
from tests.sample_motions import ASF, BVH

ROOT = Path(__file__).parents[2]
CONTENT = random.Random(0).randbytes(2**18)
TRIES = HASTY.retries + 1


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    """A server on this machine with nothing published yet."""
    with serving() as found:
        yield found


@pytest.fixture(autouse=True)
def waits(monkeypatch) -> list[float]:
    """The seconds that pooch would wait between tries."""
    told: list[float] = []
    monkeypatch.setattr("pooch.core.time", SimpleNamespace(sleep=told.append))
    return told


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def visible(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("[!.]*") if path.is_file()}


def files_of(publisher: Publisher, bodies: dict[str, bytes]) -> Collection:
    """A collection of files that are known byte by byte, published below "in"."""
    publisher.files |= {f"in/{name}": body for name, body in bodies.items()}
    known = {name: (f"in/{name}", digest(body)) for name, body in bodies.items()}
    return Collection("some", "some files", "", "some/where", download=Download("", publisher.url, "", files=lambda: known))


@pytest.fixture
def one(publisher) -> Collection:
    return files_of(publisher, {"a.bin": CONTENT})


@pytest.fixture
def cmu(publisher, tmp_path) -> Collection:
    """Two people with two clips each, published, with subjects and actions that only a list knows."""
    publisher.files |= publish_two_people(tmp_path / "there")
    clips = [c._replace(action=f"walk, {c.frames} frames") for c in clips_of(tmp_path / "there")]
    return replace(COLLECTIONS["cmu"], download=Download("", publisher.url, "", clips=lambda: clips))


CMU_WHOLE = {"clips.csv", "05/05.asf", "05/05_01.amc", "05/05_02.amc", "09/09.asf", "09/09_01.amc", "09/09_02.amc"}


def with_clips(collection: Collection, clips: list[Listed]) -> Collection:
    return replace(collection, download=replace(collection.download, clips=lambda: clips))


NAMES = ("walk1_subject1.bvh", "walk1_subject2.bvh", "aiming2_subject5.bvh")
LAFAN1_WHOLE = {*NAMES, "license.txt", PROOF}


def zip_of(publisher: Publisher, texts: dict[str, str], **changes) -> Collection:
    """LAFAN1 as a zip of these texts, with the licence beside it."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, text in texts.items():
            archive.writestr(name, text)
    publisher.files |= {"lafan1.zip": content.getvalue(), "license.txt": b"CC BY-NC-ND"}
    known = Archive(
        f"{publisher.url}/lafan1.zip", digest(content.getvalue()), len(content.getvalue()),
        COLLECTIONS["lafan1"].download.archive.wanted, 3,
    )._replace(**changes)  # fmt: skip
    files = {"license.txt": ("license.txt", digest(b"CC BY-NC-ND"))}
    return replace(COLLECTIONS["lafan1"], download=Download("", publisher.url, "", files=lambda: files, archive=known))


@pytest.fixture
def lafan1(publisher) -> Collection:
    return zip_of(publisher, {f"in/{name}": BVH for name in NAMES} | {"__MACOSX/._a.bvh": "", "padding.txt": " " * 300_000})


@pytest.mark.parametrize(
    "tricks", [[], ["drop"], ["stall"], ["cut"], ["empty"], ["page"], ["pointer"], [503], [500, 429], ["slow"]], ids=str
)
def test_a_line_that_fails_and_comes_back_gives_the_file(publisher, one, tmp_path, tricks):
    publisher.tricks["in/a.bin"] = list(tricks)
    assert (bring(one, tmp_path, HASTY) / "a.bin").read_bytes() == CONTENT
    assert publisher.agents == {f"mwlib/{__version__} (motion-wavelet-notebooks)"}
    assert len(publisher.asked) == 1 + len([trick for trick in tricks if trick != "slow"])
    half = len(CONTENT) // 2
    assert publisher.begun[-1] == (half if tricks in (["drop"], ["stall"]) else 0), "what came is not asked for again"


def test_what_a_killed_download_left_is_gone_on_with_or_replaced(publisher, one, tmp_path):
    part = tmp_path / ".fetch-some" / ".a.bin.part"
    part.parent.mkdir()
    size = len(CONTENT)
    for left, begun in ((CONTENT[:-7], [size - 7]), (bytes(size + 9), [size + 9, 0]), (b"other", [5, 0]), (b"", [0])):
        part.parent.mkdir(exist_ok=True)
        part.write_bytes(left)
        assert (file := bring(one, tmp_path, HASTY) / "a.bin").read_bytes() == CONTENT
        assert publisher.begun == begun and not part.parent.exists()
        publisher.begun.clear()
        file.unlink()


@pytest.mark.parametrize(
    "trick, message, tries",
    [
        ("drop", f"ended early .*; tried {TRIES} times. The same command goes on from here", TRIES),
        ("stall", f"timed out.*; tried {TRIES} times", TRIES),
        ("more", "ended early", TRIES),
        (503, f"the server says 503 Service Unavailable; tried {TRIES} times", TRIES),
        (404, "the server says 404 Not Found$", 1),
        (403, "the server says 403 Forbidden$", 1),
        ("cut", "SHA256 hash .* does not match the known hash", TRIES),
        ("page", "a web page arrived in place of the file; is there a login page", TRIES),
        ("pointer", r"a Git LFS pointer of \d+ bytes arrived in place .*media.githubusercontent.com/media/OWNER", TRIES),
        ("empty", "an empty file arrived$", TRIES),
        ("endless", "more than 40000000 bytes arrived; expected at most that$", 1),
        ("drip", r"\d+ bytes in \d+ s; expected at least 100000 a second$", 1),
        *[(line, r"0 bytes in 2 s; expected at least 100000 a second$", 1) for line in ("status", "header", "chunk")],
    ],
)
def test_a_line_that_stays_broken_is_given_up(publisher, one, tmp_path, waits, trick, message, tries):
    publisher.tricks["in/a.bin"] = [trick] * 20
    begin = time.monotonic()
    with pytest.raises(FetchError, match=f"(?s)^{publisher.url}/in/a.bin: .*{message}") as caught:
        bring(one, tmp_path, HASTY)
    without_rest = publisher.begun.count(len(CONTENT))  # after these it is asked for from its start
    assert time.monotonic() - begin < 20 and waits == [1, 2][: tries - 1]
    assert len(publisher.asked) == tries + without_rest and without_rest == (2 if trick == "more" else 0)
    assert isinstance(caught.value, NotOfferedError) == (trick not in ("drop", "stall", "more", 503))
    assert visible(tmp_path) == set() and "HTTPConnectionPool" not in str(caught.value)


def test_nobody_there_is_told(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    download = Download("", f"http://127.0.0.1:{port}", "", files=lambda: {"a.bin": ("a.bin", "")})
    with pytest.raises(FetchError, match=f"127.0.0.1:{port}/a.bin: no connection.*refused.*tried {TRIES} times"):
        bring(Collection("some", "", "", "some", download=download), tmp_path, HASTY)


def test_named_files_come_once_and_are_mended(publisher, tmp_path):
    bodies = {"a_1.bvh": BVH.encode(), "b_1.bvh": BVH.replace("90 2", "99 2").encode(), "LICENSE": b"CC BY-NC"}
    collection = files_of(publisher, bodies)
    folder = bring(collection, tmp_path, HASTY)
    assert folder == tmp_path / "some" / "where" and visible(folder) == {*bodies} and len(mw.load_motions(folder)) == 2
    bring(collection, tmp_path, HASTY)
    assert publisher.asked == [f"in/{name}" for name in bodies] and publisher.most_at_once == 1
    assert {path.name for path in tmp_path.iterdir()} <= {"some", ".fetch-some.lock"}
    (folder / "LICENSE").write_text("half")
    (folder / "b_1.bvh").unlink()
    (folder / "a_1.bvh.xz").write_bytes(lzma.compress(bodies["a_1.bvh"]))
    (folder / "a_1.bvh").unlink()
    publisher.asked.clear()
    bring(collection, tmp_path, HASTY)
    assert publisher.asked == ["in/b_1.bvh", "in/LICENSE"], "what is there, plain or packed, is not asked for again"
    (folder / "LICENSE").unlink()
    publisher.files["in/LICENSE"] = b"another"
    with pytest.raises(NotOfferedError, match="LICENSE: .*does not match the known hash"):
        bring(collection, tmp_path, HASTY)
    assert visible(folder) == {"a_1.bvh.xz", "b_1.bvh"}


def test_clips_that_are_brought_read_as_the_list_says(publisher, cmu, tmp_path):
    folder, clips = bring(cmu, tmp_path / "data", HASTY), cmu.download.clips()
    assert folder == tmp_path / "data" / "cmu" / "asfamc" and visible(folder) == CMU_WHOLE
    found = [(m.name, m.subject, m.action, m.fps) for m in mw.load_motions(folder)]
    assert found == [(Path(c.file).stem, c.subject, c.action, c.fps) for c in clips]
    assert len({c.motion for c in clips}) == 4 and "mocap.cs.cmu.edu" in acknowledgement(str(folder))["acknowledgement"]
    assert publisher.asked == [name for name in sorted(CMU_WHOLE, key=lambda n: (n[:2], n[-3:] != "asf", n)) if "/" in name]
    assert publisher.most_at_once == 1
    bring(cmu, tmp_path / "data", HASTY)
    assert len(publisher.asked) == 6, "what is there is not asked for again"
    assert {p.name for p in (tmp_path / "data").iterdir()} <= {"cmu", ".fetch-cmu.lock"}
    (folder / "clips.csv").unlink()
    bring(cmu, tmp_path / "data", HASTY)
    assert visible(folder) == CMU_WHOLE and len(publisher.asked) == 6, "what was said of the clips is said again"


def half(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def pack(file: Path) -> None:
    file.with_name(f"{file.name}.xz").write_bytes(lzma.compress(file.read_bytes()))
    file.unlink()


def pack_badly(file: Path) -> None:
    pack(file)
    file.with_name(f"{file.name}.xz").write_bytes(b"no xz")


@pytest.mark.parametrize(
    "name, injury, asked",
    [
        ("05/05_02.amc", half, ["05/05.asf", "05/05_02.amc"]),
        ("05/05_02.amc", Path.unlink, ["05/05.asf", "05/05_02.amc"]),
        ("09/09.asf", half, ["09/09.asf", "09/09_01.amc", "09/09_02.amc"]),
        ("05/05_01.amc", pack, []),
        ("05/05_01.amc", pack_badly, ["05/05.asf", "05/05_01.amc"]),
    ],
)
def test_what_is_broken_comes_again_whatever_broke_it(publisher, cmu, tmp_path, name, injury: Callable, asked):
    folder = bring(cmu, tmp_path, HASTY)
    injury(folder / name)
    publisher.asked.clear()
    bring(cmu, tmp_path, HASTY)
    assert publisher.asked == asked and len(mw.load_motions(folder)) == 4


def test_comments_and_line_ends_do_not_count(publisher, cmu, tmp_path):
    publisher.files = {n: b"# as published\r\n" + b.replace(b"\n", b"\r\n") for n, b in publisher.files.items()}
    assert [m.name for m in mw.load_motions(bring(cmu, tmp_path, HASTY))] == ["05_01", "05_02", "09_01", "09_02"]


def test_every_clip_may_fail_once(publisher, cmu, tmp_path):
    tricks = ["cut", "page", "drop", "cut", "page", 503]
    publisher.tricks |= {name: [trick] for name, trick in zip(publisher.files, tricks, strict=True)}
    folder = bring(cmu, tmp_path, HASTY)
    assert visible(folder) == CMU_WHOLE and [motion_fault(folder / c.file, c) for c in cmu.download.clips()] == [""] * 4


@pytest.mark.parametrize(
    "name, content, message",
    [
        ("05/05_01.amc", clip(99.0).encode(), r"1 of 4 .*05_01.amc: another motion \(2 frames, .*expected 2 frames"),
        ("05/05_01.amc", clip(10.0)[:150].encode(), "05_01.amc: it cannot be read: .*found"),
        ("05/05_01.amc", PAGE, "05_01.amc: a web page arrived"),
        ("05/05_01.amc", None, "05_01.amc: the server says 404 Not Found"),
        ("05/05.asf", ASF.replace("length 16", "length 17").encode(), "2 of 4 .*05_01.amc: another.*05_02.amc: another"),
    ],
)
def test_another_clip_than_the_listed_one_is_refused_and_the_others_come(publisher, cmu, tmp_path, name, content, message):
    publisher.files[name] = content
    with pytest.raises(FetchError, match=f"(?s){message}"):
        bring(cmu, tmp_path, HASTY)
    missing = {name} if name != "05/05.asf" else {n for n in CMU_WHOLE if n[:2] == "05"}
    assert visible(tmp_path / cmu.place) == CMU_WHOLE - missing
    assert publisher.asked.count("05/05_01.amc") <= TRIES


def test_a_publisher_without_the_data_is_not_asked_for_all_of_it(publisher, cmu, tmp_path):
    publisher.files = {name: body for name, body in publisher.files.items() if name.endswith("asf")}
    many = [c._replace(file=c.file.replace("_0", f"_{n}")) for n in range(10, 15) for c in cmu.download.clips()]
    with pytest.raises(FetchError, match="5 of 20 clips could not"):
        bring(with_clips(cmu, sorted(many)), tmp_path, HASTY)
    assert len(publisher.asked) == 6


def test_a_dead_line_ends_it_at_once_and_the_next_command_goes_on(publisher, cmu, tmp_path):
    publisher.tricks["05/05_02.amc"] = ["drop"] * TRIES
    with pytest.raises(FetchError, match="05_02.amc: .* ended early"):
        bring(cmu, tmp_path, HASTY)
    assert visible(tmp_path / cmu.place) == {"clips.csv", "05/05.asf", "05/05_01.amc"}
    publisher.asked.clear()
    bring(cmu, tmp_path, HASTY)
    assert publisher.asked == ["05/05_02.amc", "09/09.asf", "09/09_01.amc", "09/09_02.amc"], "the skeleton is there"


def killed_amid(publisher: Publisher, collection: Collection, to: Path, held: str) -> None:
    """kill -9 of a process that has received half of a file."""
    publisher.tricks[held] = ["hold"]
    staging, end = to / f".fetch-{collection.name}", time.monotonic() + 30
    staging.mkdir(parents=True)
    if (child := os.fork()) == 0:
        try:
            bring(collection, to, HASTY)
        finally:
            os._exit(1)
    while publisher.asked[-1:] != [held] or not [*staging.rglob("tmp*")]:
        assert time.monotonic() < end
        time.sleep(0.005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    publisher.asked.clear()


def test_a_kill_amid_a_clip_leaves_nothing_half(publisher, cmu, tmp_path):
    killed_amid(publisher, cmu, tmp_path, "05/05_02.amc")
    assert visible(tmp_path / cmu.place) == {"clips.csv", "05/05.asf", "05/05_01.amc"}
    with pytest.warns(BrokenFilesWarning, match="3 rows match no file: '05/05_02.amc'"):
        assert [m.name for m in mw.load_motions(tmp_path / "cmu")] == ["05_01"], "no half file is read"
    bring(cmu, tmp_path, HASTY)
    assert visible(tmp_path / cmu.place) == CMU_WHOLE and "05/05_01.amc" not in publisher.asked
    assert not (tmp_path / ".fetch-cmu").exists()


def test_two_at_once_bring_each_file_once(publisher, cmu, tmp_path, capsys):
    publisher.tricks["*"] = ["patient"]
    both = [threading.Thread(target=bring, args=(cmu, tmp_path, HASTY)) for _ in range(2)]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    assert visible(tmp_path / cmu.place) == CMU_WHOLE and sorted(publisher.asked) == sorted(CMU_WHOLE - {"clips.csv"})
    assert publisher.most_at_once == 1 and "another mwlib fetch cmu is at work" in capsys.readouterr().err


def test_a_table_of_somebody_else_is_not_overwritten(publisher, cmu, tmp_path):
    table = tmp_path / cmu.place / "clips.csv"
    table.parent.mkdir(parents=True)
    table.write_text("file,subject\n05/05_01.amc,me\n")
    with pytest.raises(FetchError, match="clips.csv says other things .*move it away"):
        bring(cmu, tmp_path, HASTY)
    assert table.read_text().endswith("me\n") and publisher.asked == []


def test_the_pause_between_files_is_kept(publisher, cmu, tmp_path, monkeypatch):
    pauses: list[float] = []
    monkeypatch.setattr("mwlib.data.fetching.time", SimpleNamespace(sleep=pauses.append, monotonic=time.monotonic))
    bring(cmu, tmp_path, replace(HASTY, between=0.5))
    assert pauses == [0.5] * 6


def test_every_clip_comes_out_of_the_archive_and_the_archive_goes(publisher, lafan1, tmp_path):
    folder = bring(lafan1, tmp_path, HASTY)
    assert folder == tmp_path / "lafan1" and visible(folder) == LAFAN1_WHOLE
    assert (folder / "license.txt").read_text() == "CC BY-NC-ND"
    found = {(m.subject, m.action, len(m)) for m in mw.load_motions(folder)}
    assert found == {("1", "walk", 3), ("2", "walk", 3), ("5", "aiming", 3)}
    assert {path.name for path in tmp_path.iterdir()} <= {"lafan1", ".fetch-lafan1.lock"}
    bring(lafan1, tmp_path, HASTY)
    assert publisher.asked == ["license.txt", "lafan1.zip"], "what is there is not asked for again"


@pytest.mark.parametrize(
    "texts, changes, message",
    [
        ({"a1_subject1.bvh": BVH}, {}, "lafan1.zip: 1 clips; expected 3"),
        (dict.fromkeys(NAMES, BVH), {"sha256": "0" * 64}, "lafan1.zip: .*does not match the known hash"),
        (dict.fromkeys(NAMES, BVH), {"size": 10}, "lafan1.zip: more than 10 bytes arrived"),
    ],
)
def test_another_archive_is_refused_whole(publisher, tmp_path, texts, changes, message):
    with pytest.raises(NotOfferedError, match=f"(?s){message}"):
        bring(zip_of(publisher, texts, **changes), tmp_path, HASTY)
    assert visible(tmp_path / "lafan1") == {"license.txt"}


@pytest.mark.parametrize("injury", [half, Path.unlink])
@pytest.mark.parametrize("name", [NAMES[1], "license.txt", PROOF])
def test_half_files_are_not_taken_for_whole_ones(publisher, lafan1, tmp_path, name, injury: Callable):
    file = bring(lafan1, tmp_path, HASTY) / name
    whole = file.read_bytes()
    injury(file)
    bring(lafan1, tmp_path, HASTY)
    assert file.read_bytes() == whole and len(publisher.asked) == 3


def test_a_kill_at_any_rename_leaves_no_claim_to_be_whole(publisher, lafan1, tmp_path, monkeypatch):
    """As if the process ended there; then the archive is not asked for again."""
    rename = Path.replace
    for place in range(len(NAMES)):
        left, to = [place], tmp_path / str(place)
        publisher.asked.clear()

        def deadly(old: Path, new: Path, left=left) -> Path:
            if new.suffix == ".bvh" and not left[0]:
                raise KeyboardInterrupt
            left[0] -= new.suffix == ".bvh"
            return rename(old, new)

        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(Path, "replace", deadly)
            bring(lafan1, to, HASTY)
        assert not (to / "lafan1" / PROOF).exists()
        assert visible(bring(lafan1, to, HASTY)) == LAFAN1_WHOLE and publisher.asked == ["license.txt", "lafan1.zip"]


def test_a_kill_amid_the_archive_leaves_what_was_whole(publisher, lafan1, tmp_path):
    killed_amid(publisher, lafan1, tmp_path, "lafan1.zip")
    assert visible(tmp_path / "lafan1") == {"license.txt"}
    assert visible(bring(lafan1, tmp_path, HASTY)) == LAFAN1_WHOLE and publisher.asked == ["lafan1.zip"]


def test_a_digest_sees_rate_skeleton_and_every_place():
    walk = synthetic_motions(subjects=1)[0]
    moved = walk.positions.copy()
    moved[-1, -1, 1] += 0.01
    others = [replace(walk, fps=25.0), replace(walk, positions=moved), walk.cut(0, len(walk) - 1), replace(walk, up="y")]
    digests = [motion_digest(motion) for motion in (walk, *others)]
    assert len({*digests}) == 5 and motion_digest(replace(walk, name="another")) == digests[0]


def test_a_list_is_written_from_the_very_files(tmp_path, monkeypatch):
    publish_two_people(tmp_path / "there")
    for module in ("tests.data.lists", "mwlib.data.collections"):
        monkeypatch.setattr(f"{module}.list_file", lambda name: tmp_path / f"{name}.csv")
    write_list("own", tmp_path / "there")
    assert listed("own") == clips_of(tmp_path / "there") and len(listed("own")) == 4


def test_records_say_what_is_published():
    assert all(len(listed(name)) == count for name, count in (("cmu", 134), ("bandai_namco", 81)))
    assert all(list_file(name).stat().st_size < 150 * (len(listed(name)) + 1) for name in ("cmu", "bandai_namco")), "no motion"
    assert Config.preset("cmu").data.data == Config.preset("cmu_paper").data.data == named_source("cmu")[0] == "cmu/asfamc"
    cmu = listed("cmu")
    assert {c.fps for c in cmu} == {120.0} and len({c.motion for c in cmu}) == 134
    assert {c.subject for c in cmu} == {"1", "2", "5", "7", "9", "14", "16", "29", "49"}
    archive = COLLECTIONS["lafan1"].download.archive
    assert re.match("https://media.githubusercontent.com/media/ubisoft/", archive.url) and len(archive.sha256) == 64
    assert (archive.size, archive.count) == (144_051_503, 77)
    files = COLLECTIONS["bandai-namco"].download.files()
    first = "dataset-2_walk_active_001.bvh"
    assert len(files) == 83 and files[first][0] == f"Bandai-Namco-Research-Motiondataset-2/data/{first}"
    assert files["LICENSE_dataset-1.txt"][0] == "Bandai-Namco-Research-Motiondataset-1/LICENSE"


@pytest.fixture
def originals(data_folder) -> list[mw.Motion]:
    """What the preset loads."""
    return [motion for name, motion in real_clips(data_folder).items() if name.startswith("cmu/asfamc/")]


@pytest.mark.parametrize("name", ["cmu", "bandai-namco"])
def test_a_list_names_the_clips_at_hand(data_folder, name):
    """All that the preset loads, and nothing else: what is behind the committed tables."""
    there = f"{COLLECTIONS[name].place}/"
    clips = [motion for file, motion in real_clips(data_folder).items() if file.startswith(there)]
    found = [(Path(c.file).stem, c.subject, c.action, c.fps, c.frames, c.motion) for c in listed(name.replace("-", "_"))]
    assert found == [(m.name, m.subject, m.action, m.fps, len(m), motion_digest(m)) for m in clips]


def test_they_are_the_clips_that_the_shipped_model_was_trained_and_measured_on(originals, monkeypatch):
    monkeypatch.setattr("mwlib.data.sources.load_source", lambda _: originals)
    about = json.loads((ROOT / "mwlib" / "models" / "cmu" / "metrics.json").read_text(encoding="utf-8"))["about"]
    assert list(split_motions(Config.preset("cmu").data).fingerprints()) == about["data"]


def test_real_clips_that_were_brought_are_the_originals_to_the_bit(publisher, data_folder, originals, tmp_path):
    cmu = COLLECTIONS["cmu"]
    some = [c for c in listed("cmu") if c.file in ("29/29_01.amc", "02/02_03.amc")]
    for name in ("02/02.asf", "29/29.asf", *(c.file for c in some)):
        publisher.files[name] = read_bytes(at(data_folder / cmu.place, name))
    here = replace(cmu, download=Download("", publisher.url, "", clips=lambda: some))
    motions = mw.load_motions(bring(here, tmp_path, HASTY))
    assert fingerprint(motions) == fingerprint([m for m in originals if m.name in ("02_03", "29_01")])


def test_bandai_namco_that_was_brought_has_the_bytes_of_the_folder_at_hand(data_folder, publisher, tmp_path):
    collection = COLLECTIONS["bandai-namco"]
    there, files = data_folder / collection.place, collection.download.files()
    publisher.files |= {place: read_bytes(at(there, name)) for name, (place, _) in files.items()}
    folder = bring(replace(collection, download=replace(collection.download, url=publisher.url)), tmp_path, HASTY)
    assert len(publisher.asked) == 83
    assert all((folder / name).read_bytes() == publisher.files[place] for name, (place, _) in files.items())
