"""Unit, up-axis and rate: who says them, who is believed first, and bodies that contradict them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mwlib import Motion, MotionFormatError, load_motions, write_bvh
from mwlib.body.skeleton import CMU, H36M17, SCHEMES, Skeleton
from mwlib.data.formats.frames import starts_in_tpose
from mwlib.data.load import motion_files, readings
from mwlib.data.meaning import CALLER, UNITS, height, hints, infer_unit, said_by, standing
from mwlib.synthetic.motions import synthetic_motions
from tests.body.test_correspondence import tree
from tests.sample_motions import AMC, ASF, BENCHMARK, BVH, write_positions_3d

WALK = synthetic_motions(subjects=1, seconds=2.0)[0]
SKELETON = {"name": "H36M17", "fps": 50}


def test_the_caller_goes_before_the_table_and_that_before_the_file(tmp_path):
    file = tmp_path / "a.npz"
    np.savez(file, positions=WALK.positions * 100, skeleton="H36M17", fps=50.0, unit="cm", up="z")
    said = [(r.unit.value, r.unit.source, r.up.source, r.fps.source) for r in readings(file)]
    assert said == [(0.01, "its own entry", "its own entry", "its own entry")]
    (tmp_path / "clips.csv").write_text("file,unit,up,fps\na.npz,0.02,y,25\n")
    (found,) = readings(file)
    assert (found.unit.value, found.up.value, found.fps.value, found.unit.source) == (0.02, "y", 25.0, "clips.csv")
    assert (found.motion.up, found.motion.fps) == ("y", 25.0)
    (found,) = readings(file, said_by(CALLER, 0.03, "z", 30.0))
    assert (found.unit.value, found.up.value, found.fps.value) == (0.03, "z", 30.0)
    assert {found.unit.source, found.up.source, found.fps.source} == {"the caller"}
    (motion,) = load_motions(file, unit="cm", up="z", file_fps=60.0, fps=30.0)
    np.testing.assert_array_equal(motion.positions[:, 3], load_motions(file, unit="cm")[0].positions[::2, 3])


def test_who_said_it_is_kept(tmp_path):
    for name, text in {"05.asf": ASF, "05_02.amc": AMC, "clip.bvh": BVH, "walking_1.txt": BENCHMARK}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "skeleton.json").write_text(json.dumps(SKELETON | {"unit": 1}))
    np.save(tmp_path / "deep" / "b.npy", WALK.positions)
    found = {file.name: readings(file)[0] for file in motion_files(tmp_path)}
    assert {name: (r.unit.source, r.up.source, r.fps.source) for name, r in found.items()} == {
        "05_02.amc": ("the file", "the format", "the format"),
        "b.npy": ("skeleton.json", "the default", "skeleton.json"),
        "clip.bvh": ("the body's size", "the format", "the file"),
        "walking_1.txt": ("the format", "the format", "the format"),
    }


@pytest.mark.parametrize("row", ["a.bvh,ell,y", "a.bvh,cm,x", "a.bvh,0,y"])
def test_a_row_that_makes_no_sense_is_refused(tmp_path, row):
    (tmp_path / "a.bvh").write_text(BVH)
    (tmp_path / "clips.csv").write_text(f"file,unit,up\n{row}\n")
    with pytest.raises(MotionFormatError, match="clips.csv, row of a.bvh, (unit|up): found .*; expected"):
        hints(tmp_path / "a.bvh")


def test_arguments_that_make_no_sense_are_refused(tmp_path):
    (tmp_path / "a.bvh").write_text(BVH)
    units, rates = [("unit", [])], [("file_fps", 0.0), ("file_fps", float("nan"))]
    units += [("unit", True), ("unit", "furlong")]
    for name, value in (("up", ["y"]), ("up", "x"), ("skeleton", 5), ("skeleton", ["H36M17"]), *units, *rates):
        with pytest.raises(ValueError, match=f"{name} is .*; expected"):
            load_motions(tmp_path / "a.bvh", **{name: value})
    with pytest.raises(ValueError, match="source is ''; expected a path"):
        load_motions("")


def test_human36m_in_millimetres_is_refused_with_the_likely_unit(tmp_path):
    file = write_positions_3d(tmp_path / "h.npz", {"S1": {"Walking": WALK.positions * 1000}})
    with pytest.raises(MotionFormatError, match="a body of .* m in the unit of the format.*if the unit is mm.*unit="):
        load_motions(file)
    (motion,) = load_motions(file, unit="mm")
    np.testing.assert_allclose(motion.positions, WALK.positions, atol=1e-5)


def test_a_length_in_an_asf_that_does_not_fit_its_body_is_refused(tmp_path):
    (tmp_path / "05_01.amc").write_text(AMC)
    (tmp_path / "05.asf").write_text(ASF.replace("length 0.45", "length 0.045"))
    with pytest.raises(MotionFormatError, match="05_01.amc, body size: found a body of 1[0-9].* in the unit of the file.*cmu"):
        load_motions(tmp_path)
    assert load_motions(tmp_path, unit="cmu")[0].positions.shape == (2, 5, 3)


def test_a_known_skeleton_in_its_usual_unit_needs_no_word(tmp_path):
    clip = Motion(np.zeros((4, 31, 3), np.float32), 30.0, CMU, up="y")
    places = clip.positions.copy()
    for parent, joint in CMU.bones:
        places[:, joint] = places[:, parent] + [0.01, -0.2 if "f" in CMU.joints[joint] else 0.2, 0]
    tall = height(places, CMU)
    clip = replace(clip, positions=(places * (1.7 / tall)).astype(np.float32))
    for unit in ("cmu", "cm", "inch"):
        write_bvh(clip, tmp_path / "a.bvh", unit=unit)
        (again,) = load_motions(tmp_path / "a.bvh")
        assert again.skeleton == CMU and height(again.positions, CMU) == pytest.approx(1.7, rel=1e-3), unit


def cmu_tree(tall: float, scheme: int) -> Motion:
    """A body of CMU's tree under the names of one of its publications, so many units tall."""
    skeleton = tree(SCHEMES[scheme].above)
    places = np.zeros((4, len(skeleton), 3), np.float32)
    for parent, joint in skeleton.bones:
        places[:, joint] = places[:, parent] + [0, 1, 0.01 * joint]
    return Motion(places * np.float32(tall / height(places, skeleton)), 30.0, skeleton, up="y")


