"""check-data and write-synthetic, as called from the command line."""

from __future__ import annotations

import re
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mwlib import Motion, load_motions, windows, write_bvh
from mwlib.body.skeleton import H36M17
from mwlib.cli import main
from mwlib.data.check import check_data
from mwlib.data.collections.h36m import WINDOWS
from mwlib.data.meaning import height
from mwlib.data.untrusted import MotionFormatError
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_motions import BVH, write_positions_3d


def line(report: str, word: str) -> str:
    return next(text for text in report.splitlines() if text.strip().startswith(word))


def test_the_published_counts_add_up():
    totals = {s: sum(n for name, n in WINDOWS.items() if name.startswith(f"{s} ")) for s in ("S9", "S11")}
    assert totals == {"S9": 3041, "S11": 2127}
    assert len(WINDOWS) == 59


def test_a_folder_is_described(tmp_path, capsys):
    (tmp_path / "walk1_subject1.bvh").write_text(BVH)
    (tmp_path / "walk1_subject2.bvh").write_text(BVH.replace("3 92 2", "3 999 2"))
    assert main(["check-data", str(tmp_path)]) == 0
    report = capsys.readouterr().out
    assert report.splitlines()[1].split()[:5] == ["bvh", "2", "6", "0", "2"]
    assert "1 (1), 2 (1)" in line(report, "subjects")
    assert "walk (2)" in line(report, "actions")
    assert "change by up to" in line(report, "bones")
    assert "1 clips above 25 m/s" in line(report, "fastest")
    assert "walk1_subject2.bvh (" in line(report, "faster than 25 m/s")
    (tmp_path / "clips.csv").write_text("file,frames\nwalk1_subject1.bvh,3\nwalk1_subject2.bvh,4\n")
    report, *_ = check_data(tmp_path)
    assert "frames as clips.csv says in 1 of 2 clips" in line(report, "known")
    assert "walk1_subject2 has 3, clips.csv says 4" in line(report, "DIFFERS")


def test_files_that_cannot_be_read_are_listed_and_the_rest_described(tmp_path, capsys):
    (tmp_path / "good.bvh").write_text(BVH)
    (tmp_path / "bad.bvh").write_text(BVH[:-40])
    assert main(["check-data", str(tmp_path)]) == 1
    report = capsys.readouterr().out
    assert report.splitlines()[1].split()[:2] == ["bvh", "1"]
    assert "1 files cannot be read" in report
    assert "bad.bvh, MOTION" in report
    assert main(["check-data", str(tmp_path / "none")]) == 1
    assert "no motions at" in capsys.readouterr().err


def test_human36m_is_compared_with_its_published_window_counts(tmp_path):
    rng, standing = np.random.default_rng(0), load_motions("synthetic")[0].positions[0]
    tree: dict[str, dict[str, np.ndarray]] = {"S1": {"Walking": np.zeros((10, 17, 3), np.float32)}}
    for name, count in WINDOWS.items():
        subject, take = name.split(" ", 1)
        pose = standing + rng.normal(size=3)
        tree.setdefault(subject, {})[take] = np.tile(pose.astype(np.float32), (125 + 25 * count, 1, 1))
    report, is_whole, _ = check_data(write_positions_3d(tmp_path / "h.npz", tree), unit="m", up="z")
    assert is_whole
    assert "S9: 3041 test windows, published 3041" in report and "S11: 2127 test windows" in report
    assert "S9 + S11: 5168 test windows, published 5168" in report
    assert "0 windows without a neighbour, 0 with at most nine; published 73, 1139" in report
    assert "DIFFERS" not in report
    tree["S9"]["Walking 1"] = tree["S9"]["Walking 1"][25:]
    del tree["S11"]["Eating"]
    report, *_ = check_data(write_positions_3d(tmp_path / "h.npz", tree), unit="m", up="z")
    assert "S9 + S11: 5083 test windows" in report
    assert "S9 Walking 1: 92, published 93" in report
    assert "S11 Eating: none, published 84" in report


