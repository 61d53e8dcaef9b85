"""The losses on bodies: the facts' worked numbers, batches, gradients where formulae are singular."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from mwlib.body import kinematics
from mwlib.body.skeleton import H36M17, Skeleton
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.inbetweening.losses import (
    _meetings,
    bone_angle_loss,
    bone_angles,
    bone_length_loss,
    bone_lengths,
    contact_loss,
    diversity_loss,
    floor_of,
    smoothness_loss,
)
from mwlib.inbetweening.space import RotationSpace
from tests.inbetweening.sample import dancers

ARM = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))


def random(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(sum(shape)))


def arm(angle: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    """One frame of an arm bent so far."""
    wrist = [1 + math.cos(angle), math.sin(angle), 0.0]
    return torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], wrist]], dtype=dtype)


LOSSES = {
    "distance": lambda x: diversity_loss(x.flatten(-2), "distance"),
    "exponential": lambda x: diversity_loss(x.flatten(-2), "exponential", 40.0),
    "step": lambda x: smoothness_loss(x.flatten(-2), x.flatten(-2), "step").mean(-1),
    "velocity": lambda x: smoothness_loss(x.flatten(-2), 0.5 * x.flatten(-2), "velocity").mean(-1),
    "acceleration": lambda x: smoothness_loss(x.flatten(-2), x.flatten(-2), "acceleration").mean(-1),
    "length": lambda x: bone_length_loss(x, torch.full((16,), 0.7, dtype=x.dtype), H36M17).mean(-1),
    "contact": lambda x: contact_loss(x, 0.02 * x, [3, 6], 5.0).mean(-1),
    "angle": lambda x: bone_angle_loss(x, torch.full((15,), 0.7, dtype=x.dtype)[: _angles()], H36M17).mean(-1),
}


def _angles() -> int:
    return sum(parent > 0 for parent in H36M17.parents)


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_a_batch_is_a_loop_and_gradients_are_right(loss):
    x = random(3, 2, 4, 17, 3)
    together = loss(x)
    assert together.shape == (3,)
    torch.testing.assert_close(together, torch.stack([loss(each) for each in x]))
    assert torch.autograd.gradcheck(lambda x: loss(x), (x[:1].clone().requires_grad_(),), fast_mode=True)


@pytest.mark.parametrize("kind, expected", [("step", 5 / 3), ("acceleration", 2.5)])
def test_smoothness_of_the_worked_path(kind, expected):
    x = torch.tensor([0.0, 1.0, 1.0, 3.0])[:, None]
    assert float(smoothness_loss(x, x, kind)) == pytest.approx(expected, abs=1e-6)
    assert float(smoothness_loss(x.repeat(1, 4), x.repeat(1, 4), kind)) == pytest.approx(4 * expected, abs=1e-5)  # squared length


def test_smoothness_by_velocity_needs_the_truth_and_is_zero_there():
    x = random(4, 7, 6)
    assert smoothness_loss(x, x + 3, "velocity").abs().max() < 1e-24  # a shift has no speed
    by_hand = (np.diff(x.numpy(), axis=1) - np.diff(2 * x.numpy(), axis=1)) ** 2
    np.testing.assert_allclose(smoothness_loss(x, 2 * x, "velocity"), by_hand.sum(-1).mean(-1))


def test_diversity_is_over_pairs():
    samples = random(6, 4, 3)
    flat = samples.flatten(1).numpy()
    pairs = [np.linalg.norm(a - b) for i, a in enumerate(flat) for b in flat[:i]]
    assert float(diversity_loss(samples, "distance")) == pytest.approx(-np.mean(pairs))
    assert float(diversity_loss(samples, "exponential", 7.0)) == pytest.approx(np.mean(np.exp(-np.square(pairs) / 7)))
    with pytest.raises(ValueError, match="1 sample; expected at least two"):
        diversity_loss(samples[:1], "distance")


@pytest.mark.parametrize("kind", ["distance", "exponential"])
def test_gradients_of_samples_that_are_alike_are_finite(kind):
    samples = torch.ones(3, 4, 2, requires_grad=True)
    diversity_loss(samples, kind).backward()
    assert samples.grad.isfinite().all()


@pytest.mark.parametrize("angle", [0.0, 1e-6, 1e-3, 1.0, math.pi / 2, 3.0, math.pi - 1e-3, math.pi])
def test_angles_of_an_arm(angle):
    x = arm(angle).requires_grad_()
    found = bone_angles(x, ARM)
    assert found.shape == (1, 1) and float(found.detach()) == pytest.approx(angle, abs=2e-6)
    (gradient,) = torch.autograd.grad(found.sum(), x)
    assert gradient.isfinite().all() and gradient.abs().max() < 2.5
    single = arm(angle, torch.float32).requires_grad_()
    (gradient,) = torch.autograd.grad(bone_angles(single, ARM).sum(), single)
    assert gradient.isfinite().all()


def test_angles_are_numpys_and_in_the_order_of_children():
    x = random(5, 17, 3)
    found = bone_angles(x, H36M17)
    rows = [(H36M17.parents[j], j, c) for c, j in enumerate(H36M17.parents) if j > 0]
    for column, (above, joint, below) in enumerate(rows):
        u, v = (x[:, joint] - x[:, above]).numpy(), (x[:, below] - x[:, joint]).numpy()
        cosine = np.sum(u * v, axis=-1) / np.linalg.norm(u, axis=-1) / np.linalg.norm(v, axis=-1)
        np.testing.assert_allclose(found[:, column], np.arccos(cosine), atol=1e-6)
    assert found.shape == (5, len(rows))


def test_only_what_is_beyond_the_limit_counts():
    limits = torch.tensor([1.0], dtype=torch.float64)
    assert float(bone_angle_loss(arm(0.9), limits, ARM)) == 0
    assert float(bone_angle_loss(arm(1.5), limits, ARM)) == pytest.approx(0.25, abs=1e-5)
    both = torch.cat([arm(0.9), arm(1.5)])
    assert float(bone_angle_loss(both, limits, ARM)) == pytest.approx(0.125, abs=1e-5)


def test_lengths_are_the_kinematics_in_the_same_order():
    x = random(4, 6, 22, 3)
    np.testing.assert_allclose(bone_lengths(x, LAFAN1), kinematics.bone_lengths(x.numpy(), LAFAN1))
    lengths = bone_lengths(x[:, 0], LAFAN1)
    for i in range(4):
        by_hand = (kinematics.bone_lengths(x[i].numpy(), LAFAN1) - lengths[i].numpy()) ** 2
        assert float(bone_length_loss(x, lengths, LAFAN1)[i]) == pytest.approx(by_hand.mean())


def test_feet_are_to_stand_where_those_of_the_truth_do():
    """Two feet over three steps: one low and slow in the first, low and fast in the second, high in the third; one never low."""
    truth = torch.zeros(4, 2, 3, dtype=torch.float64)
    truth[2:, 0, 0] = 1.0
    truth[3, 0, 2] = truth[:, 1, 2] = 0.3
    truth += torch.tensor([5.0, 6.0, 7.0])  # the floor is where the lowest foot is
    x = random(4, 2, 3)
    by_hand = float(np.square(10 * (x[1, 0] - x[0, 0]).numpy()).sum() / 6)
    assert float(contact_loss(x, truth, [0, 1], 10.0)) == pytest.approx(by_hand)
    assert float(contact_loss(x, truth, [1], 10.0)) > by_hand  # alone it is the lowest, and stands
    assert float(contact_loss(truth, truth, [0, 1], 10.0)) == 0
    both = torch.stack([truth, truth + torch.tensor([0.0, 0.0, 1.0])])
    assert contact_loss(x.expand(2, 4, 2, 3), both, [0, 1], 10.0).tolist() == pytest.approx(
        [by_hand, by_hand]
    )  # each on its own floor
    assert floor_of(both, [0, 1]).tolist() == [7.0, 8.0]


@pytest.mark.parametrize(("metres_a_second", "stands"), [(0.19, True), (0.21, False)])
def test_a_foot_that_creeps_stands(metres_a_second, stands):
    truth = torch.zeros(4, 1, 3, dtype=torch.float64)
    truth[:, 0, 0] = metres_a_second / 10 * torch.arange(4)
    assert (float(contact_loss(truth, truth, [0], 10.0)) > 0) == stands


def test_forward_kinematics_has_no_length_loss():
    motion = dancers().train[0]
    space = RotationSpace.of(motion)
    x = space.valid(space.encode(motion) + 0.3 * torch.randn(len(motion), space.channels))
    places = space.positions(x, space.offsets(motion))
    assert float(bone_length_loss(places, bone_lengths(places[0], LAFAN1), LAFAN1)) < 1e-10
    stretched = places * torch.tensor([1.0, 1.0, 1.1])
    assert float(bone_length_loss(stretched, bone_lengths(places[0], LAFAN1), LAFAN1)) > 1e-5


def test_what_was_first_asked_without_gradients_serves_training():
    """Indices are kept for the process; made within inference mode no gradient could pass them."""
    _meetings.cache_clear()
    kinematics._levels.cache_clear()
    places = torch.randn(2, 3, len(H36M17), 3, generator=torch.Generator().manual_seed(0), requires_grad=True)
    turns = torch.nn.functional.normalize(torch.randn(2, 3, len(H36M17), 4, generator=torch.Generator().manual_seed(1)), dim=-1)
    turns.requires_grad_()
    moved = lambda: kinematics.fk(turns, places[0, 0], places[..., 0, :], H36M17)[0]  # noqa: E731
    with torch.inference_mode():
        bone_angles(places, H36M17), moved()
    (bone_angles(places, H36M17).sum() + moved().sum()).backward()
    assert places.grad.isfinite().all() and turns.grad.isfinite().all()