TALL = {30.0: "cmu", 24.0: "cmu", 67.0: "inch", 55.0: "inch", 170.0: "cm", 1.7: "m", 1700.0: "mm"}


@pytest.mark.parametrize("scheme", range(3))
@pytest.mark.parametrize(("units", "unit"), TALL.items())
def test_of_cmu_s_people_the_unit_is_told_by_names_and_size(scheme, units, unit):
    found = infer_unit((m := cmu_tree(units, scheme)).positions, m.skeleton, Path("a.bvh"))
    assert (found.value, found.source) == (UNITS[unit], "the skeleton")


@pytest.mark.parametrize(("units", "names", "message"), [
    (44.0, 0, "a person of 2.48 m if the unit is cmu or 1.12 m if the unit is inch; expected a human"),
    (67.0, None, "a person of 1.70 m if the unit is inch or 0.67 m if the unit is cm; expected a human"),
    (30.0, None, "a person of 1.69 m if the unit is cmu or 0.76 m if the unit is inch; expected a human"),
])  # fmt: skip
def test_a_unit_that_cannot_be_told_is_refused_with_both_readings(units, names, message):
    m = cmu_tree(units, names or 0)
    skeleton = m.skeleton if names is not None else replace(m.skeleton, joints=tuple(f"j{i}" for i in range(len(m.skeleton))))
    with pytest.raises(MotionFormatError, match=f"{message}.* say unit= "):
        infer_unit(m.positions, skeleton, Path("a.bvh"))


def test_size_does_not_depend_on_where_the_root_is():
    """A root on the floor under the body is tied to it by no bone."""
    skeleton = Skeleton("rooted", ("world", *H36M17.joints), (-1, *(p + 1 for p in H36M17.parents)))
    path = np.zeros((len(WALK), 1, 3), np.float32)
    far = WALK.positions + np.linspace(0, 30, len(WALK))[:, None, None]
    assert height(np.concatenate([path, far], axis=1), skeleton) == pytest.approx(height(far, H36M17), rel=1e-4)


