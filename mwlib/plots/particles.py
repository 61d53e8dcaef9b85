"""A density that noise melts and a sampler builds again: as a map over the diffusion index, and as a loop of moving points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure

from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, WIDTH, array, canvas, style
from mwlib.plots.loops import Loop

Array = np.ndarray | torch.Tensor


@style()
def density_map(
    ts: Sequence[int],
    values: Float[Array, " V"],
    density: Float[Array, "steps V"],
    *,
    paths: Float[Array, "steps N"] | None = None,
    parting: float = 0.0,
    ylabel: str = "y",
) -> tuple[Figure, Axes]:
    """The density of one number at every diffusion index, dark where it is high, and paths that run through it.

    Args:
        ts: diffusion index of each row of `density` and `paths`; the first stands on the left.
        values: where the density is given, rising.
        density: its values, a row per index.
        paths: a column per particle; coloured and dashed by which side of `parting` they end on.
        ylabel: what, and its unit; the density has one over it.
    """
    times, heights = np.asarray(ts), array(values)
    fig, axes = canvas(height=3.4)
    ax = axes[0, 0]
    mesh = ax.pcolormesh(times, heights, array(density).T, cmap="Greys", norm=PowerNorm(0.5, vmin=0), shading="nearest")
    for path in () if paths is None else array(paths).T:
        side = int(path[-1] > parting)
        ax.plot(times, path, color=CYCLE[side], linestyle=DASHES[side], linewidth=1.5)
    ax.set(xlim=(times[0], times[-1]), ylim=(heights[0], heights[-1]), xlabel="diffusion index t", ylabel=ylabel)
    fig.colorbar(mesh, label="density", ticks=[0, 0.1, 0.4, 1.0])
    return fig, ax


def particles(
    ts: Sequence[int],
    paths: Float[Array, "steps N"],
    values: Float[Array, " V"],
    density: Float[Array, "steps V"],
    *,
    alt: str,
    parting: float = 0.0,
    xlabel: str = "y",
    milliseconds: int = 90,
    width: int = 480,
) -> Loop:
    """Points that a sampler moves, each in a lane of its own, below the density that they should have at that moment.

    Args:
        ts: diffusion index of each row of `paths` and `density`.
        paths: a column per point; coloured by which side of `parting` it ends on.
        values, density: as for `density_map`.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        xlabel: what moves, and its unit.
        milliseconds: how long each picture stays; the last one stays a second.
        width: pixels.

    Raises:
        ValueError: the alternative text is empty.
    """
    places, curve = array(paths), array(density)
    figures = (_moment(int(t), places, places[i], array(values), curve[i], curve.max(), parting, xlabel, width)
               for i, t in enumerate(ts))  # fmt: skip
    return Loop.of_figures(figures, milliseconds, alt)


@style()
def _moment(
    t: int,
    paths: np.ndarray,
    now: np.ndarray,
    values: np.ndarray,
    curve: np.ndarray,
    top: float,
    parting: float,
    xlabel: str,
    width: int,
) -> Figure:
    """One picture: the density above zero, the points in their lanes below."""
    fig, axes = canvas(height=2.6)
    fig.set_dpi(width / WIDTH)
    ax = axes[0, 0]
    ax.fill_between(values, curve, color=FAINT)
    ax.plot(values, curve, color=INK, linewidth=1.2)
    lanes, side = -top * (0.08 + np.arange(len(now)) / len(now)), paths[-1] > parting
    for which, marker in ((False, "o"), (True, "^")):
        ax.plot(now[side == which], lanes[side == which], marker, color=CYCLE[int(which)], markersize=4)
    ax.set(xlim=(values[0], values[-1]), ylim=(-1.12 * top, 1.05 * top), yticks=[], xlabel=xlabel)
    ax.set_title(f"t = {t}")
    ax.spines["left"].set_visible(False)
    return fig
