"""Measures of how people move, and the table of all metrics of a whole test set, streamed.

Errors of the best of many samples do not tell: standing still, or shaking, can have a good one. Speed, change of pose,
smoothness and the error's growth with the horizon are to be read beside the same numbers of the truth.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import partial
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.settings import Positive, choice, real

from mwlib.metrics.prediction import (  # isort: skip
    ERRORS, Metric, MultimodalFutures, PerWindow, Samples, Sets, Truths, ade, by_action, check_shapes, cmd, fde,
    mean_ade, step_length,
)  # fmt: skip
from mwlib.metrics.table import Column, summary

SPEED_SECONDS = 0.2  # speeds over shorter times measure a recording's noise
HORIZONS = (0.2, 0.4, 1.0)  # seconds ahead at which errors are reported beside FDE
BANDS = (0.5, 0.9)  # shares of the samples in whose middle the truth is looked for
Past = Float[Tensor, "N H C"]  # the frames before


def speed(p: Samples, fps: Positive) -> PerWindow:
    """How fast a joint moves, m/s: mean over samples, joints and frames of the way in 0.2 s.

    Source: own choice.

    Raises:
        ValueError: p is not (N, S, F, C), not finite or shorter than that.

    >>> steady = torch.arange(20.0)[:, None] * torch.tensor([0.03, 0.04, 0.0])
    >>> round(float(speed(steady[None, None], fps=10.0)), 4)
    0.5
    """
    step = _step(fps)
    check_shapes(p, frames=step + 1)
    joints = p.unflatten(-1, (-1, 3))
    return (joints[:, :, step:] - joints[:, :, :-step]).norm(dim=-1).mean((1, 2, 3)) * fps / step


def pose_change(p: Samples) -> PerWindow:
    """How far the last predicted pose is from the first, metres over the C values; mean over samples.

    Source: own choice.

    >>> pose_change(torch.tensor([0.0, 5.0, 3.0]).reshape(1, 1, 3, 1))
    tensor([3.])
    """
    check_shapes(p)
    return (p[:, :, -1] - p[:, :, 0]).norm(dim=-1).mean(1)


def jerk(p: Samples, fps: Positive) -> PerWindow:
    """Third derivative of a joint's place, m/s³: mean length over samples, joints and frames of the third difference.

    Source: own choice; Flash and Hogan, 1985, take it as the measure of smoothness.

    Raises:
        ValueError: p is not (N, S, F, C), not finite or of fewer than four frames.

    >>> cubic = (torch.arange(8.0) / 10) ** 3
    >>> round(float(jerk(torch.stack([cubic, 0 * cubic, 0 * cubic], -1)[None, None], fps=10.0)), 3)
    6.0
    """
    return _jerks(p, fps).mean((1, 2, 3))


def median_jerk(p: Samples, fps: Positive) -> PerWindow:
    """The median over frames of the jerk there, m/s³: a twitch at one end does not make up for a stiff middle.

    Source: own choice, as `jerk`.

    Raises:
        ValueError: as in `jerk`.
    """
    return _jerks(p, fps).mean((1, 3)).median(dim=1).values


def seam_jerk(p: Samples, x_history: Past, fps: Positive) -> PerWindow:
    """Jerk where the future begins, m/s³: the largest of the three third differences that straddle it, each a mean over samples
    and joints.

    Source: own choice. Jerk within the future does not see a jump at its first frame.

    Args:
        p: futures, metres.
        x_history: the frames before them; three are looked at.
        fps: frames per second.

    Raises:
        ValueError: as in `jerk`, or fewer than three frames are observed.

    >>> p = torch.arange(3.0, 9.0).reshape(1, 1, 6, 1) * torch.ones(3)
    >>> x_history = torch.arange(3.0).reshape(1, 3, 1) * torch.ones(3)
    >>> float(seam_jerk(p, x_history, 1.0)), round(float(seam_jerk(p + 1, x_history, 1.0)), 3)
    (0.0, 3.464)
    """
    check_shapes(p, frames=4)
    around = torch.cat([_last(x_history, 3)[:, None].expand(-1, p.shape[1], -1, -1), p[:, :, :3]], dim=2)
    return _jerks(around, fps).mean((1, 3)).amax(1)


def first_step(p: Samples, x_history: Past) -> PerWindow:
    """How far a joint of the first predicted frame is from where its last observed step would take it, metres.

    Source: own choice; mean over samples and joints.

    Raises:
        ValueError: p is not (N, S, F, C) or not finite, or fewer than two frames are observed.
    """
    check_shapes(p)
    before, last = _last(x_history, 2).unbind(1)
    return (p[:, :, 0] - (2 * last - before)[:, None]).unflatten(-1, (-1, 3)).norm(dim=-1).mean((1, 2))


def _jerks(p: Samples, fps: float) -> Float[Tensor, "N S _F J"]:
    """Of each joint between four neighbouring frames, m/s³."""
    check_shapes(p, frames=4)
    return p.unflatten(-1, (-1, 3)).diff(n=3, dim=2).norm(dim=-1) * fps**3


def _last(x_history: Past, frames: int) -> Float[Tensor, "N _frames C"]:
    if x_history.shape[1] < frames:
        raise ValueError(f"{x_history.shape[1]} frames are observed; expected at least {frames}")
    return x_history[:, -frames:]


def error_at(p: Samples, g: Truths, fps: Positive, seconds: float) -> PerWindow:
    """Error of the best sample at one time ahead, metres over the C values: `fde`, had the prediction ended there.

    Raises:
        ValueError: shapes do not fit, or the prediction does not reach so far.

    >>> p, g = torch.tensor([1.0, 4.0]).reshape(1, 1, 2, 1), torch.zeros(1, 2, 1)
    >>> error_at(p, g, fps=10.0, seconds=0.1), error_at(p, g, fps=10.0, seconds=0.2)
    (tensor([1.]), tensor([4.]))
    """
    frame = round(seconds * fps)
    if not 1 <= frame <= p.shape[2]:
        raise ValueError(f"seconds is {seconds:g}; expected a time within the {p.shape[2] / fps:g} s that are predicted")
    return fde(p[:, :, :frame], g[:, :frame])


def coverage(p: Samples, g: Truths, share: float) -> PerWindow:
    """How often a coordinate of the truth lies in the middle `share` of the samples; NaN for a single sample.

    The truth's rank among S samples stands for an interval of length 1/(S+1); what counts is how much of it lies in the band.
    So `share` is what comes out, for any S, where the truth is as one more sample would be. Source: own choice; ranks after the
    verification rank histogram of weather forecasts (Hamill, 2001).

    Raises:
        ValueError: shapes do not fit, a value is not finite, or share is not between 0 and 1.

    >>> p = torch.arange(3.0).reshape(1, 3, 1, 1)
    >>> [float(coverage(p, torch.full((1, 1, 1), g), share=0.5)) for g in (-0.5, 0.5, 5.0)]
    [0.0, 1.0, 0.0]
    """
    check_shapes(p, g)
    if not 0 < share < 1:
        raise ValueError(f"share is {share:g}; expected more than 0 and less than 1")
    samples = p.shape[1]
    if samples == 1:
        return p.new_full((len(p),), torch.nan)
    below, equal = (relation(p, g[:, None]).sum(1, dtype=p.dtype) for relation in (torch.lt, torch.eq))
    first = (below + equal / 2) / (samples + 1)
    last, edge = first + 1 / (samples + 1), (1 - share) / 2
    inside = (last.clamp_max(1 - edge) - first.clamp_min(edge)).clamp_min(0) * (samples + 1)
    return inside.mean((1, 2))


def _step(fps: float) -> int:
    """Frames over which speed is measured."""
    return max(round(SPEED_SECONDS * fps), 1)


REALISM = {  # of futures at a known rate
    "speed": Metric(Column("speed (m/s)"), speed, lambda fps: _step(fps) + 1),
    "pose_change": Metric(Column("change of pose (m)"), pose_change),
    "jerk": Metric(Column("jerk (m/s³)"), jerk, lambda _: 4),
    "median_jerk": Metric(Column("jerk of the median frame (m/s³)"), median_jerk, lambda _: 4),
    **{
        f"error_{s:g}s": Metric(
            Column(f"error at {s:g} s", "lower"), partial(error_at, seconds=s), lambda fps, s=s: round(s * fps)
        )
        for s in HORIZONS
    },
    **{f"coverage_{share:g}": Metric(Column(f"inside {100 * share:g} %"), partial(coverage, share=share)) for share in BANDS},
}
SEAM = {  # of those whose past is known, too
    "seam_jerk": Metric(Column("jerk where it begins (m/s³)"), seam_jerk, lambda _: 4, past=3),
    "first_step": Metric(Column("first frame from steady motion (mm)", scale=1000.0), first_step, past=2),
    "average_ade": Metric(Column("ADE of the average sample", "lower"), mean_ade),
    "ade_of_mean": Metric(Column("ADE of the samples' mean", "lower"), lambda p, g: ade(p.mean(1, keepdim=True), g)),
}

MM_SINGLETONS = ("keep", "skip_all", "skip_mm")


class MetricTable:
    """Metrics of a test set that is too big to hold at once: feed chunks of windows, then ask for the summary.

    Args:
        gs: multimodal sets of all N windows of the test set, from `multimodal_futures` or a list of tensors.
        actions: class of each window, for the table per action and for CMD; None: one class.
        skeleton: if given, `bone_length_jitter` is reported too.
        fps: if given, so are `speed`, `pose_change` and `jerk`, and the errors 0.2, 0.4 and 1 s ahead ("error_0.2s", ...), as far
            as the futures are long enough for them.
        clips: where each window comes from; windows of one clip are not independent.
        history: the observed frames of all N windows; if given, with `fps`, so is how futures continue them: `seam_jerk`,
            `first_step`, and the ADE of an average sample and of the samples' mean.
        mm_singletons: what becomes of windows whose set holds only themselves: "keep" (DLow, HumanMAC, BeLFusion; the
            default, as MotionWavelet follows HumanMAC), "skip_all": left out of every number (GSPS, STARS),
            "skip_mm": left out of MMADE and MMFDE only (CoMusion).

    `values` maps each metric to (N,) float64, NaN where a window has not been fed yet. Numbers depend neither on the
    size nor on the order of the chunks; windows that were never fed do not count, their futures still serve as neighbours.

    Raises:
        ValueError: an argument does not fit the others, a window is fed twice, or a prediction is not finite.

    >>> g = torch.zeros(3, 2, 3)
    >>> table = MetricTable([g[i : i + 1] for i in range(3)])
    >>> table.update(torch.ones(2, 4, 2, 3), g[:2], windows=[0, 1])
    >>> summary = table.summary()
    >>> summary["windows"]["ade"], round(summary["mean"]["ade"], 3)
    (2, 1.732)
    """

    def __init__(
        self,
        gs: Sets,
        actions: Sequence[Hashable] | None = None,
        skeleton: Skeleton | None = None,
        mm_singletons: str = "keep",
        fps: float | None = None,
        clips: Sequence[Hashable] | None = None,
        history: Past | None = None,
    ) -> None:
        choice("mm_singletons", mm_singletons, MM_SINGLETONS)
        self.actions = ["all"] * len(gs) if actions is None else list(actions)
        self.clips = list(range(len(gs)) if clips is None else clips)
        for name, rows in (
            ("actions", self.actions),
            ("clips", self.clips),
            ("histories", self.actions if history is None else history),
        ):
            if len(rows) != len(gs):
                raise ValueError(f"{len(rows)} {name} for {len(gs)} windows; expected one each")
        if fps is not None and real("fps", fps) <= 0:
            raise ValueError(f"fps is {fps}; expected a positive number")
        self.gs, self.skeleton, self.fps, self.mm_singletons = MultimodalFutures.of(gs), skeleton, fps or 0.0, mm_singletons
        self.history, frames = history, self.gs.futures.shape[1]
        offered = ERRORS | (REALISM if fps else {}) | (SEAM if fps and history is not None else {})
        if skeleton is None:
            del offered["bone_length_jitter"]
        seen = 0 if history is None else history.shape[1]
        self.metrics = {n: m for n, m in offered.items() if 1 <= m.fewest(self.fps) <= frames and m.past <= seen}
        self.values = {name: torch.full((len(gs),), torch.nan, dtype=torch.float64) for name in self.metrics}
        self._steps = torch.full((2, len(gs), frames - 1), torch.nan, dtype=torch.float64)

    def update(self, p: Float[Tensor, "n S F C"], g: Float[Tensor, "n F C"], windows: Sequence[int] | Int[Tensor, " n"]) -> None:
        """Add the predictions of some windows, given by their numbers in the test set."""
        windows = torch.as_tensor(windows)
        if windows.shape != (len(p),) or len(windows.unique()) < len(p):
            raise ValueError(f"{len(windows)} window numbers for {len(p)} predictions; expected one each, all different")
        if wrong := [n for n in windows.tolist() if not 0 <= n < len(self.gs.sizes)]:
            raise ValueError(f"window {wrong[0]} of {len(self.gs.sizes)}; expected numbers from 0 to {len(self.gs.sizes) - 1}")
        check_shapes(p, g, windows=windows)
        if fed := windows[self.values["apd"][windows].isfinite()].tolist():
            raise ValueError(f"window {fed[0]} was fed before; expected every window once")
        past, gs = None if self.history is None else self.history[windows].to(p), self.gs.take(windows.tolist())
        for name, metric in self.metrics.items():
            found = metric.of(p=p, g=g, gs=gs, skeleton=self.skeleton, fps=self.fps, x_history=past)
            self.values[name][windows] = found.double().cpu()
        for row, motion in zip(self._steps, (p, g[:, None]), strict=True):
            if p.shape[2] > 1:
                row[windows] = step_length(motion).double().cpu()

    def summary(self) -> dict[str, Any]:
        """`summary` of the windows that count, with "windows", their number, by metric, "cmd" (metres), and "actions": the same
        for the windows of each action.
        """
        alone = self.gs.sizes == 1
        counted = self.values["apd"].isfinite() & ~(alone & (self.mm_singletons == "skip_all"))
        rows = counted.nonzero()[:, 0].tolist()
        actions = [self.actions[i] for i in rows]
        hidden = alone & (self.mm_singletons == "skip_mm")
        kept = {k: v.masked_fill(hidden, torch.nan)[rows] if k.startswith("mm") else v[rows] for k, v in self.values.items()}
        predicted, truth = self._steps[:, rows]
        clips = [self.clips[i] for i in rows]
        per_action = {a: _row({k: v[i] for k, v in kept.items()}, [clips[n] for n in i]) for a, i in by_action(actions).items()}
        return {
            **_row(kept, clips),
            "cmd": float(cmd(predicted, truth, actions)) if predicted.shape[1] else float("nan"),
            "actions": per_action,
        }


def _row(values: dict[str, Tensor], clips: Sequence[Hashable]) -> dict[str, Any]:
    return {**summary(values, clips), "windows": {name: int(v.isfinite().sum()) for name, v in values.items()}}
