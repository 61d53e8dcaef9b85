"""What guidance does: arrows in a plane, noised rows, predictions under several weights, claimed and measured changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float
from matplotlib.figure import Figure

from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import THREE_QUARTER, AnyMotion, Board, facing, poses, project
from mwlib.plots.coefficients import DIVERGING
from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, OBSERVED, array, canvas, colourbar, style

Array = np.ndarray | torch.Tensor
HEADS = {"apd": "APD (m)", "ade": "ADE (m)", "fde": "FDE (m)", "mmade": "MMADE (m)", "mmfde": "MMFDE (m)"}


@style()
def noised_rows(
    versions: Mapping[str, Float[Array, "rows columns"]],
    mask: Bool[Array, " rows"],
    *,
    history_rows: int | None = None,
    columns: int = 60,
) -> tuple[Figure, np.ndarray]:
    """Noisy coefficients, and versions of them with some rows noised once more; marks at the left show the mask.

    Args:
        versions: name -> coefficients; one colour scale for all, that of the first.
        mask: rows that were noised once more.
        history_rows: rows before this one see observed frames only: above the dashed line.
        columns: how many of the columns to show, from the first.
    """
    mask, first = array(mask), array(next(iter(versions.values())))
    edge = float(np.quantile(np.abs(first), 0.99))
    fig, axes = canvas(1, len(versions), height=3.4, sharey=True)
    for ax, (name, values) in zip(axes[0], versions.items(), strict=True):
        image = ax.imshow(array(values)[:, :columns], cmap=DIVERGING, vmin=-edge, vmax=edge, aspect="auto")
        rows = np.flatnonzero(mask)
        ax.plot(np.full(len(rows), -1.8), rows, "s", color=CYCLE[3], markersize=3.5, clip_on=False)
        if history_rows is not None:
            ax.axhline(history_rows - 0.5, color=INK, linewidth=1.2, linestyle="--")
        ax.set(title=name, xlabel="column", xlim=(-3.2, min(columns, first.shape[1]) - 0.5))
        ax.spines[:].set_visible(False)
    axes[0, 0].set_ylabel("row of coefficients")
    colourbar(image, list(axes[0]), "coefficient", cut=True)
    return fig, axes[0]


@style()
def arrows(
    panels: Mapping[str, Mapping[str, tuple[Float[Array, " 2"], Float[Array, " 2"]]]],
    line: tuple[Float[Array, " 2"], Float[Array, " 2"]],
    marks: Mapping[str, Float[Array, " 2"]],
) -> tuple[Figure, np.ndarray]:
    """Arrows in a plane, a panel for each group of them on common axes; every arrow has a colour, dashes and a name.

    Args:
        panels: title -> name -> (where the arrow starts, where it ends).
        line: two points of a grey line that every panel shows.
        marks: name -> a point of every panel, a dot with its name below.
    """
    fig, axes = canvas(1, len(panels), height=3.5, sharex=True, sharey=True)
    for ax, (title, found) in zip(axes[0], panels.items(), strict=True):
        ax.plot(*zip(*(array(point) for point in line), strict=True), color=OBSERVED, linewidth=1.0, zorder=0)
        for name, point in marks.items():
            ax.plot(*array(point), "o", color=OBSERVED, markersize=7, zorder=1)
            ax.annotate(name, array(point), (0, -8), textcoords="offset points", ha="center", va="top", color=INK, fontsize=9)
        for (name, (start, end)), colour, dashes in zip(found.items(), CYCLE, DASHES, strict=False):
            ax.plot(*zip(array(start), array(end), strict=True), color=colour, linestyle=dashes, label=name)
            ax.plot(*array(end), "o", color=colour, markersize=5, markerfacecolor="white", markeredgewidth=1.6, zorder=3)
        ax.set(title=title, aspect="equal", xlabel="first coefficient")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), frameon=False)
    axes[0, 0].set_ylabel("second coefficient")
    return fig, axes[0]


@style()
def pose_grid(
    futures: Mapping[tuple[str, str], Float[Array, "S F ..."]],
    skeleton: Skeleton,
    *,
    truth: AnyMotion | None = None,
    frame: int = -1,
) -> tuple[Figure, object]:
    """One moment of several predictions, one place for each pair of settings; the true pose on top in black.

    Args:
        futures: (row label, column title) -> samples.
        truth: (F, C) or (F, J+1, 3).
        frame: which future frame.
    """
    labels = list(dict.fromkeys(row for row, _ in futures))
    titles = list(dict.fromkeys(column for _, column in futures))
    first = truth if truth is not None else array(next(iter(futures.values())))[0]
    view = facing(poses(first, skeleton)[frame], skeleton) + THREE_QUARTER
    flat = {place: project(poses(motion, skeleton)[:, frame], view) for place, motion in futures.items()}
    true = [] if truth is None else [project(poses(truth, skeleton)[frame], view)[None]]
    board = Board(skeleton, [*flat.values(), *true], labels, titles)
    for (row, column), points in flat.items():
        place = labels.index(row), titles.index(column)
        board.draw(*place, points, "predicted", alpha=0.6, width=1.1)
        for points in true:
            board.draw(*place, points, "truth", width=1.3)
    return board.fig, board.ax


@style()
def claimed_and_measured(
    found: Sequence[Mapping[str, Any]], metrics: Sequence[str] = ("apd", "ade", "fde"), *, reference: int = 0
) -> tuple[Figure, np.ndarray]:
    """How far each setting moves each metric from a reference row: as the paper claims, and as measured.

    The grey band is the standard error of the reference over test windows. Bars are the deviation over seeds.

    Args:
        found: rows of `grids.measure`: "name", "paper", "mean", "seed_deviation", "standard_error".
        metrics: one panel each.
        reference: number of the row that the others are compared with.

    Raises:
        ValueError: a metric without a panel title.
    """
    if unknown := [m for m in metrics if m not in HEADS]:
        raise ValueError(f"metrics are {list(metrics)}; expected some of {', '.join(HEADS)}, not {unknown}")
    fig, axes = canvas(1, len(metrics), height=1.2 + 0.3 * len(found), sharey=True)
    base, places = found[reference], np.arange(len(found))
    for ax, metric in zip(axes[0], metrics, strict=True):
        error = base["standard_error"][metric]
        ax.axvspan(-error, error, color=FAINT, linewidth=0, zorder=0)
        ax.axvline(0, color=OBSERVED, linewidth=0.8)
        claims = [(i - 0.16, row["paper"][metric] - base["paper"][metric]) for i, row in enumerate(found)
                  if metric in row["paper"] and metric in base["paper"]]  # fmt: skip
        if claims:
            height, change = zip(*claims, strict=True)
            ax.plot(change, height, "D", color=CYCLE[1], markerfacecolor="white", label="paper (Human3.6M)")
        changes = [row["mean"][metric] - base["mean"][metric] for row in found]
        bars = [row["seed_deviation"][metric] or 0.0 for row in found]
        ax.errorbar(changes, places + 0.16, xerr=bars, fmt="o", color=CYCLE[0], elinewidth=1.2, label="measured here")
        ax.set(title=HEADS[metric], xlabel="change (m)")
        ax.set_xticks(_three_ticks(*ax.get_xlim()))
        ax.grid(axis="y")
    axes[0, 0].set(yticks=places, yticklabels=[row["name"] for row in found])
    axes[0, 0].invert_yaxis()
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return fig, axes[0]


def _three_ticks(low: float, high: float) -> list[float]:
    """Zero and the largest round number on either side that lies inside; more would run into each other in narrow panels."""
    reach = max(-low, high)
    unit = 10.0 ** np.floor(np.log10(reach))
    step = unit * np.floor(reach / unit)
    return [tick for tick in (-step, 0.0, step) if low <= tick <= high]
