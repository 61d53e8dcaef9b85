"""How sure a mean over windows is, when windows of one clip resemble each other."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from jaxtyping import Float


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
