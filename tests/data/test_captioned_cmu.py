"""CMU's clips as features with captions: one body, left on the left, split by person."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import HUMANML22
from mwlib.data import captioned as module
from mwlib.data.captioned import CaptionsConfig, captioned_cmu, load_clips
from mwlib.data.formats.humanml import HUMANML3D, joints_of


@pytest.fixture(scope="module")
def walkers(data_folder):
    """Subject 7, who walks."""
    return captioned_cmu(data_folder, ["7"])


def small_folder(data_folder: Path, to: Path, columns: dict[str, str]) -> Path:
    """A folder of data with one short clip, and a clips.csv with these columns."""
    (to / "cmu" / "asfamc" / "07").mkdir(parents=True)
    for name in ("07.asf", "07_04.amc.xz"):
        shutil.copy(data_folder / "cmu" / "asfamc" / "07" / name, to / "cmu" / "asfamc" / "07" / name)
    with (to / "cmu" / "clips.csv").open("w", newline="") as table:
        writer = csv.writer(table)
        writer.writerows([["file", "fps", *columns], ["cmu/asfamc/07/07_04.amc.xz", "120", *columns.values()]])
    return to


def test_walks_are_read_with_both_kinds_of_captions(walkers):
    assert [clip.name for clip in walkers] == [f"07_{n:02}" for n in (1, 3, 4, 5, 6, 7, 8, 9, 10, 11)]
    named = {clip.name: clip for clip in walkers}
    assert named["07_04"].captions == ("A human walks straight.", "slow walk") and named["07_01"].captions == ("walk",)
    assert {clip.split for clip in walkers} == {"test"}
    assert named["07_04"].attributes == {"subject": "7", "kind": "walk", "part": 1.0, "parts": 1.0}
    assert named["07_04"].features.shape == (74, 263) and named["07_04"].features.dtype == np.float32  # 449 frames at 120 Hz


def test_people_have_the_one_body_and_walk_ahead_with_the_left_on_the_left(walkers):
    for clip in walkers:
        joints = joints_of(clip.features.astype(float), HUMANML3D)
        np.testing.assert_allclose(
            bone_lengths(joints, HUMANML22), np.tile(HUMANML3D.bone_lengths[1:], (len(joints), 1)), atol=1e-5
        )
        assert -1e-6 < joints[..., 1].min() < 0.05
        local = clip.features[:, HUMANML3D.blocks["positions"]].reshape(len(joints), 21, 3).mean(axis=0)
        at = {name: local[i] for i, name in enumerate(HUMANML22.joints[1:])}
        for part in ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist"):
            assert at[f"left_{part}"][0] > at[f"right_{part}"][0] + 0.02, part
        heights = [at[name][1] for name in ("left_foot", "left_ankle", "left_knee", "left_hip", "spine1", "spine2", "spine3")]
        assert np.all(np.diff([*heights, at["neck"][1], at["head"][1]]) > 0) and 1.4 < at["head"][1] < 1.7
        assert at["left_foot"][2] > at["left_ankle"][2] + 0.05 and at["right_foot"][2] > at["right_ankle"][2] + 0.05
        speed = clip.features[:, 2].mean() * HUMANML3D.fps
        assert 0.6 < speed < 2.5 and abs(clip.features[:, 1].mean()) * HUMANML3D.fps < 0.1


def test_a_long_trial_is_cut_into_pieces_of_one_length(data_folder):
    clips = captioned_cmu(data_folder, ["1"])
    assert [(clip.name, clip.split, len(clip.features)) for clip in clips] == [
        (f"01_01 part {n}", "val", rows) for n, rows in ((1, 153), (2, 152), (3, 153))
    ]
    assert all(clip.captions == clips[0].captions and clip.attributes["parts"] == 3 for clip in clips)
    (whole,) = load_motions(data_folder / "cmu/asfamc/01/01_01.amc.xz", skeleton="HUMANML22", fps=20)
    assert len(whole) == 459
    own = np.diff(whole.positions[:, 0, 1])[153 + 10 : 153 + 20]
    found = np.diff(clips[1].features[:, 3])[10:20]  # how the root rises and sinks, scaled as the legs are
    assert np.corrcoef(own, found)[0, 1] > 0.99999


def test_short_clips_and_glitches_are_left_out(data_folder, tmp_path, monkeypatch):
    folder = small_folder(data_folder, tmp_path, {"description": "walk", "subject": "3"})
    (clip,) = captioned_cmu(folder)
    assert (clip.captions, clip.split) == (("walk",), "train")
    assert captioned_cmu(folder, ["7"]) == []
    (motion,) = load_motions(folder / "cmu")
    monkeypatch.setattr(module, "read_motion_file", lambda file: [motion.cut(0, 240)])
    assert captioned_cmu(folder) == []  # 40 frames are 39 rows
    monkeypatch.setattr(module, "read_motion_file", lambda file: [motion.cut(0, 241)])
    assert [len(clip.features) for clip in captioned_cmu(folder)] == [40]
    motion = replace(motion, rig=None)
    motion.positions[120:] += 0.4  # 0.69 m within a twentieth of a second
    assert captioned_cmu(folder) == []


def test_without_words_there_is_no_clip_and_a_broken_table_is_refused(data_folder, tmp_path):
    folder = small_folder(data_folder, tmp_path, {"description": "", "action": ""})
    assert captioned_cmu(folder) == []
    (folder / "captions_cmu.csv").write_text("clip_file,caption\ncmu/asfamc/07/07_04.amc,A walk.\n")
    assert [clip.captions for clip in captioned_cmu(folder)] == [("A walk.",)]
    (folder / "captions_cmu.csv").write_text("clip_file,text\ncmu/asfamc/07/07_04.amc,A walk.\n")
    with pytest.raises(MotionFormatError, match="captions_cmu.csv, line 2: found .*; expected columns clip_file and caption"):
        captioned_cmu(folder)


def test_changed_files_are_read_again(data_folder, tmp_path, monkeypatch):
    folder = small_folder(data_folder, tmp_path, {"description": "walk", "subject": "3"})
    shutil.copy(folder / "cmu/asfamc/07/07_04.amc.xz", folder / "cmu/asfamc/07/07_05.amc.xz")
    table = folder / "cmu" / "clips.csv"
    rows = table.read_text()
    table.write_text(rows + "cmu/asfamc/07/07_05.amc.xz,120,walk,2\n")
    monkeypatch.setenv("MWLIB_DATA", str(folder))
    found = [load_clips(CaptionsConfig(data="cmu"))]
    assert load_clips(CaptionsConfig(data="cmu")).train[0] is found[0].train[0]
    table.write_text(rows + "cmu/asfamc/07/07_05.amc.xz,120,slow walk,2\n")
    found.append(load_clips(CaptionsConfig(data="cmu")))
    (folder / "captions_cmu.csv").write_text("clip_file,caption\ncmu/asfamc/07/07_05.amc,A walk.\n")
    found.append(load_clips(CaptionsConfig(data="cmu")))
    assert [parts.test[0].captions for parts in found] == [("walk",), ("slow walk",), ("A walk.", "slow walk")]
    assert len({parts.fingerprints() for parts in found}) == 3
