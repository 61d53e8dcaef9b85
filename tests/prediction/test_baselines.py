"""Baselines on motions whose answer is known."""

from __future__ import annotations

import math

import pytest
import torch

from mwlib import metrics
from mwlib.body.kinematics import turn_heading
from mwlib.prediction.baselines import FUTURES, NearestHistory, constant_velocity, zero_velocity

M, H, F, C = 40, 6, 10, 12


def _walks(count: int = M, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(count, H + F, C, generator=generator, dtype=torch.float64).cumsum(1)


def test_velocities_on_a_straight_line():
    velocity = torch.zeros(2, C)
    velocity[0, 0], velocity[1, 4] = 0.1, -0.2
    x = torch.arange(H + F)[:, None] * velocity[:, None]
    g = x[:, H:]
    still, moving = zero_velocity(x[:, :H], F), constant_velocity(x[:, :H], F)
    assert still.shape == moving.shape == (2, 1, F, C)
    torch.testing.assert_close(metrics.ade(still, g), torch.tensor([0.1, 0.2]) * (F + 1) / 2)
    torch.testing.assert_close(metrics.fde(still, g), torch.tensor([0.1, 0.2]) * F)
    torch.testing.assert_close(moving[:, 0], g)
    with pytest.raises(ValueError, match="at least 2"):
        constant_velocity(x[:, :1], F)


def test_a_training_window_finds_its_own_future():
    x = _walks()
    p = NearestHistory(x, H, samples=5).predict(x[3:8, :H])
    assert p.shape == (5, 5, F, C)
    torch.testing.assert_close(p[:, 0], x[3:8, H:])


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_turned_training_window_finds_its_turned_future(up):
    x = _walks()
    angle = torch.tensor([0.5, 2.0, -3.0], dtype=x.dtype)
    query = turn_heading(x[:3], angle, up)
    p = NearestHistory(x, H, samples=2, up=up).predict(query[:, :H])
    torch.testing.assert_close(p[:, 0], query[:, H:])


def test_neighbours_are_the_nearest_of_all_that_windows_may_be_turned_to():
    x, queries = _walks(15), _walks(6, seed=1)[:, :H]
    angle = torch.linspace(0, 2 * math.pi, 3601, dtype=x.dtype)
    every = torch.stack([turn_heading(window.expand(len(angle), -1, -1), angle) for window in x])  # (M, angles, T, C)
    for query, found in zip(queries, NearestHistory(x, H, samples=4).predict(queries), strict=True):
        distance, turn = (every[:, :, :H] - query).flatten(2).norm(dim=2).min(1)
        near = distance.argsort()[:4]
        expected = every[near, turn[near], H:]
        assert (found - expected).flatten(1).norm(dim=1).max() < 0.002 * expected.norm()


def test_heading_is_the_best_angle():
    x, query = _walks(1), _walks(1, seed=1)[:, :H]
    angle = torch.linspace(0, 2 * math.pi, 3601, dtype=x.dtype)
    turned = turn_heading(x.expand(len(angle), -1, -1), angle)
    best = (turned[:, :H] - query).flatten(1).norm(dim=1).argmin()
    found = NearestHistory(x, H, samples=1).predict(query)[0, 0]
    assert (found - turned[best, H:]).norm() < 0.002 * found.norm()


def test_chunks_of_queries_do_not_matter(monkeypatch):
    x, queries = _walks(), _walks(6, seed=1)[:, :H]
    whole = NearestHistory(x, H, samples=4).predict(queries)
    monkeypatch.setattr("mwlib.prediction.baselines._BUDGET", 1)
    torch.testing.assert_close(NearestHistory(x, H, samples=4).predict(queries), whole)


def test_displacements_go_on_from_the_last_pose():
    """The neighbours are the same; what they do is added to where the query is."""
    x = _walks()
    queries = x[3:8, :H] + 0.2
    poses, moves = (NearestHistory(x, H, samples=4, futures=kind).predict(queries) for kind in FUTURES)
    torch.testing.assert_close(moves.diff(dim=2), poses.diff(dim=2), atol=1e-5, rtol=0)
    own = NearestHistory(x, H, samples=1, futures="displacement").predict(x[3:8, :H])[:, 0]
    torch.testing.assert_close(own, x[3:8, H:])


def test_refusals():
    x = _walks(4)
    for wrong, message in (
        (dict(futures="mirror"), "futures is 'mirror'; expected one of pose, displacement"),
        (dict(samples=5), "samples is 5; expected 1 to 4"),
        (dict(history=H + F, samples=1), "history is 16; expected 1 to 15"),
    ):
        with pytest.raises(ValueError, match=message):
            NearestHistory(x, **{"history": H, **wrong})
    with pytest.raises(ValueError, match="has 5 frames; expected 6"):
        NearestHistory(x, H, samples=1).predict(x[:, :5])
