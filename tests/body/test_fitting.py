"""Rotations fitted to positions: exact for rigid bones, honest about others, never jumping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from mwlib.body.fitting import fit_rig
from mwlib.body.kinematics import bone_lengths, fk
from mwlib.body.motion import Motion
from mwlib.body.skeleton import CMU, H36M17, Skeleton
from mwlib.synthetic.motions import synthetic_motions

ARM = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))


@pytest.fixture(scope="module")
def fits():
    """Clips, and what is fitted to each."""
    return [(clip, fit_rig(clip)) for clip in synthetic_motions(subjects=1, seconds=2.0)]


def rigid(skeleton: Skeleton, frames: int = 60, seed: int = 0) -> Motion:
    """A body of random bones that tumbles smoothly."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-np.pi, np.pi, (len(skeleton), 3)) * [[0.3]]
    steps = np.cumsum(rng.normal(0, 0.05, (frames, len(skeleton), 3)), axis=0)
    q = Rotation.from_rotvec((start + steps).reshape(-1, 3)).as_quat().reshape(frames, -1, 4)[..., [3, 0, 1, 2]]
    offsets, root = rng.normal(0, 0.3, (len(skeleton), 3)), np.cumsum(rng.normal(0, 0.02, (frames, 3)), axis=0)
    places, _ = fk(*(torch.from_numpy(a) for a in (q, offsets, root)), skeleton)
    return Motion(places.numpy(), 30.0, skeleton, up="y")


@pytest.mark.parametrize("skeleton", [ARM, H36M17, CMU])
@pytest.mark.parametrize("up", ["y", "z"])
def test_rigid_bones_are_found_exactly(skeleton, up):
    motion = replace(rigid(skeleton), up=up)
    rig, error = fit_rig(motion)
    assert error.max < 1e-6
    np.testing.assert_allclose(rig.positions(), motion.positions, atol=1e-6)
    lengths = np.linalg.norm(rig.offsets[1:], axis=-1)
    np.testing.assert_allclose(lengths, bone_lengths(motion.positions[0], skeleton), atol=1e-9)


def test_every_action_of_the_synthetic_people_is_found_and_goes_on_in_time(fits):
    for clip, (rig, error) in fits:
        assert error.max < 1e-6, clip.name
        assert np.sum(rig.rotations[1:] * rig.rotations[:-1], axis=-1).min() > np.cos(0.5), clip.name  # under 1 rad a frame


def test_a_motion_can_carry_what_was_fitted(fits):
    clip, (rig, _) = fits[0]
    fitted = replace(clip, rig=rig)
    np.testing.assert_allclose(fitted.mirror().rig.positions(), clip.mirror().positions, atol=1e-6)
    np.testing.assert_allclose(fitted.turn(1.0).rig.positions(), clip.turn(1.0).positions, atol=1e-6)


def test_stretched_bones_get_their_median_length_and_the_error_says_how_far_the_joints_are():
    turn = np.linspace(0, 1, 21)
    direction = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    stretch = np.where(np.arange(21) % 5 == 0, 1.3, 1.0)[:, None]  # 5 of 21 frames
    elbow = direction * stretch
    positions = np.stack([np.zeros((21, 3)), elbow, elbow + [0, 0, 0.5]], axis=1)
    rig, error = fit_rig(Motion(positions, 30.0, ARM, up="y"))
    np.testing.assert_allclose(np.linalg.norm(rig.offsets[1:], axis=-1), [1.0, 0.5], atol=1e-9)
    assert error.max == pytest.approx(0.3, abs=1e-6)
    away = np.linalg.norm(rig.positions() - positions, axis=-1)
    assert error.mean == pytest.approx(away.mean()) and error.mean > 5 / 21 * 0.3 / 3
    np.testing.assert_allclose(away[:, 1], stretch[:, 0] - 1, atol=1e-6)
    assert away[:, 2].max() < 0.3  # the wrist is aimed at from where the elbow has come to stand


def test_the_rest_pose_stands_upright_and_faces_along_z(fits):
    for _, (rig, _) in fits[:3]:
        rest, at = rig.offsets, H36M17.joints.index
        across = rest[at("left_hip")] - rest[at("right_hip")]
        assert across[0] > 0.99 * np.linalg.norm(across[[0, 2]])
        assert rest[at("spine")][1] > 0.9 * np.linalg.norm(rest[at("spine")])
        assert rest[at("left_knee")][1] < -0.5 * np.linalg.norm(rest[at("left_knee")])


def test_the_twist_does_not_jump_where_a_bone_passes_opposite_to_its_rest():
    """A bone that points one way most of the time, then sweeps past the opposite direction, not quite through it."""
    angle = np.concatenate([np.zeros(300), np.linspace(0, 2 * np.pi, 400), np.zeros(300)])
    tilt = 0.005 * np.sin(angle / 2)
    bone = np.stack([np.cos(angle), np.sin(angle) * np.cos(tilt), np.sin(tilt)], axis=-1)
    bone /= np.linalg.norm(bone, axis=-1, keepdims=True)
    still = np.tile([[0.0, 1, 0]], (1000, 1))
    body = Skeleton("body", ("a", "b", "c", "d"), (-1, 0, 1, 2))
    positions = np.stack([0 * still, still, still + bone, still + bone + [0, 0, 0.3]], axis=1)
    rig, error = fit_rig(Motion(positions, 30.0, body, up="y"))
    assert error.max < 1e-6
    assert np.sum(rig.rotations[1:] * rig.rotations[:-1], axis=-1).min() > np.cos(0.4)  # under 0.8 rad a frame


def test_children_on_one_line_have_no_twist_of_their_own():
    body = Skeleton("body", ("chest", "left", "right"), (-1, 0, 0), (1,), (2,))
    turn = np.linspace(0, 3, 50)
    line = np.stack([np.cos(turn), np.zeros(50), np.sin(turn)], axis=-1)
    positions = np.stack([np.zeros((50, 3)), line, -0.8 * line], axis=1)
    rig, error = fit_rig(Motion(positions, 30.0, body, up="y"))
    assert error.max < 1e-6
    np.testing.assert_allclose(np.abs(rig.rotations[:, 0, [1, 3]]), 0, atol=1e-5)  # turns about y and nothing else


def test_bones_without_length_do_no_harm():
    positions = rigid(CMU).positions.copy()
    hand, fingers = CMU.joints.index("left_hand"), CMU.joints.index("left_fingers")
    positions[:, fingers] = positions[:, hand]
    positions[:, CMU.joints.index("lowerneck")] = positions[:, CMU.joints.index("thorax")]
    rig, error = fit_rig(Motion(positions, 30.0, CMU, up="y"))
    assert np.isfinite(rig.rotations).all() and error.mean < 0.02


def test_a_single_frame_and_a_single_joint_will_do():
    assert fit_rig(rigid(H36M17, 1)).error.max < 1e-6
    assert fit_rig(Motion(np.ones((3, 1, 3)), 30.0, Skeleton("point", ("p",), (-1,)))).error.max < 1e-6


def test_positions_that_are_no_numbers_are_refused():
    broken = rigid(H36M17, 6)
    broken.positions[5, 9] = np.nan
    with pytest.raises(ValueError, match="position of neck in frame 5 is not finite"):
        fit_rig(broken)
