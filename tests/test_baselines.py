"""Baselines on motions whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from mwlib import metrics
from mwlib.baselines import NearestHistory, constant_velocity, history_completion, turn_heading, zero_velocity
from mwlib.transforms import DCTTransform, WaveletTransform, pad_history

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


@pytest.mark.parametrize("align", ["none", "heading"])
@pytest.mark.parametrize("distance", ["history", "last_frame"])
def test_a_training_window_finds_its_own_future(align, distance):
    x = _walks()
    p = NearestHistory(x, H, samples=5, align=align, distance=distance).predict(x[3:8, :H])
    assert p.shape == (5, 5, F, C)
    torch.testing.assert_close(p[:, 0], x[3:8, H:])


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_turned_training_window_finds_its_turned_future(up):
    x = _walks()
    angle = torch.tensor([0.5, 2.0, -3.0], dtype=x.dtype)
    query = turn_heading(x[:3], angle, up)
    p = NearestHistory(x, H, samples=2, align="heading", up=up).predict(query[:, :H])
    torch.testing.assert_close(p[:, 0], query[:, H:])


def test_neighbours_without_alignment_are_the_nearest():
    x, queries = _walks(), _walks(6, seed=1)[:, :H]
    distance = torch.stack([(x[:, :H] - q).flatten(1).norm(dim=1) for q in queries])
    expected = x[distance.argsort(1)[:, :4], H:]
    torch.testing.assert_close(NearestHistory(x, H, samples=4, align="none").predict(queries), expected)


def test_heading_is_the_best_angle():
    x, query = _walks(1), _walks(1, seed=1)[:, :H]
    angle = torch.linspace(0, 2 * math.pi, 3601, dtype=x.dtype)
    turned = turn_heading(x.expand(len(angle), -1, -1), angle)
    best = (turned[:, :H] - query).flatten(1).norm(dim=1).argmin()
    found = NearestHistory(x, H, samples=1).predict(query)[0, 0]
    assert (found - turned[best, H:]).norm() < 0.002 * found.norm()


def test_turn():
    x = torch.tensor([[1.0, 2.0, 3.0]])
    quarter = torch.tensor(math.pi / 2)
    torch.testing.assert_close(turn_heading(x, quarter), torch.tensor([[-2.0, 1.0, 3.0]]))
    torch.testing.assert_close(turn_heading(x, quarter, up="y"), torch.tensor([[-3.0, 2.0, 1.0]]))


def test_chunks_of_queries_do_not_matter(monkeypatch):
    x, queries = _walks(), _walks(6, seed=1)[:, :H]
    whole = NearestHistory(x, H, samples=4).predict(queries)
    monkeypatch.setattr("mwlib.baselines._BUDGET", 1)
    torch.testing.assert_close(NearestHistory(x, H, samples=4).predict(queries), whole)


def test_refusals():
    x = _walks(4)
    for wrong, message in (
        (dict(align="mirror"), "align is 'mirror'; expected one of none, heading"),
        (dict(samples=5), "samples is 5; expected 1 to 4"),
        (dict(history=H + F, samples=1), "history is 16; expected 1 to 15"),
    ):
        with pytest.raises(ValueError, match=message):
            NearestHistory(x, **{"history": H, **wrong})
    with pytest.raises(ValueError, match="has 5 frames; expected 6"):
        NearestHistory(x, H, samples=1).predict(x[:, :5])


TRANSFORMS = [WaveletTransform(H + F, C), DCTTransform(H + F, C)]


@pytest.mark.parametrize("tf", TRANSFORMS, ids=lambda tf: type(tf).__name__)
@pytest.mark.parametrize("lead", [(3,), (3, 4)], ids=str)
def test_completion_without_noise_keeps_history_and_future(tf, lead):
    generator = torch.Generator().manual_seed(0)
    x = _walks(3)
    y = torch.randn(*lead, *tf.shape, generator=generator, dtype=x.dtype)
    padded = pad_history(x[:, :H], H + F)
    complete = history_completion(tf, padded, H, lambda: torch.randn(y.shape, generator=generator, dtype=x.dtype))
    found = tf.inverse(complete(y, 1.0))
    torch.testing.assert_close(found[..., :H, :], x[:, :H].reshape(3, *[1] * (len(lead) - 1), H, C).expand(*lead, H, C))
    torch.testing.assert_close(found[..., H:, :], tf.inverse(y)[..., H:, :])


def test_completion_is_humanmacs():
    """Against a transcription in matrices: few DCT rows, noise left, known in front of unknown."""
    rows, a = 5, 0.3
    tf = DCTTransform(H + F, C, rows)
    i, k = np.arange(H + F), np.arange(rows)[:, None]
    dct = np.sqrt(2 / (H + F)) * np.cos(np.pi * (i + 0.5) * k / (H + F))
    dct[0] /= np.sqrt(2)
    generator = torch.Generator().manual_seed(0)
    y, eps = torch.randn(2, 3, rows, C, generator=generator, dtype=torch.float64)
    padded = pad_history(_walks(3)[:, :H], H + F)
    known = dct.T @ (np.sqrt(a) * dct @ padded.numpy() + np.sqrt(1 - a) * eps.numpy())
    mask = (i < H)[:, None]
    expected = dct @ (mask * known + ~mask * (dct.T @ y.numpy()))
    found = history_completion(tf, padded, H, lambda: eps)(y, a)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_completion_draws_anew_each_step():
    tf = TRANSFORMS[0]
    generator = torch.Generator().manual_seed(0)
    y = torch.zeros(1, *tf.shape)
    complete = history_completion(tf, torch.zeros(1, H + F, C), H, lambda: torch.randn(y.shape, generator=generator))
    assert not torch.equal(complete(y, 0.5), complete(y, 0.5))
