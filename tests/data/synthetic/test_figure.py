"""The body on 22 joints: constant bones, feet that stand flat, and the same pose as on 17 joints."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import H36M17, HUMANML22
from mwlib.synthetic.movements import RUN, WALK, gait_pose, stand_pose
from mwlib.synthetic.person import ANKLES, AT, POSE, SIDES, TOES, draw_figure, figure_positions, positions_of

FPS = 40.0
JOINT = {name: joint for joint, name in enumerate(HUMANML22.joints)}


@pytest.fixture(scope="module")
def figure():
    return draw_figure(np.random.default_rng(3))


def walking(figure, gait=WALK, heading=0.0, seconds=3.0):
    time = np.arange(int(seconds * FPS)) / FPS
    pose = gait_pose(gait, figure.body, gait.cadence * time)
    return figure_positions(pose, heading * time, figure, FPS)


def test_a_standing_body_has_its_left_at_plus_x_while_it_faces_plus_z(figure):
    joints = figure_positions(np.tile(stand_pose(), (3, 1)), np.zeros(3), figure, FPS)[1]
    for left, right in zip(HUMANML22.left, HUMANML22.right, strict=True):
        assert joints[left, 0] > 0.02 and joints[right, 0] < -0.02
        np.testing.assert_allclose(joints[left] * [-1, 1, 1], joints[right], atol=1e-9)
    assert (joints[TOES, 2] > joints[ANKLES, 2] + 0.08).all()
    np.testing.assert_allclose(joints[TOES, 1], 0.0, atol=1e-12)
    height = {name: joints[joint, 1] for name, joint in JOINT.items()}
    spine = [height[name] for name in ("left_hip", "pelvis", "spine1", "spine2", "spine3", "left_collar", "neck", "head")]
    assert spine == sorted(spine) and 1.35 < height["head"] < 1.75
    assert height["left_wrist"] < height["left_elbow"] < height["left_shoulder"] < height["neck"]


def test_bones_keep_their_length(figure):
    pose = np.random.default_rng(0).uniform(-0.5, 0.9, (20, len(POSE)))
    heading = np.linspace(-3, 5, 20)
    lengths = bone_lengths(figure_positions(pose, heading, figure, FPS), HUMANML22)
    np.testing.assert_allclose(lengths, np.tile(lengths[0], (20, 1)), atol=1e-12)
    np.testing.assert_allclose(lengths[0], np.linalg.norm(figure.offsets[1:], axis=-1), atol=1e-12)
    assert lengths[0].min() > 0.03


def test_limbs_point_where_those_of_17_joints_do(figure):
    pose = np.random.default_rng(1).uniform(-0.3, 0.8, (5, len(POSE)))
    pose[:, [AT[name] for name in POSE if name.startswith(("spine", "pelvis"))]] = 0.0
    few, many = positions_of(pose, np.full(5, 0.7), figure.body), figure_positions(pose, np.full(5, 0.7), figure, 50.0)
    for side in SIDES:
        for a, b, end in (("hip", "knee", "knee"), ("knee", "foot", "ankle")):
            old = few[:, H36M17.joints.index(f"{side}_{b}")] - few[:, H36M17.joints.index(f"{side}_{a}")]
            new = many[:, JOINT[f"{side}_{end}"]] - many[:, JOINT[f"{side}_{a}"]]
            np.testing.assert_allclose(new, old[:, [1, 2, 0]], atol=1e-9)


def test_feet_stand_on_the_floor_and_do_not_slide(figure):
    joints = walking(figure)
    toes = joints[:, TOES]
    assert abs(toes[..., 1].min()) < 1e-9
    ankle_rest = -figure.offsets[TOES[0], 2]
    stands = (joints[:, ANKLES, 1] < ankle_rest + 0.004) & (toes[..., 1] < 0.004)
    assert 0.3 < stands.mean() < 0.7
    step = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=-1) * FPS
    assert np.quantile(step[stands[1:] & stands[:-1]], 0.9) < 0.15
    assert joints[-1, 0, 2] - joints[0, 0, 2] > 2.0


def test_toes_point_down_when_they_push_off_and_up_before_they_land(figure):
    joints = walking(figure)
    rest = figure.offsets[TOES[0], 2]
    pitch = joints[:, TOES[0], 1] - joints[:, ANKLES[0], 1] - rest  # positive: toes higher than when flat
    behind = joints[:, ANKLES[0], 2] - joints[:, 0, 2]
    assert pitch[behind < np.quantile(behind, 0.1)].mean() < -0.03
    ahead = (behind > np.quantile(behind, 0.9)) & (joints[:, ANKLES[0], 1] > -rest + 0.01)
    assert pitch[ahead].max() > 0.01


def test_a_runner_is_in_the_air_now_and_then_and_a_walker_never(figure):
    lowest = {gait.cadence: walking(figure, gait)[:, TOES, 1].min(axis=1) for gait in (WALK, RUN)}
    assert lowest[WALK.cadence].max() < 0.01 and (lowest[RUN.cadence] > 0.02).mean() > 0.1


def test_a_foot_that_stands_keeps_its_direction_while_the_body_turns(figure):
    joints = walking(figure, heading=1.0)
    foot = joints[:, TOES] - joints[:, ANKLES]
    angle = np.unwrap(np.arctan2(foot[..., 0], foot[..., 2]), axis=0)
    stands = joints[:, ANKLES, 1] < -figure.offsets[TOES[0], 2] + 0.01
    rate = np.diff(angle, axis=0) * FPS
    assert np.abs(rate[stands[1:] & stands[:-1]]).max() < 1e-6
    assert 0.6 < (angle[-1] - angle[0]).mean() / (len(joints) / FPS) < 1.1  # turns to the left all the same


def test_in_flight_the_body_travels_as_told(figure):
    pose = np.tile(stand_pose(), (10, 1))
    travel = np.stack([np.linspace(0, 1, 10), np.linspace(0, 0.2, 10)], axis=-1)
    still, moved = (figure_positions(pose, np.zeros(10), figure, FPS, t) for t in (None, travel))
    np.testing.assert_allclose((moved - still)[-1], np.tile([0.2, 0.0, 1.0], (22, 1)), atol=1e-12)
