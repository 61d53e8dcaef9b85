"""Tables of metrics: columns, standard errors clustered by clip, and the summary of an evaluation."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from torch import Tensor

NOTHING: Mapping[str, float] = MappingProxyType({})


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
    found, names = values[kept], {}
    number = [names.setdefault(cluster, len(names)) for cluster, k in zip(clusters, kept, strict=True) if k]
    if len(names) < 2:
        return float("nan")
    totals = np.bincount(number, found - found.mean())
    return float(np.sqrt(len(names) / (len(names) - 1) * (totals**2).sum()) / len(found))


def summary(
    values: Mapping[str, Float[Tensor, " N"]],
    clips: Sequence[Hashable],
    mean: Mapping[str, float] = NOTHING,
    standard_error: Mapping[str, float] = NOTHING,
) -> dict[str, Any]:
    """What every system's `evaluate` gives, in plain numbers, ready for JSON.

    Args:
        values: by metric one number for each window, float64; NaN where it was not measured.
        clips: where each window comes from; windows of one clip are not independent.
        mean, standard_error: of metrics of the whole set, and what is to stand in place of the means and errors over windows.

    Returns:
        "mean" and "standard_error" (see `clustered_error`) by metric, "windows", their number, "values" by metric, and "clips".
        NaN where there is nothing to average.

    >>> summary({"ade": torch.tensor([0.0, 1.0, 2.0], dtype=torch.float64)}, "aab", mean={"npss": 0.5})["mean"]
    {'ade': 1.0, 'npss': 0.5}
    """
    return {
        "mean": {name: float(value.nanmean()) for name, value in values.items()} | {**mean},
        "standard_error": {name: clustered_error(v.numpy(), clips) for name, v in values.items()} | {**standard_error},
        "windows": len(clips),
        "values": {name: value.tolist() for name, value in values.items()},
        "clips": list(clips),
    }
