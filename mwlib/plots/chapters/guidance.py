"""Pictures of guidance, attention and control (chapters 08 to 10)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import camera, draw_bodies, poses, project

from mwlib.plots.look import (  # isort: skip
    CYCLE, FAINT, INK, LOOKS, OBSERVED, Array, Curves, Matrix, Panel, Panels, Values, array, canvas, colourbar, legend, style,
    tiled, titled,
)  # fmt: skip

DASHED = {"linestyle": "--", "linewidth": 0.9}


@style()
def row_support(analysis: Matrix, *, history: int, split: int) -> Panels:
    """Which frames each row of coefficients sees, approximation and detail side by side; the observed frames are shaded.

    Args:
        analysis: (rows, T), the transform's matrix along time, approximation rows above detail rows.
        history: observed frames H.
        split: K, number of approximation rows.
    """
    analysis = array(analysis)
    fig, axes = canvas(1, 2, height=3.6, sharey=True)
    left, _ = axes[0]
    for ax, block in titled(axes, {"approximation": analysis[:split], "detail": analysis[split:]}):
        _observed(ax, history)
        for row, values in enumerate(block):
            seen = np.flatnonzero(np.abs(values) > 1e-12)
            if not len(seen):  # a short filter beyond the end sees padding only
                continue
            colour = CYCLE[0] if seen[-1] < history else CYCLE[1] if seen[0] >= history else INK
            ax.plot([seen[0] - 0.5, seen[-1] + 0.5], [row, row], color=colour, linewidth=2.2, solid_capstyle="butt")
        ax.set(xlabel="frame", xlim=(-0.5, analysis.shape[1] - 0.5))
    left.set_ylabel("row of coefficients")
    left.invert_yaxis()
    for colour, name in ((CYCLE[0], "observed frames only"), (CYCLE[1], "future frames only"), (INK, "both")):
        left.plot([], [], color=colour, linewidth=3, label=name)
    legend(left)
    return fig, axes[0]


@style()
def attention_vectors(attention: Matrix, *, history_rows: int, mask: Bool[Array, " rows"]) -> Panels:
    """Attention vectors of all rows with their mean, and that of the middle one (the paper's Fig. 12a and b).

    Args:
        attention: (rows, rows); rows ask, columns are looked at; each row sums to 1.
        history_rows: rows before this one see observed frames only; they are shaded.
        mask: rows that TABG noises, marked below the curves of the first panel.
    """
    attention = array(attention)
    middle = len(attention) // 2
    fig, axes = canvas(2, 1, height=4.6, sharex=True)
    upper, lower = axes[:, 0]
    for ax in axes.flat:
        _observed(ax, history_rows)
        ax.axhline(1 / len(attention), color=INK, **DASHED)
        ax.set(ylabel="attention weight", xlim=(-0.5, len(attention) - 0.5))
    upper.plot(attention.T, color=CYCLE[0], linewidth=0.7, alpha=0.25)
    upper.plot(attention.mean(0), color=CYCLE[1], linewidth=2.2, label="mean over the rows, $A_t/K$")
    upper.plot([], [], color=CYCLE[0], linewidth=0.9, label="each row")
    upper.set_ylim(0, 1.05 * float(attention.max()))
    rows = np.flatnonzero(array(mask))
    upper.plot(rows, np.zeros(len(rows)), "s", color=CYCLE[3], markersize=4, clip_on=False, label="rows that TABG noises")
    lower.plot(attention[middle], color=CYCLE[0])
    lower.axvline(middle, color=CYCLE[0], linewidth=0.9, linestyle=":")
    lower.set_ylim(bottom=0)
    upper.set_title("(a) every row")
    lower.set(title=f"(b) row {middle}, the middle one", xlabel="row of coefficients")
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend(upper)
    return fig, axes[:, 0]


@style()
def attention_over_steps(a: Matrix, masks: Matrix | Bool[Array, "steps rows"], ts: Sequence[int], *, history_rows: int) -> Panels:
    """Accumulated attention A_t and the mask M_t while the sampler runs; noise at the top.

    Args:
        a: (steps, rows), A_t of each step, mean 1.
        masks: rows that TABG noises, or the share of futures in which it does.
        ts: diffusion index of each step.
        history_rows: rows before this one see observed frames only: left of the line.
    """
    fig, axes = canvas(1, 2, height=2.9, sharey=True)
    left, right = axes[0]
    colourbar(_map(left, array(a)), left, extend="both")
    right.imshow(array(masks).astype(float), cmap="Greys", vmin=0, vmax=1.4, aspect="auto")
    for ax, colour, title in ((left, "white", "$A_t$"), (right, CYCLE[1], "mask $M_t$ (dark = noised)")):
        ax.axvline(history_rows - 0.5, color=colour, linewidth=1.6, linestyle="--")
        ax.set(title=title, xlabel="row of coefficients")
    left.set(ylabel="diffusion index t", yticks=range(len(ts)), yticklabels=[str(t) for t in ts])
    return fig, axes[0]


@style()
def attention_heads(attention: Float[Array, "2 heads rows rows"], *, history_rows: int) -> Panels:
    """The maps of every head of the middle two blocks, on one colour scale.

    Args:
        attention: rows ask, columns are looked at.
        history_rows: rows before this one see observed frames only: above and left of the lines.
    """
    attention = array(attention)
    blocks, heads = attention.shape[:2]
    fig, axes = canvas(blocks, heads, height=3.6, sharex=True, sharey=True)
    top = float(np.quantile(attention, 0.99))
    for (block, head), ax in np.ndenumerate(axes):
        image = ax.imshow(attention[block, head], vmin=0, vmax=top)
        _cross(ax, history_rows, color=FAINT, **DASHED)
        ax.set_title(f"block {'AB'[block]}, head {head}")
    axes[-1, 0].set(xlabel="row looked at", ylabel="row that asks")
    colourbar(image, list(axes.flat), extend="both")
    return fig, axes


@style()
def attention_part(attention: Matrix, *, history_rows: int, title: str = "") -> Panel:
    """One map with the attention its rows receive on top of it.

    Args:
        attention: (rows, rows); rows ask, columns are looked at.
        history_rows: rows before this one see observed frames only.
    """
    attention = array(attention)
    fig, axes = canvas(2, 1, height=4.4, width=4.4, sharex=True, gridspec_kw={"height_ratios": (1, 3)})
    upper, lower = axes[:, 0]
    upper.plot(attention.sum(0), color=CYCLE[0])
    upper.axhline(1, color=INK, **DASHED)
    upper.set(ylabel="received", title=title, ylim=(0, None))
    _map(lower, attention)
    edge = {"color": OBSERVED, "linewidth": 1.2, "linestyle": "--"}
    _cross(lower, history_rows, **edge)
    upper.axvline(history_rows - 0.5, **edge)
    lower.set(xlabel="row looked at", ylabel="row that asks")
    return fig, lower


def _observed(ax: Axes, count: int) -> None:
    """Shades what lies before this place."""
    ax.axvspan(-0.5, count - 0.5, color=OBSERVED, alpha=0.25, linewidth=0)


def _cross(ax: Axes, place: int, **look: Any) -> None:
    """Lines before this row and this column."""
    ax.axvline(place - 0.5, **look)
    ax.axhline(place - 0.5, **look)


def _map(ax: Axes, values: np.ndarray) -> AxesImage:
    """Weights as a picture; the largest hundredth runs off the scale."""
    return ax.imshow(values, vmin=0, vmax=float(np.quantile(values, 0.99)), aspect="auto")


@style()
def arrows(panels: Mapping[str, Mapping[str, tuple[Values, Values]]], line: tuple[Values, Values], marks: Curves) -> Panels:
    """Arrows in a plane from dots to rings, a panel for each group on common axes; every arrow has a colour, dashes and a name.

    Every point is two numbers.

    Args:
        panels: title -> name -> (where the arrow starts, where it ends).
        line: two points of a grey line that every panel shows.
        marks: name -> a point of every panel, a dot with its name below.
    """
    fig, axes = canvas(1, len(panels), height=3.5, sharex=True, sharey=True)
    for ax, found in titled(axes, panels):
        ax.plot(*zip(*map(array, line), strict=True), color=OBSERVED, linewidth=1.0, zorder=0)
        for name, point in marks.items():
            x, y = array(point)
            ax.plot(x, y, "o", color=OBSERVED, markersize=7, zorder=1)
            ax.annotate(name, (x, y), (0, -8), textcoords="offset points", ha="center", va="top", fontsize=9)
        for (name, way), look in zip(found.items(), LOOKS, strict=False):
            start, end = map(array, way)
            ax.plot(*zip(start, end, strict=True), label=name, **look)
            ax.plot(*start, ".", color=INK, zorder=2)
            ax.plot(*end, "o", color=look["color"], markerfacecolor="white", markeredgewidth=1.6, zorder=3)
        ax.set(aspect="equal", xlabel="first coefficient")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.32), frameon=False)
    axes[0, 0].set_ylabel("second coefficient")
    return fig, axes[0]


@style()
def claimed_and_measured(
    changes: Mapping[str, Mapping[str, tuple[float, float]]], claimed: Mapping[str, Mapping[str, float]] = MappingProxyType({})
) -> Panels:
    """How far each setting moves each metric from a row of reference: measured in pairs, and as a paper claims.

    A bar reaches two standard errors of the paired difference to either side: where it crosses zero, the sign is open.

    Args:
        changes: by setting, by heading of a metric the mean difference and its standard error; a panel for each metric.
        claimed: the paper's differences, of those settings and metrics that it has.

    Raises:
        ValueError: no settings, or settings of different metrics.
    """
    metrics = [*next(iter(changes.values()), ())]
    if not metrics:
        raise ValueError("no settings; expected one or more, with changes of metrics")
    if unlike := [name for name, row in changes.items() if [*row] != metrics]:
        raise ValueError(f"metrics of {unlike} differ; expected {metrics} of each")
    fig, axes = canvas(1, len(metrics), height=1.2 + 0.3 * len(changes), sharey=True)
    for ax, metric in zip(axes[0], metrics, strict=True):
        ax.axvline(0, color=OBSERVED, linewidth=0.8)
        told = {place - 0.16: claimed[name][metric] for place, name in enumerate(changes) if metric in claimed.get(name, ())}
        if told:
            ax.plot([*told.values()], [*told], "D", color=CYCLE[1], markerfacecolor="white", label="paper (Human3.6M)")
        middle, error = np.array([row[metric] for row in changes.values()], float).T
        places, label = np.arange(len(changes)) + 0.16 * bool(claimed), "measured, ± 2 standard errors"
        ax.errorbar(middle, places, xerr=2 * error, fmt="o", color=CYCLE[0], elinewidth=1.2, label=label)
        name, bracket, unit = metric.partition(" (")
        ax.set(title=name, xlabel=f"change{bracket}{unit}")
        ax.set_xticks(_three_ticks(*ax.get_xlim()))
        ax.grid(axis="y")
    axes[0, 0].set(yticks=np.arange(len(changes)), yticklabels=[*changes])
    axes[0, 0].invert_yaxis()
    legend(axes[0, 0], 2, "outside upper right")
    return fig, axes[0]


def _three_ticks(low: float, high: float) -> list[float]:
    """Zero and the largest round number on either side that lies inside; more would run into each other in narrow panels."""
    reach = max(-low, high)
    unit = 10.0 ** np.floor(np.log10(reach))
    step = unit * np.floor(reach / unit)
    return [tick for tick in (-step, 0.0, step) if low <= tick <= high]


@style()
def controlled_poses(
    cases: Mapping[str, tuple[Float[Array, "S C"], Bool[Array, " C"]]],
    skeleton: Skeleton,
    *,
    truth: Values,
    last: Values,
) -> Panels:
    """One panel per case: sampled poses laid over each other, the truth in black, prescribed joints as filled circles.

    Args:
        cases: name -> (poses of the samples, which channels were prescribed).
        truth: (C,) the true pose, metres.
        last: the last observed pose, drawn in a panel of its own.
    """
    view = camera(poses(truth, skeleton), skeleton)
    true, before, *flat = (project(poses(pose, skeleton), view) for pose in (truth, last, *(pose for pose, _ in cases.values())))
    fig, axes = tiled(1 + len(cases), frame=0, each=2.4, shared=False)
    first, *others = axes.flat
    draw_bodies(first, before[None], skeleton, "observed")
    first.set_title("last observed pose")
    for ax, (name, (_, given)), points in zip(others, cases.items(), flat, strict=False):
        draw_bodies(ax, points, skeleton, "predicted", max(0.2, 1 / len(points)), 1.5)
        draw_bodies(ax, true[None], skeleton, "truth", width=1.2)
        joints = 1 + np.flatnonzero(np.asarray(given).reshape(-1, 3).any(1))
        ax.plot(*true[joints].T, "o", color=CYCLE[3], markersize=6, zorder=5)
        ax.set_title(name.replace("_", " "))
    everything = np.concatenate([points.reshape(-1, 2) for points in (true, before, *flat)])
    (left, low), (right, high) = everything.min(0) - 0.08, everything.max(0) + 0.12
    for ax in axes.flat:
        ax.set_axis_off()
        ax.set(xlim=(left, right), ylim=(low, high), aspect="equal")
    return fig, axes
