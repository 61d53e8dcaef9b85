"""Controlled predictions: end poses with the prescribed joints marked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.figure import Figure

from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import THREE_QUARTER, Array, draw_bodies, facing, poses, project
from mwlib.plots.look import CYCLE, canvas, style

MARK = CYCLE[3]
COLUMNS = 3


@style()
def controlled_poses(
    cases: Mapping[str, tuple[Float[Array, "S C"], Bool[Array, " C"]]],
    skeleton: Skeleton,
    *,
    truth: Float[Array, " C"],
    last: Float[Array, " C"] | None = None,
) -> tuple[Figure, np.ndarray]:
    """One panel per case: sampled poses laid over each other, the truth in black, prescribed joints as filled circles.

    Args:
        cases: name -> (poses of the samples, which channels were prescribed).
        truth: the true pose, metres.
        last: the last observed pose, drawn in a panel of its own.
    """
    view = facing(poses(truth, skeleton), skeleton) + THREE_QUARTER
    flat = {name: project(poses(pose, skeleton), view) for name, (pose, _) in cases.items()}
    true = project(poses(truth, skeleton), view)
    panels = len(cases) + (last is not None)
    rows = -(-panels // COLUMNS)
    fig, axes = canvas(rows, COLUMNS, height=2.4 * rows)
    free = list(axes.ravel())
    for ax in free:
        ax.set_axis_off()
    drawn = [true, *[points.reshape(-1, 2) for points in flat.values()]]
    if last is not None:
        ax = free.pop(0)
        before = project(poses(last, skeleton), view)
        draw_bodies(ax, before[None], skeleton, "observed")
        ax.set_title("last observed pose")
        drawn.append(before)
    everything = np.concatenate(drawn)
    (left, low), (right, high) = everything.min(0) - 0.08, everything.max(0) + 0.12
    for ax, (name, points) in zip(free, flat.items(), strict=False):
        draw_bodies(ax, points, skeleton, "predicted", max(0.2, 1 / len(points)), 1.5)
        draw_bodies(ax, true[None], skeleton, "truth", width=1.2)
        joints = 1 + np.flatnonzero(np.asarray(cases[name][1]).reshape(-1, 3).any(1))
        ax.plot(*true[joints].T, "o", color=MARK, markersize=6, zorder=5)
        ax.set_title(name.replace("_", " "))
    for ax in axes.ravel():
        ax.set(xlim=(left, right), ylim=(low, high), aspect="equal")
    return fig, axes
