"""CMU's clips: only listed motions get a name, whatever the publisher, the line or a kill does."""

from __future__ import annotations

import json
import lzma
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

import mwlib as mw
from mwlib.data.fetching.cmu import FOLDER, fetch_cmu
from mwlib.data.fetching.errors import FetchError
from mwlib.data.fetching.lists import at, clips_of, listed, motion_digest, motion_fault
from mwlib.data.known import acknowledgement, named_source
from mwlib.data.sources import fingerprint, split_motions
from mwlib.data.untrusted import read_bytes
from mwlib.prediction.config import PRESETS, Config
from tests.data.fetching.publisher import HASTY, PAGE, clip, publish_two_people
from tests.sample_motions import ASF

ROOT = Path(__file__).parents[3]
KILLED = """
import json, sys
from pathlib import Path
from mwlib.data.fetching.cmu import fetch_cmu
from mwlib.data.fetching.lists import Listed
from mwlib.data.fetching.download import Patience
fetch_cmu(Path(sys.argv[1]), sys.argv[2], Patience(), [Listed(*words) for words in json.loads(sys.argv[3])])
"""


@pytest.fixture
def clips(publisher, tmp_path):
    """Two people with two clips each, published, with subjects and actions that only a list knows."""
    publisher.files |= publish_two_people(tmp_path / "there")
    return [c._replace(action=f"walk, {c.frames} frames") for c in clips_of(tmp_path / "there")]


def visible(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("[!.]*") if path.is_file()}


WHOLE = {"clips.csv", "05/05.asf", "05/05_01.amc", "05/05_02.amc", "09/09.asf", "09/09_01.amc", "09/09_02.amc"}


def test_what_is_brought_reads_as_the_list_says(publisher, clips, tmp_path):
    folder = fetch_cmu(tmp_path / "data", publisher.url, HASTY, clips)
    assert folder == tmp_path / "data" / "cmu" / "asfamc" and visible(folder) == WHOLE
    motions = mw.load_motions(folder)
    assert [(m.name, m.subject, m.action, m.fps) for m in motions] == [
        (Path(c.file).stem, c.subject, c.action, c.fps) for c in clips
    ]
    assert len({c.motion for c in clips}) == 4 and "mocap.cs.cmu.edu" in acknowledgement(str(folder))["acknowledgement"]
    assert publisher.paths() == [name for name in sorted(WHOLE, key=lambda n: (n[:2], n[-3:] != "asf", n)) if "/" in name]
    assert publisher.most_at_once == 1
    fetch_cmu(tmp_path / "data", publisher.url, HASTY, clips)
    assert len(publisher.asked) == 6, "what is there is not asked for again"
    assert {p.name for p in (tmp_path / "data").iterdir()} <= {"cmu", ".fetch-cmu.lock"}


def test_comments_and_line_ends_do_not_count(publisher, clips, tmp_path):
    publisher.files = {n: b"# as published\r\n" + b.replace(b"\n", b"\r\n") for n, b in publisher.files.items()}
    folder = fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert [m.name for m in mw.load_motions(folder)] == ["05_01", "05_02", "09_01", "09_02"]


@pytest.mark.parametrize("end", [0.3, 0.6, 0.99])
def test_half_files_are_not_taken_for_whole_ones(publisher, clips, tmp_path, end):
    """Whatever left them: another program, a full disk."""
    folder = fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    file = folder / "05" / "05_02.amc"
    whole = file.read_bytes()
    file.write_bytes(whole[: int(len(whole) * end)])
    publisher.asked.clear()
    fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert file.read_bytes() == whole and publisher.paths() == ["05/05.asf", "05/05_02.amc"]


def test_a_half_skeleton_is_brought_again(publisher, clips, tmp_path):
    folder = fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    (folder / "09" / "09.asf").write_text(ASF[:200])
    fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert (folder / "09" / "09.asf").read_text() == ASF and len(mw.load_motions(folder)) == 4


