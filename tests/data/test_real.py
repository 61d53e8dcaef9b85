"""Every real file at hand: read, of human size, as long and as fast as its table says."""

from __future__ import annotations

import csv
import hashlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from mwlib.body.kinematics import AXES, bone_lengths
from mwlib.body.motion import Motion
from mwlib.data import sources
from mwlib.data.check import GLITCH, check_data, fastest
from mwlib.data.meaning import ADULT, UPRIGHT, height, standing
from mwlib.prediction.config import Config
from tests.data.real import FOLDERS, real_clips

TABLES = ("cmu", "cmu_benchmark", "lafan1", "bandai_namco")


@pytest.fixture
def clips(data_folder) -> dict[str, Motion]:
    return real_clips(data_folder)


@pytest.fixture(scope="module")
def rows(data_folder):
    """File -> its row in clips.csv."""
    tables = [(data_folder / folder / "clips.csv").read_text().splitlines() for folder in TABLES]
    return {row["file"]: row for lines in tables for row in csv.DictReader(lines)}


def test_every_listed_file_is_read_and_no_other(clips, rows):
    assert set(clips) == set(rows)
    assert Counter(Path(name).parts[0] for name in clips) == {"cmu": 146, "cmu_benchmark": 72, "lafan1": 10, "bandai_namco": 81}


def test_lengths_rates_and_labels_are_those_of_the_tables(clips, rows):
    for name, motion in clips.items():
        row = rows[name]
        added = row.get("tpose_frame0", "0") == "1" or "rows" in row
        assert len(motion) == int(row.get("frames") or row["rows"]) - added, name
        assert motion.fps == float(row["fps"]), name
        assert motion.action == (row.get("action") or row["content"]), name
        assert motion.subject == row.get("subject", row.get("style", "")), name
    assert {m.fps for n, m in clips.items() if "/60_" in n} == {60.0}


def test_everyone_is_as_tall_as_a_human_with_bones_that_keep_their_length(clips):
    for name, motion in clips.items():
        height = np.percentile(np.ptp(motion.positions[..., AXES[motion.up]], axis=1), 95)
        assert 1.1 < height < 2.2, (name, height)  # from a crouching runner to raised hands
        assert np.ptp(bone_lengths(motion.positions, motion.skeleton), axis=0).max() < 2e-4, name
    lowest = {n: np.median(m.positions[..., 1].min(axis=1)) for n, m in clips.items() if n.startswith("lafan1")}
    assert all(abs(height) < 0.2 for height in lowest.values()), lowest  # on the floor, not twice as high


def test_size_and_up_axis_are_never_in_doubt(clips):
    """Also where people fall, turn cartwheels or roll on the ground: those are not upright, but nor are they by another axis."""
    lying = set()
    for name, motion in clips.items():
        found = standing(motion.positions, motion.skeleton, motion.up)
        assert ADULT[0] < height(motion.positions, motion.skeleton) < ADULT[1] and not found.is_clear, name
        assert all(standing(motion.positions, motion.skeleton, up).axis in ("y", found.axis) for up in "yz"), name
        if found.share < UPRIGHT:
            lying.add(Path(name).name)
        elif found.share > 0.8:
            assert standing(motion.positions, motion.skeleton, "z").is_clear, f"{name} called z up"
    assert lying == {"ground1_subject5.bvh.xz"}


# Over what clips say and hold, folder by folder, as the library read them before it was laid out in rooms; the styles of
# Bandai-Namco stand for subjects since.
CMU_SPLIT = ["31a7b0cc", "82e8490c", "07c6670e"]
CONTENT = dict(zip(FOLDERS, "58f63834 ec90444f 601cea17 4eceab18 4957c731".split(), strict=True))
SIDES = {  # skeleton -> left hip, ankles and toes
    "CMU": ("left_hipjoint", ("left_tibia", "right_tibia"), ("left_toes", "right_toes")),
    "LAFAN1": ("LeftUpLeg", ("LeftFoot", "RightFoot"), ("LeftToe", "RightToe")),
    "BANDAI21": ("UpperLeg_L", ("Foot_L", "Foot_R"), ("Toes_L", "Toes_R")),
}


def test_toes_point_ahead_of_someone_whose_left_hip_is_left(clips):
    ahead = []
    for motion in clips.values():
        if motion.skeleton.name in SIDES:
            hip, ankles, toes = SIDES[motion.skeleton.name]
            left = motion.skeleton.joints.index(hip)
            across = motion.positions[:, left] - motion.positions[:, motion.skeleton.mirror[left]]
            ends = ([motion.skeleton.joints.index(j) for j in joints] for joints in (toes, ankles))
            feet = np.subtract(*(motion.positions[:, joints].sum(axis=1) for joints in ends))
            ahead.append(np.median(np.sum(np.cross(across, [0, 1, 0]) * feet, axis=-1)) > 0)
    assert len(ahead) == 298
    assert np.mean(ahead) > 0.97  # dancers may stand otherwise


def test_the_glitches_of_cmu_are_kept_and_found(clips, rows):
    amc = {name: motion for name, motion in clips.items() if name.endswith(".amc.xz")}
    assert {name for name, motion in amc.items() if fastest(motion)[0] > GLITCH} == {n for n in amc if rows[n]["glitch"] == "1"}


def test_a_real_folder_agrees_with_its_table(data_folder):
    report, is_whole, _ = check_data(data_folder / "cmu" / "bvh")
    assert is_whole
    for clips in (1, 6, 5):  # cgspeed's, Daz's at 120 and at 60 Hz
        assert f"frames as clips.csv says in {clips} of {clips} clips" in report
    assert "DIFFERS" not in report


def test_kinematics_of_the_rotations_give_the_positions(clips):
    """Of every file that has rotations; quaternions never jump in sign."""
    rigged = {name: m for name, m in clips.items() if m.rig is not None}
    assert len(rigged) == 134 + 12 + 10 + 81
    for name, motion in rigged.items():
        away = np.linalg.norm(motion.rig.positions() - motion.positions, axis=-1)
        assert away.max() < 1e-6, name
        q = motion.rig.rotations
        assert np.sum(q[1:] * q[:-1], axis=-1).min() >= 0, name


def content(motions: Sequence[Motion]) -> str:
    """Eight hex digits over what clips say and hold. To the bit: another CPU may round the last digit of a sine otherwise."""
    digest = hashlib.sha256()
    for m in motions:
        digest.update(f"{m.subject}/{m.action}/{m.fps}/{m.positions.shape}".encode())
        digest.update(np.ascontiguousarray(m.positions, dtype=np.float32).tobytes())
    return digest.hexdigest()[:8]


@pytest.mark.parametrize("folder", CONTENT)
def test_clips_are_read_as_they_were(clips, folder):
    assert content([motion for name, motion in clips.items() if name.startswith(f"{folder}/")]) == CONTENT[folder]


def test_the_split_of_real_people_is_what_it_was(clips, monkeypatch):
    people = [motion for name, motion in clips.items() if name.startswith("cmu/asfamc/")]
    monkeypatch.setattr(sources, "load_motions", lambda data, **stated: people)
    assert [content(part) for part in sources.split_motions(Config.preset("cmu").data)] == CMU_SPLIT
