"""In-betweens as motions: poses met in the world, whatever way they stand, at whatever rate, with y or z up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mwlib.body.motion import Motion
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.inbetweening.bridge import Bridge, filled
from tests.inbetweening.sample import data_of, untrained


def pair(bridge: Bridge) -> tuple[Motion, Motion]:
    """Two poses of one body, the second a little later, turned and elsewhere."""
    motion = data_of(bridge.cfg).test[0].turn(0.9)
    return motion.cut(0, 5), motion.cut(12, 20)


@pytest.mark.parametrize("state", ["positions", "rotations"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_it_leaves_the_last_pose_and_arrives_at_the_first(state, up):
    bridge = untrained(state=state)
    start, end = (m.with_up(up) for m in pair(bridge))
    made = filled(bridge, start, end, samples=3)
    assert len(made) == 3 and all(isinstance(m, Motion) for m in made)
    for m in made:
        assert (len(m), m.up, m.fps, m.skeleton) == (8, up, 10.0, start.skeleton)
        np.testing.assert_allclose(m.positions[0], start.positions[-1], atol=1e-5)
        np.testing.assert_allclose(m.positions[-1], end.positions[0], atol=1e-5)
        assert (m.rig is not None) == (state == "rotations") and "in between" in m.name
    assert np.abs(made[0].positions - made[1].positions).max() > 1e-3


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_poses_turned_and_carried_elsewhere_give_the_same_motion_there(state):
    bridge = untrained(state=state)
    start, end = pair(bridge)
    here = filled(bridge, start, end, samples=1)[0]
    there = filled(bridge, start.turn(2.0), end.turn(2.0), samples=1)[0]
    np.testing.assert_allclose(there.positions, here.turn(2.0).positions, atol=1e-3)


def test_numbered_frames_of_a_motion():
    bridge = untrained(shortest=3, more_keyframes=1)
    motion = data_of(bridge.cfg).test[0]
    for numbers in ([4, 8, 11], (4, 11), range(6, 14, 7)):
        made = filled(bridge, motion, numbers, samples=1)[0]
        assert len(made) == numbers[-1] - numbers[0] + 1
        for n in numbers:
            np.testing.assert_allclose(made.positions[n - numbers[0]], motion.positions[n], atol=1e-5)
    assert len(filled(bridge, motion, [4, 9], frames=4, samples=1)[0]) == 6


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_a_past_is_what_was_before_the_first_keyframe(state):
    bridge = untrained(state=state, past=4, shortest=3)
    motion = data_of(bridge.cfg).test[0].turn(0.9)
    by_numbers = filled(bridge, motion, [6, 13], samples=1, seed=3)[0]
    by_poses = filled(bridge, motion.cut(0, 7), motion.cut(13, 20), 6, samples=1, seed=3)[0]
    assert len(by_numbers) == len(by_poses) == 11
    for made in (by_numbers, by_poses):
        np.testing.assert_allclose(made.positions[:4], motion.positions[3:7], atol=1e-5)
        np.testing.assert_allclose(made.positions[-1], motion.positions[13], atol=1e-5)
    np.testing.assert_allclose(by_poses.positions, by_numbers.positions, atol=1e-4)
    there = filled(bridge, motion.turn(2.0), [6, 13], samples=1, seed=3)[0]
    np.testing.assert_allclose(there.positions, by_numbers.turn(2.0).positions, atol=1e-3)


def test_a_past_at_another_rate_ends_with_the_last_frame():
    bridge = untrained(past=4)
    motion = data_of(bridge.cfg).test[0]
    fast = replace(motion, fps=20.0)
    made = filled(bridge, fast.cut(0, 12), fast.cut(20, 21), samples=1)[0]
    np.testing.assert_allclose(made.positions[:4], motion.positions[[5, 7, 9, 11]], atol=1e-5)


def test_a_past_that_is_too_short_is_refused():
    bridge = untrained(past=4)
    motion = data_of(bridge.cfg).test[0]
    for start, end, found in ((motion.cut(0, 3), motion.cut(9, 10), 3), (motion, [2, 9], 3)):
        with pytest.raises(ValueError, match=f"{found} frames at 10 Hz up to the first keyframe; expected at least 4, the past"):
            filled(bridge, start, end)


def test_what_lies_between_is_not_looked_at_and_seeds_are():
    bridge = untrained()
    motion = data_of(bridge.cfg).test[0]
    other = motion.positions.copy()
    other[5:10] += 1.0
    one, two = (filled(bridge, m, [4, 11], seed=5)[1] for m in (motion, replace(motion, positions=other)))
    np.testing.assert_array_equal(one.positions, two.positions)
    assert np.abs(filled(bridge, motion, [4, 11], seed=6)[1].positions - one.positions).max() > 1e-3


@pytest.mark.parametrize("state", ["positions", "rotations"])
@pytest.mark.parametrize("fps", [4.0, 24.0, 120.0])
def test_poses_at_another_rate_are_still_the_last_and_the_first(state, fps):
    """A motion's last frame does not fall on a frame of the model's rate; single frames have no rate at all."""
    bridge = untrained(state=state)
    start, end = (replace(m, fps=fps) for m in pair(bridge))
    made = filled(bridge, start, end, samples=1)[0]
    assert made.fps == 10.0 and len(made) == 8
    np.testing.assert_allclose(made.positions[0], start.positions[-1], atol=1e-5)
    np.testing.assert_allclose(made.positions[-1], end.positions[0], atol=1e-5)
    alone = filled(bridge, start.cut(4, 5), end.cut(0, 1), samples=1)[0]
    np.testing.assert_array_equal(alone.positions, made.positions)


def test_other_bodies_are_carried_over_or_refused():
    bridge = untrained()
    start, end = pair(bridge)
    rng = np.random.default_rng(0)
    cmu = Motion(rng.normal(size=(1, 31, 3)).astype(np.float32), 120.0, CMU, up="y")
    made = filled(bridge, cmu, cmu, samples=1)[0]
    assert made.skeleton == start.skeleton and made.up == "y"
    np.testing.assert_allclose(made.positions[0], cmu.retarget(start.skeleton).positions[0], atol=1e-5)
    other = Motion(np.zeros((1, 2, 3), np.float32), 10.0, Skeleton("arm", ("a", "b"), (-1, 0)))
    with pytest.raises(ValueError, match="the skeleton is arm .2 joints.; .*no way from one to the other is known"):
        filled(bridge, start, other)


@pytest.mark.parametrize(
    "end, frames, message",
    [
        ([3], None, "keyframes are .3. of a motion of 30 frames at 10 Hz; expected two or more, rising"),
        ([5, 3], None, "expected two or more, rising"),
        ([3, 3, 10], None, "expected two or more, rising"),
        ([-8, -1], None, "expected two or more, rising"),
        ([25, 32], None, "of a motion of 30 frames"),
        ([3, 10], 5, "frames is 5, but 6 lie between frames 3 and 10; expected None"),
        ([3, 12], None, "frames between is 8; expected 6"),
        ([3, 5, 10], None, "3 keyframes; expected at most 2"),
        (None, 0, "frames is 0; expected at least 1"),
        (None, 9, "frames between is 9; expected 6"),
    ],
)
def test_what_cannot_be_filled_is_refused(end, frames, message):
    bridge = untrained()
    motion = data_of(bridge.cfg).test[0].cut(0, 30)
    with pytest.raises(ValueError, match=message):
        filled(bridge, motion, motion if end is None else end, frames)


def test_a_model_of_rotations_needs_them():
    bridge = untrained(state="rotations")
    start, end = pair(bridge)
    with pytest.raises(ValueError, match="has positions only; expected rotations"):
        filled(bridge, start, replace(end, rig=None))
