"""Curves, histograms, fans and bars of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, OBSERVED, TRUTH, array, bar_look, canvas, style

Array = np.ndarray | torch.Tensor
Density = tuple[Float[Array, " M"], Float[Array, " M"]]  # values, and the density at them


@style()
def curves(
    lines: Mapping[str, Float[Array, " M"]],
    x: Sequence[float] | Float[Array, " M"] | None = None,
    *,
    xlabel: str,
    ylabel: str,
    log: str = "",
) -> tuple[Figure, Axes]:
    """Several functions of one variable, told apart by colour and dashes.

    Args:
        lines: name -> values at x; one called "truth" is black and solid.
        x: where; None counts from 0.
        xlabel, ylabel: what, and its unit.
        log: axes with a logarithmic scale: "", "x", "y" or "xy".
    """
    fig, axes = canvas(height=3.0)
    ax = axes[0, 0]
    for (name, values), colour, dashes in zip(lines.items(), CYCLE, DASHES, strict=False):
        values = array(values)
        look = {"color": INK} if name == "truth" else {"color": colour, "linestyle": dashes}
        ax.plot(np.arange(len(values)) if x is None else array(x), values, label=name, **look)
    ax.set(xlabel=xlabel, ylabel=ylabel, xscale="log" if "x" in log else "linear", yscale="log" if "y" in log else "linear")
    ax.grid(axis="y")
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def histograms(
    samples: Mapping[str, Float[Array, " N"]], *, density: Density | None = None, bins: int = 80, xlabel: str = ""
) -> tuple[Figure, np.ndarray]:
    """Where many numbers lie, one panel per name on common axes, each scaled to area 1.

    Args:
        samples: name -> numbers.
        density: a curve (values, density) to compare with, drawn in every panel; it also sets the range, widened by half,
            and the height: a spike is cut off.
        bins: over the common range; numbers beyond it are not drawn.
    """
    edges = np.linspace(*_range(list(samples.values()), density), bins + 1)
    fig, axes = canvas(len(samples), 1, height=0.5 + 0.95 * len(samples), sharex=True, sharey=True)
    for ax, (name, values), colour in zip(axes[:, 0], samples.items(), CYCLE * len(samples), strict=False):
        values = array(values).ravel()
        counts, _ = np.histogram(values, edges)
        ax.stairs(counts / (len(values) * np.diff(edges)), edges, fill=True, color=colour, alpha=0.75)
        if density is not None:
            ax.plot(*map(array, density), color=INK, linestyle=(0, (3, 1)))
        ax.set(yticks=[], title=name)
    if density is not None:
        axes[0, 0].set_ylim(0, 1.4 * float(array(density[1]).max()))
    axes[-1, 0].set_xlabel(xlabel)
    return fig, axes[:, 0]


@style()
def sampling_paths(
    ts: Sequence[int],
    paths: Float[Array, "steps N"],
    *,
    density: Density | None = None,
    shown: int = 40,
    ylabel: str = "y",
    parting: float = 0.0,
) -> tuple[Figure, np.ndarray]:
    """How single numbers travel from noise (left) to samples (right), and where all of them end.

    Args:
        ts: diffusion index of each row of `paths`; noise first, falling.
        paths: a column per sample.
        density: (values, density) of the true distribution, drawn beside the end points.
        shown: how many paths are drawn; the histogram counts all.
        ylabel: what, and its unit.
        parting: paths that end above it are coloured otherwise, and dashed.
    """
    paths, times = array(paths), np.asarray(ts)
    low, high = _range([paths[0], paths[-1]], density)
    fig, axes = canvas(1, 2, height=3.2, sharey=True, gridspec_kw={"width_ratios": (4, 1)})
    left, right = axes[0]
    for path in paths.T[:shown]:
        side = int(path[-1] > parting)
        left.plot(times, path, color=CYCLE[side], linestyle=DASHES[side], alpha=0.5, linewidth=1.5)
    left.set(xlim=(times[0], times[-1]), ylim=(low, high), xlabel="diffusion index t, falling", ylabel=ylabel)
    left.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.axhline(0, color=OBSERVED, linewidth=0.8, zorder=1)
    edges = np.linspace(low, high, 81)
    counts, _ = np.histogram(paths[-1], edges)
    right.stairs(
        counts / (paths.shape[1] * np.diff(edges)), edges, orientation="horizontal", fill=True, color=CYCLE[0], alpha=0.75
    )
    if density is not None:
        values, height = map(array, density)
        right.plot(height, values, color=INK, linestyle=(0, (3, 1)), label="truth")
        right.legend(loc="lower right")
    right.set(xticks=[], xlabel="where they end", facecolor="white")
    right.spines["left"].set_color(FAINT)
    return fig, axes[0]


def _range(samples: Sequence[Array], density: Density | None) -> tuple[float, float]:
    """What holds nearly all numbers: of the density, widened by half, or of the samples."""
    if density is not None:
        low, high = float(array(density[0]).min()), float(array(density[0]).max())
        return low - (high - low) / 4, high + (high - low) / 4
    low, high = np.quantile(np.concatenate([array(values).ravel() for values in samples]), [0.001, 0.999])
    return float(low - 0.05 * (high - low)), float(high + 0.05 * (high - low))


@style()
def trajectories(
    truth: Float[Array, " T"],
    futures: Mapping[str, Float[Array, "_ F"]] | Float[Array, "S F"],
    *,
    fps: float,
    ylabel: str = "position (m)",
    fan: bool = True,
) -> tuple[Figure, Axes]:
    """One coordinate over time: observed grey, truth black dashed, many futures as a fan or as thin lines.

    Args:
        truth: observed and true future frames, T = H + F.
        futures: (S, F) samples, or name of a method -> (S, F).
        fps: frames per second; time 0 is the last observed frame.
        ylabel: what the coordinate is.
        fan: median and the middle 50 and 90 % of the samples; False draws every sample.
    """
    futures = dict(futures) if isinstance(futures, Mapping) else {"predicted": futures}
    futures = {name: array(samples) for name, samples in futures.items()}
    truth = array(truth)
    history = len(truth) - next(iter(futures.values())).shape[1]
    time = (np.arange(len(truth)) - (history - 1)) / fps
    fig, axes = canvas(height=3.0)
    ax = axes[0, 0]
    for (name, samples), colour, dashes in zip(futures.items(), CYCLE, DASHES, strict=False):
        draw = _fan if fan else _lines
        draw(ax, time[history:], samples, name, colour, dashes)
    ax.plot(time[:history], truth[:history], color=OBSERVED, linewidth=2.4, label="observed")
    ax.plot(time[history - 1 :], truth[history - 1 :], color=TRUTH, linestyle=(0, (3, 1)), label="truth")
    ax.axvline(0, color=OBSERVED, linewidth=0.8)
    shades = "; shaded: the middle 50 and 90 % of the samples" if fan else ""
    ax.set(xlabel=f"time (s){shades}", ylabel=ylabel, xlim=(time[0], time[-1]))
    legend = fig.legend(loc="outside upper left", ncols=4 if len(futures) < 3 else 3)
    for handle in legend.legend_handles:
        if handle is not None:
            handle.set_alpha(1)
    return fig, ax


@style()
def bars_per_action(values: Mapping[str, Mapping[str, float]], *, xlabel: str) -> tuple[Figure, Axes]:
    """One metric for every action, a bar per method; actions in the order of the first method's mapping.

    Args:
        values: method -> action -> value; an action that a method lacks has no bar.
        xlabel: the metric and its unit.
    """
    actions = list(next(iter(values.values())))
    fig, axes = canvas(height=0.9 + len(actions) * (0.11 * len(values) + 0.12))
    ax, thick = axes[0, 0], 0.82 / len(values)
    for row, (method, scores) in enumerate(values.items()):
        places = [place for place, action in enumerate(actions) if action in scores]
        lengths = [scores[actions[place]] for place in places]
        offset = (row - (len(values) - 1) / 2) * thick
        ax.barh(np.array(places) + offset, lengths, 0.9 * thick, label=method, **bar_look(row))
    ax.set(yticks=range(len(actions)), yticklabels=actions, xlabel=xlabel, ylim=(len(actions) - 0.5, -0.5))
    ax.grid(axis="x")
    if len(values) > 1:
        fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


def _fan(ax: Axes, time: np.ndarray, samples: np.ndarray, name: str, colour: str, dashes) -> None:
    if len(samples) > 1:
        for share in (0.9, 0.5):
            low, high = np.quantile(samples, [(1 - share) / 2, (1 + share) / 2], axis=0)
            ax.fill_between(time, low, high, color=colour, alpha=0.2, linewidth=0)
    ax.plot(time, np.median(samples, axis=0), color=colour, linestyle=dashes, label=name)


def _lines(ax: Axes, time: np.ndarray, samples: np.ndarray, name: str, colour: str, dashes) -> None:
    alpha = max(0.25, 1 / len(samples))
    for number, sample in enumerate(samples):
        ax.plot(time, sample, color=colour, linewidth=1.5, linestyle=dashes, alpha=alpha, label=None if number else name)
