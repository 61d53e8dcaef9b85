"""Transitions between keyframes: values by hand, slow transcriptions, invariances, motions whose numbers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mwlib import metrics
from mwlib.body.kinematics import bone_lengths, fk
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections.lafan1 import LAFAN1

N, F, J = 5, 7, 4
T, C = 9, 12  # of whole motions, keyframes included
CHAIN = Skeleton("chain", ("root", "a", "b"), (-1, 0, 1))


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
    assert f"{metrics.l2q(metrics.continued(p, g[:, 0]), g).item():.7f}" == "0.5411961"


def test_npss_by_hand():
    g = torch.tensor([[1, 2, 3, 4], [0, 1, 0, 0]], dtype=torch.float64).T[None]
    p = torch.tensor([[1, 1, 1, 2], [1, 1, 1, 1]], dtype=torch.float64).T[None]
    assert f"{metrics.npss(p, g):.7f}" == f"{metrics.npss(-p, g):.7f}" == f"{metrics.npss(p, -g):.7f}" == "0.1524966"
    one, two = (metrics.npss(p[..., [c]], g[..., [c]]) for c in (0, 1))
    assert (f"{one:.6f}", f"{two:.1f}") == ("0.137363", "1.0")
    assert metrics.npss(p, g) == pytest.approx((112 * one + 2 * two) / 114)


def test_l2p_and_l2q_are_their_definitions():
    p, g, mean = sequences(0), sequences(1), sequences(2, 3 * J)
    deviation = sequences(3, 3 * J).abs() + 0.1
    q, r = quaternions(N, F, J), quaternions(N, F, J, seed=1)
    for n in range(N):
        far, turned = 0.0, 0.0
        for t in range(F):
            z = [(float(x[n, t, c]) - float(mean[c])) / float(deviation[c]) for x in (p, g) for c in range(3 * J)]
            far += math.dist(z[: 3 * J], z[3 * J :]) / F
            turned += math.dist(q[n, t].flatten().tolist(), r[n, t].flatten().tolist()) / F
        assert metrics.l2p(p, g, mean, deviation)[n].item() == pytest.approx(far, rel=1e-12)
        assert metrics.l2q(q, r)[n].item() == pytest.approx(turned, rel=1e-12)


def _npss_slowly(p: np.ndarray, g: np.ndarray) -> float:
    """One sequence, one channel and one bin at a time, with a Fourier sum written out."""
    weighted = weights = 0.0
    frames = p.shape[1]
    for n in range(len(p)):
        for c in range(p.shape[2]):
            shares, total = [], 0.0
            for x in (p[n, :, c], g[n, :, c]):
                bins = [sum(x[t] * np.exp(-2j * np.pi * k * t / frames) for t in range(frames)) for k in range(frames)]
                power = [b.real**2 for b in bins]
                total = sum(power)
                shares.append([sum(power[: k + 1]) / total for k in range(frames)])
            weighted += total * sum(abs(a - b) for a, b in zip(*shares, strict=True))
            weights += total
    return weighted / weights


def test_npss_is_its_definition():
    p, g = sequences(0, 3, 6, 4), sequences(1, 3, 6, 4) * torch.tensor([1.0, 2.0, 5.0, 0.1])
    assert metrics.npss(p, g) == pytest.approx(_npss_slowly(p.numpy(), g.numpy()), rel=1e-12)


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


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=25)
def test_with_a_start_frame_signs_do_not_matter(seed):
    p, g, draws = quaternions(N, F, J), quaternions(N, F, J, seed=1), torch.Generator().manual_seed(seed)
    start = g[:, 0]
    signs = [torch.randint(2, (N, F, J, 1), generator=draws) * 2 - 1 for _ in range(2)]
    found, expected = (metrics.l2q(metrics.continued(a * p, start), metrics.continued(b * g, start)) for a, b in (signs, (1, 1)))
    torch.testing.assert_close(found, expected)


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
    many = metrics.l2q(metrics.continued(p, g[:, None, 0]), g[:, None]), metrics.l2p(x, y[:, None], y[0, 0], deviation)
    assert many[0].shape == many[1].shape == (N, 3)
    for n in range(N):
        for s in range(3):
            torch.testing.assert_close(many[0][n, s], metrics.l2q(metrics.continued(p[n, s], g[n, 0]), g[n]))
            torch.testing.assert_close(many[1][n, s], metrics.l2p(x[n, s], y[n], y[0, 0], deviation))
    each = y[:, None].expand_as(x).flatten(0, 1)
    assert metrics.npss(x, y[:, None]) == pytest.approx(metrics.npss(x.flatten(0, 1), each), rel=1e-12)


def test_float32_agrees_with_float64():
    p, g, deviation = sequences(0), sequences(1), torch.ones(3 * J)
    q, r = quaternions(N, F, J), quaternions(N, F, J, seed=1)
    found = metrics.l2p(p.float(), g.float(), deviation, deviation), metrics.l2q(q.float(), r.float())
    assert found[0].dtype == found[1].dtype == torch.float32
    torch.testing.assert_close(found[0].double(), metrics.l2p(p, g, deviation, deviation), rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(found[1].double(), metrics.l2q(q, r), rtol=1e-5, atol=1e-6)
    assert metrics.npss(p.float(), g.float()) == pytest.approx(metrics.npss(p, g), rel=1e-5)


def whole(seed: int = 0) -> torch.Tensor:
    return sequences(seed, N, T, C)


def samples() -> tuple[torch.Tensor, torch.Tensor]:
    """Three samples of two frames and two numbers, and a truth."""
    p = torch.tensor([[[0.0, 0], [0, 0]], [[3, 0], [0, 4]], [[0, 0], [0, 4]]], dtype=torch.float64)
    return p[None], torch.tensor([[[0.0, 0], [0, 2]]], dtype=torch.float64)


def test_displacement_errors_by_hand():
    p, g = samples()
    assert metrics.apd(p).tolist() == [4.0]
    assert metrics.sample_ade(p, g).tolist() == [[1.0, 2.5, 1.0]]
    assert (metrics.ade(p, g).tolist(), metrics.mean_ade(p, g).tolist()) == ([1.0], [1.5])


def test_nearer_share_by_hand():
    p, g = samples()
    shares = [metrics.nearer_share(p, g, g + offset).item() for offset in (0.0, 0.8, 1.0, 2.0)]  # off by sqrt(2) times that
    assert shares == pytest.approx([0, 2 / 3, 2 / 3, 1])
    assert metrics.nearer_share(p, g, p[:, 0]).item() == 0  # a tie is not nearer
    many = metrics.nearer_share(torch.cat([p, p]), torch.cat([g, g]), torch.cat([g, g + 2]))
    assert many.tolist() == [0, 1]


def test_seam_ratio():
    t = torch.linspace(0, 1, T, dtype=torch.float64)[:, None]
    line = t * sequences(1, C)
    assert metrics.seam_ratio(line).item() == pytest.approx(1)
    pasted = line.clone()
    pasted[0] -= 3 * (line[1] - line[0])
    assert metrics.seam_ratio(pasted).item() == pytest.approx((4 + 1) / 2)
    pasted[-1] += 6 * (line[1] - line[0])
    assert metrics.seam_ratio(pasted).item() == pytest.approx((4 + 7) / 2)
    assert metrics.seam_ratio(torch.cat([0 * line[:4], line[-1:]])).item() == math.inf
    assert metrics.seam_ratio(0 * line).isnan()
    x = whole()
    for n, row in enumerate(x.numpy()):
        step = [np.linalg.norm(b - a) for a, b in zip(row[:-1], row[1:], strict=True)]
        expected = (step[0] + step[-1]) / 2 / np.mean(step[1:-1])
        assert metrics.seam_ratio(x)[n].item() == pytest.approx(expected, rel=1e-12)
    torch.testing.assert_close(metrics.seam_ratio(x.flip(-2)), metrics.seam_ratio(x))
    torch.testing.assert_close(metrics.seam_ratio(100 * x + 1), metrics.seam_ratio(x))


def test_keyframe_error():
    p, g = whole(0), whole(1)
    far = (p - g).unflatten(-1, (-1, 3)).norm(dim=-1)  # (N, T, J)
    torch.testing.assert_close(metrics.keyframe_error(p, g, (0, -1)), far[:, [0, -1]].amax((1, 2)))
    torch.testing.assert_close(metrics.keyframe_error(p, g, (4,)), far[:, 4].amax(1))
    p[:, [0, -1]] = g[:, [0, -1]]
    assert metrics.keyframe_error(p, g, (0, T - 1)).tolist() == [0.0] * N
    many = torch.stack([p, p + 1], dim=1)
    assert metrics.keyframe_error(many, g[:, None], (0,))[0].tolist() == pytest.approx([0, 3**0.5])


def test_path_length():
    angle = torch.linspace(0, 2 * torch.pi, 721, dtype=torch.float64)
    ring = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=-1)
    assert metrics.path_length(ring).item() == pytest.approx(2 * math.pi, rel=1e-4)
    assert metrics.path_length(torch.stack([ring, 2 * ring]))[1].item() == pytest.approx(4 * math.pi, rel=1e-4)
    assert metrics.path_length(ring[:1].expand(5, 3)).item() == 0


def sliding(fps: float, speed: float = 0.3, height: float = 0.02, seconds: float = 2.0) -> torch.Tensor:
    """Two feet, z up: one slides along a slant at this speed and height, the other is in the air and much faster."""
    t = torch.arange(round(seconds * fps) + 1, dtype=torch.float64) / fps
    one = torch.stack([0.6 * speed * t, 0.8 * speed * t, torch.full_like(t, height)], dim=-1)
    other = torch.stack([5 * t, 0 * t, torch.full_like(t, 0.3)], dim=-1)
    return torch.cat([one, other], dim=-1)


@pytest.mark.parametrize("fps", [20.0, 30.0, 120.0])
def test_skating_is_a_speed_at_any_frame_rate(fps):
    x = sliding(fps)
    assert metrics.foot_skate(x, [0, 1], fps).item() == pytest.approx(0.3)
    assert metrics.foot_skate(x, [1], fps).isnan()
    assert metrics.foot_skate(x, [0, 1], fps, floor=0.26).item() == pytest.approx((0.3 + 5) / 2)
    assert metrics.foot_skate(x, [0], fps, floor=-0.04).isnan()  # 6 cm above a lower floor
    y_up = x.unflatten(-1, (-1, 3))[..., [0, 2, 1]].flatten(-2)
    assert metrics.foot_skate(y_up, [0, 1], fps, up="y").item() == pytest.approx(0.3)
    assert metrics.foot_skate(y_up, [0], fps, up="z").item() == pytest.approx(0.18)  # z for height: another motion


def test_a_foot_that_stands_does_not_skate_and_one_that_lands_counts_from_then_on():
    x = sliding(30.0, speed=0.0)[..., :3]
    assert metrics.foot_skate(x, [0], 30.0).item() == 0
    x[:31, 2], x[:31, 0] = 1.0, torch.linspace(-9, 0, 31)  # in the air for a second, fast
    x[31:, 0] = 0.2 * torch.arange(30) / 30
    assert metrics.foot_skate(x, [0], 30.0).item() == pytest.approx(0.2)
    assert metrics.foot_skate(torch.stack([x, x]), [0], 30.0).shape == (2,)
    x[:, 2] += torch.linspace(0, 0.01, len(x))  # up and down is no skating
    assert metrics.foot_skate(x, [0], 30.0).item() == pytest.approx(0.2)


def test_contacts_are_low_in_both_frames_and_slow():
    feet = torch.zeros(2, 5, 2, 3)
    feet[:, 2:, 0, 0] = 0.4  # a jump along the floor
    feet[1] += 1.0
    feet[1, 4, 1, 2] += 0.06
    low = metrics.foot_contacts(feet, [0, 1], 10.0, floor=torch.tensor([0.0, 1.0]))
    assert low.shape == (2, 4, 2) and low[0].all() and low[1].sum() == 7 and not low[1, 3, 1]
    slow = metrics.foot_contacts(feet, [0, 1], 10.0, floor=torch.tensor([0.0, 1.0]), fastest=3.9)
    assert not slow[:, 1, 0].any() and int(low.sum() - slow.sum()) == 2
    assert metrics.foot_contacts(feet, [1], 10.0, floor=1.0)[0].all()  # below the floor is low, too


def test_bone_length_error():
    draws = torch.Generator().manual_seed(0)
    q = torch.nn.functional.normalize(torch.randn(N, T, 22, 4, generator=draws, dtype=torch.float64), dim=-1)
    offsets = torch.randn(22, 3, generator=draws, dtype=torch.float64)
    x = fk(q, offsets, sequences(2, N, T, 3), LAFAN1)[0]
    lengths = offsets[1:].norm(dim=-1)
    assert metrics.bone_length_error(x.flatten(-2), lengths, LAFAN1).abs().max() < 1e-12
    noisy = x + 0.1 * torch.randn(x.shape, generator=draws, dtype=torch.float64)
    expected = np.abs(bone_lengths(noisy.numpy(), LAFAN1) - lengths.numpy()).mean((1, 2))
    np.testing.assert_allclose(metrics.bone_length_error(noisy.flatten(-2), lengths, LAFAN1), expected, rtol=1e-12)
    own = torch.from_numpy(bone_lengths(noisy[:, 0].numpy(), LAFAN1))  # those of each motion's first frame
    assert metrics.bone_length_error(noisy[:, :1].flatten(-2), own, LAFAN1).abs().max() < 1e-12
    moved = torch.tensor([[5.0, 5, 5, 6, 5, 5, 6, 6.1, 5]], dtype=torch.float64)
    assert metrics.bone_length_error(moved, torch.ones(2), CHAIN).item() == pytest.approx(0.05)


def test_whole_motions_in_float32_agree_with_float64():
    x, g = whole(0), whole(1)
    for metric in (
        metrics.seam_ratio,
        metrics.path_length,
        lambda a: metrics.keyframe_error(a, g.to(a), (0, -1)),
        lambda a: metrics.foot_skate(a, [0, 1], 30.0, floor=0.65),
        lambda a: metrics.bone_length_error(a[..., :9], torch.ones(2), CHAIN),
    ):
        torch.testing.assert_close(metric(x.float()).double(), metric(x), rtol=1e-5, atol=1e-6)


ONES = torch.ones(3 * J)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: metrics.l2p(sequences()[:, None], sequences(), ONES, ONES), "the truth as g"),
        (lambda: metrics.l2p(sequences()[:2], sequences()[:3], ONES, ONES), r"g \(3, .*equal but for leading axes of 1"),
        (lambda: metrics.l2p(sequences(), sequences()[..., :9], ONES, ONES), r"g \(5, 7, 9\)"),
        (lambda: metrics.l2p(sequences(), sequences(), ONES[:9], ONES), r"mean \(9,\) and deviation \(12,\); expected \(12,\)"),
        (lambda: metrics.l2p(sequences(), sequences(), ONES, 0 * ONES), "smallest deviation is 0"),
        (lambda: metrics.l2p(sequences() / 0, sequences(), ONES, ONES), r"p is not finite at \[0, 0, 0\]"),
        (lambda: metrics.l2q(sequences(0, 2, 3, 4, 3), sequences(0, 2, 3, 4, 3)), r"of float numbers \(.*, 4\)"),
        (lambda: metrics.continued(quaternions(N, F, J), quaternions(N, F, J)), "expected one frame"),
        (lambda: metrics.npss(sequences()[:, :0], sequences()[:, :0]), r"p has shape \(5, 0, 12\)"),
        (lambda: metrics.seam_ratio(whole()[:, :3]), "at least 4 frames"),
        (lambda: metrics.path_length(whole()[:, :1]), "at least 2 frames"),
        (lambda: metrics.seam_ratio(whole() / 0), r"not finite at \[0, 0, 0\]"),
        (lambda: metrics.keyframe_error(whole(), whole(), ()), r"keyframes are \[\]"),
        (lambda: metrics.keyframe_error(whole(), whole(), (T,)), "each from -9 to 8"),
        (lambda: metrics.keyframe_error(whole()[..., :5], whole()[..., :5], (0,)), "5 numbers per frame"),
        (lambda: metrics.foot_skate(whole(), [], 30.0), r"feet are \[\]; expected at least one of joints 0 to 3"),
        (lambda: metrics.foot_skate(whole(), [4], 30.0), r"feet are \[4\]"),
        (lambda: metrics.bone_length_error(whole(), torch.ones(2), CHAIN), "12 numbers per frame .* expected 9 and 2"),
        (lambda: metrics.bone_length_error(whole()[..., :9], torch.ones(3), CHAIN), "lengths 3; expected 9 and 2"),
        (lambda: metrics.nearer_share(sequences(0, N, 3, T, C), whole(), whole()[:, 1:]), "to fit p"),
    ],
)  # fmt: skip
def test_mistakes_are_told(call, message):
    with pytest.raises(ValueError, match=message):
        call()
