"""A user's rig follows a model's joints: same body, poses kept, the rest interpolated, at any rate, with any channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from mwlib.body.fitting import fit_rig
from mwlib.body.following import on_rig
from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES
from mwlib.body.rotation import multiply
from mwlib.body.skeleton import H36M17, Skeleton, to_h36m17
from tests.body.sample import PREFIX, animators_motion, apart, rigged
from tests.body.test_rig import on_the_floor

# Joints whose rotations places of the 17 show, but for twists: what lies between two of these is not among them.
SHOWN = ("Hips", "Spine1", "Neck", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg", "LeftArm", "LeftForeArm", "RightArm")


def picked(motion: Motion, *frames: int) -> Motion:
    """Some of its frames."""
    return replace(motion, positions=motion.positions[list(frames)], rig=motion.rig.pick(np.array(frames)))


def column(motion: Motion, name: str) -> int:
    return motion.rig.skeleton.joints.index(PREFIX + name)


def test_all_joints_come_back_where_a_model_knows_all():
    motion = animators_motion()
    made = on_rig(replace(motion, rig=None), picked(motion, 0, 24), [0, 24])
    assert made.skeleton == motion.skeleton and made.rig.skeleton == motion.rig.skeleton and made.fps == motion.fps
    assert made.rig.channels == motion.rig.channels and np.array_equal(made.rig.offsets, motion.rig.offsets)
    np.testing.assert_allclose(made.positions, motion.positions, atol=2e-6)
    np.testing.assert_allclose(made.rig.root, motion.rig.root, atol=1e-6)


def test_seventeen_joints_come_back_from_places_of_seventeen():
    """The others stand still here, so that interpolation knows them."""
    motion = animators_motion(moving=SHOWN)
    made = on_rig(motion.retarget(H36M17), picked(motion, 0, 24), [0, 24])
    shown = to_h36m17(motion.skeleton)
    np.testing.assert_allclose(made.positions[:, shown], motion.positions[:, shown], atol=2e-6)
    away = np.linalg.norm(made.positions - motion.positions, axis=-1)
    assert 0.01 < away.max() < 0.2  # toes and fingers hang from twists that places do not show


def test_up_makes_no_difference():
    motion = animators_motion(moving=SHOWN)
    one = on_rig(motion.retarget(H36M17).with_up("z"), picked(motion, 0, 24), [0, 24])
    other = on_rig(motion.retarget(H36M17), picked(motion.with_up("z"), 0, 24), [0, 24])
    assert one.up == "y" and other.up == "z"
    np.testing.assert_allclose(other.with_up("y").positions, one.positions, atol=1e-5)


def test_poses_stay_and_what_no_model_knows_is_interpolated_between_and_held_behind():
    motion = animators_motion()
    poses = picked(motion, 0, 12)
    made = on_rig(motion.retarget(H36M17), poses, [0, 12])
    assert len(made) == 25
    assert apart(made.rig.rotations[[0, 12]], poses.rig.rotations).max() < 1e-4
    np.testing.assert_allclose(made.positions[[0, 12]], poses.positions, atol=1e-6)
    halfway = poses.rig.between(np.array([0]), np.array([1]), np.array([0.5])).rotations[0]
    for name in ("LeftHandIndex1", "LeftHandIndex2", "RightHandIndex1", "LeftArmTwist", "LeftToe", "Head"):
        joint = column(motion, name)
        assert apart(made.rig.rotations[6, joint], halfway[joint]) < 1e-3, name
        assert apart(made.rig.rotations[12:, joint], poses.rig.rotations[1, joint]).max() < 1e-3, name
        assert apart(halfway[joint], poses.rig.rotations[1, joint]) > 1, name


def test_a_shoulder_twists_so_that_the_elbow_bends_as_the_model_says():
    """The upper arm turns about itself from pose to pose and back; only the forearm's way shows it."""
    motion = animators_motion(moving=("none",))
    arm, elbow = column(motion, "LeftArm"), column(motion, "LeftForeArm")
    angle = 0.9 * np.sin(np.linspace(0, np.pi, 25))
    turns = motion.rig.rotations.astype(np.float64).copy()
    w, x, y, z = turns[:, arm].T
    cos, sin = np.cos(angle / 2), np.sin(angle / 2)  # times a turn about the bone, which lies along x
    turns[:, arm] = np.stack([w * cos - x * sin, w * sin + x * cos, y * cos + z * sin, z * cos - y * sin], axis=1)
    turns[:, elbow] = [np.cos(0.6), 0, 0, np.sin(0.6)]
    motion = rigged(motion, rotations=turns.astype(np.float32))
    made = on_rig(motion.retarget(H36M17), picked(motion, 0, 24), [0, 24])
    assert apart(made.rig.rotations, motion.rig.rotations)[:, [arm, elbow]].max() < 4  # of 52


