"""L2P, L2Q and NPSS: values by hand, slow transcriptions, invariances."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mwlib import metrics

N, F, J = 5, 7, 4


def about_x(*degrees: float) -> torch.Tensor:
    half = torch.deg2rad(torch.tensor(degrees, dtype=torch.float64)) / 2
    return torch.stack([half.cos(), half.sin(), 0 * half, 0 * half], dim=-1)


def quaternions(*shape: int, seed: int = 0) -> torch.Tensor:
    """Turns that go on smoothly along the axis before the last."""
    draws = torch.Generator().manual_seed(seed)
    steps = 0.2 * torch.randn(*shape, 4, generator=draws, dtype=torch.float64)
    return torch.nn.functional.normalize(torch.tensor([1.0, 0, 0, 0]) + steps.cumsum(-3), dim=-1)


def sequences(seed: int = 0, *shape: int) -> torch.Tensor:
    return torch.randn(*(shape or (N, F, 3 * J)), generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def test_l2p_by_hand():
    g = torch.tensor([[[0, 0, 0, 0, 1, 0], [1, 0, 0, 1, 1, 0]]], dtype=torch.float64)
    p = g.clone()
    p[0, 1, [2, 5]] = 2
    mean = torch.tensor([0.5, 0, 0, 0.5, 1, 0], dtype=torch.float64)
    deviation = torch.tensor([0.5, 1, 1, 0.5, 2, 4], dtype=torch.float64)
    assert f"{metrics.l2p(p, g, mean, deviation).item():.7f}" == "1.0307764"
    assert f"{metrics.l2p(p, g, mean, torch.ones(6)).item():.7f}" == "1.4142136"


def test_l2q_by_hand():
    g = torch.stack([about_x(0, 90), about_x(0, 90)])[None]
    p = torch.stack([about_x(0, 90), about_x(90, 180)])[None]
    assert f"{metrics.l2q(p, g).item():.7f}" == "0.5411961"
    p[0, 1, 1] *= -1
    assert f"{metrics.l2q(p, g).item():.7f}" == "1.0000000"
    assert f"{metrics.l2q(p, g, start=g[:, 0]).item():.7f}" == "0.5411961"


def test_npss_by_hand():
    g = torch.tensor([[1, 2, 3, 4], [0, 1, 0, 0]], dtype=torch.float64).T[None]
    p = torch.tensor([[1, 1, 1, 2], [1, 1, 1, 1]], dtype=torch.float64).T[None]
    assert f"{metrics.npss(p, g):.7f}" == f"{metrics.npss(-p, g):.7f}" == f"{metrics.npss(p, -g):.7f}" == "0.1524966"
    assert f"{metrics.npss(p, g, power='magnitude'):.7f}" == "0.1635945"
    one, two = (metrics.npss(p[..., [c]], g[..., [c]]) for c in (0, 1))
    assert (f"{one:.6f}", f"{two:.1f}") == ("0.137363", "1.0")
    assert metrics.npss(p, g) == pytest.approx((112 * one + 2 * two) / 114)


def test_l2p_and_l2q_are_their_definitions():
    p, g, mean = sequences(0), sequences(1), sequences(2, 3 * J)
    deviation = sequences(3, 3 * J).abs() + 0.1
    q, r, start = quaternions(N, F, J), quaternions(N, F, J, seed=1), quaternions(N, 1, J, seed=2)[:, 0]
    for n in range(N):
        far, turned = 0.0, 0.0
        for t in range(F):
            z = [(float(x[n, t, c]) - float(mean[c])) / float(deviation[c]) for x in (p, g) for c in range(3 * J)]
            far += math.dist(z[: 3 * J], z[3 * J :]) / F
            turned += math.dist(q[n, t].flatten().tolist(), r[n, t].flatten().tolist()) / F
        assert metrics.l2p(p, g, mean, deviation)[n].item() == pytest.approx(far, rel=1e-12)
        assert metrics.l2q(q, r)[n].item() == pytest.approx(turned, rel=1e-12)
    assert metrics.l2q(q, r, start).shape == (N,)


def _npss_slowly(p: np.ndarray, g: np.ndarray, *, is_real: bool) -> float:
    """One sequence, one channel and one bin at a time, with a Fourier sum written out."""
    weighted = weights = 0.0
    frames = p.shape[1]
    for n in range(len(p)):
        for c in range(p.shape[2]):
            shares, total = [], 0.0
            for x in (p[n, :, c], g[n, :, c]):
                bins = [sum(x[t] * np.exp(-2j * np.pi * k * t / frames) for t in range(frames)) for k in range(frames)]
                power = [b.real**2 if is_real else abs(b) ** 2 for b in bins]
                total = sum(power)
                shares.append([sum(power[: k + 1]) / total for k in range(frames)])
            weighted += total * sum(abs(a - b) for a, b in zip(*shares, strict=True))
            weights += total
    return weighted / weights


@pytest.mark.parametrize("power", ["real", "magnitude"])
def test_npss_is_its_definition(power):
    p, g = sequences(0, 3, 6, 4), sequences(1, 3, 6, 4) * torch.tensor([1.0, 2.0, 5.0, 0.1])
    expected = _npss_slowly(p.numpy(), g.numpy(), is_real=power == "real")
    assert metrics.npss(p, g, power) == pytest.approx(expected, rel=1e-12)


@given(st.lists(st.integers(1, N), min_size=1, max_size=4), st.integers(1, 3 * J))
@settings(deadline=None, max_examples=25)
def test_npss_does_not_depend_on_how_it_is_fed(sizes, channels):
    """Sequences in chunks of any size, channels in two parts: all are weighed together."""
    p, g = sequences(0, sum(sizes), F, 3 * J), sequences(1, sum(sizes), F, 3 * J) * torch.arange(1, 3 * J + 1)
    found = metrics.NPSS()
    for part in (slice(0, channels), slice(channels, None)):
        start = 0
        for size in sizes:
            if p[..., part].shape[-1]:
                found.update(p[start : start + size, :, part], g[start : start + size, :, part])
            start += size
    assert found.value() == pytest.approx(metrics.npss(p, g), rel=1e-9)


def test_a_mean_over_batches_is_another_npss():
    p, g = sequences(0), sequences(1) * torch.arange(1, N + 1)[:, None, None]
    assert metrics.npss(p, g) != pytest.approx(np.mean([metrics.npss(p[[n]], g[[n]]) for n in range(N)]), rel=1e-3)


def test_npss_where_there_is_no_power():
    still, g = torch.zeros(1, F, 1), sequences(1)
    shares = (torch.fft.fft(g[:1, :, :1], dim=1).real ** 2).cumsum(1)
    assert metrics.npss(still, g[:1, :, :1]) == pytest.approx(float((shares / shares[:, -1:]).sum()))
    assert math.isnan(metrics.npss(still, still)) and math.isnan(metrics.NPSS().value())
    found = metrics.NPSS()
    found.update(sequences(0), g)
    before = found.value()
    found.update(sequences(2), 0 * g)  # a truth without power does not count
    assert found.value() == before


def test_nothing_is_off_from_itself():
    g, q = sequences(), quaternions(N, F, J)
    assert metrics.l2p(g, g, g[0, 0], torch.ones(3 * J)).tolist() == metrics.l2q(q, q).tolist() == [0.0] * N
    assert metrics.npss(g, g) == 0


def test_l2p_has_no_unit_and_no_place():
    p, g = sequences(0), sequences(1)
    mean, deviation, shift = sequences(2, 3 * J), sequences(3, 3 * J).abs() + 0.1, sequences(4, 3 * J)
    found = metrics.l2p(p, g, mean, deviation)
    torch.testing.assert_close(metrics.l2p(100 * p, 100 * g, 100 * mean, 100 * deviation), found)
    torch.testing.assert_close(metrics.l2p(p + shift, g + shift, mean, deviation), found)
    torch.testing.assert_close(metrics.l2p(g, p, mean, deviation), found)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=25)
def test_with_a_start_frame_signs_do_not_matter(seed):
    p, g, draws = quaternions(N, F, J), quaternions(N, F, J, seed=1), torch.Generator().manual_seed(seed)
    start = g[:, 0]
    signs = [torch.randint(2, (N, F, J, 1), generator=draws) * 2 - 1 for _ in range(2)]
    torch.testing.assert_close(metrics.l2q(signs[0] * p, signs[1] * g, start), metrics.l2q(p, g, start))


def test_continued_goes_on_from_the_start():
    g = quaternions(N, F, J)
    start = -g[:, 0]
    found = metrics.continued(g, start)
    whole = torch.cat([start[:, None], found], dim=1)
    assert (whole[:, 1:] * whole[:, :-1]).sum(-1).min() > 0
    torch.testing.assert_close(found.abs(), g.abs())
    torch.testing.assert_close(metrics.continued(found, start), found)


def test_a_sample_axis_and_no_axis():
    p, g = quaternions(N, 3, F, J), quaternions(N, F, J, seed=1)
    x, y, deviation = sequences(0, N, 3, F, 3 * J), sequences(1), torch.ones(3 * J)
    many = metrics.l2q(p, g[:, None], g[:, None, 0]), metrics.l2p(x, y[:, None], y[0, 0], deviation)
    assert many[0].shape == many[1].shape == (N, 3)
    for n in range(N):
        for s in range(3):
            torch.testing.assert_close(many[0][n, s], metrics.l2q(p[n, s], g[n], g[n, 0]))
            torch.testing.assert_close(many[1][n, s], metrics.l2p(x[n, s], y[n], y[0, 0], deviation))
    each = y[:, None].expand_as(x).flatten(0, 1)
    assert metrics.npss(x, y[:, None]) == pytest.approx(metrics.npss(x.flatten(0, 1), each), rel=1e-12)


def test_float32_agrees_with_float64():
    p, g, deviation = sequences(0), sequences(1), torch.ones(3 * J)
    q, r = quaternions(N, F, J), quaternions(N, F, J, seed=1)
    found = metrics.l2p(p.float(), g.float(), deviation, deviation), metrics.l2q(q.float(), r.float(), r[:, 0].float())
    assert found[0].dtype == found[1].dtype == torch.float32
    torch.testing.assert_close(found[0].double(), metrics.l2p(p, g, deviation, deviation), rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(found[1].double(), metrics.l2q(q, r, r[:, 0]), rtol=1e-5, atol=1e-6)
    assert metrics.npss(p.float(), g.float()) == pytest.approx(metrics.npss(p, g), rel=1e-5)


ONES = torch.ones(3 * J)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: metrics.l2p(sequences()[:, None], sequences(), ONES, ONES), "the truth as g"),
        (lambda: metrics.l2p(sequences()[:2], sequences()[:3], ONES, ONES), "as many sequences in both"),
        (lambda: metrics.l2p(sequences(), sequences()[..., :9], ONES, ONES), r"g \(5, 7, 9\)"),
        (lambda: metrics.l2p(sequences(), sequences(), ONES[:9], ONES), r"mean \(9,\) and deviation \(12,\); expected \(12,\)"),
        (lambda: metrics.l2p(sequences(), sequences(), ONES, 0 * ONES), "smallest deviation is 0"),
        (lambda: metrics.l2p(sequences() / 0, sequences(), ONES, ONES), r"p is not finite at \[0, 0, 0\]"),
        (lambda: metrics.l2q(sequences(0, 2, 3, 4, 3), sequences(0, 2, 3, 4, 3)), "expected .* quaternions"),
        (lambda: metrics.l2q(quaternions(N, F, J), quaternions(N, F, J), quaternions(N, F, J)), "expected one frame"),
        (lambda: metrics.NPSS("phase"), "power is 'phase'; expected one of real, magnitude"),
        (lambda: metrics.npss(sequences()[:, :0], sequences()[:, :0]), r"p has shape \(5, 0, 12\)"),
    ],
)  # fmt: skip
def test_mistakes_are_told(call, message):
    with pytest.raises(ValueError, match=message):
        call()
