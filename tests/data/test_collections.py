"""Records of data sets, and the command that brings them: what there is, whose licence, and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from mwlib.cli import main
from mwlib.data.collections import COLLECTIONS, NAMED_SOURCES, Collection, listed
from mwlib.data.fetching import fetch
from mwlib.data.load import data_folder, find_source
from mwlib.prediction.config import PRESETS


@pytest.fixture
def brought(monkeypatch) -> list[str]:
    """What would have been downloaded; nothing is."""
    names: list[str] = []

    def bring(collection: Collection, to: Path) -> Path:
        names.append(f"{collection.name} {to}")
        return to / collection.place

    monkeypatch.setattr("mwlib.data.fetching.bring", bring)
    return names


def test_without_a_name_it_lists_what_there_is(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path))
    for clip in listed("cmu")[:3]:
        file = tmp_path / "cmu" / "asfamc" / f"{clip.file}.xz"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    (tmp_path / "data_3d_h36m.npz").touch()
    (tmp_path / "lafan1").mkdir()
    for name in ("walk1_subject1.bvh", "walk1_subject1.bvh.xz", "walk2_subject1.bvh.xz", "notes.txt"):
        (tmp_path / "lafan1" / name).touch()
    assert main(["fetch"]) == 0
    rows = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line}
    assert set(rows) == {"name", *COLLECTIONS, "The"}
    assert rows["cmu"].endswith("3 of 134 files") and "76 MB" in rows["cmu"] and "not for resale" in rows["cmu"]
    assert rows["lafan1"].endswith("2 of 77 files") and "CC BY-NC-ND 4.0" in rows["lafan1"]
    assert rows["bandai-namco"].endswith("0 of 81 files")
    assert rows["human36m"].endswith("yes") and rows["humanml3d"].endswith("no")
    assert f"The folder of data is {tmp_path}." in rows["The"]


def test_the_cmu_clips_come_with_what_their_owners_ask_for(brought, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path / "data"))
    assert main(["fetch", "cmu"]) == 0 and main(["fetch", "cmu", "--to", str(tmp_path / "my data")]) == 0
    assert brought == [f"cmu {tmp_path / 'data'}", f"cmu {tmp_path / 'my data'}"]
    first, second = capsys.readouterr().out.split("NSF EIA-0196217.\n", 1)
    assert "obtained from mocap.cs.cmu.edu" in first and "next: mwlib check-data cmu/asfamc\n" in first
    assert f"MWLIB_DATA='{tmp_path / 'my data'}' mwlib train --preset cmu\n" in second


@pytest.mark.parametrize("name", ["lafan1", "bandai-namco"])
@pytest.mark.parametrize(
    "words, terminal, answer, accepted",
    [
        ([], False, None, False), (["--accept-licence"], False, None, True), ([], True, "yes", True), ([], True, " Y ", True),
        ([], True, "no", False), ([], True, "", False),
    ],
)  # fmt: skip
def test_a_licence_is_shown_and_accepted_first(brought, monkeypatch, capsys, tmp_path, name, words, terminal, answer, accepted):
    monkeypatch.setattr(sys.stdin, "isatty", lambda: terminal, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: answer if terminal else pytest.fail("nobody to ask"))
    assert main(["fetch", name, "--to", str(tmp_path), *words]) == (0 if accepted else 1)
    told = capsys.readouterr()
    assert "NonCommercial" in told.out and "https://creativecommons.org/licenses/by-nc" in told.out
    assert bool(brought) == accepted and ("Please cite" in told.out) == accepted
    assert ("--accept-licence" in told.err) == (not accepted)


def test_the_library_asks_for_acceptance_too(brought, tmp_path):
    with pytest.raises(ValueError, match="the licence of lafan1 has not been accepted:\n.*NoDerivatives"):
        fetch("lafan1", tmp_path)
    assert fetch("lafan1", tmp_path, accepted=True) == tmp_path / "lafan1" and len(brought) == 1
    with pytest.raises(ValueError, match="name is 'cmuu'; expected one of bandai-namco, cmu, lafan1"):
        fetch("cmuu", tmp_path)
    with pytest.raises(ValueError, match="human36m cannot be downloaded by a program"):
        fetch("human36m", tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file is no folder"):
        fetch("cmu", tmp_path / "file")


@pytest.mark.parametrize("name", [name for name, c in COLLECTIONS.items() if c.download is None])
def test_what_no_program_can_download_is_explained(name, tmp_path, capsys):
    assert main(["fetch", name, "--to", str(tmp_path)]) == 0
    told, record = capsys.readouterr().out, COLLECTIONS[name]
    assert "No program can download it" in told and "https://github.com/" in told
    assert f"put it at {tmp_path / record.place}\n" in told
    assert f"MWLIB_DATA={tmp_path} mwlib check-data {record.preset or record.place}\n" in told


# A row for each record: what a file of it is called, and what that says of subject and action; its usual unit.
RECORDS = {
    "bandai-namco": ("dataset-1_bow_normal_001", ("normal", "bow"), "cm"),
    "amass": ("", (None, None), ""),
    "cmu": ("05_12", ("05", None), "cmu"),
    "lafan1": ("walk4_subject1", ("1", "walk"), "cm"),
    "human36m": ("", (None, None), ""),
    "humaneva": ("", (None, None), ""),
    "humanml3d": ("", (None, None), ""),
    "kit-ml": ("", (None, None), ""),
}


@pytest.mark.parametrize("name", COLLECTIONS)
def test_a_record_says_all_that_a_data_set_needs(name):
    record, (stem, said, unit) = COLLECTIONS[name], RECORDS[name]
    assert (
        record.name == name and record.title and record.licence and record.place and bool(record.steps) != bool(record.download)
    )
    found = record.file_name.fullmatch(stem).groupdict() if record.file_name else {}
    assert (found.get("subject"), found.get("action")) == said and record.unit == unit
    others = [c.file_name for c in COLLECTIONS.values() if c.file_name and c is not record]
    assert not any(pattern.fullmatch(stem) for pattern in others), "a name that two records claim"
    assert not record.preset or record.place == PRESETS[record.preset]["data"] == NAMED_SOURCES[record.preset][0]


def test_without_mwlib_data_there_is_one_place_for_all(monkeypatch, tmp_path):
    """What is fetched is found from any working folder."""
    monkeypatch.delenv("MWLIB_DATA", raising=False)
    monkeypatch.setattr("pooch.os_cache", lambda name: tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert data_folder() == tmp_path / "mwlib"
    (tmp_path / "mwlib" / "cmu" / "asfamc").mkdir(parents=True)
    assert find_source(PRESETS["cmu"]["data"]) == tmp_path / "mwlib" / "cmu" / "asfamc"


def test_help_helps(capsys):
    with pytest.raises(SystemExit):
        main(["fetch", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in COLLECTIONS) and "--to TO" in told and "--accept-licence" in told
    with pytest.raises(SystemExit):
        main(["fetch", "nothing"])
    assert "there is no 'nothing'" in capsys.readouterr().err
