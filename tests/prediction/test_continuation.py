"""Futures that continue what was observed."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

import mwlib as mw
from mwlib import metrics
from mwlib.prediction import representation as continuation
from mwlib.prediction.representation import Continuation, fit_representation
from mwlib.transforms.dwt import TimeWaveletTransform
from tests.sample_settings import small, two_people

H, T, C, FPS = 25, 75, 6, 50.0
TRANSFORMS = [
    TimeWaveletTransform(T, C, level=3, omit=1),
    TimeWaveletTransform(T, C, level=2),
    mw.DCTTransform(T, C, 12),
    mw.WaveletTransform(T, C, "bior2.8", "zero"),
]
names = pytest.mark.parametrize("tf", TRANSFORMS, ids=lambda tf: type(tf).__name__ + str(tf.shape))


def smooth_motions(n: int = 3) -> torch.Tensor:
    """Sums of slow sines, metres."""
    t, rng = np.arange(T) / FPS, np.random.default_rng(0)
    turns = 2 * np.pi * np.array([0.3, 0.8, 1.5]) * t[:, None]  # (T, 3)
    phases, sizes = rng.uniform(0, 6, (n, 1, C, 3)), rng.normal(size=(n, 1, C, 3))
    return torch.from_numpy((sizes * np.sin(turns[:, None] + phases)).sum(-1))


@pytest.mark.parametrize("seam", [0.0, 0.02])
@names
def test_it_is_the_least_of_what_it_weighs(tf, seam):
    """Against a minimiser that knows nothing of matrices, one channel."""
    x = smooth_motions(1)[0]
    y = tf(x + 0.05 * torch.randn(T, C, generator=torch.Generator().manual_seed(1), dtype=torch.float64))
    found = Continuation(tf, H, T, FPS, seam)(y, x[:H])[:, 0].numpy()
    rows = tf.time_rows()
    rows, c = np.eye(T) if rows is None else rows, tf.along_time(y)[:, 0].numpy()
    ends = np.exp(-np.minimum(np.abs(np.arange(T - 3) + 2 - H), T - 2.5 - np.arange(T - 3)) / (continuation.REACH * FPS))
    weights = (continuation.INSIDE * FPS) ** 6 + (continuation.ENDS * FPS) ** 6 * ends

    def cost(f: np.ndarray) -> float:
        whole = np.concatenate([x[:H, 0].numpy(), f])
        turn = (seam * FPS) ** 4 * (whole[H] - 2 * whole[H - 1] + whole[H - 2]) ** 2
        return float(((rows @ whole - c) ** 2).sum() + (weights * np.diff(whole, n=3) ** 2).sum() + turn)

    best = minimize(cost, found, method="L-BFGS-B", options={"ftol": 1e-15, "gtol": 1e-10})
    assert cost(found) <= best.fun + 1e-9
    assert np.abs(best.x - found).max() < 1e-3


def test_a_future_may_begin_with_the_velocity_that_was_observed():
    """The more the longer the seam; of futures that fit the history badly."""
    tf, x = TRANSFORMS[0], smooth_motions(1)[0]
    y = tf(x + 0.3 * torch.randn(T, C, generator=torch.Generator().manual_seed(1), dtype=torch.float64))
    onward = 2 * x[H - 1] - x[H - 2]
    off = [float((Continuation(tf, H, T, FPS, s)(y, x[:H])[0] - onward).norm()) for s in (0.0, 0.03, 0.1, 1.0)]
    assert off == sorted(off, reverse=True) and off[2] < 0.7 * off[0] and off[3] < 0.01 * off[0]


@names
def test_a_smooth_motion_comes_back_whole(tf):
    x = smooth_motions()
    continued = Continuation(tf, H, T, FPS)(tf(x), x[:, :H])
    cut = tf.inverse(tf(x))[:, H:]
    assert (continued - x[:, H:]).abs().max() <= max(0.02, 1.01 * float((cut - x[:, H:]).abs().max()))


def test_levels_that_are_left_out_do_not_take_the_last_frames_along():
    x, tf = smooth_motions(), TRANSFORMS[0]
    futures = tf.inverse(tf(x))[:, H:], Continuation(tf, H, T, FPS)(tf(x), x[:, :H])
    cut, continued = ((f - x[:, H:]).norm(dim=-1)[:, -3:].mean() for f in futures)
    assert continued < 0.1 * cut


@names
def test_a_future_begins_where_the_past_ends(tf):
    """Coefficients of another motion, as a model that has not looked draws them."""
    x, other = smooth_motions(2)
    shifted = other + (x[H] - other[H]) + 0.2
    cut, continued = tf.inverse(tf(shifted))[H:], Continuation(tf, H, T, FPS)(tf(shifted), x[:H])
    steps = [metrics.first_step(f[None, None], x[None, :H]) for f in (cut, continued)]
    jerks = [metrics.seam_jerk(f[None, None], x[None, :H], FPS) for f in (cut, continued)]
    assert steps[1] < 0.5 * steps[0] and jerks[1] < 0.5 * jerks[0]


def test_batches_broadcast_and_gradients_flow():
    tf = TRANSFORMS[0]
    x = smooth_motions(4).float()
    y = torch.randn(4, 5, *tf.shape, requires_grad=True)
    together = Continuation(tf, H, T, FPS)(y, x[:, None, :H])
    one = Continuation(tf, H, T, FPS)
    alone = torch.stack([torch.stack([one(s, h[:H]) for s in part]) for part, h in zip(y, x, strict=True)])
    torch.testing.assert_close(together, alone, rtol=1e-5, atol=1e-5)
    together.sum().backward()
    assert y.grad is not None and y.grad.isfinite().all()


def test_times_mean_the_same_at_every_rate():
    """The same movement, twice as often: the same futures at the times that both have."""
    t = np.arange(2 * T) / (2 * FPS)
    fine = torch.from_numpy(np.sin(2 * np.pi * 0.7 * t)[:, None] * np.ones(3))
    found = []
    for x, history, fps in ((fine, 2 * H, 2 * FPS), (fine[::2], H, FPS)):
        tf = mw.DCTTransform(len(x), 3, 12)
        found.append(Continuation(tf, history, len(x), fps)(tf(x), x[:history]))
    assert (found[0][::2] - found[1])[:-2].abs().max() < 0.02


@pytest.mark.parametrize("representation", ["pose", "displacement", "relaxing"])
def test_every_representation_is_continued(representation):
    cfg = small(transform="time_wavelet", level=2, omit=1, representation=representation)
    split = two_people()
    seen = fit_representation(cfg, split.train)
    test = mw.windows(split.validation, cfg.windows.history, cfg.windows.future, 5)
    y, continuation = seen.encode(test.x)[:, None], Continuation(seen.motion, seen.history, seen.frames, cfg.data.fps)
    whole, cut = seen.continued(y, test.x_history, continuation), seen.decode(y, test.x_history)[:, :, seen.history :]
    assert metrics.ade(whole, test.x_future).mean() < metrics.ade(cut, test.x_future).mean()
    assert whole.shape == cut.shape == (len(test), 1, cfg.windows.future, test.x.shape[-1])
