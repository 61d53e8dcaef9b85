"""Predictions against the truth: one coordinate over time, results per action."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mwlib.plots.look import CYCLE, DASHES, OBSERVED, TRUTH, array, bar_look, canvas, style

Array = np.ndarray | torch.Tensor


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
