"""Measures of how people move: speed, distance, smoothness, and the error's growth with the horizon.

Errors of the best of many samples do not tell: standing still, or shaking, can have a good one. Each number here is to be
read beside the same number of the truth.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.metrics.prediction import Metric, Predictions, check_shapes, fde
from mwlib.metrics.table import Column

__all__ = ["coverage", "error_at", "jerk", "pose_change", "speed"]

SPEED_SECONDS = 0.2  # speeds over shorter times measure a recording's noise
HORIZONS = (0.2, 0.4, 1.0)  # seconds ahead at which errors are reported beside FDE
BANDS = (0.5, 0.9)  # shares of the samples in whose middle the truth is looked for


def speed(p: Float[Tensor, "N S F C"], fps: float) -> Float[Tensor, " N"]:
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


def pose_change(p: Float[Tensor, "N S F C"]) -> Float[Tensor, " N"]:
    """How far the last predicted pose is from the first, metres over the C values; mean over samples.

    Source: own choice.

    >>> pose_change(torch.tensor([0.0, 5.0, 3.0]).reshape(1, 1, 3, 1))
    tensor([3.])
    """
    check_shapes(p)
    return (p[:, :, -1] - p[:, :, 0]).norm(dim=-1).mean(1)


def jerk(p: Float[Tensor, "N S F C"], fps: float) -> Float[Tensor, " N"]:
    """Third derivative of a joint's place, m/s³: mean length over samples, joints and frames of the third difference.

    Source: own choice; Flash and Hogan, 1985, take it as the measure of smoothness.

    Raises:
        ValueError: p is not (N, S, F, C), not finite or of fewer than four frames.

    >>> cubic = (torch.arange(8.0) / 10) ** 3
    >>> round(float(jerk(torch.stack([cubic, 0 * cubic, 0 * cubic], -1)[None, None], fps=10.0)), 3)
    6.0
    """
    check_shapes(p, frames=4)
    return p.unflatten(-1, (-1, 3)).diff(n=3, dim=2).norm(dim=-1).mean((1, 2, 3)) * fps**3


def error_at(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"], fps: float, seconds: float) -> Float[Tensor, " N"]:
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


def coverage(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"], share: float) -> Float[Tensor, " N"]:
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
    below, equal = ((relation(p, g[:, None])).sum(1, dtype=p.dtype) for relation in (torch.lt, torch.eq))
    first = (below + equal / 2) / (samples + 1)
    last, edge = first + 1 / (samples + 1), (1 - share) / 2
    inside = (last.clamp_max(1 - edge) - first.clamp_min(edge)).clamp_min(0) * (samples + 1)
    return inside.mean((1, 2))


def _step(fps: float) -> int:
    """Frames over which speed is measured."""
    return max(round(SPEED_SECONDS * fps), 1)


def _timed(heading: str, of: Callable[[Predictions], Tensor], fewest: Callable[[float], int], better: str = "") -> Metric:
    """A metric of futures at a known rate that have so many frames or more; 0: such a rate has none."""
    return Metric(Column(heading, better), of, lambda frames, fps, _: fps > 0 and 1 <= fewest(fps) <= frames)


REALISM = {
    "speed": _timed("speed (m/s)", lambda w: speed(w.p, w.fps), lambda fps: _step(fps) + 1),
    "pose_change": _timed("change of pose (m)", lambda w: pose_change(w.p), lambda _: 1),
    "jerk": _timed("jerk (m/s³)", lambda w: jerk(w.p, w.fps), lambda _: 4),
    **{
        f"error_{s:g}s": _timed(
            f"error at {s:g} s", lambda w, s=s: error_at(w.p, w.g, w.fps, s), lambda fps, s=s: round(s * fps), "lower"
        )
        for s in HORIZONS
    },
    **{
        f"coverage_{share:g}": _timed(f"inside {100 * share:g} %", lambda w, share=share: coverage(w.p, w.g, share), lambda _: 1)
        for share in BANDS
    },
}
