"""Two motions of one body: told from two bodies, one brought to where the other ends, and both as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from mwlib.body.joining import ROUGHLY, aligned, check_one_body, joined
from mwlib.body.kinematics import bone_lengths, heading
from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17, Skeleton
from tests.body.sample import PREFIX, animators_motion, rigged
from tests.body.test_rig import on_the_floor
from tests.inbetweening.sample import lafan_motion


def longer(motion: Motion, name: str, by: float) -> Motion:
    """The same motion with a longer bone to one joint."""
    joint = motion.rig.skeleton.joints.index(PREFIX + name)
    offsets = motion.rig.offsets.copy()
    offsets[joint] *= 1 + by / np.linalg.norm(offsets[joint])
    return rigged(motion, offsets=offsets)


def test_one_body_in_two_clips_is_one():
    one, other = animators_motion(), animators_motion(seed=1)
    check_one_body(one, other)
    check_one_body(one, longer(other, "LeftLeg", 0.004))
    elsewhere = replace(other.rig, offsets=np.concatenate([other.rig.offsets[:1] + 1, other.rig.offsets[1:]]))
    check_one_body(one, replace(other, rig=elsewhere))  # the root's place at rest is no bone
    shrugging = animators_motion(bend=2.0, seed=1).retarget(H36M17)
    spans = [np.median(bone_lengths(m.positions, H36M17), axis=0) for m in (shrugging, one.retarget(H36M17))]
    assert np.abs(spans[0] - spans[1]).max() > 1.5 * ROUGHLY
    check_one_body(one.retarget(H36M17), shrugging)  # shoulders that shrug make no other body
    check_one_body(one.retarget(H36M17), lafan_motion())  # nothing to compare


def test_another_body_is_refused_with_what_differs():
    one = animators_motion()
    told = (
        "start and end are of different bodies: from mixamorig:LeftUpLeg to mixamorig:LeftLeg it is 0.435 m in start and "
        "0.455 m in end; expected bones of the same length"
    )
    with pytest.raises(ValueError, match=told):
        check_one_body(one, longer(one, "LeftLeg", 0.02))
    with pytest.raises(ValueError, match="only end has Head under Neck; expected the same joints .52 are not"):
        check_one_body(one, lafan_motion())
    tree = one.rig.skeleton
    more = Skeleton("more", (*tree.joints, "tail"), (*tree.parents, 0))
    rig = replace(
        one.rig, skeleton=more, offsets=np.concatenate([one.rig.offsets, [[0, 0, 0.1]]]), channels=(*one.rig.channels, ()),
        rotations=np.concatenate([one.rig.rotations, np.tile(np.float32([1, 0, 0, 0]), (25, 1, 1))], axis=1),
    )  # fmt: skip
    with pytest.raises(ValueError, match="different bodies: only end has tail under mixamorig:Hips; expected the same joints"):
        check_one_body(one, replace(one, rig=rig))
    with pytest.raises(ValueError, match="_hip to .*_knee it is 0.435 m in start and 0.522 m in end"):
        check_one_body(*(replace(animators_motion(size=size).retarget(H36M17)) for size in (1.0, 1.2)))


@pytest.mark.parametrize("up", ["y", "z"])
def test_aligned_it_begins_where_the_other_ends_and_is_the_same_motion(up):
    to, motion = animators_motion().with_up(up), animators_motion(seed=1).turn(2.0).with_up(up)
    moved = aligned(motion, to)
    faces = [heading(torch.from_numpy(m.root_relative()[n]), m.skeleton, up) for m, n in ((moved, 0), (to, -1))]
    assert abs(faces[0] - faces[1]) < 1e-5
    vertical = {"y": 1, "z": 2}[up]
    floor = [axis for axis in range(3) if axis != vertical]
    np.testing.assert_allclose(moved.positions[0, 0, floor], to.positions[-1, 0, floor], atol=1e-5)
    np.testing.assert_allclose(moved.positions[..., vertical], motion.positions[..., vertical], atol=1e-6)
    spans = [np.linalg.norm(m.positions[-1] - m.positions[0, 3], axis=-1) for m in (moved, motion)]
    np.testing.assert_allclose(*spans, atol=1e-5)
    np.testing.assert_allclose(moved.rig.positions(), moved.positions, atol=1e-5)


def test_joined_they_follow_each_other_on_the_rig_of_the_first():
    one, other = animators_motion(5), animators_motion(7, seed=1)
    both = joined(one, other)
    np.testing.assert_allclose(both.positions, np.concatenate([one.positions, other.positions]), atol=1e-6)
    np.testing.assert_allclose(both.rig.positions(), both.positions, atol=1e-6)
    assert both.rig.channels == one.rig.channels and len(both) == 12
    floor = on_the_floor()
    np.testing.assert_allclose(joined(floor.cut(0, 4), floor.cut(4, 12)).positions, floor.positions, atol=1e-6)
    fixed = rigged(floor.cut(4, 12), moves=None)  # no places of its own for each joint
    np.testing.assert_allclose(joined(floor.cut(0, 4), fixed).positions[4:], fixed.positions, atol=1e-6)
    with pytest.raises(ValueError, match="animated has positions only; expected rotations"):
        joined(one, replace(other, rig=None))