def test_a_body_that_stands_along_another_axis_is_refused(tmp_path):
    (tmp_path / "skeleton.json").write_text(json.dumps(SKELETON | {"unit": "m"}))
    np.save(tmp_path / "a.npy", WALK.with_up("y").positions)
    told = "a.npy, up-axis: found a body that stands along y; expected z up, as the default"
    with pytest.raises(MotionFormatError, match=told):
        load_motions(tmp_path)
    (motion,) = load_motions(tmp_path, up="y")
    np.testing.assert_allclose(motion.with_up("z").positions, WALK.positions, atol=1e-6)
    (tmp_path / "skeleton.json").write_text(json.dumps(SKELETON | {"unit": "m", "up": "y"}))
    assert load_motions(tmp_path)[0].up == "y"
    np.save(tmp_path / "a.npy", -WALK.positions)
    (tmp_path / "skeleton.json").write_text(json.dumps(SKELETON | {"unit": "m"}))
    with pytest.raises(MotionFormatError, match="stands along -z; .*turn the positions"):
        load_motions(tmp_path)


def test_a_z_up_bvh_is_refused_and_once_told_its_rotations_stay_with_it(tmp_path):
    moving = WALK.with_up("y")
    write_bvh(moving, tmp_path / "y.bvh")
    (upright,) = load_motions(tmp_path / "y.bvh")
    write_bvh(replace(upright.with_up("z"), up="y"), tmp_path / "z.bvh")  # the same file as a program with z up would write it
    with pytest.raises(MotionFormatError, match=r"z.bvh, up-axis: found a body that stands along z; expected y up, .* up=z"):
        load_motions(tmp_path / "z.bvh")
    (told,) = load_motions(tmp_path / "z.bvh", up="z")
    assert told.up == "z"
    np.testing.assert_allclose(told.positions, upright.with_up("z").positions, atol=1e-5)
    for turned in (told, told.with_up("y"), told.with_up("y").turn(1.0)):
        np.testing.assert_allclose(turned.rig.positions(), turned.positions, atol=1e-5)
    np.testing.assert_allclose(told.with_up("y").positions, upright.positions, atol=1e-5)


def test_an_added_t_pose_is_found_whichever_axis_is_up():
    angles = np.array([[0.0, 0, 0], [0.1, 0, 0]])
    cross = np.array([[0.8, 1.4, 0], [-0.8, 1.4, 0], [0, 0, 0.1], [0, 1.6, 0]])
    y_up = np.stack([cross, cross + 1])
    assert starts_in_tpose(angles, y_up, "y") and not starts_in_tpose(angles, y_up, "z")
    assert starts_in_tpose(angles, y_up[..., [0, 2, 1]], "z")


def test_people_who_lie_crawl_or_tumble_are_read(tmp_path):
    (tmp_path / "skeleton.json").write_text(json.dumps(SKELETON | {"unit": "m"}))
    rolling = WALK.positions.copy()
    for frame, angle in enumerate(np.linspace(0, 6 * np.pi, len(rolling))):
        c, s = np.cos(angle), np.sin(angle)
        rolling[frame] = rolling[frame] @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
    crawling = np.roll(WALK.positions, 1, axis=-1) + np.linspace(0, 3, len(WALK))[:, None, None] * [1, 0, 0]
    for name, places in (("rolling", rolling), ("crawling", crawling)):
        np.save(tmp_path / f"{name}.npy", places.astype(np.float32))
        assert len(load_motions(tmp_path / f"{name}.npy")) == 1, name
    assert standing(crawling, H36M17, "z").share < 0.5  # which check-data reports


def test_without_names_the_longest_side_of_a_body_tells(tmp_path):
    numbered = replace(H36M17, joints=tuple(f"j{i}" for i in range(17)), name="numbered", left=(), right=(), parts={})
    found = standing(WALK.positions, numbered, "y")
    assert (found.axis, found.is_clear) == ("z", True)
    assert not standing(WALK.positions, numbered, "z").is_clear
    cube = np.random.default_rng(0).normal(size=(50, 17, 3))
    assert not any(standing(cube, numbered, up).is_clear for up in "yz")


def test_a_single_joint_is_no_body(tmp_path):
    (tmp_path / "a.bvh").write_text(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\n"
        "MOTION\nFrames: 2\nFrame Time: 0.04\n1 2 3\n4 5 6\n"
    )
    with pytest.raises(MotionFormatError, match="a.bvh, HIERARCHY: found one joint; expected at least two"):
        load_motions(tmp_path)