def test_packed_clips_count_as_there(publisher, clips, tmp_path):
    folder = fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    for file in folder.rglob("*.amc"):
        file.with_name(f"{file.name}.xz").write_bytes(lzma.compress(file.read_bytes()))
        file.unlink()
    publisher.asked.clear()
    fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert publisher.asked == []
    (folder / "05" / "05_01.amc.xz").write_bytes(b"no xz")
    fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert publisher.paths() == ["05/05.asf", "05/05_01.amc"] and len(mw.load_motions(folder)) == 4


@pytest.mark.parametrize("trick", ["drop", "stall", "more", "cut", "page", "empty", 503])
def test_every_file_may_fail_once(publisher, clips, tmp_path, trick):
    failing = list(publisher.files)[:2] if trick == "stall" else list(publisher.files)  # which takes its time
    publisher.tricks |= {name: [trick] for name in failing}
    folder = fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert visible(folder) == WHOLE and len(publisher.asked) == 6 + len(failing)
    assert [motion_fault(folder / c.file, c) for c in clips] == [""] * 4


@pytest.mark.parametrize(
    "name, content, message",
    [
        (
            "05/05_01.amc",
            clip(99.0).encode(),
            r"1 of 4 clips could not .*05_01.amc: another motion \(2 frames, .*expected 2 frames",
        ),
        ("05/05_01.amc", clip(10.0)[:150].encode(), "05_01.amc: it cannot be read: .*found"),
        ("05/05_01.amc", PAGE, "05_01.amc: a web page arrived"),
        ("05/05_01.amc", None, "05_01.amc: the server says 404 Not Found"),
        (
            "05/05.asf",
            ASF.replace("length 16", "length 17").encode(),
            "2 of 4 clips .*05_01.amc: another motion.*05_02.amc: another",
        ),
    ],
)
def test_another_clip_than_the_listed_one_is_refused_and_the_others_come(publisher, clips, tmp_path, name, content, message):
    if content is None:
        del publisher.files[name]
    else:
        publisher.files[name] = content
    with pytest.raises(FetchError, match=f"(?s){message}"):
        fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert visible(tmp_path / FOLDER) == (WHOLE - {name} if name != "05/05.asf" else {n for n in WHOLE if n[:2] != "05"})


def test_a_publisher_without_the_data_is_not_asked_for_all_of_it(publisher, clips, tmp_path):
    publisher.files = {name: body for name, body in publisher.files.items() if name.endswith("asf")}
    many = [c._replace(file=c.file.replace("_0", f"_{n}")) for n in range(10, 15) for c in clips]
    with pytest.raises(FetchError, match="5 of 20 clips could not"):
        fetch_cmu(tmp_path, publisher.url, HASTY, sorted(many))
    assert len(publisher.asked) == 6


def test_a_dead_line_ends_it_at_once_and_the_next_command_goes_on(publisher, clips, tmp_path):
    publisher.tricks["05/05_02.amc"] = ["stall"] * 3
    with pytest.raises(FetchError, match="05_02.amc: nothing arrived for 1 s.*tried 3 times. The same command goes on"):
        fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert visible(tmp_path / FOLDER) == {"clips.csv", "05/05.asf", "05/05_01.amc"}
    publisher.asked.clear()
    fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert publisher.paths() == ["05/05.asf", "05/05_02.amc", "09/09.asf", "09/09_01.amc", "09/09_02.amc"]


def test_a_kill_amid_a_download_leaves_nothing_half(publisher, clips, tmp_path):
    """kill -9 while the second clip arrives; then the same again."""
    publisher.tricks["05/05_02.amc"] = ["hold"]
    words = [sys.executable, "-c", KILLED, str(tmp_path), publisher.url, json.dumps(clips)]
    with subprocess.Popen(words, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}) as child:
        while not any(part.stat().st_size for part in tmp_path.glob(".fetch-cmu/05/05_02.amc")):
            assert child.poll() is None
            time.sleep(0.01)
        os.kill(child.pid, signal.SIGKILL)
    assert visible(tmp_path / FOLDER) == {"clips.csv", "05/05.asf", "05/05_01.amc"}
    assert [m.name for m in mw.load_motions(tmp_path / "cmu")] == ["05_01"], "no half file is read"
    publisher.asked.clear()
    fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert visible(tmp_path / FOLDER) == WHOLE and "05/05_01.amc" not in publisher.paths()
    assert not (tmp_path / ".fetch-cmu").exists()


