"""The sine transform against SciPy, and what it does to a Brownian bridge."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.fft import dst

from mwlib.transforms import DSTTransform


def bridge(frames: int, *lead: int, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    """Random numbers that vanish in the first and the last frame."""
    x = torch.randn(*lead, frames, 5, dtype=dtype, generator=torch.Generator().manual_seed(frames))
    x[..., [0, -1], :] = 0
    return x


@pytest.mark.parametrize("frames", [3, 4, 5, 8, 24, 32, 101])
def test_it_is_scipys_orthonormal_and_exact(frames):
    tf, x = DSTTransform(frames, 5), bridge(frames, 2)
    assert tf.shape == (frames - 2, 5)
    np.testing.assert_allclose(tf(x), dst(x.numpy()[:, 1:-1], type=1, norm="ortho", axis=1), atol=1e-12)
    torch.testing.assert_close(tf.inverse(tf(x)), x, atol=1e-12, rtol=0)
    np.testing.assert_allclose(tf.analysis_time @ tf.synthesis_time, np.eye(frames - 2), atol=1e-12)
    single = x.float()
    assert tf(single).dtype == torch.float32
    torch.testing.assert_close(tf.inverse(tf(single)), single, atol=1e-5, rtol=0)


@pytest.mark.parametrize("rows", [1, 2, 7, 18])
def test_few_rows_are_the_slowest_sines(rows):
    tf, full, x = DSTTransform(20, 5, rows), DSTTransform(20, 5), bridge(20)
    torch.testing.assert_close(tf(x), full(x)[:rows])
    n, k = np.arange(20), np.arange(1, rows + 1)
    sines = np.sqrt(2 / 19) * np.sin(np.pi * k[:, None] * n / 19)
    np.testing.assert_allclose(tf.analysis_time, sines, atol=1e-12)
    y = torch.randn(rows, 5, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    torch.testing.assert_close(tf(tf.inverse(y)), y, atol=1e-12, rtol=0)
    assert torch.equal(tf.project(y), y) and torch.equal(tf.join(tf.split(y)), y)


def test_both_ends_are_zero_whatever_the_coefficients_and_do_not_count():
    tf, x = DSTTransform(12, 5), bridge(12, 3)
    y = 100 * torch.randn(3, 10, 5, generator=torch.Generator().manual_seed(2))
    assert torch.equal(tf.inverse(y)[:, [0, -1]], torch.zeros(3, 2, 5))
    moved = x.clone()
    moved[:, [0, -1]] = 7.0
    assert torch.equal(tf(moved), tf(x))


def test_coefficients_of_a_brownian_bridge_are_independent():
    """Its covariance, min(s, t) - s t / n, becomes diagonal; that of a free walk does not."""
    frames = 17
    n = frames - 1
    t = np.arange(frames)
    covariance = np.minimum(t[:, None], t) - t[:, None] * t / n
    a = DSTTransform(frames, 1).analysis_time
    found = a @ covariance @ a.T
    np.testing.assert_allclose(found - np.diag(np.diag(found)), 0, atol=1e-12)
    np.testing.assert_allclose(np.diag(found), 0.25 / np.sin(np.pi * np.arange(1, n) / (2 * n)) ** 2, rtol=1e-10)
    free = a @ np.minimum(t[:, None], t) @ a.T
    assert np.abs(free - np.diag(np.diag(free))).max() > 0.1


@pytest.mark.parametrize("rows", [0, -1, 9])
def test_rows_that_there_are_not_are_refused(rows):
    with pytest.raises(ValueError, match=f"rows is {rows}; expected 1 to 8 "):
        DSTTransform(10, 3, rows)
