"""check-data and write-synthetic, as called from the command line."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib import load_motions, windows
from mwlib.__main__ import main
from mwlib.data import known
from mwlib.data.check import check_data
from mwlib.data.synthetic.script import synthetic_motions
from tests.sample_motions import BVH, write_positions_3d


def line(report: str, word: str) -> str:
    return next(text for text in report.splitlines() if text.strip().startswith(word))


def test_the_published_counts_add_up():
    totals = {s: sum(n for name, n in known.H36M_WINDOWS.items() if name.startswith(f"{s} ")) for s in ("S9", "S11")}
    assert totals == {"S9": 3041, "S11": 2127}
    assert len(known.H36M_WINDOWS) == 59


def test_a_folder_is_described(tmp_path, capsys):
    (tmp_path / "walk1_subject1.bvh").write_text(BVH)
    (tmp_path / "walk1_subject2.bvh").write_text(BVH.replace("3 92 2", "3 999 2"))
    assert main(["check-data", str(tmp_path)]) == 0
    report = capsys.readouterr().out
    assert line(report, "clips").split()[1:4] == ["2,", "6", "frames,"]
    assert "1 (1), 2 (1)" in line(report, "subjects")
    assert "walk (2)" in line(report, "actions")
    assert "change by up to" in line(report, "bones")
    assert "1 clips above 25 m/s: walk1_subject2" in line(report, "fastest")
    (tmp_path / "clips.csv").write_text("file,frames\nwalk1_subject1.bvh,3\nwalk1_subject2.bvh,4\n")
    report, _ = check_data(tmp_path)
    assert "frames as clips.csv says in 1 of 2 clips" in line(report, "known")
    assert "walk1_subject2 has 3, clips.csv says 4" in line(report, "DIFFERS")


def test_files_that_cannot_be_read_are_listed_and_the_rest_described(tmp_path, capsys):
    (tmp_path / "good.bvh").write_text(BVH)
    (tmp_path / "bad.bvh").write_text(BVH[:-40])
    assert main(["check-data", str(tmp_path)]) == 1
    report = capsys.readouterr().out
    assert "clips     1" in report
    assert "1 files cannot be read" in report
    assert "bad.bvh, MOTION" in report
    assert main(["check-data", str(tmp_path / "none")]) == 1
    assert "no motions at" in capsys.readouterr().err


def test_human36m_is_compared_with_its_published_window_counts(tmp_path):
    rng = np.random.default_rng(0)
    tree: dict[str, dict[str, np.ndarray]] = {"S1": {"Walking": np.zeros((10, 17, 3), np.float32)}}
    for name, count in known.H36M_WINDOWS.items():
        subject, take = name.split(" ", 1)
        pose = rng.normal(size=(17, 3)).astype(np.float32)
        tree.setdefault(subject, {})[take] = np.tile(pose, (125 + 25 * count, 1, 1))
    report, is_whole = check_data(write_positions_3d(tmp_path / "h.npz", tree))
    assert is_whole
    for text in (
        "S9: 3041 test windows, published 3041",
        "S11: 2127 test windows",
        "S9 + S11: 5168 test windows, published 5168",
    ):
        assert text in report
    assert "0 windows without a neighbour, 0 with at most nine; published 73, 1139" in report
    assert "DIFFERS" not in report
    tree["S9"]["Walking 1"] = tree["S9"]["Walking 1"][25:]
    del tree["S11"]["Eating"]
    report, _ = check_data(write_positions_3d(tmp_path / "h.npz", tree))
    assert "S9 + S11: 5083 test windows" in report
    assert "S9 Walking 1: 92, published 93" in report
    assert "S11 Eating: none, published 84" in report


def test_humaneva_counts_its_test_windows(tmp_path):
    tree = {s: {"Walking 1 chunk0": np.zeros((106, 15, 3), np.float32)} for s in ("Train/S1", "Validate/S1")}
    report, _ = check_data(write_positions_3d(tmp_path / "e.npz", tree))
    assert "6 of 15 + 60 frames at 60 Hz, every 15 frames" in line(report, "windows")
    assert "3 test windows in Validate/*; published never, at most 385" in line(report, "known")


def test_written_synthetic_motions_are_those_one_loads(tmp_path, capsys, monkeypatch):
    motions = synthetic_motions(subjects=2, seconds=3)
    for module in ("commands", "check"):
        monkeypatch.setattr(f"mwlib.data.{module}.synthetic_motions", lambda seed=0: motions)
    file = tmp_path / "synthetic.npz"
    assert main(["write-synthetic", str(file)]) == 0
    assert str(file) in capsys.readouterr().out
    back = load_motions(file)
    assert [(m.subject, m.action) for m in back] == [(m.subject, m.action) for m in motions]
    for motion, other in zip(motions, back, strict=True):
        np.testing.assert_array_equal(other.positions, motion.positions.astype(np.float32))
    report, _ = check_data(file)
    assert line(report, "windows").split()[1] == str(len(windows(back, 25, 100, 25)))
    assert line(report, "windows") == line(check_data("synthetic")[0], "windows")


def test_help_lists_the_commands(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert "check-data" in text
    assert "write-synthetic" in text