def test_humaneva_counts_its_test_windows(tmp_path):
    tree = {s: {"Walking 1 chunk0": np.zeros((106, 15, 3), np.float32)} for s in ("Train/S1", "Validate/S1")}
    report, *_ = check_data(write_positions_3d(tmp_path / "e.npz", tree), unit="m")
    assert "6 of 15 + 60 frames at 60 Hz, every 15 frames" in line(report, "windows")
    assert "3 test windows in Validate/*; published never, at most 385" in line(report, "known")


def test_written_synthetic_motions_are_those_one_loads(tmp_path, capsys, monkeypatch):
    motions = synthetic_motions(subjects=2, seconds=3)
    for module in ("cli.data", "data.check"):
        monkeypatch.setattr(f"mwlib.{module}.synthetic_motions", lambda seed=0: motions)
    file = tmp_path / "synthetic.npz"
    assert main(["write-synthetic", str(file)]) == 0
    assert str(file) in capsys.readouterr().out
    back = load_motions(file)
    assert [(m.subject, m.action) for m in back] == [(m.subject, m.action) for m in motions]
    for motion, other in zip(motions, back, strict=True):
        np.testing.assert_array_equal(other.positions, motion.positions.astype(np.float32))
    report, *_ = check_data(file)
    assert line(report, "windows").split()[1] == str(len(windows(back, 25, 100, 25)))
    assert line(report, "windows") == line(check_data("synthetic")[0], "windows")


WALKS = synthetic_motions(subjects=2, seconds=3.0)


def section(report: str, title: str) -> str:
    return report.split(f"{title}:")[1].split("\n\n")[0]


def save(folder, name: str, motion: Motion, scale: float = 1.0) -> None:
    """A clip as an array that says all but its unit."""
    parts = {"skeleton": motion.skeleton.name, "fps": motion.fps, "up": motion.up, "subject": motion.subject}
    np.savez(folder / f"{name}.npz", positions=motion.positions * scale, **parts)


def test_the_table_says_what_each_kind_is_and_who_said_so(tmp_path):
    write_bvh(WALKS[0], tmp_path / "a.bvh")
    write_bvh(WALKS[12], tmp_path / "b.bvh")
    write_bvh(WALKS[1], tmp_path / "slow.bvh")
    (tmp_path / "clips.csv").write_text("file,fps,unit,subject\na.bvh,,,1\nb.bvh,,,2\nslow.bvh,25,cm,1\n")
    save(tmp_path, "c", WALKS[2].with_up("y"), 1000)
    head, first, second, third = check_data(tmp_path).report.splitlines()[:4]
    assert head.split("  ")[0] == "files" and "metres per unit" in head
    assert re.split("  +", first) == [
        "bvh", "2", "300", "6", "2", "50 (the file)", "H36M17, 17 joints", "y (the format)", "0.01 (the body's size)",
        re.split("  +", first)[-1],
    ]  # fmt: skip
    assert re.match(r"1\.[3-8]\d to 1\.[3-8]\d", re.split("  +", first)[-1])
    assert "y (its own entry)" in second and "0.001 (the body's size)" in second
    assert "25 (clips.csv)" in third and "0.01 (clips.csv)" in third and " 6 " in third


def test_what_training_will_leave_out_is_listed_with_its_reason(tmp_path):
    for name, motion in (("a", WALKS[0]), ("b", WALKS[13]), ("short", WALKS[1].cut(0, 125)), ("tiny", WALKS[2].cut(0, 10))):
        write_bvh(motion, tmp_path / f"{name}.bvh")
    (tmp_path / "bad.bvh").write_text("HIERARCHIE")
    found = section(check_data(tmp_path).report, "left out of training")
    assert "2 clips no longer than 25 + 100 frames at 50 Hz: short.bvh, tiny.bvh" in found
    assert "bad.bvh, " in found and "expected" in found
    shorter = check_data(tmp_path, fps=25.0, history=2, future=10).report
    assert "1 clips no longer than 2 + 10 frames at 25 Hz: tiny.bvh" in section(shorter, "left out of training")


