"""Metrics of a whole test set of predictions, streamed."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.metrics.prediction import ERRORS, MultimodalFutures, Predictions, by_action, check_shapes, cmd, step_length
from mwlib.metrics.realism import REALISM
from mwlib.metrics.table import summary

__all__ = ["MetricTable"]

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
        gs: Sequence[Float[Tensor, "_M F C"]],
        actions: Sequence[Hashable] | None = None,
        skeleton: Skeleton | None = None,
        mm_singletons: str = "keep",
        fps: float | None = None,
        clips: Sequence[Hashable] | None = None,
    ) -> None:
        if mm_singletons not in MM_SINGLETONS:
            raise ValueError(f"mm_singletons is {mm_singletons!r}; expected one of {', '.join(MM_SINGLETONS)}")
        if actions is not None and len(actions) != len(gs):
            raise ValueError(f"{len(actions)} actions for {len(gs)} windows; expected one each")
        self.gs, self.skeleton, self.fps, self.mm_singletons = MultimodalFutures.of(gs), skeleton, fps or 0.0, mm_singletons
        self.actions = ["all"] * len(gs) if actions is None else list(actions)
        self.clips = list(range(len(gs))) if clips is None else list(clips)
        frames = self.gs.futures.shape[1]
        self.metrics = {name: m for name, m in (ERRORS | REALISM).items() if m.fits(frames, self.fps, skeleton)}
        self.values = {name: torch.full((len(gs),), torch.nan, dtype=torch.float64) for name in self.metrics}
        self._steps = torch.full((2, len(gs), frames - 1), torch.nan, dtype=torch.float64)

    def update(self, p: Float[Tensor, "n S F C"], g: Float[Tensor, "n F C"], windows: Sequence[int] | Int[Tensor, " n"]) -> None:
        """Add the predictions of some windows, given by their numbers in the test set."""
        windows = torch.as_tensor(windows)
        if windows.shape != (len(p),) or len(windows.unique()) < len(p):
            raise ValueError(f"{len(windows)} window numbers for {len(p)} predictions; expected one each, all different")
        check_shapes(p, g, windows=windows)
        fed = windows[self.values["apd"][windows].isfinite()].tolist()
        if fed:
            raise ValueError(f"window {fed[0]} was fed before; expected every window once")
        part = Predictions(p, g, self.gs.take(windows.tolist()), self.skeleton, self.fps)
        for name, metric in self.metrics.items():
            self.values[name][windows] = metric.of(part).double().cpu()
        for row, motion in zip(self._steps, (p, g[:, None]), strict=True):
            row[windows] = step_length(motion).double().cpu()

    def summary(self) -> dict[str, Any]:
        """`summary` of the windows that count, with "windows", their number, by metric, "cmd" (metres), and "actions": the same
        for the windows of each action.
        """
        alone = self.gs.sizes == 1
        counted = self.values["apd"].isfinite() & ~(alone if self.mm_singletons == "skip_all" else torch.zeros_like(alone))
        rows = counted.nonzero()[:, 0].tolist()
        actions = [self.actions[i] for i in rows]
        hidden = alone if self.mm_singletons == "skip_mm" else torch.zeros_like(alone)
        kept = {k: v.masked_fill(hidden, torch.nan)[rows] if k.startswith("mm") else v[rows] for k, v in self.values.items()}
        predicted, truth = self._steps[:, rows]
        clips = [self.clips[i] for i in rows]
        per_action = {a: _row({k: v[i] for k, v in kept.items()}, [clips[n] for n in i]) for a, i in by_action(actions).items()}
        return {**_row(kept, clips), "cmd": float(cmd(predicted, truth, actions)), "actions": per_action}


def _row(values: dict[str, Tensor], clips: Sequence[Hashable]) -> dict[str, Any]:
    return {**summary(values, clips), "windows": {name: int(v.isfinite().sum()) for name, v in values.items()}}
