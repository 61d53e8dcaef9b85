"""Seams, keyframes, feet, bones and paths on motions whose values are known; displacement errors over samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from mwlib import metrics
from mwlib.body.kinematics import bone_lengths, fk
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections.lafan1 import LAFAN1

CHAIN = Skeleton("chain", ("root", "a", "b"), (-1, 0, 1))
N, S, T, C = 4, 3, 9, 12


def motions(seed: int = 0, *shape: int) -> torch.Tensor:
    return torch.randn(*(shape or (N, T, C)), generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


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
    line = t * motions(1, C)
    assert metrics.seam_ratio(line).item() == pytest.approx(1)
    pasted = line.clone()
    pasted[0] -= 3 * (line[1] - line[0])
    assert metrics.seam_ratio(pasted).item() == pytest.approx((4 + 1) / 2)
    pasted[-1] += 6 * (line[1] - line[0])
    assert metrics.seam_ratio(pasted).item() == pytest.approx((4 + 7) / 2)
    assert metrics.seam_ratio(torch.cat([0 * line[:4], line[-1:]])).item() == math.inf
    assert metrics.seam_ratio(0 * line).isnan()
    x = motions()
    for n, row in enumerate(x.numpy()):
        step = [np.linalg.norm(b - a) for a, b in zip(row[:-1], row[1:], strict=True)]
        expected = (step[0] + step[-1]) / 2 / np.mean(step[1:-1])
        assert metrics.seam_ratio(x)[n].item() == pytest.approx(expected, rel=1e-12)
    torch.testing.assert_close(metrics.seam_ratio(x.flip(-2)), metrics.seam_ratio(x))
    torch.testing.assert_close(metrics.seam_ratio(100 * x + 1), metrics.seam_ratio(x))


def test_keyframe_error():
    p, g = motions(0), motions(1)
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
    assert metrics.foot_skate(x, [0, 1], fps, height=0.5).item() == pytest.approx((0.3 + 5) / 2)
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
    x = fk(q, offsets, motions(2, N, T, 3), LAFAN1)[0]
    lengths = offsets[1:].norm(dim=-1)
    assert metrics.bone_length_error(x.flatten(-2), lengths, LAFAN1).abs().max() < 1e-12
    noisy = x + 0.1 * torch.randn(x.shape, generator=draws, dtype=torch.float64)
    expected = np.abs(bone_lengths(noisy.numpy(), LAFAN1) - lengths.numpy()).mean((1, 2))
    np.testing.assert_allclose(metrics.bone_length_error(noisy.flatten(-2), lengths, LAFAN1), expected, rtol=1e-12)
    own = torch.from_numpy(bone_lengths(noisy[:, 0].numpy(), LAFAN1))  # those of each motion's first frame
    assert metrics.bone_length_error(noisy[:, :1].flatten(-2), own, LAFAN1).abs().max() < 1e-12
    moved = torch.tensor([[5.0, 5, 5, 6, 5, 5, 6, 6.1, 5]], dtype=torch.float64)
    assert metrics.bone_length_error(moved, torch.ones(2), CHAIN).item() == pytest.approx(0.05)


def test_float32_agrees_with_float64():
    x, g = motions(0), motions(1)
    for metric in (
        metrics.seam_ratio,
        metrics.path_length,
        lambda a: metrics.keyframe_error(a, g.to(a), (0, -1)),
        lambda a: metrics.foot_skate(a, [0, 1], 30.0, height=0.7),
        lambda a: metrics.bone_length_error(a[..., :9], torch.ones(2), CHAIN),
    ):
        torch.testing.assert_close(metric(x.float()).double(), metric(x), rtol=1e-5, atol=1e-6)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: metrics.seam_ratio(motions()[:, :3]), "at least 4 frames"),
        (lambda: metrics.path_length(motions()[:, :1]), "at least 2 frames"),
        (lambda: metrics.seam_ratio(motions() / 0), r"not finite at \[0, 0, 0\]"),
        (lambda: metrics.keyframe_error(motions(), motions(), ()), r"keyframes are \[\]"),
        (lambda: metrics.keyframe_error(motions(), motions(), (T,)), "each from -9 to 8"),
        (lambda: metrics.keyframe_error(motions()[..., :5], motions()[..., :5], (0,)), "5 numbers per frame"),
        (lambda: metrics.foot_skate(motions(), [], 30.0), r"feet are \[\]; expected at least one of joints 0 to 3"),
        (lambda: metrics.foot_skate(motions(), [4], 30.0), r"feet are \[4\]"),
        (lambda: metrics.bone_length_error(motions(), torch.ones(2), CHAIN), "12 numbers per frame .* expected 9 and 2"),
        (lambda: metrics.bone_length_error(motions()[..., :9], torch.ones(3), CHAIN), "lengths 3; expected 9 and 2"),
        (lambda: metrics.nearer_share(motions(0, N, S, T, C), motions(), motions()[:, 1:]), "to fit p"),
    ],
)  # fmt: skip
def test_mistakes_are_told(call, message):
    with pytest.raises(ValueError, match=message):
        call()
