"""What fills the frames without training: paces at their ends, slerp, and a Gaussian process by brute force."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.body.rotation import from_six, slerp
from mwlib.inbetweening.baselines import PACES, GaussianBetween, between
from mwlib.inbetweening.space import RotationSpace
from mwlib.inbetweening.windows import Clips, make_space
from tests.inbetweening.sample import dancers, people


@pytest.mark.parametrize("pace", PACES)
def test_paces_begin_at_0_and_end_at_1(pace):
    u = torch.linspace(0, 1, 101, dtype=torch.float64)
    share = PACES[pace](u)
    assert float(share[0]) == 0 and float(share[-1]) == pytest.approx(1, abs=1e-12) and (share.diff() >= -1e-12).all()


@pytest.mark.parametrize(
    "pace, speed, acceleration", [("interpolation", 1.0, 0.0), ("hermite", 0.0, 6.0), ("minimum_jerk", 0.0, 0.0)]
)
def test_speed_and_acceleration_at_both_ends(pace, speed, acceleration):
    for end, sign in ((0.0, 1), (1.0, -1)):
        u = torch.tensor(end, dtype=torch.float64, requires_grad=True)
        (first,) = torch.autograd.grad(PACES[pace](u), u, create_graph=True)
        assert float(first.detach()) == pytest.approx(speed, abs=1e-12)
        second = torch.autograd.grad(first, u)[0] if first.requires_grad and pace != "interpolation" else torch.tensor(0.0)
        assert float(second) == pytest.approx(sign * acceleration, abs=1e-12)
    half = torch.tensor([0.3, 0.5, 0.7], dtype=torch.float64)
    moved = PACES[pace](half)
    assert float(moved[1]) == pytest.approx(0.5) and float(moved[0] + moved[2]) == pytest.approx(1)


def test_no_velocity_waits_for_the_last_frame():
    x = torch.randn(3, 8, 51, generator=torch.Generator().manual_seed(0))
    found = between(make_space(people().train, "positions"), x, "zero_velocity")
    assert torch.equal(found[:, :-1], x[:, :1].expand(3, 7, 51))
    torch.testing.assert_close(found[:, -1], x[:, -1])


def test_places_go_straight_and_only_the_ends_are_looked_at():
    x = torch.randn(3, 8, 51, generator=torch.Generator().manual_seed(0))
    blind = x.clone()
    blind[:, 1:-1] = torch.nan
    found = between(make_space(people().train, "positions"), blind, "interpolation")
    expected = np.linspace(x[:, 0].numpy(), x[:, -1].numpy(), 8, axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("pace", PACES)
def test_rotations_are_slerped_at_the_pace(pace):
    space = RotationSpace.of(dancers().train[0])
    x = Clips(dancers().train, space).windows(8, 5).x
    found = between(space, x, pace)
    first, last = (from_six(x[:, i, 3:].unflatten(-1, (-1, 6))) for i in (0, -1))
    for i, u in enumerate(torch.linspace(0, 1, 8)):
        share = PACES[pace](u)
        expected = slerp(first, last, share.expand(first.shape[:-1]))
        turns = from_six(found[:, i, 3:].unflatten(-1, (-1, 6)))
        np.testing.assert_allclose((turns * expected).sum(-1).abs().numpy(), 1.0, atol=1e-5)
        torch.testing.assert_close(found[:, i, :3], torch.lerp(x[:, 0, :3], x[:, -1, :3], share), atol=1e-5, rtol=0)
    torch.testing.assert_close(space.valid(found), found, atol=1e-5, rtol=0)
    torch.testing.assert_close(found[:, [0, -1]], x[:, [0, -1]], atol=1e-5, rtol=0)


def test_the_gaussian_is_a_conditional_mean_by_brute_force(generator):
    smooth = torch.randn(200, 30, 3, generator=generator, dtype=torch.float64).cumsum(1)[:, 10:17].float() * torch.tensor(
        [1, 5, 0.1]
    )
    x = smooth + torch.tensor([3.0, -1.0, 0.5])
    model = GaussianBetween(x)
    mean, deviation = x.numpy().mean((0, 1)), x.numpy().reshape(-1, 3).std(0, ddof=1)
    z = (x.numpy() - mean) / deviation
    sums, counts = np.zeros(7), np.zeros(7)
    for i in range(7):
        for j in range(7):
            sums[abs(i - j)] += np.mean(np.sum(z[:, i] * z[:, j], axis=-1))
            counts[abs(i - j)] += 1
    rho = sums / counts
    rho = rho / rho[0]
    k = rho[np.abs(np.arange(7)[:, None] - np.arange(7))]
    given = x.numpy()[:5][:, [0, -1]]
    expected = mean + k[:, [0, -1]] @ np.linalg.inv(k[[0, -1]][:, [0, -1]]) @ (given - mean)
    blind = x[:5].clone()
    blind[:, 1:-1] = torch.nan
    np.testing.assert_allclose(model(blind), expected, atol=1e-4)
    np.testing.assert_allclose(model(blind)[:, [0, -1]], given, atol=1e-5)


def test_the_gaussian_knows_the_process_that_it_was_shown(generator):
    """Of a stationary process the weights are those of its own covariance."""
    lag = torch.arange(9)
    covariance = torch.exp(-((lag[:, None] - lag) ** 2) / 18.0) + 1e-4 * torch.eye(9)
    x = torch.linalg.cholesky(covariance) @ torch.randn(20000, 9, 2, generator=generator)
    expected = covariance[:, [0, -1]] @ torch.linalg.inv(covariance[[0, -1]][:, [0, -1]])
    torch.testing.assert_close(GaussianBetween(x).weights, expected, atol=0.03, rtol=0)


@pytest.mark.parametrize("poses", [torch.tensor([0.0, 1.0, 5.0]), torch.zeros(3)])
def test_the_gaussian_of_people_who_stand_still_goes_between_the_two_frames(poses):
    """The correlation of any two frames is one, and says nothing of which is nearer."""
    still = poses[:, None, None].expand(3, 7, 2).clone()
    torch.testing.assert_close(GaussianBetween(still)(still), still)
    moved = still.clone()
    moved[:, -1] += 1.0
    if poses.any():
        torch.testing.assert_close(GaussianBetween(still)(moved)[:, 1:-1], still[:, 1:-1] + 0.5)
