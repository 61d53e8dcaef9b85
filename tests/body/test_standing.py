"""Feet that stand are held, feet below the floor are lifted, and legs keep their bones."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.body.kinematics import bone_lengths
from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17, Skeleton
from mwlib.body.standing import bent, legs, standing

LEG = Skeleton("leg", ("hip", "knee", "foot"), (-1, 0, 1))
FPS = 30.0


def leg(path: np.ndarray, up: str = "z", hip: np.ndarray | None = None) -> Motion:
    """Hip one metre above the path of a foot, or another one, and the knee bent along x."""
    hip = (path if hip is None else hip) * [1, 1, 0] + [0, 0, 0.9]
    knee, foot = bent(hip, hip + [0.1, 0, -0.5], hip + [0, 0, -1.0], path)
    return Motion(np.stack([hip, knee, foot], axis=1).astype(np.float32), FPS, LEG).with_up(up)


def path(*speeds: float, height: float = 0.05) -> np.ndarray:
    steps = np.array(speeds)[:, None] / FPS * [[1.0, 0.0, 0.0]]
    return np.concatenate([np.zeros((1, 3)), steps.cumsum(0)]) + [0, 0, height]


def test_legs_are_found_by_their_knees():
    names = [tuple(H36M17.joints[joint].split("_")[-1] for joint in leg) for leg in legs(H36M17)]
    assert names == [("hip", "knee", "foot")] * 2 and legs(Skeleton("arm", ("a", "b"), (-1, 0))) == []


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_low_slow_foot_is_held_and_the_rest_goes_over(up):
    slow, fast = 0.3, 2.0
    motion = leg(path(*[fast] * 8, *[slow] * 10, *[fast] * 8), up)
    made = standing(motion, 0.05).with_up("z")
    foot = made.positions[:, 2]
    assert np.ptp(foot[8:19, 0]) < 1e-5  # held
    np.testing.assert_allclose(foot[8, 0], motion.with_up("z").positions[8:19, 2, 0].mean(), atol=1e-4)
    assert np.abs(np.diff(foot, 2, axis=0)).max() < 0.08  # no jump
    assert np.abs(np.diff(foot[:8], 2, axis=0)).max() < 0.01  # nor on the way to where it is held
    np.testing.assert_array_equal(made.positions[[0, -1]], motion.with_up("z").positions[[0, -1]])
    np.testing.assert_allclose(bone_lengths(made.positions, LEG), bone_lengths(motion.positions, LEG), atol=1e-5)


@pytest.mark.parametrize("speeds, height", [([1.0] * 12, 0.05), ([0.3] * 12, 0.2)])
def test_feet_that_are_fast_or_high_are_left_alone(speeds, height):
    motion = leg(path(*[2.0] * 5, *speeds, *[2.0] * 5, height=height))
    np.testing.assert_allclose(standing(motion, 0.05).positions, motion.positions, atol=1e-5)


@pytest.mark.parametrize("speed, around, is_held", [(0.95, 8, True), (1.15, 8, False), (0.95, 1, False)])
def test_a_low_foot_that_a_walking_body_leaves_behind_is_held_but_in_brief_motions(speed, around, is_held):
    speeds = [1.5] * around + [speed] * 6 + [1.5] * around
    walking = path(*[1.5] * len(speeds)) - [0.1, 0, 0]
    foot = standing(leg(path(*speeds), hip=walking), 0.05).positions[around : around + 7, 2, 0]
    assert (np.ptp(foot) < 1e-5) == is_held


def test_a_foot_that_stands_at_a_keyframe_stands_there():
    motion = leg(path(*[0.3] * 8, *[2.0] * 8))
    foot = standing(motion, 0.05).positions[:, 2]
    np.testing.assert_allclose(foot[:9], motion.positions[[0] * 9, 2], atol=1e-5)
    slow = leg(path(*[0.3] * 8))
    made = standing(slow, 0.05).positions[:, 2]
    np.testing.assert_allclose(made[:, 0], np.linspace(0, 0.08, 9), atol=1e-5)


def test_no_foot_is_below_the_floor():
    sunk = path(*[2.0] * 12)
    sunk[3:9, 2] -= 0.1
    made = standing(leg(sunk), 0.05).positions
    assert made[:, 2, 2].min() > 0.05 - 1e-5
    other = sunk - [0, 0, 0.2]  # a keyframe lies lower than the floor that was told
    np.testing.assert_array_equal(standing(leg(other), 0.05).positions[[0, -1]], leg(other).positions[[0, -1]])


def test_a_leg_stretches_no_further_than_it_is_long_and_bends_where_it_was_straight():
    hip = np.array([[0.0, 0.0, 1.0]])
    knee, foot = bent(hip, hip - [0, 0, 0.5], hip - [0, 0, 1.0], np.array([[3.0, 0.0, 1.0]]))
    assert 0.99 < foot[0, 0] <= 1.0 and abs(np.linalg.norm(knee - hip) - 0.5) < 1e-6
    knee, foot = bent(hip, hip - [0, 0, 0.5], hip - [0, 0, 1.0], np.array([[0.0, 0.0, 0.4]]))
    np.testing.assert_allclose(foot, [[0.0, 0.0, 0.4]], atol=1e-9)
    assert abs(np.linalg.norm(knee - hip) - 0.5) < 1e-9 and abs(np.linalg.norm(knee - foot) - 0.5) < 1e-9
