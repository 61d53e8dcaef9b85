"""The transform along time in tokens, against PyWavelets."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pywt
import torch

from mwlib.transforms import TimeWaveletTransform

WAVELETS = [name for name in pywt.wavelist(kind="discrete") if name != "dmey"]


def random(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))


def oracle(x: torch.Tensor, wavelet: str, level: int) -> list[np.ndarray]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # PyWavelets remarks on levels of short signals
        return pywt.wavedec(x.numpy(), wavelet, "periodization", level, axis=-2)


@pytest.mark.parametrize("level", [1, 2, 3, 4])
@pytest.mark.parametrize("frames", [16, 40, 75, 125])
def test_sub_bands_are_those_of_pywavelets_and_nothing_is_lost(frames, level):
    x = random(2, frames, 3)
    for wavelet in WAVELETS:
        tf = TimeWaveletTransform(frames, 3, wavelet, level)
        y, expected = tf(x), oracle(x, wavelet, level)
        for name, band, coefficients in zip(tf.names, tf.split(y).values(), expected, strict=True):
            in_time = band.unflatten(-1, (-1, 3)).flatten(-3, -2)  # rows one after the other: the sub-band along time
            there = coefficients.shape[-2]
            np.testing.assert_allclose(in_time[:, :there], coefficients, atol=1e-10, err_msg=f"{wavelet} {name}")
            assert not in_time[:, there:].any()
        torch.testing.assert_close(tf.inverse(y), x, atol=1e-9, rtol=0)
        torch.testing.assert_close(tf.join(tf.split(y)), y, atol=0, rtol=0)


@pytest.mark.parametrize("omit", [0, 1, 2])
def test_what_is_left_out_is_zero_in_the_inverse(omit):
    x = random(125, 3)
    tf = TimeWaveletTransform(125, 3, "bior6.8", 3, omit)
    coefficients = oracle(x, "bior6.8", 3)
    kept = coefficients[: 4 - omit] + [np.zeros_like(c) for c in coefficients[4 - omit :]]
    expected = pywt.waverec(kept, "bior6.8", "periodization", axis=-2)[:125]
    np.testing.assert_allclose(tf.inverse(tf(x)), expected, atol=1e-10)
    assert tf.shape == (16, 3 * 2 ** (3 - omit)) and list(tf.split(tf(x))) == ["a3", "d3", "d2", "d1"][: 4 - omit]


def test_the_projection_is_analysis_of_the_synthesis_and_idempotent():
    y, tf = random(4, 16, 24), TimeWaveletTransform(125, 3)
    torch.testing.assert_close(tf.project(y), tf(tf.inverse(y)), atol=1e-12, rtol=0)
    torch.testing.assert_close(tf.project(tf.project(y)), tf.project(y), atol=1e-10, rtol=0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"omit": 3}, "omit is 3; expected 0 to 2"), ({"omit": -1}, "omit is -1"),
        ({"level": 5}, "level is 5 of 20 frames; expected at most 4"),
        ({"wavelet": "lion"}, "wavelet is 'lion'"), ({"level": 0}, "level is 0; expected at least 1"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        TimeWaveletTransform(20, 3, **changes)
