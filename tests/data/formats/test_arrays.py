"""Arrays of one's own, with the skeleton beside them, inside them, or from the caller."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.body.skeleton import H36M17, HUMANML22
from mwlib.data.check import check_data
from mwlib.data.formats import arrays
from mwlib.data.load import readings, unread_entries
from mwlib.synthetic.motions import synthetic_motions

OWN = {
    "name": "cross",
    "joints": ["middle", "left", "right", "top"],
    "parents": [-1, 0, 0, 0],
    "left": [1],
    "right": [2],
    "parts": {"arms": [1, 2]},
    "fps": 25,
    "unit": "cm",
    "up": "y",
}
WALK = synthetic_motions(subjects=1, seconds=2.0)[0]
POSITIONS = np.array([[[0, 90, 0], [120, 90, 0], [-120, 90, 0], [0, 180, 0]]] * 3, dtype=np.float32)


def test_the_skeleton_file_beside_says_everything(tmp_path):
    (tmp_path / "skeleton.json").write_text(json.dumps(OWN))
    (tmp_path / "a").mkdir()
    np.save(tmp_path / "a" / "walk.npy", POSITIONS)
    np.savez(tmp_path / "a" / "07_03.npz", positions=POSITIONS.astype(np.float64), fps=25, subject="Ann", action="run")
    run, walk = load_motions(tmp_path)
    for motion in (run, walk):
        np.testing.assert_allclose(motion.positions, POSITIONS / 100, rtol=1e-6)
        assert (motion.skeleton.name, motion.skeleton.joints[1], motion.up) == ("cross", "left", "y")
        assert motion.skeleton.parts == {"arms": (1, 2)}
    assert (walk.fps, walk.name, walk.subject) == (25.0, "walk", "")
    assert (run.fps, run.name, run.subject, run.action) == (25.0, "07_03", "Ann", "run")


@pytest.mark.parametrize("name, value, other", [("fps", 30, 25.0), ("unit", "m", 0.01), ("up", "z", "y")])
def test_two_files_that_contradict_each_other_need_a_word(tmp_path, name, value, other):
    (tmp_path / "skeleton.json").write_text(json.dumps(OWN))
    np.savez(tmp_path / "a.npz", positions=POSITIONS, **{name: value})
    argument = {"fps": "file_fps"}.get(name, name)
    found = f"{name}: found .* in its own entry, {other} in skeleton.json; expected one value; or a column {name} in clips.csv, "
    with pytest.raises(MotionFormatError, match=f"a.npz, {found}or {argument}="):
        load_motions(tmp_path / "a.npz")
    assert len(load_motions(tmp_path / "a.npz", **{argument: value})) == 1
    (tmp_path / "clips.csv").write_text(f"file,{name}\na.npz,{value}\n")
    assert len(load_motions(tmp_path / "a.npz")) == 1


@pytest.mark.parametrize("left, right", [([2], [1]), ([1, 3], [4, 2]), ([1], [3])], ids=["sides", "order", "another"])
def test_pairs_that_the_names_contradict_are_refused(tmp_path, left, right):
    joints = ["hips", "left_knee", "right_knee", "left_foot", "right_foot"]
    own = {"name": "legs", "joints": joints, "parents": [-1, 0, 0, 1, 2], "left": left, "right": right, "fps": 25}
    (tmp_path / "skeleton.json").write_text(json.dumps(own))
    np.save(tmp_path / "a.npy", np.zeros((3, 5, 3)))
    found = (
        f"found '{joints[left[0]]}' on the left and '{joints[right[0]]}' on the right; expected pairs as the joints' names say"
    )
    with pytest.raises(MotionFormatError, match=f"skeleton.json, left, right: {found}"):
        load_motions(tmp_path)


def test_the_caller_says_what_nobody_else_does(tmp_path):
    array = WALK.positions[:3]
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(
        MotionFormatError, match="skeleton: found none; expected a skeleton.json beside the file .*, or skeleton="
    ):
        load_motions(tmp_path / "a.npy")
    for said in ({}, {"fps": 50.0}):  # to resample something one has to know its rate
        with pytest.raises(MotionFormatError, match="frame rate: found none.*clips.csv, or file_fps="):
            load_motions(tmp_path / "a.npy", skeleton="H36M17", **said)
    (motion,) = load_motions(tmp_path / "a.npy", skeleton="H36M17", file_fps=50, unit="m")
    np.testing.assert_allclose(motion.positions, array, rtol=1e-6)
    assert (motion.fps, motion.up, motion.skeleton) == (50, "z", H36M17)
    (thin,) = load_motions(tmp_path / "a.npy", skeleton="H36M17", file_fps=50, fps=25, unit="m")
    np.testing.assert_array_equal(thin.positions, motion.positions[::2])


def test_a_known_skeleton_goes_by_its_name(tmp_path):
    array = 1000 * WALK.positions[:3]
    np.savez(tmp_path / "a.npz", positions=array, skeleton="H36M17", fps=50.0, unit="mm", up="z")
    (motion,) = load_motions(tmp_path / "a.npz")
    np.testing.assert_allclose(motion.positions, array / 1000, rtol=1e-6)
    (tmp_path / "skeleton.json").write_text(json.dumps({"name": "H36M17", "fps": 50, "unit": 0.001}))
    np.save(tmp_path / "b.npy", array)
    (motion,) = load_motions(tmp_path / "b.npy", up="z")
    assert motion.skeleton == H36M17
    (tmp_path / "skeleton.json").write_text(json.dumps(OWN))
    assert load_motions(tmp_path / "a.npz")[0].skeleton == H36M17, "the file itself knows best"


def test_a_unit_that_nobody_states_is_inferred(tmp_path):
    (tmp_path / "skeleton.json").write_text(json.dumps(OWN | {"unit": None}))
    for name, scale in (("cm", 1), ("m", 0.01), ("mm", 10)):
        np.save(tmp_path / f"{name}.npy", POSITIONS * scale)
    for motion in load_motions(tmp_path):
        np.testing.assert_allclose(motion.positions, POSITIONS / 100, rtol=1e-5)
    np.save(tmp_path / "ant.npy", POSITIONS * 1e-5)
    with pytest.raises(MotionFormatError, match="ant.npy, body size"):
        load_motions(tmp_path / "ant.npy")


def test_humanml3d_joints_need_no_skeleton_file(tmp_path, data_folder):
    (motion,) = load_motions(data_folder / "humanml3d")
    assert (motion.skeleton, motion.fps, motion.up, len(motion)) == (HUMANML22, 20.0, "y", 170)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (POSITIONS[:, :3], r"shape \(3, 3, 3\); expected numbers of shape \(T, 4, 3\)"),
        (POSITIONS[:0], r"T > 0"),
        (POSITIONS[0], r"shape \(4, 3\)"),
        (np.where(POSITIONS == 180, np.inf, POSITIONS), r"positions, entry \(0, 3, 1\): found inf"),
        (np.full(POSITIONS.shape, -(2**63)), "found -9223372036854775808; expected a finite number"),
        (POSITIONS.astype(np.longdouble) * 1e308, "finite number"),
        (POSITIONS.astype(str), "numbers of shape"),
        (POSITIONS.astype(complex), "dtype complex128"),
        (np.array({"positions": POSITIONS}, dtype=object), "dtype object"),
    ],
)
def test_an_array_that_does_not_fit_is_refused(tmp_path, array, message):
    (tmp_path / "skeleton.json").write_text(json.dumps(OWN))
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(MotionFormatError, match=message):
        load_motions(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": None}, "an object with a name"),
        ({"joints": None}, "joints: found None; expected a list"),
        ({"joints": ["middle"]}, "two or more names"),
        ({"joints": [1, 2, 3, 4]}, "joints: found 1; expected a name"),
        ({"parents": [-1, 0, 0]}, "4 joint names but 3 parents"),
        ({"parents": [-1, 2, 0, 0]}, "parent of joint 1 is 2"),
        ({"parents": [-1, 0, 0, 1.5]}, "skeleton: found parents is 1.5; expected a whole number"),
        ({"left": [7]}, r"skeleton: found cross: left\[0\] is 7; expected at most 3"),
        ({"left": [1, 3]}, "2 left joints but 1 right"),
        ({"parts": [1]}, r"skeleton: found parts is \[1\] .list.; expected a dict"),
        ({"parts": {"arms": ["left"]}}, r"skeleton: found arms\[0\] is 'left'; expected a whole number"),
        ({"fps": 0}, "fps: found 0 frames"),
        ({"fps": "fast"}, "fps: found 'fast'"),
        ({"unit": "ell"}, "unit: found 'ell'; expected metres"),
        ({"unit": [1]}, r"unit: found \[1\]"),
        ({"up": "x"}, "up: found 'x'; expected 'y' or 'z'"),
        ({"up": ["z"]}, r"up: found \['z'\]; expected 'y' or 'z'"),
        ({"fps": [25]}, "fps: found list; expected a number"),
        ({"joints": ["\ud800", "left", "right", "top"]}, "joints: found .* a name"),
        ({"name": "x" * 300}, "name: found .*at most 200 characters"),
        ({"joints": ["j"] * 501}, "names up to 500"),
        ({"joints": ["middle", "left", "right", "left"]}, "skeleton: found .*joint 'left' twice"),
        ({"joints": ["middle", "left", "right", " left"]}, "joints: found ' left'; expected names without blanks"),
        ({"joints": ["", "left", "right", "top"]}, "joints: found ''; expected names"),
        ({"left": [1], "right": [1]}, "joint of a side 1 twice; expected each once"),
        ({"left": [1, 1], "right": [2, 3]}, "joint of a side 1 twice"),
        ({"parts": {"arms": [1, 1]}}, "arms 1 twice"),
        ({"unit": True}, "unit: found True; expected metres"),
        ({"name": " "}, "an object with a name"),
    ],
)
def test_a_skeleton_file_that_makes_no_sense_is_refused(tmp_path, change, message):
    (tmp_path / "skeleton.json").write_text(json.dumps(OWN | change))
    np.save(tmp_path / "a.npy", POSITIONS)
    with pytest.raises(MotionFormatError, match=message) as caught:
        load_motions(tmp_path / "a.npy")
    assert "skeleton.json" in str(caught.value)


@pytest.mark.parametrize("text", ['{"name": "H36M17", "fps": 30, "fps": 60}', "", "{", "[" * 100_000, "[]", '"H36M17"'])
def test_a_skeleton_file_is_a_json_object(tmp_path, text):
    (tmp_path / "skeleton.json").write_text(text)
    np.save(tmp_path / "a.npy", POSITIONS)
    with pytest.raises(MotionFormatError, match="skeleton.json"):
        load_motions(tmp_path / "a.npy")


def test_other_archives_are_refused_by_what_they_hold(tmp_path):
    np.savez(tmp_path / "a.npz", images=POSITIONS, paths=POSITIONS)
    with pytest.raises(MotionFormatError, match="entries images, paths; expected positions"):
        load_motions(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", positions=POSITIONS, skeleton="OWL9", fps=50)
    with pytest.raises(MotionFormatError, match="skeleton: found 'OWL9'; expected one of .*H36M17"):
        load_motions(tmp_path / "b.npz")
    np.savez(tmp_path / "b.npz", positions=POSITIONS, skeleton=np.array(5), fps=50)
    with pytest.raises(MotionFormatError, match="b.npz, skeleton: found 5; expected one of"):
        load_motions(tmp_path / "b.npz")
    for point in (0x110000, 0xD800):  # beyond Unicode, and half a pair
        subject = np.frombuffer(np.array([point], "<u4").tobytes(), "<U1").reshape(())
        np.savez(tmp_path / "b.npz", positions=POSITIONS, skeleton="H36M17", fps=50, subject=subject)
        with pytest.raises(MotionFormatError, match="b.npz, subject: found no character at byte 0"):
            load_motions(tmp_path / "b.npz")
    np.savez(tmp_path / "b.npz", positions=POSITIONS, fps=[50, 60])
    with pytest.raises(MotionFormatError, match=r"b.npz, fps: found shape \(2,\); expected a single value"):
        load_motions(tmp_path / "b.npz")
    (tmp_path / "c.npz").write_bytes((tmp_path / "a.npz").read_bytes()[:200])
    with pytest.raises(MotionFormatError, match="archive"):
        load_motions(tmp_path / "c.npz")


MEANT = [
    ({"units": "cm"}, "'units' (did you mean 'unit'?)"),
    ({"Unit": "cm"}, "'Unit' (did you mean 'unit'?)"),
    ({"FPS": 25, "fps": None}, "'FPS' (did you mean 'fps'?)"),
    ({"frame_rate": 25, "fps": None}, "'frame_rate' (did you mean 'fps'?)"),
    ({"up_axis": "y"}, "'up_axis' (did you mean 'up'?)"),
    ({"subject_id": "A"}, "'subject_id' (did you mean 'subject'?)"),
    ({"actions": "run"}, "'actions' (did you mean 'action'?)"),
    ({"Skeleton": "H36M17", "skeleton": None}, "'Skeleton' (did you mean 'skeleton'?)"),
    ({"Positions": POSITIONS, "positions": None}, "'Positions' (did you mean 'positions'?)"),
    ({"positions3d": POSITIONS, "positions": None}, "'positions3d' (did you mean 'positions_3d'?)"),
]


@pytest.mark.parametrize(("change", "found"), MEANT)
def test_an_entry_that_looks_like_one_of_ours_is_refused(tmp_path, change, found):
    whole = {"positions": POSITIONS, "fps": 25.0, "skeleton": "H36M17"} | change
    np.savez(tmp_path / "a.npz", **{name: value for name, value in whole.items() if value is not None})
    expected = "expected some of positions, positions_3d, fps, unit, up, subject, action, skeleton, and others unlike these"
    for source in (tmp_path / "a.npz", tmp_path):
        with pytest.raises(MotionFormatError, match=re.escape(f"a.npz, archive: found unknown entry {found}; {expected}")):
            load_motions(source)


FOREIGN = {"poses": POSITIONS, "trans": 1, "betas": 1, "gender": "male", "mocap_framerate": 120, "joint_names": "a", "dmpls": 1}


def test_what_other_programs_keep_beside_positions_is_told_and_not_read(tmp_path):
    own = {"positions": WALK.positions, "fps": 50.0, "skeleton": "H36M17", "up": "z", "unit": "m"}
    np.savez(tmp_path / "a.npz", **own, **FOREIGN, units="cm", positions_2d=POSITIONS)
    (motion,) = load_motions(tmp_path)
    assert motion.fps == 50.0 and unread_entries(tmp_path / "a.npz") == sorted([*FOREIGN, "units", "positions_2d"])
    check = check_data(tmp_path)
    assert check.is_whole
    told = "  unread    entries betas, dmpls, gender, joint_names, mocap_framerate, poses, positions_2d, trans, units of a.npz"
    assert told in check.report.splitlines()


def test_an_archive_of_human36m_may_say_what_its_numbers_mean(tmp_path):
    tree = np.array({"S1": {"Walking": WALK.positions * 1000}}, dtype=object)
    np.savez(tmp_path / "a.npz", positions_3d=tree, fps=25.0, unit="mm", up="z", positions_2d=1, metadata=1, subject="S1")
    (found,) = readings(tmp_path / "a.npz")
    assert (found.unit.value, found.fps.value) == (0.001, 25.0)
    assert {found.unit.source, found.fps.source, found.up.source} == {"its own entry"}
    assert unread_entries(tmp_path / "a.npz") == ["metadata", "positions_2d", "subject"]
    np.savez(tmp_path / "a.npz", positions_3d=tree, units="mm")
    with pytest.raises(MotionFormatError, match=r"unknown entry 'units' \(did you mean 'unit'"):
        load_motions(tmp_path)


def test_an_archive_of_other_things_is_no_motion(tmp_path):
    np.savez(tmp_path / "data_2d.npz", positions_2d=POSITIONS, metadata=1, units="px")
    np.savez(tmp_path / "a.npz", positions=WALK.positions, fps=50.0, skeleton="H36M17")
    assert len(load_motions(tmp_path, strict=True)) == 1


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("UP", r"top: found unknown key 'UP' \(did you mean 'up'\?\); expected some of name, joints, parents"),
        ("units", r"unknown key 'units' \(did you mean 'unit'\?\)"),
        ("frame_rate", r"unknown key 'frame_rate' \(did you mean 'fps'\?\)"),
    ],
)
def test_a_key_of_a_skeleton_file_that_nothing_is_read_from_is_refused(tmp_path, key, message):
    (tmp_path / "skeleton.json").write_text(json.dumps({"name": "H36M17", "fps": 50, key: "y"}))
    with pytest.raises(MotionFormatError, match=message):
        arrays.read_skeleton_file(tmp_path / "skeleton.json")
