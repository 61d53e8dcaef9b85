"""Linear transforms: what all of them promise, each against PyWavelets or SciPy, and what they refuse."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pywt
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.fft import dct, dst

from mwlib.transforms import (
    DCTTransform,
    DSTTransform,
    LinearTransform,
    ScaledTransform,
    TimeWaveletTransform,
    WaveletTransform,
    fit_scale,
    pad_history,
)

WAVELETS = pywt.wavelist(kind="discrete")  # all 106
EXACTLY = [name for name in WAVELETS if name != "dmey"]  # those with perfect reconstruction
MODES = pywt.Modes.modes
TABLE_3 = ["bior2.8", "rbio2.8", "bior6.8", "sym9", "sym10", "coif3", "db9", "coif5", "haar", "dmey"]
PAPERS_SIZES = ((125, 48), (75, 42), (8, 5))

# Everything is float64 and of size 1. Two ways to add up the same products differ by 1e-14; PyWavelets adds them up in C.
SAME = 1e-10
EXACT = 1e-9  # perfect reconstruction is as good as the filters' published digits: sym20 misses it by 1.5e-10, sym3 by 7e-11


def random(*shape: int, seed: int = 1) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def bridge(frames: int, *lead: int) -> torch.Tensor:
    """Random numbers that vanish in the first and the last frame."""
    x = random(*lead, frames, 5, seed=frames)
    x[..., [0, -1], :] = 0
    return x


def oracle(x: torch.Tensor, wavelet: str, mode: str) -> dict[str, np.ndarray]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # PyWavelets remarks on levels of short signals
        aa, (da, ad, dd) = pywt.dwt2(x.numpy(), wavelet, mode)
    return {"aa": aa, "da": da, "ad": ad, "dd": dd}


def over_time(x: torch.Tensor, wavelet: str, level: int) -> list[np.ndarray]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return pywt.wavedec(x.numpy(), wavelet, "periodization", level, axis=-2)


of_any_size = given(
    st.sampled_from(["wavelet", "time", "dct", "dst"]), st.integers(8, 40), st.integers(2, 9), st.sampled_from(EXACTLY),
    st.sampled_from(MODES), st.integers(1, 3), st.integers(0, 40), st.integers(0, 2**31),
)  # fmt: skip


def made(kind: str, frames: int, channels: int, wavelet: str, mode: str, level: int, kept: int) -> LinearTransform:
    """A linear transform; `kept` says how many levels or rows are left out or kept."""
    if kind == "wavelet":
        return WaveletTransform(frames, channels, wavelet, mode, level)
    if kind == "time":
        return TimeWaveletTransform(frames, channels, wavelet, level, kept % level)
    make, most = (DCTTransform, frames) if kind == "dct" else (DSTTransform, frames - 2)
    return make(frames, channels, 1 + kept % most if kept % 3 else None)


def is_whole(tf: LinearTransform) -> bool:
    """Whether every motion has all of its coefficients."""
    return tf.shape[0] * tf.shape[1] >= tf.frames * tf.channels


@of_any_size
@settings(deadline=None, max_examples=80)
def test_every_linear_transform(kind, frames, channels, wavelet, mode, level, kept, seed):
    """Rebuilt where nothing is left out; a projection that is its own; sub-bands that join; leading axes; precision."""
    tf = made(kind, frames, channels, wavelet, mode, level, kept)
    x, y = random(2, 3, tf.frames, tf.channels, seed=seed), random(2, 3, *tf.shape, seed=seed + 1)
    found = tf(x)
    assert found.shape == (2, 3, *tf.shape)
    torch.testing.assert_close(found[1, 2], tf(x[1, 2]), atol=1e-9, rtol=1e-9)
    torch.testing.assert_close(tf.inverse(y)[0, 1], tf.inverse(y[0, 1]), atol=1e-9, rtol=1e-9)
    size = max(1.0, float(found.abs().max()), float(tf.inverse(y).abs().max()))
    if is_whole(tf):
        torch.testing.assert_close(tf.inverse(found), x, atol=1e-7 * size, rtol=0)
        torch.testing.assert_close(tf.project(tf.project(y)), tf.project(y), atol=1e-6 * size**2, rtol=0)
    torch.testing.assert_close(tf.project(y), tf(tf.inverse(y)), atol=1e-8 * size**2, rtol=0)
    assert torch.equal(tf.join(tf.split(y)), y)
    assert tf(x.float()).dtype == torch.float32
    torch.testing.assert_close(tf(x.float()).double(), found, atol=1e-4 * size, rtol=1e-4)


@of_any_size
@settings(deadline=None, max_examples=40)
def test_gradients_are_the_adjoint(kind, frames, channels, wavelet, mode, level, kept, seed):
    """<tf x, y> and <x, adjoint y> are one number, and so are those of the inverse: linear maps with the right transposes."""
    tf = made(kind, frames, channels, wavelet, mode, level, kept)
    x, y = random(tf.frames, tf.channels, seed=seed).requires_grad_(), random(*tf.shape, seed=seed + 1).requires_grad_()
    for function, given_, tested in ((tf, x, y), (tf.inverse, y, x)):
        product = (function(given_) * tested.detach()).sum()
        (adjoint,) = torch.autograd.grad(product, given_)
        torch.testing.assert_close((adjoint * given_).sum(), product, atol=1e-8, rtol=1e-8)
        torch.testing.assert_close(function(2 * given_), 2 * function(given_), atol=1e-8, rtol=1e-8)


@pytest.mark.parametrize("mode", MODES)
def test_one_level_equals_pywavelets_for_every_wavelet(mode):
    for wavelet in WAVELETS:
        for size in ((25, 9), (16, 12), *(PAPERS_SIZES if wavelet in TABLE_3 else ())):
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


def test_sizes_of_the_paper():
    sizes = {"bior2.8": (71, 128), "sym10": (72, 132), "coif5": (77, 152), "haar": (63, 96), "dmey": (93, 216)}
    assert {name: WaveletTransform(125, 48, name).shape for name in sizes} == sizes
    assert WaveletTransform(75, 42).shape == (46, 116)


@pytest.mark.parametrize("level", [2, 3])
@pytest.mark.parametrize("mode", ["zero", "symmetric", "periodization"])
def test_more_levels_equal_the_fully_separable_transform(level, mode):
    x = random(64, 24)
    found = pywt.fswavedecn(x.numpy(), "db2", mode, level)
    np.testing.assert_allclose(WaveletTransform(64, 24, "db2", mode, level)(x), found.coeffs, atol=1e-10)


@pytest.mark.parametrize("mode", MODES)
def test_projection_has_rank_t_times_c(mode):
    tf = WaveletTransform(11, 6, "bior2.8", mode)
    size = tf.shape[0] * tf.shape[1]
    p = tf.project(torch.eye(size, dtype=torch.float64).reshape(size, *tf.shape)).reshape(size, size)
    torch.testing.assert_close(p @ p, p, atol=1e-9, rtol=0)
    assert torch.linalg.matrix_rank(p) == 11 * 6 and abs(p.trace() - 11 * 6) < 1e-8


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
    x, tf = random(125, 48), WaveletTransform(125, 48, "dmey")
    assert 1e-5 < (tf.inverse(tf(x)) - x).abs().max() < 1e-1


@pytest.mark.parametrize("level", [1, 2, 3, 4])
@pytest.mark.parametrize("frames", [16, 40, 75, 125])
def test_sub_bands_over_time_are_those_of_pywavelets_and_nothing_is_lost(frames, level):
    x = random(2, frames, 3)
    for wavelet in EXACTLY:
        tf = TimeWaveletTransform(frames, 3, wavelet, level)
        y, expected = tf(x), over_time(x, wavelet, level)
        for (name, band), coefficients in zip(tf.split(y).items(), expected, strict=True):
            in_time = band.unflatten(-1, (-1, 3)).flatten(-3, -2)  # rows one after the other: the sub-band along time
            there = coefficients.shape[-2]
            np.testing.assert_allclose(in_time[:, :there], coefficients, atol=1e-10, err_msg=f"{wavelet} {name}")
            assert not in_time[:, there:].any()
        torch.testing.assert_close(tf.inverse(y), x, atol=1e-9, rtol=0)


@pytest.mark.parametrize("omit", [0, 1, 2])
def test_what_is_left_out_is_zero_in_the_inverse(omit):
    x = random(125, 3)
    tf = TimeWaveletTransform(125, 3, "bior6.8", 3, omit)
    coefficients = over_time(x, "bior6.8", 3)
    kept = coefficients[: 4 - omit] + [np.zeros_like(c) for c in coefficients[4 - omit :]]
    expected = pywt.waverec(kept, "bior6.8", "periodization", axis=-2)[:125]
    np.testing.assert_allclose(tf.inverse(tf(x)), expected, atol=1e-10)
    assert tf.shape == (16, 3 * 2 ** (3 - omit)) and list(tf.split(tf(x))) == ["a3", "d3", "d2", "d1"][: 4 - omit]


@pytest.mark.parametrize("rows", [1, 2, 7, 18])
def test_cosines_and_sines_are_scipys_and_few_rows_the_slowest(rows):
    x, z = random(2, 20, 5), bridge(20, 2)
    for tf, source, expected in (
        (DCTTransform(20, 5, rows), x, dct(x.numpy(), norm="ortho", axis=1)),
        (DSTTransform(20, 5, rows), z, dst(z.numpy()[:, 1:-1], type=1, norm="ortho", axis=1)),
    ):
        np.testing.assert_allclose(tf(source), expected[:, :rows], atol=1e-12)
        y = random(*tf.shape)
        torch.testing.assert_close(tf(tf.inverse(y)), y, atol=1e-12, rtol=0)
        assert torch.equal(tf.project(y), y) and tf.shape == (rows, 5)
        assert (source - tf.inverse(tf(source))).norm() < source.norm()
    n, k = np.arange(20), np.arange(1, rows + 1)
    sines = np.sqrt(2 / 19) * np.sin(np.pi * k[:, None] * n / 19)
    np.testing.assert_allclose(DSTTransform(20, 5, rows).analysis_time, sines, atol=1e-12)


@pytest.mark.parametrize("frames", [3, 4, 5, 8, 24, 32, 101])
def test_sines_are_exact_for_what_vanishes_at_both_ends_and_do_not_see_them(frames):
    tf, x = DSTTransform(frames, 5), bridge(frames, 3)
    torch.testing.assert_close(tf.inverse(tf(x)), x, atol=1e-12, rtol=0)
    assert torch.equal(tf.inverse(100 * random(3, frames - 2, 5))[:, [0, -1]], torch.zeros(3, 2, 5, dtype=torch.float64))
    moved = x.clone()
    moved[:, [0, -1]] = 7.0
    assert torch.equal(tf(moved), tf(x))


def test_coefficients_of_a_brownian_bridge_are_independent():
    """Its covariance, min(s, t) - s t / n, becomes diagonal; that of a free walk does not."""
    frames = 17
    n, t = frames - 1, np.arange(frames)
    covariance = np.minimum(t[:, None], t) - t[:, None] * t / n
    a = DSTTransform(frames, 1).analysis_time
    found = a @ covariance @ a.T
    np.testing.assert_allclose(found - np.diag(np.diag(found)), 0, atol=1e-12)
    np.testing.assert_allclose(np.diag(found), 0.25 / np.sin(np.pi * np.arange(1, n) / (2 * n)) ** 2, rtol=1e-10)
    free = a @ np.minimum(t[:, None], t) @ a.T
    assert np.abs(free - np.diag(np.diag(free))).max() > 0.1


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


def test_the_last_pose_of_a_history_is_held(generator):
    x = torch.randn(2, 3, 4, generator=generator)
    padded, before = pad_history(x, 5), x.clone()
    assert torch.equal(padded[:, :3], x) and torch.equal(padded[:, 2:], x[:, 2:].expand(-1, 3, -1))
    padded.add_(1)
    assert torch.equal(x, before)
    assert torch.equal(pad_history(x[0], 3), x[0])


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: WaveletTransform(20, 9, "bior9.9"), "bior9.9"),
        (lambda: WaveletTransform(20, 9, mode="mirror"), "mirror"),
        (lambda: WaveletTransform(20, 9, level=0), "level is 0"),
        (lambda: WaveletTransform(20, 9)(torch.zeros(21, 9)), r"\(21, 9\); expected \(20, 9\)"),
        (lambda: WaveletTransform(20, 9).inverse(torch.zeros(20, 9)), "expected"),
        (lambda: TimeWaveletTransform(20, 3, omit=3), "omit is 3; expected 0 to 2"),
        (lambda: TimeWaveletTransform(20, 3, omit=-1), "omit is -1"),
        (lambda: TimeWaveletTransform(20, 3, level=5), "level is 5 of 20 frames; expected at most 4"),
        (lambda: TimeWaveletTransform(20, 3, "lion"), "wavelet is 'lion'"),
        (lambda: TimeWaveletTransform(20, 3, level=0), "level is 0; expected at least 1"),
        (lambda: DCTTransform(20, 9, 21), "rows is 21"),
        (lambda: DSTTransform(10, 3, 0), "rows is 0; expected at least 1"),
        (lambda: DSTTransform(10, 3, -1), "rows is -1; expected at least 1"),
        (lambda: DSTTransform(10, 3, 9), "rows is 9; expected at most 8"),
        (lambda: pad_history(torch.zeros(5, 3), 4), "5 frames; expected at most 4"),
    ],
)
def test_bad_arguments_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_scales_of_bands_that_hold_still():
    """Windows that differ, but in which nobody moves, leave the time details at nothing."""
    x = torch.randn(20, 1, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).expand(20, 16, 6)
    tf = WaveletTransform(16, 6, "haar")
    for kind in ("band", "coefficient"):
        scales = fit_scale(tf, x, kind)
        assert scales[0].dtype == scales[1].dtype == torch.float32
        scaled = ScaledTransform(tf, *scales)
        assert scaled(x.float()).isfinite().all() and (scaled.frames, scaled.channels, scaled.bands) == (16, 6, tf.bands)