@pytest.mark.parametrize("off, twist", [(0.05, 0.0), (0.1, 2.0)])
def test_an_arm_that_swings_past_the_half_turn_does_not_flip(off, twist):
    """A circle from pose to pose, which passes close by the opposite of where interpolation has the arm; or most of one."""
    motion = animators_motion(49, moving=("none",))
    arm = column(motion, "LeftArm")
    angle, turns = np.linspace(0, 2 * np.pi - 0.5 * twist, 49) / 2, motion.rig.rotations.astype(np.float64).copy()
    axis = np.array([np.sin(off), 0, np.cos(off)])  # the bone lies along x
    circle = torch.from_numpy(np.concatenate([np.cos(angle)[:, None], np.sin(angle)[:, None] * axis], axis=1))
    turns[:, arm] = multiply(torch.from_numpy(turns[:, arm]), circle).numpy()
    motion = rigged(motion, rotations=turns.astype(np.float32))
    made = on_rig(motion.retarget(H36M17), picked(motion, 0, 48), [0, 48])
    shown = to_h36m17(motion.skeleton)
    np.testing.assert_allclose(made.positions[:, shown], motion.positions[:, shown], atol=3e-6)
    assert apart(made.rig.rotations[[0, 48]], motion.rig.rotations[[0, 48]]).max() < 1e-4
    steps = apart(made.rig.rotations[1:, arm], made.rig.rotations[:-1, arm])
    assert steps.max() < 40, steps


@pytest.mark.parametrize("fps", [15.0, 24.0, 25.0, 120.0])
def test_it_has_the_rate_of_the_poses_and_meets_them_at_the_nearest_frame(fps):
    motion = animators_motion(moving=SHOWN)
    model, fast = motion.retarget(H36M17), motion.resample(fps)
    last = round(24 * fps / 30)
    poses = picked(fast, 0, min(last, len(fast) - 1))
    made = on_rig(model, poses, [0, 24])
    assert made.fps == fps and len(made) == last + 1
    assert apart(made.rig.rotations[[0, -1]], poses.rig.rotations).max() < 1e-4
    np.testing.assert_allclose(made.positions[[0, -1]], poses.positions, atol=1e-6)
    middle = min(last, len(fast) - 1) // 2
    shown = to_h36m17(motion.skeleton)
    assert np.abs(made.positions[middle, shown] - fast.positions[middle, shown]).max() < 0.02
    steps = np.linalg.norm(np.diff(made.positions[:, shown], axis=0), axis=-1) * fps
    true = np.linalg.norm(np.diff(motion.positions[:, shown], axis=0), axis=-1) * 30
    assert steps.max() < 1.2 * true.max()


def test_frames_before_and_behind_the_motion_are_poses_only():
    motion = animators_motion(30)
    model = motion.retarget(H36M17).cut(10, 20)
    outside = [*range(11), *range(19, 30)]
    made = on_rig(model, picked(motion, *outside), [frame - 10 for frame in outside])
    assert len(made) == 30
    np.testing.assert_allclose(made.positions[outside], motion.positions[outside], atol=1e-6)


