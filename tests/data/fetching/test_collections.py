"""The command: what there is, whose licence, and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from mwlib.__main__ import main
from mwlib.data import commands
from mwlib.data.fetching import collections
from mwlib.data.fetching.by_hand import BY_HAND
from mwlib.data.fetching.collections import COLLECTIONS, NAMES, fetch
from mwlib.data.fetching.lists import list_file, listed
from mwlib.data.load import data_folder, find_source
from mwlib.prediction.config import PRESETS


@pytest.fixture
def brought(monkeypatch) -> list[str]:
    """What would have been downloaded; nothing is."""
    names: list[str] = []

    def bring(name: str):
        def to(folder: Path) -> Path:
            names.append(f"{name} {folder}")
            return folder / COLLECTIONS[name].folder

        return to

    instead = {n: c.__class__(**{**vars(c), "bring": bring(n)}) for n, c in COLLECTIONS.items()}
    monkeypatch.setattr(collections, "COLLECTIONS", instead)
    monkeypatch.setattr(commands, "COLLECTIONS", instead)
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
    assert set(rows) == {"name", *NAMES, "The"}
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
    with pytest.raises(ValueError, match="name is 'cmuu'; expected one of cmu, lafan1, bandai-namco"):
        fetch("cmuu", tmp_path)
    with pytest.raises(ValueError, match="human36m cannot be downloaded by a program"):
        fetch("human36m", tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file is no folder"):
        fetch("cmu", tmp_path / "file")


@pytest.mark.parametrize("name", BY_HAND)
def test_what_no_program_can_download_is_explained(name, tmp_path, capsys):
    assert main(["fetch", name, "--to", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "No program can download it" in told and "https://github.com/" in told
    assert f"put it at {tmp_path / BY_HAND[name].place}\n" in told
    assert f"MWLIB_DATA={tmp_path} mwlib check-data {BY_HAND[name].check}\n" in told


def test_steps_by_hand_end_where_a_preset_looks():
    assert BY_HAND["human36m"].place == PRESETS["h36m"]["data"] and BY_HAND["human36m"].check == "h36m"
    assert BY_HAND["humaneva"].place == PRESETS["humaneva"]["data"] and BY_HAND["humaneva"].check == "humaneva"


def test_without_mwlib_data_there_is_one_place_for_all(monkeypatch, tmp_path):
    """What is fetched is found from any working folder."""
    monkeypatch.delenv("MWLIB_DATA", raising=False)
    monkeypatch.setattr("pooch.os_cache", lambda name: tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert data_folder() == tmp_path / "mwlib"
    (tmp_path / "mwlib" / "cmu" / "asfamc").mkdir(parents=True)
    assert find_source(PRESETS["cmu"]["data"]) == tmp_path / "mwlib" / "cmu" / "asfamc"


def test_lists_hold_no_motion():
    """A line each, of some hundred bytes."""
    for name, count in (("cmu", 134), ("lafan1", 10), ("bandai_namco", 81)):
        assert len(listed(name)) == count and list_file(name).stat().st_size < 150 * (count + 1)


def test_help_helps(capsys):
    with pytest.raises(SystemExit):
        main(["fetch", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in NAMES) and "--to FOLDER" in told and "--accept-licence" in told
    with pytest.raises(SystemExit):
        main(["fetch", "nothing"])
    assert "invalid choice: 'nothing'" in capsys.readouterr().err