def test_two_at_once_bring_each_file_once(publisher, clips, tmp_path, capsys):
    publisher.tricks["*"] = ["patient"]
    both = [threading.Thread(target=fetch_cmu, args=(tmp_path, publisher.url, HASTY, clips)) for _ in range(2)]
    for one in both:
        one.start()
    for one in both:
        one.join()
    assert visible(tmp_path / FOLDER) == WHOLE and sorted(publisher.paths()) == sorted(WHOLE - {"clips.csv"})
    assert publisher.most_at_once == 1 and "another mwlib fetch cmu is at work" in capsys.readouterr().err


def test_a_table_of_somebody_else_is_not_overwritten(publisher, clips, tmp_path):
    table = tmp_path / FOLDER / "clips.csv"
    table.parent.mkdir(parents=True)
    table.write_text("file,subject\n05/05_01.amc,me\n")
    with pytest.raises(FetchError, match="clips.csv says other things .*move it away"):
        fetch_cmu(tmp_path, publisher.url, HASTY, clips)
    assert table.read_text().endswith("me\n") and publisher.asked == []


def test_the_pause_between_files_is_kept(publisher, clips, tmp_path, monkeypatch):
    waits = []
    monkeypatch.setattr("mwlib.data.fetching.cmu.time.sleep", waits.append)
    fetch_cmu(tmp_path, publisher.url, replace(HASTY, between=0.5), clips)
    assert waits.count(0.5) == 6


def test_the_preset_reads_where_it_is_brought():
    assert PRESETS["cmu"]["data"] == PRESETS["cmu_paper"]["data"] == named_source("cmu")[0] == FOLDER
    assert {c.fps for c in listed("cmu")} == {120.0} and len({c.motion for c in listed("cmu")}) == len(listed("cmu")) == 134
    people = {c.subject for c in listed("cmu")}
    assert people == {"1", "2", "5", "7", "9", "14", "16", "29", "49"}


@pytest.fixture(scope="module")
def originals(data_folder) -> list[mw.Motion]:
    """What the preset loads."""
    return mw.load_motions(data_folder / FOLDER)


def test_the_list_names_the_clips_behind_the_committed_tables(originals):
    """All that the preset loads, and nothing else."""
    found = [(Path(c.file).stem, c.subject, c.action, c.fps, c.frames, c.motion) for c in listed("cmu")]
    assert found == [(m.name, m.subject, m.action, m.fps, len(m), motion_digest(m)) for m in originals]


def test_they_are_the_clips_that_the_shipped_model_was_trained_and_measured_on(originals, monkeypatch):
    monkeypatch.setattr("mwlib.data.sources.load_source", lambda _: originals)
    about = json.loads((ROOT / "mwlib" / "models" / "cmu" / "metrics.json").read_text(encoding="utf-8"))["about"]
    assert list(split_motions(Config.preset("cmu").data).fingerprints()) == about["data"]


def test_real_clips_that_were_brought_are_the_originals_to_the_bit(publisher, data_folder, originals, tmp_path):
    some = [c for c in listed("cmu") if c.file in ("29/29_01.amc", "02/02_03.amc")]
    for name in ("02/02.asf", "29/29.asf", *(c.file for c in some)):
        publisher.files[name] = read_bytes(at(data_folder / FOLDER, name), 10**8)
    motions = mw.load_motions(fetch_cmu(tmp_path, publisher.url, HASTY, some))
    assert fingerprint(motions) == fingerprint([m for m in originals if m.name in ("02_03", "29_01")])
