"""Joints to features: as published, back again, and whatever must not change them."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from mwlib.body.kinematics import bone_lengths
from mwlib.data.formats.humanml import HUMANML3D, KIT, joints_of
from mwlib.data.formats.humanml_encoding import features_of, placed, with_bones

from tests.data.formats.sample_features import (  # isort: skip
    about_y, joints_of_rotations, mirrored, published_rates, slow_features, wandering,
)  # fmt: skip

LAYOUTS = pytest.mark.parametrize("layout", [HUMANML3D, KIT], ids=["HumanML3D", "KIT"])
HEADINGS = pytest.mark.parametrize("heading", ["correct", "humanml3d"])


@pytest.fixture(scope="module")
def example(data_folder):
    """Features and joints of the published example."""
    return tuple(np.load(data_folder / "humanml3d" / kind / "012314.npy") for kind in ("new_joint_vecs", "new_joints"))


@LAYOUTS
@HEADINGS
def test_every_block_agrees_with_a_slow_encoder(layout, heading):
    world = placed(wandering(30, layout), layout)
    found, slow = features_of(world, layout, heading), slow_features(world, layout, heading)
    assert found.dtype == np.float32 and found.shape == (29, layout.width)
    size = np.abs(world).max()
    for name, block in layout.blocks.items():
        atol = 1e-5 if name in ("yaw_rate", "rotations") else 1e-6 * size
        np.testing.assert_allclose(found[:, block], slow[:, block], atol=atol, err_msg=name)


@LAYOUTS
@HEADINGS
def test_what_is_encoded_is_decoded(layout, heading):
    positions = wandering(120, layout, seed=1)
    x, world = features_of(positions, layout, heading), placed(positions, layout)[:-1]
    size = np.abs(world).max()
    np.testing.assert_allclose(joints_of(x.astype(float), layout), world, atol=2e-6 * size)
    lengths = [0, *bone_lengths(world[0], layout.skeleton)]
    np.testing.assert_allclose(joints_of_rotations(x, lengths, layout, heading), world, atol=1e-5 * size)


@LAYOUTS
@HEADINGS
def test_velocities_are_steps_of_the_decoded_joints_seen_from_the_heading(layout, heading):
    x = features_of(wandering(50, layout, seed=2), layout, heading).astype(float)
    steps = np.diff(joints_of(x, layout), axis=0)
    turns = about_y(2 * np.concatenate([[0], np.cumsum(x[:-2, 0])]))
    seen = np.einsum("tab,tjb->tja", turns.as_matrix(), steps)
    np.testing.assert_allclose(x[:-1, layout.blocks["velocities"]], seen.reshape(48, -1), atol=2e-5 * np.abs(steps).max() + 2e-6)


def test_the_published_example_is_encoded_as_published(example):
    """The stored features come from one frame more, so that smoothing differs towards the end."""
    stored, joints = example
    found = features_of(joints, HUMANML3D, "humanml3d")
    off = {name: np.abs(found[:, block] - stored[:-1, block]) for name, block in HUMANML3D.blocks.items()}
    most = {"yaw_rate": 3.1e-4, "root_velocity": 1.4e-4, "positions": 7e-3, "rotations": 1.4e-2, "velocities": 4.2e-4}
    for name, part in off.items():
        assert part.max() <= most.get(name, 0.0), name
        assert part[:90].max() < 1e-5, name


def test_the_correct_heading_differs_from_the_published_one(example):
    stored, joints = example
    found = features_of(joints, HUMANML3D)
    assert np.abs(found[:, 0] - stored[:-1, 0]).max() == pytest.approx(0.1777, abs=1e-4)
    positions = HUMANML3D.blocks["positions"]
    assert np.abs(found[:, positions] - stored[:-1, positions]).max() == pytest.approx(0.5385, abs=1e-4)
    rms = [np.sqrt(np.mean(np.square(x[:, 0]))) for x in (found, stored)]
    np.testing.assert_allclose(rms, [0.0176, 0.0347], atol=1e-4)
    np.testing.assert_array_equal(found[:, -4:], stored[:-1, -4:])
    assert stored[0, 0] == pytest.approx(0.106, abs=1e-3) and np.abs(stored[1:11, 0]).max() < 0.006  # the first holds more


def test_a_body_that_turns_straight_backwards_is_decoded():
    """There the published arcsine of the yaw rate has the wrong sign."""
    positions = wandering(240, rounds=2.0)
    x = features_of(positions)
    to_z = 2 * np.concatenate([[0], np.cumsum(x[:-1, 0].astype(float))])
    wrong = np.abs(published_rates(to_z) - x[:-1, 0]) > 1e-5
    assert wrong.sum() == 2 and np.all(np.abs(np.cos(to_z[:-1][wrong]) + 1) < 0.1)
    np.testing.assert_allclose(published_rates(to_z)[wrong], -x[:-1, 0][wrong], atol=1e-5)
    np.testing.assert_allclose(joints_of(x, HUMANML3D), placed(positions)[:-1], atol=1e-4)


@LAYOUTS
@HEADINGS
def test_turning_and_moving_the_clip_changes_nothing(layout, heading):
    positions = wandering(40, layout, seed=3)
    elsewhere = np.einsum("ab,tjb->tja", about_y(np.array(2.5)).as_matrix(), positions) + np.array([3.0, -7.0, 11.0])
    size = np.abs(positions).max()
    found, other = features_of(positions, layout, heading), features_of(elsewhere, layout, heading)
    np.testing.assert_allclose(found, other, atol=2e-6 * size)


@LAYOUTS
def test_placed_clips_stand_on_the_floor_above_the_origin_and_face_z(layout):
    world = placed(wandering(20, layout), layout)
    assert world[..., 1].min() == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(world[0, 0, [0, 2]], 0, atol=1e-9)
    right_hip, left_hip, right_shoulder, left_shoulder = world[0, list(layout.face_joints)]
    across = right_hip - left_hip + right_shoulder - left_shoulder
    assert across[0] < 0 and abs(across[2]) < 1e-9 * abs(across[0])
    np.testing.assert_allclose(placed(world, layout), world, atol=1e-9 * np.abs(world).max())


@LAYOUTS
@HEADINGS
def test_features_of_the_mirror_image(layout, heading):
    positions = wandering(40, layout, seed=4)
    x = features_of(positions, layout, heading)
    image = positions[:, layout.skeleton.mirror] * [-1, 1, 1]
    expected = features_of(image, layout, heading)
    np.testing.assert_allclose(mirrored(x, layout), expected, atol=1e-6 * np.abs(positions).max() + 2e-5)


def test_contacts_are_joints_that_move_less_than_the_threshold():
    positions = np.tile(wandering(1), (5, 1, 1))
    slow, fast = 0.044, 0.046  # the square root of 0.002 is 0.0447
    positions[1:, 7, 1] += slow
    positions[2:, 11, 0] += fast
    expected = np.ones((4, 4))
    expected[1, 3] = 0
    np.testing.assert_array_equal(features_of(positions)[:, -4:], expected)


def test_a_bone_opposite_to_its_rest_is_half_a_turn_away():
    """Where the published code divides zero by zero."""
    positions = np.zeros((3, 22, 3))
    for before, joint in HUMANML3D.skeleton.bones:
        positions[:, joint] = positions[:, before] + HUMANML3D.rests("correct")[joint] * (-1 if joint == 18 else 1)
    x = features_of(positions)
    assert np.isfinite(x).all()
    joints = joints_of_rotations(x, [1.0] * 22)
    np.testing.assert_allclose(joints, placed(positions)[:-1], atol=1e-5)


def test_another_body_in_the_same_directions():
    positions = wandering(10)
    twice = with_bones(positions, replace(HUMANML3D, bone_lengths=tuple(2 * length for length in HUMANML3D.bone_lengths)))
    np.testing.assert_allclose(twice, 2 * positions, atol=1e-9)
    own = with_bones(2.5 * positions)
    np.testing.assert_allclose(own, positions, atol=1e-9)
    longer = [*HUMANML3D.bone_lengths]
    longer[20] += 0.1  # the left forearm alone
    reach = with_bones(positions, replace(HUMANML3D, bone_lengths=tuple(longer))) - positions
    assert set(np.nonzero(np.abs(reach).max(axis=(0, 2)) > 1e-9)[0]) == {20}
    for chain in HUMANML3D.chains[:2]:
        longer = [*HUMANML3D.bone_lengths]
        longer[chain[2]] += 0.1
        legs = [joint for leg in HUMANML3D.chains[:2] for joint in leg[2:4]]
        grown = 1 + 0.1 / sum(HUMANML3D.bone_lengths[joint] for joint in legs)
        moved = with_bones(positions, replace(HUMANML3D, bone_lengths=tuple(longer)))
        np.testing.assert_allclose(moved[:, 0], grown * positions[:, 0], atol=1e-9)
    with pytest.raises(ValueError, match="bone_lengths of KIT-ML is None; expected 21 lengths"):
        with_bones(wandering(3, KIT), KIT)


def test_what_cannot_be_encoded_is_refused():
    with pytest.raises(ValueError, match=r"positions have shape \(5, 21, 3\); expected \(T, 22, 3\) for HumanML3D"):
        features_of(np.zeros((5, 21, 3)))
    with pytest.raises(ValueError, match="1 frame; expected at least 2"):
        features_of(wandering(1))
    with pytest.raises(ValueError, match="heading is 'wrong'; expected one of correct, humanml3d"):
        features_of(wandering(3), heading="wrong")  # type: ignore[arg-type]
    broken = wandering(4)
    broken[2, 15, 1] = np.nan
    with pytest.raises(ValueError, match="head in frame 2 is not finite; expected numbers"):
        features_of(broken)


def test_a_clip_takes_milliseconds():
    positions = wandering(121)
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        features_of(positions)
        best = min(best, time.perf_counter() - start)
    assert best < 0.05  # 2 ms on one core; slow machines shall not fail