def test_what_looks_wrong_is_listed(tmp_path):
    write_bvh(WALKS[0], tmp_path / "a_1.bvh")
    write_bvh(WALKS[0], tmp_path / "a_2.bvh")
    crawling = np.roll(WALKS[1].positions, 1, axis=-1) + np.linspace(0, 5, len(WALKS[1]))[:, None, None] * [1, 0, 0]
    save(tmp_path, "crawls", replace(WALKS[1], positions=crawling))
    jumping = WALKS[2].positions + (np.arange(len(WALKS[2])) == 70)[:, None, None] * 1.0
    save(tmp_path, "jumps", replace(WALKS[2], positions=jumping))
    save(tmp_path, "child", WALKS[3], 0.6)
    found = section(check_data(tmp_path).report, "looks wrong")
    assert f"no adult's height: child.npz ({0.6 * height(WALKS[3].positions, H36M17):.3g} m)" in found
    assert "not upright along the up-axis: crawls.npz (along x)" in found
    assert "faster than 25 m/s, so perhaps glitches: jumps.npz (" in found
    assert "the same clip twice, perhaps in training and test: a_1.bvh = a_2.bvh" in found
    assert "subject" not in found and "mirror" not in found
    (tmp_path / "clips.csv").write_text("file,subject\n" + "".join(f"{n},P1\n" for n in ("a_1.bvh", "a_2.bvh")))
    found = section(check_data(tmp_path).report, "looks wrong")
    assert "one subject only, 'P1': test clips will be of people trained on" in found


def test_bodies_without_pairs_and_mixed_skeletons_are_told(tmp_path):
    (tmp_path / "walk_1.bvh").write_text(BVH.replace("Left", "A").replace("Right", "B"))
    (tmp_path / "walk_2.bvh").write_text(BVH)
    write_bvh(WALKS[0], tmp_path / "walk_3.bvh")
    found = section(check_data(tmp_path).report, "looks wrong")
    assert re.search("training will not mirror: no joint of Hips6_.... has a left or right partner", found)
    assert re.search(r"3 skeletons, and training takes one: .* \(walk_2.bvh\); H36M17 \(walk_3.bvh\)", found)
    assert "no clip has a subject: test clips will be of people trained on" in found


def test_statements_and_picture_from_the_command_line(tmp_path, capsys):
    np.save(tmp_path / "a.npy", WALKS[0].with_up("y").positions / 0.0254)
    words = ["check-data", str(tmp_path), "--unit", "inch", "--up", "y", "--skeleton", "H36M17", "--file-fps", "50"]
    picture = tmp_path / "new" / "strip.png"
    assert main([*words, "--picture", str(picture), "--clip", "a"]) == 0
    report = capsys.readouterr().out
    assert all(f"{value} (the caller)" in report for value in ("50", "y", "0.0254"))
    assert plt.imread(picture).shape[1] > 600
    for left_out, told in (("--unit", "body size"), ("--up", "up-axis"), ("--file-fps", "file_fps=")):
        at = words.index(left_out)
        assert main([*words[:at], *words[at + 2 :]]) == 1
        assert told in capsys.readouterr().out
    for wrong, told in (("--picture=a.jpg", "ends in .png"), ("--history=0", "history is 0"), ("--unit=ell", "unit is 'ell'")):
        assert main([*words, wrong]) == 1
        assert told in capsys.readouterr().err
    assert main([*words, "--picture", str(picture), "--clip", "z"]) == 1
    assert "clip is 'z'; expected one of a.npy" in capsys.readouterr().err


def test_arrays_that_are_no_motions_are_named(tmp_path):
    np.save(tmp_path / "flat.npy", np.zeros((300, 66)))
    np.savez(tmp_path / "other.npz", joints3d=np.zeros((9, 17, 3)), rate=50)
    with pytest.raises(MotionFormatError, match=r"2 files without motions \(.*flat.npy: an array of shape \(300, 66\); expected"):
        load_motions(tmp_path)
    write_bvh(synthetic_motions(subjects=1)[0], tmp_path / "walk.bvh")
    text = check_data(tmp_path).report
    assert "passed over, as nothing says that they are motions:" in text and "every other file could be read" in text
    assert f"{tmp_path / 'flat.npy'}: an array of shape (300, 66); expected (frames, joints, 3)" in text
    assert f"{tmp_path / 'other.npz'}: entries joints3d, rate; expected positions or poses among them" in text
    for file in ("flat.npy", "other.npz"):
        (tmp_path / file).unlink()
    assert "passed over" not in check_data(tmp_path).report
