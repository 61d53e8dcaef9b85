"""Scaled coefficients: unit deviation, the same motions, the same projection."""

from __future__ import annotations

import pytest
import torch

from mwlib.transforms import ScaledTransform, WaveletTransform, fit_scale


def random(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("kind", ["none", "band", "coefficient"])
def test_scaled_transform_round_trip_and_projection(kind):
    x = random(200, 20, 9).float() * torch.linspace(0.1, 2, 9)
    base = WaveletTransform(20, 9)
    tf = ScaledTransform(base, *fit_scale(base, x, kind))
    torch.testing.assert_close(tf.inverse(tf(x)), x, atol=1e-4, rtol=1e-4)
    y = random(5, *tf.shape).float()
    torch.testing.assert_close(tf.project(y), tf(tf.inverse(y)), atol=1e-3, rtol=1e-3)
    if kind == "coefficient":
        alive = base(x).std(0) > 2e-3 * base(x).std(0).max()
        torch.testing.assert_close(tf(x).std(0)[alive], torch.ones(int(alive.sum())), atol=1e-3, rtol=0)
    if kind == "band":
        for band in tf.split(tf(x)).values():
            assert abs(band.std() - 1) < 0.01
