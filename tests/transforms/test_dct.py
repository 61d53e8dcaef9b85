"""The cosine transform against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.fft import dct

from mwlib.transforms import DCTTransform


def random(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))


def test_dct_equals_scipy_and_is_exact_with_all_rows():
    x = random(4, 30, 5)
    np.testing.assert_allclose(DCTTransform(30, 5, 12)(x), dct(x.numpy(), norm="ortho", axis=1)[:, :12], atol=1e-12)
    full = DCTTransform(30, 5)
    torch.testing.assert_close(full.inverse(full(x)), x, atol=1e-12, rtol=0)


def test_few_rows_keep_the_slow_part():
    x = random(30, 5)
    tf = DCTTransform(30, 5, 12)
    y = tf(x)
    torch.testing.assert_close(tf(tf.inverse(y)), y, atol=1e-12, rtol=0)
    assert torch.equal(tf.project(y), y) and tf.shape == (12, 5)
    assert (x - tf.inverse(y)).norm() < x.norm()


def test_more_rows_than_frames_are_refused():
    with pytest.raises(ValueError, match="rows is 21"):
        DCTTransform(20, 9, 21)
