"""Motions carried over to Human3.6M's 17 joints: known skeletons, and CMU's tree under each of its names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mwlib.body.motion import Motion
from mwlib.body.skeleton import CMU, H36M17, HUMANML22, MIXAMO, SCHEMES, Skeleton, is_cmu, to_h36m17, to_humanml22
from mwlib.data.collections import SKELETONS
from mwlib.data.collections.bandai_namco import BANDAI21
from mwlib.data.collections.h36m import HUMANEVA15
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.load import read_motion_file
from mwlib.data.mirroring import own_skeleton
from mwlib.data.windows import Bodies, prepare

SIDES = {"right": ("right", "r", "R"), "left": ("left", "l", "L")}


def tree(above: dict[str, str], extra: dict[str, str] | None = None) -> Skeleton:
    """A skeleton of these joints, parents first."""
    above = above | (extra or {})
    (root,) = set(above.values()) - set(above)
    names = [root]
    while len(names) <= len(above):
        names += [joint for joint, parent in above.items() if parent in names and joint not in names]
    return own_skeleton(tuple(names), (-1, *(names.index(above[name]) for name in names[1:])))


@pytest.mark.parametrize("scheme", SCHEMES, ids=["asf", "cgspeed", "daz"])
def test_each_scheme_of_cmu_is_carried_over(scheme):
    plain = tree(scheme.above)
    fingers = tree(scheme.above, {"rIndex1": scheme.joints[-1], "extra toe": scheme.joints[3]})
    for skeleton in (plain, fingers):
        picked = to_h36m17(skeleton)
        assert picked is not None and [skeleton.joints[i] for i in picked] == scheme.joints
        for (parent, child), own in zip(H36M17.bones, H36M17.joints[1:], strict=True):  # ancestors stay ancestors
            above, seen = picked[child], []
            while above >= 0:
                seen.append(above)
                above = skeleton.parents[above]
            assert picked[parent] in seen or own == "neck", own
            side = next((side for side in SIDES if own.startswith(side)), None)
            assert side is None or skeleton.joints[picked[child]].startswith(SIDES[side]), own
        clip = Motion(np.random.default_rng(0).normal(size=(5, len(skeleton), 3)), 50.0, skeleton)
        (ready,) = prepare([clip], 50.0)
        assert ready.skeleton == H36M17
        np.testing.assert_array_equal(ready.positions, clip.positions[:, picked])
        (fitted,) = Bodies(H36M17, 50.0, "z").prepare([clip])
        np.testing.assert_array_equal(fitted.positions, ready.positions)


@pytest.mark.parametrize("prefix", ["", "mixamorig:", "Character1_"])
def test_a_prefix_of_all_names_does_not_count(prefix):
    for scheme in (*SCHEMES, MIXAMO):
        plain = tree(scheme.above)
        named = replace(plain, joints=tuple(prefix + name for name in plain.joints))
        assert to_h36m17(named) == to_h36m17(plain) == [plain.joints.index(name) for name in scheme.joints]


def test_lafans_tree_with_fingers_is_carried_over_as_lafans():
    fingers = tree(MIXAMO.above, {"LeftHandIndex1": "LeftHand", "HeadTop": "Head", "LeftToeBase": "LeftFoot"})
    picked = to_h36m17(fingers)
    assert [fingers.joints[j] for j in picked] == [LAFAN1.joints[j] for j in to_h36m17(LAFAN1)]
    assert not is_cmu(fingers)


def test_names_of_another_tree_are_not_carried_over():
    scheme = SCHEMES[1]
    assert to_h36m17(tree(scheme.above | {"LeftArm": "Head"})) is None
    assert to_h36m17(Skeleton("CMU", ("root", "left_hipjoint"), (-1, 0))) is None  # a known name, but not its joints
    with pytest.raises(ValueError, match="cannot carry HUMANEVA15 over to H36M17; known: .*CMU's tree"):
        Motion(np.zeros((2, 15, 3)), 50.0, HUMANEVA15).retarget(H36M17)
    renamed = replace(CMU, joints=("hips", *CMU.joints[1:]), name="renamed")
    assert to_h36m17(renamed) is None and to_humanml22(renamed) is None, "what it says of its joints is of others"
    with pytest.raises(ValueError, match="cannot carry HUMANEVA15 over to HUMANML22; known: "):
        Motion(np.zeros((2, 15, 3)), 50.0, HUMANEVA15).retarget(HUMANML22)


@pytest.mark.parametrize("skeleton", [CMU, LAFAN1, BANDAI21], ids=lambda s: s.name)
def test_the_22_joints_lie_where_those_they_stand_for_lie(skeleton):
    """The image of a mirror image is the mirror image, and the 17 joints that both ways give are the same."""
    clip = Motion(np.random.default_rng(0).normal(size=(5, len(skeleton), 3)), 50.0, skeleton, up="y")
    carried = clip.retarget(HUMANML22)
    assert carried.skeleton == HUMANML22 and carried.positions.dtype == clip.positions.dtype and carried.rig is None
    np.testing.assert_allclose(clip.mirror().retarget(HUMANML22).positions, carried.mirror().positions, atol=1e-12)
    limbs = [H36M17.joints.index(f"{side}_{joint}") for side in ("left", "right") for joint in ("hip", "knee", "foot")]
    limbs += [H36M17.joints.index(f"{side}_{joint}") for side in ("left", "right") for joint in ("shoulder", "elbow", "wrist")]
    both, direct = carried.retarget(H36M17).positions, clip.retarget(H36M17).positions
    np.testing.assert_allclose(both[:, [0, *limbs]], direct[:, [0, *limbs]], atol=1e-12)
    shares = to_humanml22(skeleton)
    assert shares is not None and shares.shape == (22, len(skeleton)) and np.all(shares >= 0)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert len({tuple(row) for row in shares}) == 22


def test_collars_of_cmu_lie_between_thorax_and_shoulders():
    place = np.zeros((1, 31, 3))
    place[0, CMU.joints.index("left_clavicle")] = 1.0, 0.0, 0.0
    place[0, CMU.joints.index("upperback")] = 0.0, -1.0, 0.0
    carried = Motion(place, 50.0, CMU).retarget(HUMANML22).positions[0]
    np.testing.assert_allclose(carried[HUMANML22.joints.index("left_collar")], [0.4, 0, 0])
    np.testing.assert_allclose(carried[HUMANML22.joints.index("spine3")], [0, -0.5, 0])


def test_the_three_publications_of_one_body_agree(data_folder):
    """Hips, knees and ankles of one trial in ASF/AMC and BVH; Daz's proportions are another body's."""
    files = ("asfamc/01/01_01.amc.xz", "bvh/01_01.bvh.xz", "bvh/10_01.bvh.xz")
    whole, same, other = (read_motion_file(data_folder / "cmu" / name)[0].cut(0, 200) for name in files)
    for joint in ("root", "left_tibia", "right_tibia", "left_toes", "upperback"):
        at = whole.skeleton.joints.index(joint)
        np.testing.assert_allclose(whole.positions[:, at], same.positions[:, at], atol=1e-4, err_msg=joint)
    amc, bvh, daz = (clip.retarget(H36M17) for clip in (whole, same, other))
    legs = [H36M17.joints.index(f"{side}_{joint}") for side in ("left", "right") for joint in ("hip", "knee", "foot")]
    np.testing.assert_allclose(amc.positions[:, legs], bvh.positions[:, legs], atol=1e-4)
    up = daz.with_up("z").positions[..., 2].mean(axis=0)
    order = ["left_foot", "left_knee", "left_hip", "spine", "thorax", "neck", "head"]
    assert np.all(np.diff([up[H36M17.joints.index(name)] for name in order]) > 0)
    away = np.linalg.norm(daz.positions[:, [4, 11]] - daz.positions[:, [1, 14]], axis=-1).mean(axis=0)
    assert np.all((0.1 < away) & (away < 0.5))  # hips and shoulders are apart
    assert [s.name for s in SKELETONS.values() if s.h36m17] == ["BANDAI21", "CMU", "LAFAN1", "H36M17", "HUMANML22"]
