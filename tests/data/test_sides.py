"""Left and right by name, under the schemes that people use; and no mirroring where they do not pair up."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
import torch

from mwlib import Motion, load_motions
from mwlib.body.skeleton import H36M17, HUMANML22, Skeleton
from mwlib.data.mirroring import own_skeleton, paired, unmirrored
from mwlib.data.windows import TrainingWindows
from mwlib.synthetic.motions import synthetic_motions

# Joints in the middle, then the left ones, whose right ones are spelt as the second pattern says.
FINGERS = [f"{finger}{i}" for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky") for i in (1, 2, 3)]
LIMBS = ["Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase"]
SCHEMES = {
    "Mixamo": (
        ["Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", "HeadTop_End"],
        "mixamorig:{}", ("Left{}", "Right{}"), [*LIMBS, "Toe_End", *(f"Hand{f}" for f in FINGERS), "Eye"],
    ),
    "Biped": (
        ["Bip01", "Bip01 Pelvis", "Bip01 Spine", "Bip01 Spine1", "Bip01 Neck", "Bip01 Head", "Bip01 HeadNub", "Bip01 Footsteps"],
        "Bip01 {}", ("L {}", "R {}"),
        ["Thigh", "Calf", "Foot", "Toe0", "Toe0Nub", "Clavicle", "UpperArm", "Forearm", "Hand", "Finger0", "Finger0Nub"],
    ),
    "VRM": (
        [f"J_Bip_C_{name}" for name in ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head")],
        "J_Bip_{}", ("L_{}", "R_{}"),
        ["UpperLeg", "LowerLeg", "Foot", "ToeBase", "Shoulder", "UpperArm", "LowerArm", "Hand", "Little1", "Thumb3"],
    ),
    "VRM's hair": (["J_Adj_C_Head", "J_Sec_Hair1_01"], "J_Adj_{}", ("L_{}", "R_{}"), ["FaceEye"]),
    "Rigify": (
        ["spine", "spine.001", "spine.006", "face", "lip.T", "tongue"],
        "{}", ("{}.L", "{}.R"), ["thigh", "shin", "foot", "toe", "shoulder", "upper_arm", "forearm", "hand", "palm.01", "lip.T"],
    ),
    "Rigify's bones that deform": (
        ["DEF-spine", "DEF-spine.001"],
        "DEF-{}", ("{}.L.001", "{}.R.001"), ["thigh", "shin", "upper_arm", "forearm", "hand", "f_index.01"],
    ),
    "Blender's underscores": (["hips", "lower_spine"], "{}", ("{}_L", "{}_R"), ["thigh", "shin", "upper_arm", "lower_arm"]),
    "Unreal": (
        ["root", "pelvis", "spine_01", "spine_05", "neck_01", "head", "ik_foot_root", "ik_hand_root", "ik_hand_gun"],
        "{}", ("{}_l", "{}_r"),
        ["thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand", "index_01", "ik_foot", "ik_hand",
         "thigh_twist_01", "lowerarm_twist_01", "clavicle_pec"],
    ),
    "Unreal's twists": (["pelvis"], "{}", ("{}_l_01", "{}_r_01"), ["thigh", "calf_twist", "upperarm"]),
    "CMU's ASF": (
        ["root", "lowerback", "upperback", "thorax", "lowerneck", "upperneck", "head"],
        "{}", ("l{}", "r{}"),
        ["hipjoint", "femur", "tibia", "foot", "toes", "clavicle", "humerus", "radius", "wrist", "hand", "fingers", "thumb"],
    ),
    "cgspeed": (
        ["Hips", "LowerBack", "Spine", "Spine1", "Neck", "Neck1", "Head"], "{}", ("Left{}", "Right{}"), [*LIMBS, "FingerBase"],
    ),
    "cgspeed's short ones": (["LowerBack"], "{}", ("L{}", "R{}"), ["HipJoint", "Fingers", "Thumb"]),
    "Daz": (
        ["hip", "abdomen", "chest", "neck", "head"],
        "{}", ("l{}", "r{}"), ["Buttock", "Thigh", "Shin", "Foot", "Collar", "Shldr", "ForeArm", "Hand", "Thumb1", "Pinky3"],
    ),
    "Daz's eyes": (["head"], "{}", ("left{}", "right{}"), ["Eye"]),
    "SMPL": (
        ["Pelvis", "Spine1", "Spine2", "Spine3", "Neck", "Head"],
        "{}", ("L_{}", "R_{}"), ["Hip", "Knee", "Ankle", "Foot", "Collar", "Shoulder", "Elbow", "Wrist", "Hand"],
    ),
    "HumanML3D": (
        ["pelvis", "spine1", "spine2", "spine3", "neck", "head"],
        "{}", ("left_{}", "right_{}"), ["hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist"],
    ),
    "Bandai-Namco": (["Hips", "Spine", "Chest"], "{}", ("{}_L", "{}_R"), ["Shoulder", "UpperArm", "LowerArm", "Toes"]),
    "elbows as one word": (["neck"], "{}", ("L{}", "R{}"), ["elbow", "wrist", "knee"]),
    "letters last": (["hip", "neck"], "{}", ("{}L", "{}R"), ["foot", "hand", "Leg"]),
    "capitals": (["HIPS", "NECK"], "{}", ("LEFT_{}", "RIGHT_{}"), ["HIP", "LEG"]),
}  # fmt: skip


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("first", ["left", "right"])
def test_each_scheme_pairs_all_of_its_sides_and_nothing_else(name, first):
    middle, whole, sides, limbs = SCHEMES[name]
    left, right = ([whole.format(side.format(limb)) for limb in limbs] for side in sides)
    joints = (*middle, *(left + right if first == "left" else right + left))
    found = [(joints[a], joints[b]) for a, b in zip(*paired(joints), strict=True)]
    assert sorted(found) == sorted(zip(left, right, strict=True))


@pytest.mark.parametrize("joints", [
    "root lowerback upperback ribs shoulder", "pelvis L1 L2 R1 R2 lumbar", "root Lelbow elbow relbow", "root left_hand",
    "root Roll Lower spine_lower spine_roll clavicle cravicle",
])  # fmt: skip
def test_likeness_alone_makes_no_pair(joints):
    """Nor vertebrae and ribs."""
    assert paired(tuple(joints.split())) == ((), ())


def test_a_skeleton_file_without_sides_is_paired_by_its_names(tmp_path):
    joints = ["middle", "hand_l", "hand_r", "top"]
    tree = {"name": "own", "joints": joints, "parents": [-1, 0, 0, 0], "fps": 25, "unit": "m", "up": "y"}
    (tmp_path / "skeleton.json").write_text(json.dumps(tree))
    np.save(tmp_path / "a.npy", np.array([[[0, 0.9, 0], [1.2, 0.9, 0], [-1.2, 0.9, 0], [0, 1.8, 0]]] * 3))
    assert (load_motions(tmp_path)[0].skeleton.left, load_motions(tmp_path)[0].skeleton.right) == ((1,), (2,))
    (tmp_path / "skeleton.json").write_text(json.dumps(tree | {"left": [], "right": []}))
    assert load_motions(tmp_path)[0].skeleton.left == ()  # said, so believed


WALK = synthetic_motions(subjects=1, seconds=3.0)[0]


def walk_as(skeleton: Skeleton, *more: np.ndarray) -> Motion:
    places = np.concatenate([WALK.positions, *(place[:, None] for place in more)], axis=1)
    return replace(WALK, positions=places, skeleton=skeleton)


def test_a_body_without_pairs_is_not_mirrored_and_a_word_says_so():
    bare = walk_as(replace(H36M17, left=(), right=(), name="bare"))
    with pytest.warns(UserWarning, match="training does not mirror: no joint of bare has a left or right partner. Names like"):
        plain = TrainingWindows([bare], 40, "uniform", "heading_mirror")
    turned = TrainingWindows([bare], 40, "uniform", "heading")
    one, other = (source.draw(16, torch.Generator().manual_seed(1)) for source in (plain, turned))
    torch.testing.assert_close(one, other, rtol=0, atol=0)


def test_a_body_paired_in_part_is_not_mirrored_either():
    legs = replace(H36M17, left=(11, 12, 13), right=(14, 15, 16), name="arms")
    assert unmirrored([walk_as(legs)]) == (
        "right_hip, right_knee, right_foot, left_hip, left_knee, left_foot of arms are off the middle without a partner"
    )
    sword = Skeleton("fencer", (*H36M17.joints, "sword"), (*H36M17.parents, 16), H36M17.left, H36M17.right)
    assert unmirrored([walk_as(sword, WALK.positions[:, 16] + 0.5)]) == "sword of fencer is off the middle without a partner"
    with pytest.warns(UserWarning, match="does not mirror: sword of fencer"):
        assert TrainingWindows([walk_as(sword, WALK.positions[:, 16])], 40, "uniform", "heading_mirror").augment == "heading"


def test_a_whole_body_is_mirrored_without_a_word():
    own = own_skeleton(H36M17.joints, H36M17.parents)
    hat = Skeleton("hat", (*own.joints, "hat"), (*own.parents, 10), own.left, own.right)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for motion in (WALK, walk_as(own), walk_as(hat, WALK.positions[:, 10] + [0, 0, 0.1])):
            assert unmirrored([motion]) == ""
            source = TrainingWindows([motion], 40, "uniform", "heading_mirror")
            assert source.augment == "heading_mirror"
    assert HUMANML22.left and set(paired(HUMANML22.joints)[0]) == set(HUMANML22.left)


def test_no_real_performer_is_taken_for_lopsided(data_folder):
    for name in ("cmu/bvh/10_01.bvh.xz", "cmu/bvh/94_13.bvh.xz"):
        assert unmirrored(load_motions(data_folder / name)) == ""
