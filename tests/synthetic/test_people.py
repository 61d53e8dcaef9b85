"""Synthetic people: repeatable, anatomically possible, smooth with abrupt events, the same on 17 and on 22 joints."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import H36M17, HUMANML22
from mwlib.synthetic.motions import ACTIONS, synthetic_motions
from mwlib.synthetic.movements import GESTURES, MARCH, RUN, WALK, gait_pose, gesture_tracks, stand_pose

from mwlib.synthetic.person import (  # isort: skip
    ANKLES, AT, FEET, FPS, POSE, SIDES, TOES, draw_body, draw_figure, figure_positions, positions_of,
)  # fmt: skip

JOINT = {name: i for i, name in enumerate(H36M17.joints)}


@pytest.fixture(scope="module")
def motions():
    return synthetic_motions()


@pytest.fixture(scope="module")
def body():
    return draw_body(np.random.default_rng(5))


def stacked(motions, *actions):
    return np.stack([m.positions for m in motions if not actions or m.action in actions])


def acceleration(positions):
    """(..., T-2) m/s2, mean over joints, root-relative."""
    relative = positions - positions[..., :1, :]
    return np.linalg.norm(np.diff(relative, 2, axis=-3), axis=-1).mean(-1) * FPS**2


def bending(positions, joint, side):
    """Flexion of knee or elbow, radians, and the sideways axis about which a knee bends backward."""
    above, middle, below = (JOINT[f"{side}_{j}"] for j in joint)
    upper, lower = positions[..., middle, :] - positions[..., above, :], positions[..., below, :] - positions[..., middle, :]
    cross = np.cross(upper, lower)
    return np.arctan2(np.linalg.norm(cross, axis=-1), np.sum(upper * lower, axis=-1)), cross


def test_size_names_and_split(motions):
    assert 8 <= len(ACTIONS) and len(motions) == 8 * len(ACTIONS)
    assert len({m.name for m in motions}) == len(motions)
    subjects = {m.subject for m in motions}
    assert subjects == {f"P{i}" for i in range(1, 9)}
    assert 6 <= sum(m.duration for m in motions) / 60 <= 11
    assert all(m.skeleton is H36M17 and m.fps == 50 and m.up == "z" and np.isfinite(m.positions).all() for m in motions)
    assert all(np.array_equal(m.positions[0, 0, :2], [0, 0]) for m in motions)


def test_clips_depend_on_seed_subject_and_action_only():
    first, again, other = (synthetic_motions(1, 1.0, seed) for seed in (3, 3, 4))
    assert all(np.array_equal(a.positions, b.positions) for a, b in zip(first, again, strict=True))
    assert not any(np.array_equal(a.positions, b.positions) for a, b in zip(first, other, strict=True))
    few, many = synthetic_motions(1, 2.0), synthetic_motions(3, 2.0)
    assert all(np.array_equal(a.positions, b.positions) for a, b in zip(few, many[: len(few)], strict=True))


@pytest.mark.parametrize("arguments", [dict(subjects=0), dict(seconds=0.0)])
def test_impossible_sizes_are_refused(arguments):
    with pytest.raises(ValueError, match="expected at least"):
        synthetic_motions(**arguments)


def test_bones_keep_their_length_and_differ_between_bodies(motions):
    mean = {}
    for motion in motions:
        lengths = bone_lengths(motion.positions, H36M17)
        reference = mean.setdefault(motion.subject, lengths[0])
        np.testing.assert_allclose(lengths, np.broadcast_to(reference, lengths.shape), rtol=1e-6)
    bodies = np.stack(list(mean.values()))
    apart = np.linalg.norm(bodies[:, None] - bodies, axis=-1) + np.eye(len(bodies))
    assert apart.min() > 0.01
    np.testing.assert_allclose(bodies, bodies[:, H36M17.mirror[1:] - 1], rtol=1e-12)
    single = bone_lengths(motions[0].positions.astype(np.float32), H36M17)
    np.testing.assert_allclose(single, np.broadcast_to(mean["P1"], single.shape), rtol=1e-4)


def test_knees_bend_backward_and_elbows_forward_within_human_range(motions):
    positions = stacked(motions)
    for side in SIDES:
        knee, _ = bending(positions, ("hip", "knee", "foot"), side)
        assert 0.03 < knee.min() and knee.max() < np.deg2rad(150)
        elbow, _ = bending(positions, ("shoulder", "elbow", "wrist"), side)
        assert 0.03 < elbow.min() and elbow.max() < np.deg2rad(155)
        # a knee that bends backward turns the shin about the axis that points to the body's left
        left = sum(positions[..., JOINT[f"{s}_hip"], :] * k for s, k in SIDES.items())
        _, axis = bending(positions, ("hip", "knee", "foot"), side)
        assert (np.sum(left * axis, axis=-1) > 0).mean() > 0.999, side


def test_standing_pose_bends_joints_the_right_way(body):
    pose = np.zeros((1, len(POSE)))
    for side in SIDES:
        pose[:, [AT[f"{side}_knee"], AT[f"{side}_elbow"]]] = np.pi / 2
    joints = positions_of(pose, np.zeros(1), body)[0]
    for side in SIDES:
        assert joints[JOINT[f"{side}_foot"], 0] < joints[JOINT[f"{side}_knee"], 0] - 0.3
        assert joints[JOINT[f"{side}_wrist"], 0] > joints[JOINT[f"{side}_elbow"], 0] + 0.2
    assert joints[JOINT["left_hip"], 1] > 0 > joints[JOINT["right_hip"], 1]


def test_mirrored_poses_and_gestures_mirror_the_body(body):
    rng = np.random.default_rng(0)
    pose = rng.uniform(0.0, 0.8, (6, len(POSE)))
    pose[:, AT["lift"]] = 0.0
    other = {"left": "right", "right": "left"}
    swapped = [AT[n.replace(s, other[s], 1)] if (s := n.split("_")[0]) in SIDES else AT[n] for n in POSE]
    mirrored = pose[:, swapped] * [-1.0 if n.endswith(("_roll", "_yaw")) else 1.0 for n in POSE]
    heading = rng.uniform(-3, 3, 6)
    expected = positions_of(pose, heading, body)[:, H36M17.mirror] * [1, -1, 1]
    np.testing.assert_allclose(positions_of(mirrored, -heading, body), expected, atol=1e-12)
    for name in GESTURES:
        share = np.linspace(0, 1, 7)
        (left, a), (right, b) = (gesture_tracks(name, side, share) for side in ("left", "right"))
        sign = [-1.0 if POSE[i].endswith(("_roll", "_yaw")) else 1.0 for i in left]
        limbs, others = ([POSE[i].removeprefix("left_").removeprefix("right_") for i in side] for side in (left, right))
        assert limbs == others
        np.testing.assert_allclose(a, b * sign)


def test_both_sides_are_used_alike(motions):
    height = stacked(motions)[..., 2]
    for joint in ("wrist", "knee"):
        sides = [np.quantile(height[..., JOINT[f"{side}_{joint}"]], (0.05, 0.5, 0.95)) for side in SIDES]
        np.testing.assert_allclose(*sides, atol=0.12)


def test_feet_stay_on_the_floor_without_sliding_at_human_speeds(motions):
    feet = stacked(motions)[..., FEET, 2]
    assert feet.min() > -0.02
    grounded = np.array([m.action not in ("jump", "run", "stop_and_go", "switch") for m in motions])
    assert np.quantile(feet[grounded].min(-1), 0.99) < 0.04
    assert stacked(motions, "jump")[..., FEET, 2].min(-1).max() > 0.15
    positions = stacked(motions, "walk")
    root = np.linalg.norm(np.diff(positions[:, :, 0, :2], axis=1), axis=-1) * FPS
    feet = positions[:, :, FEET]
    speed = np.linalg.norm(np.diff(feet[..., :2], axis=1), axis=-1) * FPS
    stance = np.maximum(feet[:, 1:, :, 2], feet[:, :-1, :, 2]) < 0.01
    assert np.median(speed[stance]) < 0.02 and np.quantile(speed[stance], 0.9) < 0.1 * np.median(root)
    assert 0.7 < np.median(root) < 1.6 and root.max() < 2.5
    assert np.linalg.norm(positions[:, -1, 0] - positions[:, 0, 0], axis=-1).min() > 2.5
    positions = stacked(motions)
    relative = positions - positions[:, :, :1]
    speed = np.linalg.norm(np.diff(relative, axis=1), axis=-1) * FPS
    assert speed.max() < 15 and np.median(speed) > 0.02
    root = np.linalg.norm(np.diff(positions[:, :, 0], axis=1), axis=-1) * FPS
    assert root.max() < 6


def test_gaits_swing_arms_against_legs_at_their_speeds(body):
    time = np.arange(100) / FPS
    speed = {}
    for name, gait in (("march", MARCH), ("walk", WALK), ("run", RUN)):
        pose = gait_pose(gait, body, gait.cadence * time)
        positions = positions_of(pose, np.zeros(100), body)
        speed[name] = (positions[-1, 0, 0] - positions[0, 0, 0]) / time[-1]
        assert abs(speed[name] - gait.cadence * gait.stride * body.leg * body.stride) < 0.12
    assert speed["march"] < 0.3 < speed["walk"] < 2.0 < speed["run"] < 4.0
    assert pose[:, AT["lift"]].max() > 0.05
    pose = gait_pose(WALK, body, np.linspace(0, 1, 50, endpoint=False))
    for side in SIDES:
        assert np.corrcoef(pose[:, AT[f"{side}_arm_flex"]], pose[:, AT[f"{side}_hip_flex"]])[0, 1] < -0.8
    assert np.corrcoef(pose[:, AT["left_hip_flex"]], pose[:, AT["right_hip_flex"]])[0, 1] < -0.7


def test_walking_is_smooth_and_switching_abrupt(motions):
    smooth = acceleration(stacked(motions, "walk"))
    assert (smooth.max(-1) < 5 * np.median(smooth, axis=-1)).all()
    abrupt = acceleration(stacked(motions, "switch", "stop_and_go"))
    assert np.quantile(abrupt, 0.99) > 4 * np.median(abrupt)
    assert (abrupt.max(-1) > smooth.max()).mean() > 0.7


def test_one_history_has_several_futures(motions):
    history, total = 25, 125
    clips = [m.root_relative() for m in motions if m.subject in ("P7", "P8")]
    windows = np.stack([c[s : s + total] for c in clips for s in range(0, len(c) - total + 1, 25)])
    last, future = windows[:, history - 1], windows[:, history::10].astype(np.float32)
    near = np.linalg.norm(last[:, None] - last, axis=-1) < 0.5
    apart = np.linalg.norm(future[:, None] - future, axis=-1).mean(-1) > 0.5
    assert (near.sum(1) > 1).mean() > 0.8
    assert ((near & apart).sum(1) >= 2).mean() > 0.5


RATE = 40.0
JOINT22 = {name: joint for joint, name in enumerate(HUMANML22.joints)}


@pytest.fixture(scope="module")
def figure():
    return draw_figure(np.random.default_rng(3))


def walking(figure, gait=WALK, heading=0.0, seconds=3.0):
    time = np.arange(int(seconds * RATE)) / RATE
    pose = gait_pose(gait, figure.body, gait.cadence * time)
    return figure_positions(pose, heading * time, figure, RATE)


def test_a_standing_body_has_its_left_at_plus_x_while_it_faces_plus_z(figure):
    joints = figure_positions(np.tile(stand_pose(), (3, 1)), np.zeros(3), figure, RATE)[1]
    for left, right in zip(HUMANML22.left, HUMANML22.right, strict=True):
        assert joints[left, 0] > 0.02 and joints[right, 0] < -0.02
        np.testing.assert_allclose(joints[left] * [-1, 1, 1], joints[right], atol=1e-9)
    assert (joints[TOES, 2] > joints[ANKLES, 2] + 0.08).all()
    np.testing.assert_allclose(joints[TOES, 1], 0.0, atol=1e-12)
    height = {name: joints[joint, 1] for name, joint in JOINT22.items()}
    spine = [height[name] for name in ("left_hip", "pelvis", "spine1", "spine2", "spine3", "left_collar", "neck", "head")]
    assert spine == sorted(spine) and 1.35 < height["head"] < 1.75
    assert height["left_wrist"] < height["left_elbow"] < height["left_shoulder"] < height["neck"]


def test_bones_keep_their_length(figure):
    pose = np.random.default_rng(0).uniform(-0.5, 0.9, (20, len(POSE)))
    heading = np.linspace(-3, 5, 20)
    lengths = bone_lengths(figure_positions(pose, heading, figure, RATE), HUMANML22)
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
            new = many[:, JOINT22[f"{side}_{end}"]] - many[:, JOINT22[f"{side}_{a}"]]
            np.testing.assert_allclose(new, old[:, [1, 2, 0]], atol=1e-9)


def test_feet_of_walkers_stand_and_push_off(figure):
    joints = walking(figure)
    toes = joints[:, TOES]
    assert abs(toes[..., 1].min()) < 1e-9
    ankle_rest = -figure.offsets[TOES[0], 2]
    stands = (joints[:, ANKLES, 1] < ankle_rest + 0.004) & (toes[..., 1] < 0.004)
    assert 0.3 < stands.mean() < 0.7
    step = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=-1) * RATE
    assert np.quantile(step[stands[1:] & stands[:-1]], 0.9) < 0.15
    assert joints[-1, 0, 2] - joints[0, 0, 2] > 2.0
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
    rate = np.diff(angle, axis=0) * RATE
    assert np.abs(rate[stands[1:] & stands[:-1]]).max() < 1e-6
    assert 0.6 < (angle[-1] - angle[0]).mean() / (len(joints) / RATE) < 1.1  # turns to the left all the same


def test_in_flight_the_body_travels_as_told(figure):
    pose = np.tile(stand_pose(), (10, 1))
    travel = np.stack([np.linspace(0, 1, 10), np.linspace(0, 0.2, 10)], axis=-1)
    still, moved = (figure_positions(pose, np.zeros(10), figure, RATE, t) for t in (0.0, travel[:, None]))
    np.testing.assert_allclose((moved - still)[-1], np.tile([0.2, 0.0, 1.0], (22, 1)), atol=1e-12)
