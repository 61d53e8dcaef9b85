"""A sheet of paper, in inches, for diagrams: boxes, arrows, and real data in small frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import THREE_QUARTER, draw_bodies, facing, poses, project
from mwlib.plots.coefficients import DIVERGING
from mwlib.plots.look import FAINT, INK, WIDTH, array, canvas, limit

Array = np.ndarray | torch.Tensor
SPACING = 0.8  # metres between bodies
Place = tuple[float, float, float, float]  # left, bottom, width, height, in inches


def sheet(height: float) -> tuple[Figure, Axes]:
    """An empty sheet whose data unit is an inch."""
    fig, axes = canvas(height=height)
    fig.set_layout_engine("none")
    ax = axes[0, 0]
    ax.set(position=(0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    return fig, ax


def box(ax: Axes, place: Place, text: str, colour: str = INK) -> None:
    """A rounded box with words in it."""
    left, bottom, width, height = place
    look = {"boxstyle": "round,pad=0,rounding_size=0.08", "facecolor": FAINT, "edgecolor": colour, "linewidth": 1.4}
    ax.add_patch(FancyBboxPatch((left, bottom), width, height, **look))
    spacing = 1.5 if "$" in text else 1.2  # hats and bars of a formula stand above its line
    ax.text(left + width / 2, bottom + height / 2, text, ha="center", va="center", fontsize=9, color=INK, linespacing=spacing)


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], text: str = "") -> None:
    """An arrow, with words above its middle."""
    look = {
        "arrowstyle": "-|>",
        "color": INK,
        "linewidth": 1.3,
        "shrinkA": 2,
        "shrinkB": 2,
    }
    ax.annotate("", end, start, arrowprops=look)
    if text:
        ax.text((start[0] + end[0]) / 2, (start[1] + end[1]) / 2 + 0.06, text, ha="center", va="bottom", fontsize=9)


def inset(ax: Axes, place: Place, title: str) -> Axes:
    """A small frame with a title."""
    frame = ax.inset_axes(place, transform=ax.transData)
    frame.set(xticks=[], yticks=[])
    frame.spines[:].set_visible(True)
    ax.text(place[0] + place[2] / 2, place[1] + place[3] + 0.05, title, ha="center", va="bottom", fontsize=9)
    return frame


def image(ax: Axes, place: Place, title: str, values: Array, cmap: str = DIVERGING) -> None:
    """A matrix in a small frame."""
    values = array(values)
    most = limit(values)
    low = -most if cmap == DIVERGING else 0
    inset(ax, place, title).imshow(values, cmap=cmap, vmin=low, vmax=most, aspect="auto")


def row_of_bodies(ax: Axes, place: Place, title: str, rows: Sequence[tuple[Array, str]], skeleton: Skeleton) -> None:
    """Several poses side by side in an inset; each item is (poses (n, C), kind)."""
    frame = inset(ax, place, title)
    frame.spines[:].set_visible(False)
    bodies = [(poses(motion, skeleton), kind) for motion, kind in rows]
    view = facing(bodies[0][0][0], skeleton) + THREE_QUARTER
    flat = [(pose, kind) for body, kind in bodies for pose in project(body, view)]
    for column, (pose, kind) in enumerate(flat):
        draw_bodies(frame, (pose + [SPACING * column, 0.0])[None], skeleton, kind, width=1.5)
    heights = np.concatenate([pose[:, 1] for pose, _ in flat])
    frame.set(xlim=(-SPACING * 0.6, SPACING * (len(flat) - 0.4)), ylim=(heights.min() - 0.08, heights.max() + 0.12))
    frame.set_aspect("equal")
