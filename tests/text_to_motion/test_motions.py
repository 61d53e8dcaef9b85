"""Features that say a joint's way twice, and the joints that agree best with both."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.data.captioned import captioned_people
from mwlib.data.formats.humanml import HUMANML3D, joints_of
from mwlib.metrics import foot_skate, jerk
from mwlib.text_to_motion.motions import fused_joints, motion_of, steady_bones


@pytest.fixture(scope="module")
def walk() -> torch.Tensor:
    """Features of a synthetic person who goes somewhere and turns."""
    clips = [clip for clip in captioned_people(40, seed=3) if clip.attributes.get("action") == "walk"]
    return torch.from_numpy(max(clips, key=lambda clip: np.abs(clip.features[:, 0]).sum()).features).double()


@pytest.fixture(scope="module")
def trembling(walk) -> torch.Tensor:
    """The same with noise of 2 cm on the places; the steps stay as they are."""
    noisy = walk.clone()
    places = noisy[:, HUMANML3D.blocks["positions"]]
    places += 0.02 * torch.randn(places.shape, generator=torch.Generator().manual_seed(0), dtype=places.dtype)
    return noisy


def test_what_agrees_stays_as_it_is(walk):
    alone = joints_of(walk, HUMANML3D)
    free_feet = walk.clone()
    free_feet[:, HUMANML3D.blocks["contacts"]] = 0.0
    torch.testing.assert_close(fused_joints(free_feet, HUMANML3D), alone, atol=1e-5, rtol=0)
    torch.testing.assert_close(fused_joints(walk, HUMANML3D, 0.0, 0.0, 0.0, 0.0), alone, atol=1e-12, rtol=0)
    assert float((fused_joints(walk, HUMANML3D) - alone).norm(dim=-1).mean()) < 0.005


def test_it_is_the_least_squares_solution_joint_by_joint(trembling):
    found, p = fused_joints(trembling, HUMANML3D, 2.0, 9.0, 0.5, 0.2), joints_of(trembling, HUMANML3D)
    heading = 2 * torch.cat([torch.zeros(1), trembling[:-1, 0]]).cumsum(0)
    local = trembling[:-1, HUMANML3D.blocks["velocities"]].unflatten(-1, (-1, 3))
    for joint in (0, HUMANML3D.contact_joints[1], 20):
        contacts = trembling[:-1, HUMANML3D.blocks["contacts"]]
        place = [*HUMANML3D.contact_joints].index(joint) if joint in HUMANML3D.contact_joints else None
        rows, right, along = [*torch.eye(len(p), dtype=torch.float64)], [*p[:, joint]], [1.0] * len(p)
        for t, (x, y, z) in enumerate(local[:, joint].tolist()):
            c, s = float(heading[t].cos()), float(heading[t].sin())
            stands = place is not None and bool(contacts[t, place] > 0.5)
            step = torch.tensor([0.0, y, 0.0] if stands else [c * x - s * z, y, s * x + c * z], dtype=torch.float64)
            row = torch.zeros(len(p), dtype=torch.float64)
            row[t + 1], row[t] = 1.0, -1.0
            rows.append(row)
            right.append(step)
            along.append(9.0 if stands else 0.2 if joint == 20 else 2.0)
        height = torch.full_like(torch.tensor(along), 0.2 if joint == 20 else 0.5)
        height[: len(p)] = 1.0
        expected = torch.empty_like(p[:, joint])
        for axes, weights in (([0, 2], torch.tensor(along)), ([1], height)):
            root = weights.double().sqrt()[:, None]
            solved = torch.linalg.lstsq(root * torch.stack(rows), root * torch.stack(right)[:, axes]).solution
            expected[:, axes] = solved
        torch.testing.assert_close(found[:, joint], expected, atol=1e-9, rtol=0)


def test_a_body_that_trembles_is_calmed_and_its_standing_foot_slides_less(walk, trembling):
    def rough(joints):
        return float(jerk(joints.flatten(-2)[None, None], HUMANML3D.fps))

    alone, both = joints_of(trembling, HUMANML3D), fused_joints(trembling, HUMANML3D)
    assert rough(both) < 0.4 * rough(alone)
    truth = joints_of(walk, HUMANML3D)
    assert (both - truth).norm(dim=-1).mean() < 0.7 * (alone - truth).norm(dim=-1).mean()
    toes = HUMANML3D.contact_joints[1::2]

    def slides(contact_weight):
        return float(foot_skate(fused_joints(trembling, HUMANML3D, 3.0, contact_weight).flatten(-2), toes, HUMANML3D.fps, up="y"))

    assert slides(30.0) < slides(3.0) < slides(0.0)


def test_heights_trust_the_rows_more_than_the_steps(walk):
    sinking = walk.clone()
    sinking[:, HUMANML3D.blocks["velocities"]] -= torch.tensor([0.0, 0.01, 0.0], dtype=torch.float64).repeat(22)
    alone = joints_of(walk, HUMANML3D)[..., 1]

    def off(**weights):
        return float((fused_joints(sinking, HUMANML3D, arm_weight=0.0, **weights)[..., 1] - alone).abs().max())

    assert off(height_weight=0.0) < 1e-12 < off() < 0.5 * off(height_weight=30.0)
    along = fused_joints(sinking, HUMANML3D)[..., [0, 2]]
    torch.testing.assert_close(along, fused_joints(walk, HUMANML3D)[..., [0, 2]], atol=1e-9, rtol=0)


def test_arms_trust_their_rows(walk):
    """A wrist that waves by 20 cm twice a second, and whose steps are said to be half as long, keeps its swing."""
    waving = walk.clone()
    wave = 0.1 * torch.sin(4 * torch.pi * torch.arange(len(walk)) / HUMANML3D.fps)
    wrist, knee = HUMANML3D.arm_joints[-1], 4
    for joint in (wrist, knee):
        waving[:, HUMANML3D.blocks["positions"].start + 3 * (joint - 1) + 1] += wave
        waving[:-1, HUMANML3D.blocks["velocities"].start + 3 * joint + 1] += 0.5 * wave.diff()

    def kept(joint, **weights):
        moved = (fused_joints(waving, HUMANML3D, **weights) - fused_joints(walk, HUMANML3D, **weights))[..., joint, 1]
        return float((moved * wave).sum() / wave.square().sum())

    assert kept(wrist) > 0.97 > 0.9 > kept(knee) and kept(wrist, arm_weight=1.0) < 0.9


def test_single_precision_motions_and_a_negative_weight(walk):
    single = fused_joints(walk.float(), HUMANML3D)
    torch.testing.assert_close(single.double(), fused_joints(walk, HUMANML3D), atol=1e-4, rtol=0)
    plain, fused = motion_of(walk.float(), HUMANML3D, "walk"), motion_of(walk.float(), HUMANML3D, "walk", fused=True)
    np.testing.assert_allclose(plain.positions, joints_of(walk.float().double(), HUMANML3D).numpy())
    expected = steady_bones(fused_joints(walk.float().double(), HUMANML3D), HUMANML3D.skeleton)
    np.testing.assert_allclose(fused.positions, expected.numpy())
    with pytest.raises(
        ValueError,
        match="step_weight=-1.0, contact_weight=0.0, height_weight=1.0, arm_weight=0.1; expected at least 0",
    ):
        fused_joints(walk, HUMANML3D, -1.0, 0.0)


def test_bones_keep_the_length_of_the_median_frame_and_point_where_they_did(walk, trembling):
    skeleton = HUMANML3D.skeleton
    recorded = joints_of(walk, HUMANML3D)
    torch.testing.assert_close(steady_bones(recorded, skeleton), recorded, atol=1e-5, rtol=0)
    given = fused_joints(trembling, HUMANML3D)
    found = steady_bones(given, skeleton)
    parent, child = torch.tensor(skeleton.bones).T
    before, after = (x[:, child] - x[:, parent] for x in (given, found))
    lengths = after.norm(dim=-1)
    assert float((before.norm(dim=-1).amax(0) / before.norm(dim=-1).amin(0)).median()) > 1.03, "else this shows nothing"
    torch.testing.assert_close(lengths, before.norm(dim=-1).quantile(0.5, dim=0).expand_as(lengths), atol=1e-9, rtol=0)
    torch.testing.assert_close(after / lengths[..., None], before / before.norm(dim=-1, keepdim=True), atol=1e-9, rtol=0)
    torch.testing.assert_close(found[:, 0], given[:, 0], atol=0, rtol=0)
    np.testing.assert_allclose(motion_of(trembling, HUMANML3D, fused=True).positions, found, atol=1e-6)
    np.testing.assert_allclose(motion_of(trembling, HUMANML3D).positions, joints_of(trembling, HUMANML3D), atol=1e-6)
