"""BVH files that are written: the same after reading, also by a reader that is not ours, and whole or not at all."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mwlib import load_motions
from mwlib.body.fitting import fit_rig
from mwlib.body.motion import Motion
from mwlib.body.skeleton import CMU, H36M17, Skeleton
from mwlib.data.collections import SKELETONS
from mwlib.data.collections.bandai_namco import BANDAI21
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.formats.asf_amc import CMU_BONES, far_ends
from mwlib.data.formats.bvh import write_bvh
from mwlib.data.formats.glb_writing import write_glb
from mwlib.data.formats.h36m import write_h36m
from mwlib.data.load import motion_files, read_motion_file
from mwlib.data.mirroring import own_skeleton
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_motions import tree_bvh

MOVES = ["Xposition", "Yposition", "Zposition"]
NAMES = ["Hips", "Left Leg", "Left Foot", "Right Leg", "Right Foot", "Chest", "Left Hand", "Right Hand"]
PARENTS = [-1, 0, 1, 0, 3, 0, 5, 5]
OFFSETS = [(3, 90, 1), (10, -5, 0), (0, -80, 3), (-10, -5, 0), (0, -80, 3), (0, 60, 0), (85, 0, 0), (-85, 0, 0)]
RNG = np.random.default_rng(0)


def angles(order: str) -> list[str]:
    return [f"{axis}rotation" for axis in order]


def bvh(channels: list[list[str]], frames=30, step="0.0166667", names=NAMES, parents=PARENTS, offsets=OFFSETS) -> str:
    """BVH text with smooth random motion; End Sites under the joints that have no children."""
    columns = []
    for own, offset in zip(channels, offsets, strict=True):
        for name in own:
            if name.endswith("rotation"):
                columns.append(RNG.uniform(-200, 200) + np.cumsum(RNG.normal(0, 6, frames)))
            else:
                columns.append(offset["XYZ".index(name[0])] + np.cumsum(RNG.normal(0, 0.5, frames)))
    return tree_bvh(names, parents, offsets, channels, np.stack(columns, axis=1), step)


def read_text(folder: Path, text: str) -> Motion:
    (folder / "given.bvh").write_text(text)
    return load_motions(folder / "given.bvh", unit="cm", up="y")[0]  # these bodies tumble


def round_trip(motion: Motion, folder: Path, **arguments) -> Motion:
    """Write, read, and check what has to come back."""
    error = write_bvh(motion, folder / "out" / "written.bvh", **arguments)
    (again,) = load_motions(folder / "out" / "written.bvh", unit=arguments.get("unit", "cm"), up="y")
    assert again.fps == pytest.approx(motion.fps, rel=1e-12)
    np.testing.assert_allclose(again.positions, motion.with_up("y").positions, atol=1e-5 + error.max)
    if motion.rig is not None:
        assert error.mean <= error.max < 1e-6
        assert again.skeleton == motion.skeleton
        assert (again.rig.skeleton, again.rig.channels) == (motion.rig.skeleton, motion.rig.channels)
        np.testing.assert_allclose(again.rig.offsets[1:], motion.rig.offsets[1:], atol=1e-8)
        alike = np.abs(np.sum(again.rig.rotations * motion.with_up("y").rig.rotations, axis=-1))
        np.testing.assert_allclose(alike, 1.0, atol=1e-6)
    return again


SIX = [MOVES + angles("ZYX")]
KINDS = {
    "zyx": SIX + [angles("ZYX")] * 7,
    "every order": [angles("YXZ") + MOVES] + [angles(o) for o in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYZ")],
    "one or two turns": SIX + [angles(o) for o in ("X", "Y", "Z", "XY", "ZX", "YZ", "ZY")],
    "positions on every joint": [MOVES + angles("ZXY")] * 8,
    "some positions, mixed up": [["Zrotation", "Xposition", "Xrotation", "Zposition", "Yrotation", "Yposition"]]
    + [["Yposition", *angles("ZYX")], *[angles("ZYX")] * 6],
    "a joint without channels": SIX + [[]] + [angles("ZYX")] * 6,
}


@pytest.mark.parametrize(("kind", "step"), [*zip(KINDS, ["0.0166667", "0.0333667", ".0083333"] * 2, strict=True)])
def test_a_file_comes_back_with_its_rate_channels_and_names(tmp_path, kind, step):
    motion = read_text(tmp_path, bvh(KINDS[kind], step=step))
    assert motion.skeleton.joints == tuple(NAMES) and len(motion.rig.skeleton) == 8 + 4
    np.testing.assert_allclose(motion.rig.positions(), motion.positions, atol=1e-6)
    assert motion.fps == {"0.0166667": 60, "0.0333667": 1 / 0.0333667, ".0083333": 120}[step]
    round_trip(motion, tmp_path)


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "inch", "cmu", 0.05])
def test_any_unit_can_be_written_and_the_metric_ones_are_told_from_the_body(tmp_path, unit):
    motion = read_text(tmp_path, bvh(KINDS["zyx"]))
    again = round_trip(motion, tmp_path, unit=unit)
    if unit in ("m", "cm", "mm"):
        (told,) = load_motions(tmp_path / "out" / "written.bvh", up="y")
        np.testing.assert_array_equal(told.positions, again.positions)


@pytest.mark.parametrize("fps", [60.0, 59.94, 23.976, 1.0, 144.0, 1000.0, 10_000.0, 2.0, 7 / 3])
def test_every_rate_comes_back(tmp_path, fps):
    round_trip(replace(read_text(tmp_path, bvh(KINDS["zyx"])), fps=fps), tmp_path)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_done_to_a_motion_can_be_written(tmp_path, kind):
    motion = read_text(tmp_path, bvh(KINDS[kind]))
    for changed in (motion.mirror(), motion.turn(2.0), motion.with_up("z"), motion.cut(3, 9)):
        round_trip(changed, tmp_path)
    between = motion.resample(47.0)
    if kind == "one or two turns":  # between two turns about the same two axes lies one about a third
        assert write_bvh(between, tmp_path / "a.bvh").max < 1e-6
        np.testing.assert_allclose(load_motions(tmp_path / "a.bvh", up="y")[0].positions, between.positions, atol=1e-5)
    else:
        round_trip(between, tmp_path)


def test_channels_that_cannot_say_it_give_way_to_all_of_their_kind(tmp_path):
    channels = [["Yposition", "Yrotation"], *[angles("ZYX")] * 7]
    motion = read_text(tmp_path, bvh(channels))
    assert round_trip(motion.turn(1.0), tmp_path).rig.channels[0] == ("yposition", "yrotation")
    tumbled = replace(motion.with_up("z"), up="y")  # lies on its back, so what was y is z
    write_bvh(tumbled, tmp_path / "a.bvh")
    (again,) = load_motions(tmp_path / "a.bvh", up="y")
    assert again.rig.channels[0] == ("xposition", "yposition", "zposition", "zrotation", "yrotation", "xrotation")
    np.testing.assert_allclose(again.positions, tumbled.positions, atol=1e-5)


def test_angles_in_the_file_do_not_jump(tmp_path):
    motion = read_text(tmp_path, bvh(KINDS["zyx"], frames=200))
    write_bvh(motion, tmp_path / "a.bvh")
    table = np.loadtxt((tmp_path / "a.bvh").read_text().split("Frame Time")[1].split("\n")[1:])
    given = np.loadtxt((tmp_path / "given.bvh").read_text().split("Frame Time")[1].split("\n")[1:])
    assert np.abs(np.diff(table[:, 3:], axis=0)).max() < 1.01 * np.abs(np.diff(given[:, 3:], axis=0)).max()


def test_the_last_joints_get_end_sites_which_other_readers_want(tmp_path):
    write_bvh(synthetic_motions(subjects=1, seconds=1.0)[0], tmp_path / "a.bvh")
    leaves = set(range(17)) - set(H36M17.parents)
    assert (tmp_path / "a.bvh").read_text().count("End Site") == len(leaves) == 5


@pytest.mark.parametrize("skeleton", SKELETONS.values(), ids=SKELETONS)
def test_positions_only_come_back_on_the_same_skeleton(tmp_path, skeleton):
    """Every known skeleton, also one whose joints a BVH file has to list in another order."""
    frames = 20
    places = np.zeros((frames, len(skeleton), 3))
    for parent, joint in skeleton.bones:
        places[:, joint] = places[:, parent] + RNG.normal(0, 0.12, 3) + np.cumsum(RNG.normal(0, 0.002, (frames, 3)), axis=0)
    motion = Motion(places.astype(np.float32), 25.0, skeleton, up="z")
    error = write_bvh(motion, tmp_path / "a.bvh", unit="m")
    (again,) = load_motions(tmp_path / "a.bvh", unit="m", up="y")
    assert again.skeleton == skeleton and again.fps == 25.0
    fitted = fit_rig(motion)
    assert tuple(error) == pytest.approx(tuple(fitted.error), abs=1e-7)
    assert error.max > 1e-3  # these bones do not keep their lengths
    np.testing.assert_allclose(again.with_up("z").positions, fitted.rig.positions(), atol=1e-5)
    away = np.linalg.norm(again.with_up("z").positions - motion.positions, axis=-1)
    assert tuple(error) == pytest.approx((away.mean(), away.max()), abs=1e-6)


def test_a_synthetic_motion_comes_back_exactly_and_in_centimetres(tmp_path):
    walk = synthetic_motions(subjects=1, seconds=2.0)[0]
    assert write_bvh(walk, tmp_path / "a.bvh").max < 1e-6
    (again,) = load_motions(tmp_path / "a.bvh")
    assert (again.skeleton, again.fps, again.name) == (H36M17, 50.0, "a")
    np.testing.assert_allclose(again.with_up("z").positions, walk.positions, atol=1e-5)


def test_asf_bones_written_as_bvh_become_the_points_of_cmu_again(tmp_path):
    names = ("root", *(n for n in CMU_BONES if n != "root"))
    parents = [CMU.parents[CMU_BONES.index(n)] for n in names]
    offsets = [tuple(v) for v in RNG.normal(0, 20, (31, 3)).round(3)]
    text = bvh([MOVES + angles("ZYX")] + [angles("ZYX")] * 30, names=names, parents=parents, offsets=offsets)
    (tmp_path / "a.bvh").write_text(text)
    (motion,) = load_motions(tmp_path / "a.bvh", unit="cm", up="y")
    assert motion.skeleton == CMU
    knee, ends = CMU.joints.index("left_femur"), [i for i, c in enumerate(motion.rig.channels) if c is None]
    assert motion.rig.skeleton.joints[motion.rig.points[knee]] == "ltibia"
    assert {motion.rig.points[CMU.joints.index(n)] for n in ("left_toes", "head", "left_thumb")} < set(ends)
    np.testing.assert_allclose(motion.rig.positions(), motion.positions, atol=1e-6)
    np.testing.assert_allclose(motion.mirror().rig.positions(), motion.mirror().positions, atol=1e-6)
    round_trip(motion, tmp_path)


def test_bones_end_at_a_child_of_neither_side_and_end_sites_pair_up():
    names = ("root", "chest", "Arm_L", "Arm_L/End", "Arm_R", "Arm_R/End", "neck", "neck/End")
    tree = own_skeleton(names, (-1, 0, 1, 2, 1, 4, 1, 6))
    assert tree.mirror.tolist() == [0, 1, 4, 5, 2, 3, 6, 7]
    assert far_ends(tree) == [0, 6, 3, 3, 5, 5, 7, 7]  # the chest's end is the neck, not the arm that is listed first


def point(name: str, parents=(-1, 0)) -> Skeleton:
    return Skeleton("points", ("a", name), parents)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"file": "a.txt"}, r"file is 'a.txt'; expected a name that ends in .bvh"),
        ({"file": "a.bvh.xz"}, "expected a name that ends in .bvh"),
        ({"unit": "mile"}, "unit is 'mile'"),
        ({"fps": 20_000.0}, "fps is 20000; expected 1 to 10000"),
        ({"skeleton": point("")}, "named ''"),
        ({"skeleton": point("two  spaces")}, "named 'two  spaces'"),
        ({"skeleton": point("brace {")}, "named 'brace {'"),
        ({"skeleton": point("line\nend")}, r"named 'line\\nend'"),
        ({"positions": np.full((4, 2, 3), np.nan)}, "a in frame 0 is not finite"),
        ({"positions": np.full((4, 2, 3), 1e6)}, "a number of the motion is 1e[+]08 in the file"),
    ],
)
def test_nonsense_is_refused_and_an_old_file_stays(tmp_path, change, message):
    motion = Motion(RNG.normal(size=(4, 2, 3)), 30.0, point("b"), up="y")
    file, unit = tmp_path / change.get("file", "a.bvh"), change.get("unit", "cm")
    file.write_text("old")
    motion = replace(motion, **{k: v for k, v in change.items() if k not in ("file", "unit")})
    with pytest.raises(ValueError, match=message):
        write_bvh(motion, file, unit=unit)
    assert file.read_text() == "old" and os.listdir(tmp_path) == [file.name]


@pytest.mark.parametrize("ending", [".bvh", ".glb", ".npz"])
def test_a_full_disk_leaves_the_old_file_and_no_half_one(tmp_path, monkeypatch, ending):
    def full(*_):
        raise OSError(28, "No space left on device")

    writers = {".bvh": write_bvh, ".glb": write_glb, ".npz": lambda motion, file: write_h36m(file, [motion])}
    file = tmp_path / f"a{ending}"
    file.write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=f"No space left on device: '{file}'"):
        writers[ending](synthetic_motions(subjects=1, seconds=0.5)[0], file)
    assert [*tmp_path.iterdir()] == [file] and file.read_bytes() == b"old"


def hierarchy(joint) -> list:
    """bvhio's joints in file order."""
    return [joint, *(below for child in joint.Children for below in hierarchy(child))]


