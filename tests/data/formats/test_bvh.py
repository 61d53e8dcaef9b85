"""BVH: forward kinematics against an independent one, units, rates, quirks, and files that are no good."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mwlib import MotionFormatError, load_motions
from mwlib.body.kinematics import bone_lengths
from mwlib.data.collections.bandai_namco import BANDAI21
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.formats.bvh import CGSPEED_PARENTS
from tests.sample_motions import BVH, tree_bvh


def read(folder: Path, text: str | bytes, **arguments: object):
    file = folder / "clip.bvh"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    (motion,) = load_motions(file, **arguments)
    return motion


def test_joints_stand_where_a_frame_by_frame_calculation_puts_them(tmp_path):
    motion = read(tmp_path, BVH, unit="cm")
    first = [float(w) for w in BVH.split("\n1 90")[1].split("\n")[0].split()]
    hips = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True)
    chest = hips * Rotation.from_euler("YXZ", [7, 8, 9], degrees=True)
    root = np.array([1, 90, 2])
    top = root + hips.apply([0, 60, 0])
    expected = [
        root,
        root + hips.apply([10, -80, 0]),
        root + hips.apply([-10, -80, 0]),
        top,
        top + chest.apply([85, 0, 0]),
        top + chest.apply([-85, first[14], 0]),  # its Yposition replaces the offset
    ]
    np.testing.assert_allclose(motion.positions[0], np.array(expected) / 100, atol=1e-6)
    assert motion.up == "y"
    assert motion.positions.dtype == np.float32


def scaled(scale: float) -> str:
    """The stick figure, every length times `scale`."""
    head, numbers = BVH.split("MOTION\n")
    lines = [
        f"OFFSET {' '.join(str(float(w) * scale) for w in line.split()[1:])}" if "OFFSET" in line else line
        for line in head.split("\n")
    ]
    rows = [row.split() for row in numbers.split("\n")[2:5]]
    for row in rows:
        for i in (0, 1, 2, 16):
            row[i] = str(float(row[i]) * scale)
    return "\n".join(lines) + "MOTION\n" + "\n".join([*numbers.split("\n")[:2], *map(" ".join, rows)])


@pytest.mark.parametrize("metres", [1, 0.01, 0.001])
def test_a_metric_unit_follows_from_the_size_of_the_body(tmp_path, metres):
    expected = read(tmp_path, BVH, unit=0.01).positions
    np.testing.assert_allclose(read(tmp_path, scaled(0.01 / metres)).positions, expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("metres", "one", "other"), [(0.0254 / 0.45, "1.60 m if the unit is cmu", "0.72 m if the unit is inch"),
                                 (0.0254, "1.60 m if the unit is inch", "0.63 m if the unit is cm")]
)  # fmt: skip
def test_a_unit_is_never_chosen_out_of_two(tmp_path, metres, one, other):
    text = scaled(0.01 / metres)
    with pytest.raises(MotionFormatError, match=f"{one} or {other}; expected .* say unit="):
        read(tmp_path, text)
    np.testing.assert_allclose(read(tmp_path, text, unit=metres).positions, read(tmp_path, BVH).positions, rtol=1e-5)


def test_a_child_in_centimetres_is_no_adult_in_inches_and_a_hand_nobody(tmp_path):
    child = read(tmp_path, scaled(1.05 / 1.6))
    np.testing.assert_allclose(child.positions, read(tmp_path, BVH).positions * 1.05 / 1.6, rtol=1e-5)
    for small in (0.9 / 1.6, 0.18 / 1.6):  # 0.9 m, or 2.3 m in inches; a hand, or a child in CMU's units
        with pytest.raises(MotionFormatError, match="body size.*if the unit is .*unit="):
            read(tmp_path, scaled(small))


def test_a_body_of_no_known_unit_needs_one(tmp_path):
    giant = BVH.replace("-80", "-80000000")
    with pytest.raises(MotionFormatError, match="up to"):
        read(tmp_path, giant)
    giant = BVH.replace("-80", "-800000")
    with pytest.raises(MotionFormatError, match="body size.*unit="):
        read(tmp_path, giant)
    assert read(tmp_path, giant, unit=1e-6).positions[0, 1, 1] == pytest.approx(-0.8, abs=0.3)


@pytest.mark.parametrize(
    ("step", "fps"),
    [
        (".0083333", 120), ("+0.033333", 30), ("3.33333e-02", 30), ("+833.333E-5", 120), ("3e-2", 30), ("3.35e-2", 1 / 0.0335),
        ("0.00833333", 120), ("0.03", 30), ("0.006", 180), ("0.017", 60), ("0.033", 30), ("0.02", 50), ("0.008", 125),
        ("0.033333", 30), ("0.0333667", 29.97), ("0.0166667", 60), ("0.04", 25), ("1", 1),
    ],
)  # fmt: skip
def test_the_frame_time_stands_for_a_whole_rate_if_its_digits_allow(tmp_path, step, fps):
    found = read(tmp_path, BVH.replace(".0083333", step)).fps
    assert found == fps or (fps != round(fps) and found == pytest.approx(fps, rel=1e-5))


def test_line_ends_and_byte_order_mark_do_not_matter(tmp_path):
    expected = read(tmp_path, BVH).positions
    np.testing.assert_array_equal(read(tmp_path, BVH.replace("\n", "\r\n")).positions, expected)
    np.testing.assert_array_equal(read(tmp_path, b"\xef\xbb\xbf" + BVH.encode()).positions, expected)


def test_an_unknown_skeleton_is_named_by_its_structure_and_paired_by_its_names(tmp_path):
    one = read(tmp_path, BVH).skeleton
    other = read(tmp_path, BVH.replace("Chest", "Torso")).skeleton
    assert one.name == read(tmp_path, BVH.replace("OFFSET 10 -80", "OFFSET 11 -80")).skeleton.name != other.name
    assert [(one.joints[a], one.joints[b]) for a, b in zip(one.left, one.right, strict=True)] == [
        ("LeftLeg", "RightLeg"),
        ("LeftHand", "RightHand"),
    ]
    daz = (
        BVH.replace("LeftLeg", "lShin").replace("RightLeg", "rShin").replace("LeftHand", "Hand_L").replace("RightHand", "Hand_R")
    )
    assert len(read(tmp_path, daz).skeleton.left) == 2


ANGLES = ["Zrotation", "Yrotation", "Xrotation"]
MOVES = ["Xposition", "Yposition", "Zposition"]
CGSPEED = (
    "Hips LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase RHipJoint RightUpLeg RightLeg RightFoot RightToeBase LowerBack Spine "
    "Spine1 Neck Neck1 Head LeftShoulder LeftArm LeftForeArm LeftHand LeftFingerBase LFingers LThumb RightShoulder RightArm "
    "RightForeArm RightHand RightFingerBase RFingers RThumb"
).split()


def cgspeed(rows: np.ndarray) -> str:
    """A cgspeed file whose joints lie where a T-pose has them, in CMU units."""
    offsets = np.zeros((31, 3))
    for name, offset in {
        "LeftUpLeg": (2, -2, 0), "LeftLeg": (0, -7, 0), "LeftFoot": (0, -7, 0), "LeftToeBase": (0, 0, 2),
        "RightUpLeg": (-2, -2, 0), "RightLeg": (0, -7, 0), "RightFoot": (0, -7, 0), "RightToeBase": (0, 0, 2),
        "Spine": (0, 2, 0), "Spine1": (0, 2, 0), "Neck1": (0, 2, 0), "Head": (0, 2, 0), "LeftArm": (3, 0, 0),
        "LeftForeArm": (5, 0, 0), "LeftHand": (4, 0, 0), "RightArm": (-3, 0, 0), "RightForeArm": (-5, 0, 0),
        "RightHand": (-4, 0, 0),
    }.items():  # fmt: skip
        offsets[CGSPEED.index(name)] = offset
    return tree_bvh(CGSPEED, CGSPEED_PARENTS, offsets, [MOVES + ANGLES] + [ANGLES] * 30, rows)


def test_cgspeed_files_become_the_31_points_of_cmu(tmp_path):
    motion = read(tmp_path, cgspeed(np.tile([5, 17, 3] + [0] * 93, (2, 1))), unit="cmu")
    at = {name: motion.positions[0, i] * 0.45 / 0.0254 for i, name in enumerate(motion.skeleton.joints)}
    assert motion.skeleton.name == "CMU"
    expected = {
        "root": (5, 17, 3), "left_hipjoint": (7, 15, 3), "left_femur": (7, 8, 3), "left_tibia": (7, 1, 3), "left_foot": (7, 1, 5),
        "left_toes": (7, 2, 7), "right_foot": (3, 1, 5), "lowerback": (5, 19, 3), "upperback": (5, 21, 3), "thorax": (5, 21, 3),
        "lowerneck": (5, 23, 3), "upperneck": (5, 25, 3), "head": (5, 26, 5), "left_clavicle": (8, 21, 3),
        "right_humerus": (-3, 21, 3), "left_radius": (17, 21, 3), "right_wrist": (-7, 21, 3), "right_thumb": (-7, 22, 5),
    }  # fmt: skip
    for name, place in expected.items():
        np.testing.assert_allclose(at[name], place, atol=1e-4, err_msg=name)


def test_an_added_t_pose_is_dropped_and_nothing_else(tmp_path):
    rows = np.tile([5.0, 17, 3] + [0.0] * 93, (4, 1))
    rows[1:, 3:] = 10.0
    rows[1:, 3 + 3 * CGSPEED.index("LeftArm")] = -80  # arms down
    rows[1:, 3 + 3 * CGSPEED.index("RightArm")] = 80
    assert len(read(tmp_path, cgspeed(rows))) == 3
    assert len(read(tmp_path, cgspeed(rows[1:]))) == 3
    rows[0, 3] = 0.01  # a recorded pose is never turned by exactly nothing
    assert len(read(tmp_path, cgspeed(rows))) == 4
    assert len(read(tmp_path, cgspeed(np.tile(rows[2:3] * 0, (3, 1))))) == 3  # someone who stands still
    lowered = np.tile([5.0, 17, 3] + [0.0] * 93, (4, 1))  # not turned, but arms down: no T-pose
    lowered[0, 3 + 3 * CGSPEED.index("LeftArm")], lowered[0, 3 + 3 * CGSPEED.index("RightArm")] = -80, 80
    lowered[1:, 3:6] = 10.0
    assert len(read(tmp_path, cgspeed(lowered))) == 4


def test_bandai_and_lafan_layouts_are_recognised(tmp_path):
    every = [MOVES + ANGLES] * 22
    offsets = np.tile([0.0, 10.0, 0.0], (22, 1))
    rows = np.tile([0.0, 0, 0, 0, 0, 0] + [0, 25, 0, 0, 0, 0] * 21, (2, 1))
    parents = [-1] + [p + 1 for p in BANDAI21.parents]
    bandai = read(tmp_path, tree_bvh(("joint_Root", *BANDAI21.joints), parents, offsets, every, rows))
    assert bandai.skeleton == BANDAI21
    np.testing.assert_allclose(bone_lengths(bandai.positions, BANDAI21), 0.25, rtol=1e-6)  # positions replace offsets
    offsets = np.tile([0.0, 25.0, 0.0], (22, 1))
    offsets[0] = 0, 90, 0
    rows = np.tile([0.0, 90, 0] + [0.0] * 66, (2, 1))
    lafan = read(tmp_path, tree_bvh(LAFAN1.joints, LAFAN1.parents, offsets, [MOVES + ANGLES] + [ANGLES] * 21, rows))
    assert lafan.skeleton == LAFAN1
    np.testing.assert_allclose(lafan.positions[:, 0], [[0, 0.9, 0]] * 2, rtol=1e-6)  # not twice as high