def test_a_body_that_hangs_from_a_joint_on_the_floor_moves_by_its_hips():
    """And every joint keeps the place that its file gives it."""
    motion = on_the_floor()
    rig = motion.rig
    made = on_rig(replace(motion, rig=None), picked(motion, 0, 11), [0, 11])
    np.testing.assert_allclose(made.positions, motion.positions, atol=1e-5)
    np.testing.assert_array_equal(made.rig.root, rig.root)
    np.testing.assert_allclose(made.rig.moves[:, 2:], rig.moves[:, 2:], atol=1e-9)
    assert apart(made.rig.rotations[:, 0], rig.rotations[:, 0]).max() < 1e-4


def test_a_joint_turns_about_the_axes_of_its_channels_only():
    motion = animators_motion()
    elbow = column(motion, "LeftForeArm")
    channels = list(motion.rig.channels)
    channels[elbow] = ("zrotation",)
    turns = motion.rig.rotations.copy()
    turns[:, elbow] = [np.cos(0.3), 0, 0, np.sin(0.3)]
    hinged = rigged(motion, channels=tuple(channels), rotations=turns)
    made = on_rig(motion.retarget(H36M17), picked(hinged, 0, 24), [0, 24])  # another elbow than it can have
    assert np.abs(made.rig.rotations[:, elbow, 1:3]).max() < 1e-6 and np.ptp(made.rig.rotations[:, elbow, 3]) > 1e-3


def test_rotations_that_a_model_says_are_taken():
    motion = animators_motion()
    made = on_rig(motion, picked(motion, 0, 24), [0, 24])
    assert apart(made.rig.rotations, motion.rig.rotations).max() < 0.01
    plain = on_rig(replace(motion, rig=None), picked(motion, 0, 24), [0, 24])
    assert apart(plain.rig.rotations, motion.rig.rotations).max() > 1


def test_a_point_where_another_stands_turns_nothing_above_it():
    """As CMU's thorax stands where the bone before it ends: what a model says of the tiny way between is noise."""
    motion = animators_motion(moving=SHOWN)
    offsets = motion.rig.offsets.copy()
    offsets[column(motion, "Spine2")] = [0.001, 0, 0]
    motion = rigged(motion, offsets=offsets)
    model = motion.retarget(H36M17)
    thorax = H36M17.joints.index("thorax")
    model.positions[1:-1, thorax] += [0, 0, 0.005]
    made = on_rig(model, picked(motion, 0, 24), [0, 24])
    shown = to_h36m17(motion.skeleton)
    away = np.linalg.norm(made.positions[:, shown] - motion.positions[:, shown], axis=-1)
    assert away.max() < 0.03
    joint = column(motion, "Spine1")
    poses = picked(motion, 0, 24).rig.between(np.zeros(25, int), np.ones(25, int), np.linspace(0, 1, 25))
    assert apart(made.rig.rotations[:, joint], poses.rotations[:, joint]).max() < 1e-3


def test_seventeen_joints_themselves_are_a_body_too():
    motion = animators_motion().retarget(H36M17)
    rig = fit_rig(motion).rig
    own = replace(motion, positions=rig.positions().astype(np.float32), rig=rig)
    made = on_rig(replace(own, rig=None), picked(own, 0, 24), [0, 24])
    np.testing.assert_allclose(made.positions, own.positions, atol=2e-6)
    assert made.rig.channels[1] == ANGLES


def test_what_cannot_follow_is_refused():
    motion = animators_motion()
    model, poses = motion.retarget(H36M17), picked(motion, 0, 24)
    with pytest.raises(ValueError, match="without rotations; expected rotations, and a skeleton that stands for H36M17"):
        on_rig(model, replace(poses, rig=None), [0, 24])
    arm = Motion(np.zeros((5, 2, 3), np.float32), 30.0, Skeleton("arm", ("a", "b"), (-1, 0)))
    with pytest.raises(ValueError, match="expected rotations, and a skeleton that stands for arm"):
        on_rig(arm, poses, [0, 24])
    for at in ([0], [24, 0], [5, 5]):
        with pytest.raises(ValueError, match="for 2 poses at 30 Hz; expected a frame for each, rising"):
            on_rig(model, poses, at)
