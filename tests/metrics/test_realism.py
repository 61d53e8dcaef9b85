"""Speed, pose change, jerk and errors at a horizon, on motions whose values are known."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib import metrics

FPS = 50.0


def swinging(amplitude: float, hertz: float, joints: int = 3, samples: int = 2, frames: int = 101) -> torch.Tensor:
    """Every joint swings along x: a cosine from its turning point."""
    t = torch.arange(frames, dtype=torch.float64) / FPS
    x = amplitude * torch.cos(2 * torch.pi * hertz * t)
    p = torch.zeros(1, samples, frames, joints, 3, dtype=torch.float64)
    p[..., 0] = x[:, None]
    return p.flatten(-2)


def test_a_swing_by_hand():
    """Over whole periods: the mean of |sin| is 2/pi; a difference over time d is shortened by sinc(pi f d)."""
    p, f, a = swinging(0.1, 1.0), 1.0, 0.1
    shortened = np.sinc(f * 0.2)
    whole = swinging(a, f, frames=110)  # 100 differences over 0.2 s: two periods
    assert float(metrics.speed(whole, FPS)) == pytest.approx(4 * a * f * shortened, rel=0.01)
    third = (2 * np.pi * f) ** 3 * a * 2 / np.pi * np.sinc(f / FPS) ** 3
    assert float(metrics.jerk(p, FPS)) == pytest.approx(third, rel=0.02)
    assert float(metrics.pose_change(p)) == pytest.approx(0, abs=1e-9)
    assert float(metrics.pose_change(p[:, :, :26])) == pytest.approx(0.2 * 3**0.5, rel=0.01)  # half a period, three joints


def test_units_do_not_depend_on_the_frame_rate():
    fast, slow = swinging(0.1, 0.5), swinging(0.1, 0.5)[:, :, ::2]
    assert float(metrics.speed(slow, FPS / 2)) == pytest.approx(float(metrics.speed(fast, FPS)), rel=0.02)
    assert float(metrics.jerk(slow, FPS / 2)) == pytest.approx(float(metrics.jerk(fast, FPS)), rel=0.05)


def test_the_error_at_the_end_is_fde():
    p, g = torch.randn(4, 5, 30, 9), torch.randn(4, 30, 9)
    torch.testing.assert_close(metrics.error_at(p, g, 10.0, 3.0), metrics.fde(p, g))
    torch.testing.assert_close(metrics.error_at(p, g, 10.0, 1.0), metrics.fde(p[:, :, :10], g[:, :10]))
    for seconds in (0.0, 3.1):
        with pytest.raises(ValueError, match="within the 3 s that are predicted"):
            metrics.error_at(p, g, 10.0, seconds)


@pytest.mark.parametrize("function", [metrics.speed, metrics.jerk])
def test_too_few_frames_are_refused(function):
    with pytest.raises(ValueError, match="F >= "):
        function(torch.zeros(1, 1, 3, 3), FPS)


@pytest.mark.parametrize("samples", [2, 3, 10, 50])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_one_more_sample_is_covered_as_often_as_said(samples, share):
    draws = torch.Generator().manual_seed(0)
    p, g = torch.randn(4, samples, 100, 60, generator=draws), torch.randn(4, 100, 60, generator=draws)
    found = metrics.coverage(p, g, share)
    assert found.shape == (4,) and abs(float(found.mean()) - share) < 0.015


def test_coverage_tells_bands_that_are_too_narrow_or_beside_the_truth():
    draws = torch.Generator().manual_seed(0)
    p, g = torch.randn(2, 50, 100, 60, generator=draws), torch.randn(2, 100, 60, generator=draws)
    # the quartiles of a normal of half the deviation are at 0.337 of the whole one, within which 26.4 % lie
    assert float(metrics.coverage(p / 2, g, 0.5).mean()) == pytest.approx(0.264, abs=0.01)
    assert metrics.coverage(p + 9, g, 0.9).max() == 0 and metrics.coverage(p - 9, g, 0.9).max() == 0
    assert metrics.coverage(p[:, :1], g, 0.5).isnan().all()
    assert float(metrics.coverage(torch.zeros(1, 5, 4, 3), torch.zeros(1, 4, 3), 0.5)) == pytest.approx(1)
    for share in (0.0, 1.0):
        with pytest.raises(ValueError, match="more than 0 and less than 1"):
            metrics.coverage(p, g, share)
