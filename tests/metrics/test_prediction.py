"""Metrics of prediction against slow transcriptions of their definitions, closed forms, invariances and known motions."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch

from mwlib import metrics
from mwlib.body.skeleton import H36M17, Skeleton

N, S, F, C = 7, 5, 6, 12
CHAIN = Skeleton("chain", ("root", "a", "b", "c", "d"), (-1, 0, 1, 2, 3))


def _case(seed: int = 0, dtype: torch.dtype = torch.float64):
    generator = torch.Generator().manual_seed(seed)
    p = torch.randn(N, S, F, C, generator=generator, dtype=dtype)
    g = torch.randn(N, F, C, generator=generator, dtype=dtype)
    last = torch.randn(N, C, generator=generator, dtype=dtype) * torch.tensor([0.1] * 4 + [1.0] * 3)[:, None].to(dtype)
    return p, g, last, metrics.multimodal_futures(last, g, 1.0)


def _norm(v) -> float:
    return math.sqrt(sum(float(a) ** 2 for a in np.ravel(v)))


def _errors(p, g) -> tuple[float, float]:
    """ADE and FDE of one window, word by word."""
    means = [sum(_norm(s[t] - g[t]) for t in range(len(g))) / len(g) for s in p]
    return min(means), min(_norm(s[-1] - g[-1]) for s in p)


def _transcription(p, g, last, threshold):
    p, g, last = (np.asarray(a) for a in (p, g, last))
    rows = []
    for i in range(len(p)):
        pairs = [_norm(a - b) for a, b in itertools.combinations(p[i], 2)]
        members = [j for j in range(len(p)) if _norm(last[j] - last[i]) < threshold]
        several = [_errors(p[i], g[j]) for j in members]
        mm = [sum(e[k] for e in several) / len(several) for k in (0, 1)]
        rows.append([sum(pairs) / len(pairs), *_errors(p[i], g[i]), *mm])
    return np.array(rows)


def _all(p, g, gs):
    values = (metrics.apd(p), metrics.ade(p, g), metrics.fde(p, g), metrics.mmade(p, gs), metrics.mmfde(p, gs))
    return torch.stack(values, dim=1)


def test_definitions():
    p, g, last, gs = _case()
    assert 1 < max(gs.sizes) and 1 in gs.sizes
    np.testing.assert_allclose(_all(p, g, gs), _transcription(p, g, last, 1.0), rtol=1e-12)


def test_float32_agrees_with_float64():
    p, g, last, gs = _case()
    p32, g32 = p.float(), g.float()
    sets = metrics.multimodal_futures(last, g32, 1.0)
    torch.testing.assert_close(_all(p32, g32, sets).double(), _all(p32.double(), g32.double(), gs), rtol=1e-6, atol=1e-7)


def test_identical_samples():
    _, g, _, gs = _case(dtype=torch.float32)
    p = g[:, None].repeat(1, S, 1, 1) * 1e3  # big numbers: a Gram matrix would leave rounding errors here
    assert metrics.apd(p).tolist() == [0.0] * N
    assert metrics.apd(p[:, :1]).tolist() == [0.0] * N
    assert metrics.ade(g[:, None], g).tolist() == metrics.fde(g[:, None], g).tolist() == [0.0] * N
    assert metrics.mmade(g[:, None], [f[None] for f in g]).tolist() == [0.0] * N


def test_multimodal_membership_is_strict_and_holds_the_window_itself():
    last = torch.zeros(4, 3)
    last[:, 0] = torch.tensor([0.0, 0.5, 0.75, 9.0])
    futures = torch.arange(4.0)[:, None, None].expand(4, 2, 3)
    gs = metrics.multimodal_futures(last, futures, 0.5)
    assert [m.tolist() for m in gs.members] == [[0], [1, 2], [1, 2], [3]]
    assert gs.sizes.tolist() == [1, 2, 2, 1]
    torch.testing.assert_close(gs[1], futures[1:3])
    assert [len(g) for g in gs] == [1, 2, 2, 1]


@pytest.mark.parametrize("rows", [1, 3])
def test_rows_of_the_search_at_a_time_do_not_matter(monkeypatch, rows):
    _, g, last, gs = _case()
    monkeypatch.setattr(metrics.prediction, "_ROWS", rows)
    again = metrics.multimodal_futures(last, g, 1.0)
    assert [m.tolist() for m in again.members] == [m.tolist() for m in gs.members]


def test_sets_given_as_tensors():
    p, _, _, gs = _case()
    torch.testing.assert_close(metrics.mmade(p, list(gs)), metrics.mmade(p, gs))
    torch.testing.assert_close(metrics.mmfde(p[2:5], gs.take(range(2, 5))), metrics.mmfde(p, gs)[2:5])


def test_sets_larger_than_a_tile(monkeypatch):
    p, g, last, gs = _case()
    expected = _transcription(p, g, last, 100.0)[:, 3:]
    monkeypatch.setattr(metrics.prediction, "_TILE", 3)
    monkeypatch.setattr(metrics.prediction, "_BUDGET", 1)
    everyone = metrics.multimodal_futures(last, g, 100.0)
    assert everyone.sizes.tolist() == [N] * N
    found = torch.stack([metrics.mmade(p, everyone), metrics.mmfde(p, everyone)], dim=1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_apd_of_the_sets(monkeypatch):
    _, g, last, gs = _case()
    monkeypatch.setattr(metrics.prediction, "_ROWS", 2)
    multimodal = metrics.multimodal_apd(gs)
    expected = [metrics.apd(members[None]).item() for members in gs]
    np.testing.assert_allclose(multimodal, expected, rtol=1e-7, atol=1e-12)
    assert (multimodal == 0).tolist() == (gs.sizes == 1).tolist()
    off = torch.where(multimodal > 0, 0.25, 9.0)  # windows without neighbours do not count
    assert metrics.apde(multimodal + off, multimodal).item() == pytest.approx(0.25)


def test_cmd():
    p, g, _, _ = _case()
    actions = ["walk", "sit", "walk", "walk", "sit", "walk", "walk"]
    joints, truth = np.asarray(p).reshape(N, S, F, -1, 3), np.asarray(g).reshape(N, F, -1, 3)
    expected = 0.0
    for action in ("walk", "sit"):
        rows = [i for i in range(N) if actions[i] == action]
        mean = np.mean([_norm(truth[i, t + 1, j] - truth[i, t, j]) for i in rows for t in range(F - 1) for j in range(C // 3)])
        for t in range(F - 1):
            steps = [_norm(joints[i, s, t + 1, j] - joints[i, s, t, j]) for i in rows for s in range(S) for j in range(C // 3)]
            expected += len(rows) / N * (F - 1 - t) * abs(np.mean(steps) - mean)
    found = metrics.cmd(metrics.step_length(p), metrics.step_length(g[:, None]), actions)
    assert found.item() == pytest.approx(expected)


def test_bone_length_jitter():
    p, _, _, _ = _case()
    joints = np.concatenate([np.zeros((N, S, F, 1, 3)), np.asarray(p).reshape(N, S, F, -1, 3)], axis=3)
    length = np.linalg.norm(np.diff(joints, axis=3), axis=-1)  # in a chain every joint's parent is the one before
    np.testing.assert_allclose(metrics.bone_length_jitter(p, CHAIN), np.abs(np.diff(length, axis=2)).mean((1, 2, 3)))
    angle = torch.linspace(0, 3, F)[:, None]
    turning = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=-1) * torch.arange(1, 5)[:, None]
    torch.testing.assert_close(metrics.bone_length_jitter(turning.flatten(1)[None, None], CHAIN), torch.zeros(1))


@pytest.mark.parametrize("sizes", [[7], [2, 5], [1] * 7])
def test_streaming_equals_batch(sizes):
    p, g, _, gs = _case()
    table = metrics.MetricTable(gs, actions=list("aabbaab"), skeleton=CHAIN)
    for windows in torch.tensor([3, 6, 0, 2, 5, 1, 4]).split(sizes):
        table.update(p[windows], g[windows], windows)
    values = _all(p, g, gs)
    summary = table.summary()
    names = ["apd", "ade", "fde", "mmade", "mmfde"]
    torch.testing.assert_close(torch.stack([table.values[n] for n in names], 1), values)
    np.testing.assert_allclose([summary["mean"][n] for n in names], values.mean(0))
    np.testing.assert_allclose([summary["standard_error"][n] for n in names], values.std(0) / N**0.5)
    np.testing.assert_allclose([summary["actions"]["b"]["mean"][n] for n in names], values[[2, 3, 6]].mean(0))
    assert summary["mean"]["bone_length_jitter"] == pytest.approx(metrics.bone_length_jitter(p, CHAIN).mean().item())
    steps = metrics.step_length(p), metrics.step_length(g[:, None])
    assert summary["cmd"] == pytest.approx(metrics.cmd(*steps, list("aabbaab")).item())


def test_where_a_future_begins_and_its_middle():
    """By hand: steady motion, then a jump of 3 cm at the first frame, and a twitch of 1 m in the last."""
    x = torch.arange(20.0)[:, None] * torch.tensor([0.01, 0.0, 0.0])
    history, g = x[None, :8], x[None, 8:]
    p = (g + torch.tensor([0.0, 0.03, 0.0]))[:, None].clone()
    p[..., -1, 2] += 1.0
    assert metrics.first_step(p, history).item() == pytest.approx(0.03, abs=1e-6)
    assert metrics.seam_jerk(p, history, 10.0).item() == pytest.approx(2 * 0.03 * 1000, rel=1e-4)  # 1, -2, 1 times the jump
    assert metrics.jerk(p, 10.0).item() == pytest.approx(1000 / 9, rel=1e-4) and metrics.median_jerk(p, 10.0).item() < 0.1
    table = metrics.MetricTable([g], fps=10.0, history=history)
    table.update(torch.cat([p, g[:, None]], dim=1), g, [0])
    found = table.summary()["mean"]
    assert found["first_step"] == pytest.approx(0.015, abs=1e-6) and found["ade"] == 0
    assert found["average_ade"] == pytest.approx(float(metrics.mean_ade(p, g).mean()) / 2)
    assert found["ade_of_mean"] == pytest.approx(float(metrics.ade((p + g[:, None]) / 2, g).mean()))
    with pytest.raises(ValueError, match="2 frames are observed; expected at least 3"):
        metrics.seam_jerk(p, history[:, -2:], 10.0)


@pytest.mark.parametrize("frames, names", [
    (12, ["speed", "pose_change", "jerk", "median_jerk", "error_0.2s"]),
    (10, ["pose_change", "jerk", "median_jerk", "error_0.2s"]),
    (3, ["pose_change"]),
])  # fmt: skip
def test_short_futures_have_the_metrics_that_fit(frames, names):
    """At 50 frames a second, speed needs eleven and jerk four."""
    p, g = torch.randn(2, 3, frames, 9), torch.randn(2, frames, 9)
    table = metrics.MetricTable([g[:1], g[1:]], fps=50.0)
    table.update(p, g, [0, 1])
    assert [*table.summary()["mean"]][5:] == [*names, "coverage_0.5", "coverage_0.9"]


def test_part_of_the_windows():
    p, g, _, gs = _case()
    table = metrics.MetricTable(gs)
    table.update(p[[1, 4]], g[[1, 4]], [1, 4])
    assert table.summary()["windows"]["ade"] == 2
    assert table.summary()["mean"]["mmade"] == pytest.approx(metrics.mmade(p, gs)[[1, 4]].mean().item())


def test_singletons():
    p, g, _, gs = _case()
    alone = gs.sizes == 1
    values = _all(p, g, gs)
    means, counts = {}, {}
    for option in metrics.evaluation.MM_SINGLETONS:
        table = metrics.MetricTable(gs, mm_singletons=option)
        table.update(p, g, range(N))
        means[option] = list(table.summary()["mean"].values())
        counts[option] = list(table.summary()["windows"].values())
    rest = values[~alone].mean(0)
    np.testing.assert_allclose(means["keep"], values.mean(0))
    np.testing.assert_allclose(means["skip_all"], rest)
    np.testing.assert_allclose(means["skip_mm"], [*values.mean(0)[:3], *rest[3:]])
    kept = int((~alone).sum())
    assert 0 < kept < N
    assert counts == {"keep": [N] * 5, "skip_all": [kept] * 5, "skip_mm": [N] * 3 + [kept] * 2}
    torch.testing.assert_close(values[alone, 1], values[alone, 3])  # MMADE is ADE there


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_non_finite_predictions_name_their_window(bad):
    p, g, _, gs = _case()
    p[3, 2, 1, 0] = bad
    for call in (metrics.apd, lambda p: metrics.ade(p, g), lambda p: metrics.mmfde(p, gs)):
        with pytest.raises(ValueError, match="p of window 3 is not finite"):
            call(p)
    table = metrics.MetricTable(gs)
    with pytest.raises(ValueError, match="p of window 6 is not finite"):
        table.update(p[[0, 3]], g[[0, 3]], [1, 6])


def test_refusals():
    p, g, last, gs = _case()
    with pytest.raises(ValueError, match="threshold is 0"):
        metrics.multimodal_futures(last, g, 0.0)
    with pytest.raises(ValueError, match="set of window 1 is empty"):
        metrics.mmade(p[:2], [g, g[:0]])
    with pytest.raises(ValueError, match="2 multimodal sets"):
        metrics.mmade(p, gs.take([0, 1]))
    with pytest.raises(ValueError, match="expected 48 for H36M17"):
        metrics.bone_length_jitter(p, H36M17)
    with pytest.raises(ValueError, match="mm_singletons is 'drop'"):
        metrics.MetricTable(gs, mm_singletons="drop")
    with pytest.raises(ValueError, match="3 actions for 7 windows"):
        metrics.MetricTable(gs, actions=list("abc"))
    table = metrics.MetricTable(gs)
    table.update(p[:3], g[:3], [0, 1, 2])
    with pytest.raises(ValueError, match="all different"):
        table.update(p[3:5], g[3:5], [3, 3])
    with pytest.raises(ValueError, match="window 2 was fed before"):
        table.update(p[2:4], g[2:4], [2, 3])


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


def test_a_change_of_pose_is_a_mean_over_samples():
    p = torch.tensor([[0.0, 9.0, 1.0], [0.0, -9.0, 3.0]]).reshape(1, 2, 3, 1)
    assert metrics.pose_change(p).tolist() == [2.0]


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


def test_a_table_leaves_out_what_the_frames_do_not_allow():
    g, pasts = torch.randn(4, 1, 3, generator=torch.Generator().manual_seed(0)), torch.zeros(4, 2, 3)
    table = metrics.MetricTable([row[None] for row in g], skeleton=CHAIN, fps=10.0, history=pasts)
    table.update(torch.zeros(4, 2, 1, 3), g, range(4))
    found = table.summary()
    assert {"ade", "first_step"} <= {*found["mean"]} and not {"seam_jerk", "bone_length_jitter", "jerk"} & {*found["mean"]}
    assert math.isnan(found["cmd"])
    longer = metrics.MetricTable(torch.zeros(4, 1, 6, 3).unbind(), fps=10.0, history=pasts)  # two frames are observed
    assert {"jerk", "first_step"} <= {*longer.metrics} and "seam_jerk" not in longer.metrics


@pytest.mark.parametrize(
    "given, message",
    [
        (dict(fps=-5.0), "fps is -5.0; expected a positive number"),
        (dict(fps=0.0), "fps is 0.0; expected a positive number"),
        (dict(clips="abc"), "3 clips for 4 windows; expected one each"),
        (dict(actions=[]), "0 actions for 4 windows; expected one each"),
        (dict(fps=10.0, history=torch.zeros(5, 3, 3)), "5 histories for 4 windows; expected one each"),
    ],
)
def test_what_does_not_fit_a_table_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        metrics.MetricTable(torch.zeros(4, 1, 2, 3).unbind(), **given)


@pytest.mark.parametrize("number", [-1, 4])
def test_numbers_of_windows_that_are_not_there(number):
    table = metrics.MetricTable(torch.zeros(4, 1, 2, 3).unbind(), actions=list("abab"))
    with pytest.raises(ValueError, match=f"window {number} of 4; expected numbers from 0 to 3"):
        table.update(torch.zeros(1, 2, 2, 3), torch.zeros(1, 2, 3), [number])


def test_cmd_counts_every_window():
    with pytest.raises(ValueError, match="2 actions for 4 and 4 windows; expected one each"):
        metrics.cmd(torch.zeros(4, 3), torch.full((4, 3), 0.1), ["walk", "walk"])