@pytest.mark.parametrize("kind", ["zyx", "every order", "positions on every joint", "fitted"])
def test_bvhio_sees_the_same_joints(tmp_path, kind):
    bvhio = pytest.importorskip("bvhio")
    if kind == "fitted":
        motion = synthetic_motions(subjects=1, seconds=0.5)[0].with_up("y")
    else:
        text = re.sub("(Left|Right) ", r"\1", bvh(KINDS[kind], frames=10))  # bvhio takes one word of a name
        motion = read_text(tmp_path, text)
    write_bvh(motion, tmp_path / "a.bvh")
    (ours,) = load_motions(tmp_path / "a.bvh", up="y")
    container = bvhio.readAsBvh(str(tmp_path / "a.bvh"))
    assert (container.FrameCount, round(1 / container.FrameTime)) == (len(motion), round(motion.fps))
    joints = hierarchy(container.Root)
    rig = ours.rig
    moving = [j for j, c in enumerate(rig.channels) if c is not None]
    assert [j.Name for j in joints] == [rig.skeleton.joints[j] for j in moving]
    assert [tuple(c.lower() for c in j.Channels) for j in joints] == [rig.channels[j] for j in moving]
    root = bvhio.readAsHierarchy(str(tmp_path / "a.bvh"))
    for frame in (0, len(motion) - 1):
        root.loadPose(frame)
        seen = np.array([list(joint.PositionWorld) for joint, _, _ in root.layout()])
        np.testing.assert_allclose(seen / 100, rig.world()[0][frame, moving], atol=2e-6)  # bvhio computes in single precision


@pytest.mark.parametrize(
    ("folder", "skeleton"), [("lafan1", LAFAN1), ("bandai_namco", BANDAI21), ("cmu/asfamc", CMU), ("cmu/bvh", CMU)]
)
def test_real_files_come_back(tmp_path, data_folder, folder, skeleton):
    for file in motion_files(data_folder / folder)[::40]:
        (motion,) = read_motion_file(file)
        motion = motion.cut(0, min(100, len(motion)))
        assert motion.skeleton == skeleton
        round_trip(motion, tmp_path)
        error = write_bvh(replace(motion, rig=None), tmp_path / "fitted.bvh")
        assert error.mean < 0.01, file
