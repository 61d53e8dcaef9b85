"""The wavelet transform against PyWavelets and algebra, and what all linear transforms have in common."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pywt
import torch

from mwlib.transforms import DCTTransform, WaveletTransform

WAVELETS = pywt.wavelist(kind="discrete")  # all 106
MODES = pywt.Modes.modes
SIZES = ((25, 9), (16, 12))
TABLE_3 = ["bior2.8", "rbio2.8", "bior6.8", "sym9", "sym10", "coif3", "db9", "coif5", "haar", "dmey"]


# Everything is float64 and of size 1. Two ways to add up the same products differ by 1e-14; PyWavelets adds them up in C.
SAME = 1e-10
EXACT = 1e-9  # perfect reconstruction is as good as the filters' published digits: sym20 misses it by 1.5e-10, sym3 by 7e-11


def random(*shape: int, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return torch.randn(*shape, dtype=dtype, generator=torch.Generator().manual_seed(1))


def oracle(x: torch.Tensor, wavelet: str, mode: str) -> dict[str, np.ndarray]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # PyWavelets remarks on levels of short signals
        aa, (da, ad, dd) = pywt.dwt2(x.numpy(), wavelet, mode)
    return {"aa": aa, "da": da, "ad": ad, "dd": dd}


@pytest.mark.parametrize("mode", MODES)
def test_one_level_equals_pywavelets_for_every_wavelet(mode):
    for wavelet in WAVELETS:
        for size in SIZES:
            x = random(*size)
            tf = WaveletTransform(*size, wavelet, mode)
            y, expected = tf(x), oracle(x, wavelet, mode)
            for name, band in tf.split(y).items():
                np.testing.assert_allclose(band, expected[name], atol=SAME, err_msg=f"{wavelet} {mode} {size} {name}")
            aa, da, ad, dd = (expected[n] for n in ("aa", "da", "ad", "dd"))
            back = pywt.idwt2((aa, (da, ad, dd)), wavelet, mode)[: size[0], : size[1]]
            np.testing.assert_allclose(tf.inverse(y), back, atol=SAME, err_msg=f"{wavelet} {mode} {size}")
            if wavelet != "dmey":
                np.testing.assert_allclose(tf.inverse(y), x, atol=EXACT, err_msg=f"{wavelet} {mode} {size}")


@pytest.mark.parametrize("wavelet", TABLE_3)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("size", [(125, 48), (75, 42), (8, 5)])
def test_paper_bases_at_paper_sizes(wavelet, mode, size):
    x = random(*size)
    tf = WaveletTransform(*size, wavelet, mode)
    for name, band in oracle(x, wavelet, mode).items():
        np.testing.assert_allclose(tf.split(tf(x))[name], band, atol=1e-10)


def test_sizes_of_the_paper():
    assert WaveletTransform(125, 48).shape == (71, 128)
    assert WaveletTransform(75, 42).shape == (46, 116)
    assert WaveletTransform(125, 48, "sym10").shape == (72, 132)
    assert WaveletTransform(125, 48, "coif5").shape == (77, 152)
    assert WaveletTransform(125, 48, "haar").shape == (63, 96)
    assert WaveletTransform(125, 48, "dmey").shape == (93, 216)


@pytest.mark.parametrize("level", [2, 3])
@pytest.mark.parametrize("mode", ["zero", "symmetric", "periodization"])
def test_more_levels_equal_the_fully_separable_transform(level, mode):
    x = random(64, 24)
    tf = WaveletTransform(64, 24, "db2", mode, level)
    found = pywt.fswavedecn(x.numpy(), "db2", mode, level)
    np.testing.assert_allclose(tf(x), found.coeffs, atol=1e-10)
    np.testing.assert_allclose(tf.inverse(tf(x)), x, atol=1e-10)
    assert torch.equal(tf.join(tf.split(tf(x))), tf(x))


@pytest.mark.parametrize("mode", MODES)
def test_projection_is_idempotent_of_rank_t_times_c(mode):
    tf = WaveletTransform(11, 6, "bior2.8", mode)
    size = tf.shape[0] * tf.shape[1]
    y = torch.eye(size, dtype=torch.float64).reshape(size, *tf.shape)
    p = tf.project(y).reshape(size, size)
    torch.testing.assert_close(p @ p, p, atol=1e-9, rtol=0)
    torch.testing.assert_close(tf.project(y), tf(tf.inverse(y)), atol=1e-10, rtol=0)
    assert torch.linalg.matrix_rank(p) == 11 * 6
    assert abs(p.trace() - 11 * 6) < 1e-8


def test_projection_is_orthogonal_for_an_orthogonal_wavelet_with_zero_extension():
    tf = WaveletTransform(12, 5, "db4", "zero")
    size = tf.shape[0] * tf.shape[1]
    p = tf.project(torch.eye(size, dtype=torch.float64).reshape(size, *tf.shape)).reshape(size, size)
    torch.testing.assert_close(p, p.T, atol=1e-10, rtol=0)


def test_projection_acts_at_the_boundary_rows_only():
    tf = WaveletTransform(125, 48)
    change = tf.analysis_time @ tf.synthesis_time - np.eye(142)
    touched = np.flatnonzero(np.abs(change).max(axis=1) > 1e-12)
    approx, detail = touched[touched < 71], touched[touched >= 71] - 71
    assert set(approx) == {*range(0, 8), *range(63, 71)}
    assert set(detail) == {*range(0, 4), *range(66, 71)}


def test_periodised_even_sizes_have_no_redundancy():
    tf = WaveletTransform(32, 12, "bior2.8", "periodization")
    y = random(3, *tf.shape)
    assert tf.shape[0] * tf.shape[1] == 32 * 12
    torch.testing.assert_close(tf.project(y), y, atol=1e-12, rtol=0)


def test_dmey_is_not_exactly_invertible():
    x = random(125, 48)
    tf = WaveletTransform(125, 48, "dmey")
    assert 1e-5 < (tf.inverse(tf(x)) - x).abs().max() < 1e-1


@pytest.mark.parametrize("tf", [WaveletTransform(20, 9), WaveletTransform(20, 9, "db3", level=2), DCTTransform(20, 9, 7)])
def test_one_interface(tf):
    x = random(2, 3, 20, 9)
    y = tf(x)
    assert y.shape == (2, 3, *tf.shape)
    torch.testing.assert_close(y[1, 2], tf(x[1, 2]), atol=1e-12, rtol=0)
    torch.testing.assert_close(tf.inverse(y)[0, 1], tf.inverse(y[0, 1]), atol=1e-12, rtol=0)
    assert torch.equal(tf.join(tf.split(y)), y)
    torch.testing.assert_close(tf.project(y), tf(tf.inverse(y)), atol=1e-10, rtol=0)
    assert tf(x.float()).dtype == torch.float32
    torch.testing.assert_close(tf(x.float()).double(), y, atol=1e-5, rtol=1e-5)


def test_gradients_flow_and_are_the_transpose():
    tf = WaveletTransform(10, 6, "db2")
    x = random(10, 6).requires_grad_()
    assert torch.autograd.gradcheck(tf, (x,))
    assert torch.autograd.gradcheck(tf.inverse, (tf(x).detach().requires_grad_(),))


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: WaveletTransform(20, 9, "bior9.9"), "bior9.9"),
        (lambda: WaveletTransform(20, 9, mode="mirror"), "mirror"),
        (lambda: WaveletTransform(20, 9, level=0), "level is 0"),
        (lambda: WaveletTransform(20, 9)(torch.zeros(21, 9)), r"\(21, 9\); expected \(20, 9\)"),
        (lambda: WaveletTransform(20, 9).inverse(torch.zeros(20, 9)), "expected"),
    ],
)
def test_bad_arguments_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
