"""Tables of metrics: columns, standard errors clustered by clip, and the streamed evaluation of a test set."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.metrics.prediction import (
    MultimodalFutures,
    ade,
    apd,
    bone_length_jitter,
    by_action,
    check_shapes,
    cmd,
    fde,
    mmade,
    mmfde,
    step_length,
)
from mwlib.metrics.realism import motion_metrics


class Column(NamedTuple):
    """A metric's column: heading, which values are better ("lower", "higher" or ""), and the factor to the unit shown.

    >>> Column("bone jitter (mm)", scale=1000.0)
    Column(heading='bone jitter (mm)', better='', scale=1000.0)
    """

    heading: str
    better: str = ""
    scale: float = 1.0


def clustered_error(values: Float[np.ndarray, " N"], clusters: Sequence[Hashable]) -> float:
    """Standard error of a mean over values that are alike within clusters.

    Windows of one clip overlap and show the same person doing the same, so they are not independent; their number
    flatters. What varies freely is a clip's total deviation from the mean:
    sqrt(C/(C-1) Σ_c (Σ_{i in c} (v_i - mean))²) / N. This is what a bootstrap over whole clips tends to; where every
    value is a cluster of its own it is the usual deviation / sqrt(N).

    Source: the cluster-robust variance of Liang and Zeger, 1986, for a mean.

    Args:
        values: one per window; those that are not finite are left out.
        clusters: the clip of each window.

    Returns:
        NaN with fewer than two clusters.

    Raises:
        ValueError: values and clusters are not equally many.

    >>> apart = clustered_error(np.array([0.0, 1.0, 0.0, 1.0]), "abcd")
    >>> alike = clustered_error(np.array([0.0, 0.0, 1.0, 1.0]), "aabb")
    >>> round(apart, 4), round(alike, 4)
    (0.2887, 0.5)
    """
    if len(values) != len(clusters):
        raise ValueError(f"{len(values)} values of {len(clusters)} clusters; expected one each")
    kept = np.isfinite(values)
    names = {name: i for i, name in enumerate(dict.fromkeys(c for c, k in zip(clusters, kept, strict=True) if k))}
    if len(names) < 2:
        return float("nan")
    found = values[kept]
    number = [names[c] for c, k in zip(clusters, kept, strict=True) if k]
    totals = np.bincount(number, found - found.mean())
    return float(np.sqrt(len(names) / (len(names) - 1) * (totals**2).sum()) / len(found))


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
        self.gs, self.skeleton, self.mm_singletons = MultimodalFutures.of(gs), skeleton, mm_singletons
        self.actions = ["all"] * len(gs) if actions is None else list(actions)
        self.clips = list(range(len(gs))) if clips is None else list(clips)
        self.motion = motion_metrics(self.gs.futures.shape[1], fps) if fps else {}
        names = ["apd", "ade", "fde", "mmade", "mmfde"] + ["bone_length_jitter"] * (skeleton is not None) + [*self.motion]
        self.values = {name: torch.full((len(gs),), torch.nan, dtype=torch.float64) for name in names}
        self._steps = torch.full((2, len(gs), self.gs.futures.shape[1] - 1), torch.nan, dtype=torch.float64)

    def update(self, p: Float[Tensor, "n S F C"], g: Float[Tensor, "n F C"], windows: Sequence[int] | Int[Tensor, " n"]) -> None:
        """Add the predictions of some windows, given by their numbers in the test set."""
        windows = torch.as_tensor(windows)
        if windows.shape != (len(p),) or len(windows.unique()) < len(p):
            raise ValueError(f"{len(windows)} window numbers for {len(p)} predictions; expected one each, all different")
        check_shapes(p, g, windows=windows)
        fed = windows[self.values["apd"][windows].isfinite()].tolist()
        if fed:
            raise ValueError(f"window {fed[0]} was fed before; expected every window once")
        sets = self.gs.take(windows.tolist())
        found = {"apd": apd(p), "ade": ade(p, g), "fde": fde(p, g), "mmade": mmade(p, sets), "mmfde": mmfde(p, sets)}
        if self.skeleton is not None:
            found["bone_length_jitter"] = bone_length_jitter(p, self.skeleton)
        found |= {name: metric(p, g) for name, metric in self.motion.items()}
        for name, value in found.items():
            self.values[name][windows] = value.double().cpu()
        for row, motion in zip(self._steps, (p, g[:, None]), strict=True):
            row[windows] = step_length(motion).double().cpu()

    def summary(self) -> dict:
        """Plain numbers, ready for JSON.

        Returns:
            {"mean": {metric: metres}, "standard_error": {metric: metres}, "windows": {metric: count}, "cmd": metres,
            "actions": {action: the first three for its windows}, "values": {metric: one number per window}, "clips": the clip of
            each window}. The standard error is `clustered_error` over clips. NaN where there is nothing to average.
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
        return {
            **_row(kept, clips), "cmd": float(cmd(predicted, truth, actions)), "actions": per_action,
            "values": {name: v.tolist() for name, v in kept.items()}, "clips": clips,
        }  # fmt: skip


def _row(values: dict[str, Tensor], clips: Sequence[Hashable]) -> dict[str, dict]:
    return {
        "mean": {name: float(v.nanmean()) for name, v in values.items()},
        "standard_error": {name: clustered_error(v.numpy(), clips) for name, v in values.items()},
        "windows": {name: int(v.isfinite().sum()) for name, v in values.items()},
    }
