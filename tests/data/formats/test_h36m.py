"""Human3.6M and HumanEva-I in VideoPose3D's layout, and writing it."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib import Motion, MotionFormatError, load_motions
from mwlib.body.skeleton import CMU, H36M17
from mwlib.data.collections.h36m import HUMANEVA15
from mwlib.data.formats.h36m import KEPT, STANDS, write_h36m
from tests.sample_motions import write_positions_3d

# VideoPose3D's 32 joints: their parents, and where they hold the 17.
PARENTS_32 = [int(p) for p in "-1 0 1 2 3 4 0 6 7 8 9 0 11 12 13 14 12 16 17 18 19 20 19 22 12 24 25 26 27 28 27 30".split()]
PLACES = {
    "hip": 0, "right_hip": 1, "right_knee": 2, "right_foot": 3, "left_hip": 6, "left_knee": 7, "left_foot": 8, "spine": 12,
    "thorax": 13, "neck": 14, "head": 15, "left_shoulder": 17, "left_elbow": 18, "left_wrist": 19, "right_shoulder": 25,
    "right_elbow": 26, "right_wrist": 27,
}  # fmt: skip


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def clip(rng, joints: int, frames: int = 4) -> np.ndarray:
    return rng.normal(size=(frames, joints, 3)).astype(np.float32)


def read(file) -> list[Motion]:
    """What a file of no human bodies holds."""
    return load_motions(file, unit="m", up="z")


def test_32_joints_become_17_with_their_left_and_right(tmp_path, rng):
    array = clip(rng, 32)
    (motion,) = read(write_positions_3d(tmp_path / "h.npz", {"S9": {"Walking 1": array}}))
    assert motion.skeleton == H36M17
    for name, place in PLACES.items():
        np.testing.assert_array_equal(motion.positions[:, H36M17.joints.index(name)], array[:, place], err_msg=name)
    assert (motion.subject, motion.action, motion.name, motion.fps, motion.up) == ("S9", "Walking", "S9 Walking 1", 50.0, "z")


def test_the_reduced_tree_is_that_of_h36m17():
    kept = [PLACES[name] for name in H36M17.joints]
    parents = []
    for place in kept:
        above = PARENTS_32[place]
        while above not in (*kept, -1):
            above = PARENTS_32[above]
        parents.append(kept.index(above) if above >= 0 else -1)
    parents[11] = parents[14] = H36M17.joints.index("thorax")  # as VideoPose3D hangs the shoulders
    assert tuple(parents) == H36M17.parents
    assert STANDS == [KEPT.index(joint) if joint in KEPT else STANDS[PARENTS_32[joint]] for joint in range(32)]


def test_17_joints_are_taken_as_they_are_in_the_order_of_the_file(tmp_path, rng):
    tree = {s: {a: clip(rng, 17) for a in ("Walking", "Eating 2")} for s in ("S9", "S11", "S1")}
    motions = read(write_positions_3d(tmp_path / "h.npz", tree))
    assert [(m.subject, m.action) for m in motions] == [(s, a) for s in ("S9", "S11", "S1") for a in ("Walking", "Eating")]
    np.testing.assert_array_equal(motions[3].positions, tree["S11"]["Eating 2"])


def test_the_corrupt_sequence_is_dropped(tmp_path, rng):
    tree = {s: {"Directions": clip(rng, 32), "Directions 1": clip(rng, 32)} for s in ("S9", "S11")}
    names = [m.name for m in read(write_positions_3d(tmp_path / "h.npz", tree))]
    assert names == ["S9 Directions", "S9 Directions 1", "S11 Directions 1"]


def test_humaneva_has_15_joints_at_60_hz_and_three_bad_chunks(tmp_path, rng):
    chunks = [f"Walking 1 chunk{i}" for i in (0, 2, 4)]
    tree = {s: {c: clip(rng, 15) for c in chunks} for s in ("Train/S3", "Validate/S3", "Train/S1")}
    motions = read(write_positions_3d(tmp_path / "e.npz", tree))
    assert [m.name for m in motions] == [
        "Train/S3 Walking 1 chunk4",
        *(f"Validate/S3 {c}" for c in chunks[:2]),
        *(f"Train/S1 {c}" for c in chunks),
    ]
    assert {(m.skeleton, m.fps, m.action, m.up) for m in motions} == {(HUMANEVA15, 60.0, "Walking", "z")}
    assert motions[0].subject == "Train/S3"


def test_what_is_written_is_read_back_exactly(tmp_path, rng):
    walks = [Motion(clip(rng, 17, n), 50.0, H36M17, s, "walk") for n, s in ((5, "P1"), (6, "P1"), (7, "P2"))]
    write_h36m(tmp_path / "w.npz", walks)
    for motion, back in zip(walks, read(tmp_path / "w.npz"), strict=True):
        np.testing.assert_array_equal(back.positions, motion.positions)
        assert (back.subject, back.action, back.fps, back.up) == (motion.subject, motion.action, 50.0, "z")


def test_writing_carries_over_skeleton_axis_and_rate(tmp_path, rng):
    motion = Motion(clip(rng, 31, 13), 100.0, CMU, "1", "walk", up="y")
    write_h36m(tmp_path / "w.npz", [motion])
    (back,) = read(tmp_path / "w.npz")
    expected = motion.retarget(H36M17).with_up("z").resample(50.0)
    np.testing.assert_array_equal(back.positions, expected.positions)
    with pytest.raises(ValueError, match="S11 Directions"):
        write_h36m(tmp_path / "w.npz", [Motion(clip(rng, 17), 50.0, H36M17, "S11", "Directions")])


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({"S1": {"Walking": np.zeros((4, 18, 3), "f4")}}, r"S1 Walking: found shape \(4, 18, 3\)"),
        ({"S1": {"Walking": np.zeros((0, 17, 3), "f4")}}, r"shape \(0, 17, 3\)"),
        ({"S1": {"Walking": np.zeros((4, 17, 2), "f4")}}, r"shape \(4, 17, 2\)"),
        ({"S1": {"Walking": np.zeros((4, 17, 3), "i4")}}, "int32; expected floats"),
        ({"S1": {"Walking": np.full((4, 17, 3), np.nan, "f4")}}, r"entry \(0, 0, 0\): found nan"),
        ({"S1": {"Walking": np.full((4, 17, 3), np.inf, "f2")}}, r"entry \(0, 0, 0\): found inf; expected a finite number up to"),
        ({"S1": {"Walking": {"deep": np.zeros((4, 17, 3), "f4")}}}, "dict among the dictionaries"),
        ({"S1": np.zeros((4, 17, 3), "f4")}, "two levels"),
        ({"S1": {"a": np.zeros((4, 17, 3), "f4"), "b": np.zeros((4, 15, 3), "f4")}}, "all with the same joints"),
        ({}, "0 sequences"),
    ],
)
def test_anything_else_is_refused_by_name_and_place(tmp_path, tree, message):
    with pytest.raises(MotionFormatError, match=message) as caught:
        read(write_positions_3d(tmp_path / "h.npz", tree))
    assert "h.npz, positions_3d" in str(caught.value)


def test_an_unpickled_entry_is_expected(tmp_path):
    np.savez(tmp_path / "h.npz", positions_3d=np.zeros((4, 17, 3)))
    with pytest.raises(MotionFormatError, match="one pickled dictionary"):
        load_motions(tmp_path / "h.npz")
