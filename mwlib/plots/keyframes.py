"""Keyframe schemes beside the law of motions that they should draw from: sampled curves, and their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mwlib.plots.look import CYCLE, FAINT, INK, OBSERVED, TRUTH, array, canvas, style

Array = np.ndarray | torch.Tensor
COLUMNS = 3
MARK = {"marker": "o", "color": TRUTH, "linestyle": "none", "markersize": 5, "zorder": 5}
MEASURES = {
    "mean_error": "error of the mean",
    "mean_error_limit": "error of the mean",
    "seam": "seam ratio",
    "spread": "spread ratio",
}


@style()
def keyframe_samples(
    mean: Float[Array, " T"],
    deviation: Float[Array, " T"],
    panels: Mapping[str, Float[Array, "S T"]],
    *,
    keyframes: Sequence[int],
    ylabel: str = "coordinate",
    lines: int = 12,
) -> tuple[Figure, np.ndarray]:
    """One panel per scheme: its samples over the true law, mean in black and bands of one and two deviations in grey.

    Args:
        mean, deviation: of the true law between the keyframes.
        panels: name -> samples; the mean of all is dashed, the first `lines` are drawn thin.
        keyframes: frames that are given; the true law has deviation 0 there.
        ylabel: what the coordinate is.
        lines: how many of the samples to draw.
    """
    mean, deviation, at = array(mean), array(deviation), np.asarray(keyframes)
    frames, rows = np.arange(len(mean)), -(-len(panels) // COLUMNS)
    fig, axes = canvas(rows, min(COLUMNS, len(panels)), height=0.7 + 1.75 * rows, sharex=True, sharey=True)
    for ax in axes.ravel()[len(panels) :]:
        ax.set_axis_off()
    for ax, (name, samples) in zip(axes.ravel(), panels.items(), strict=False):
        samples = array(samples)
        for times, shade in ((2, FAINT), (1, "#cfd3d8")):
            label = f"true law, ± {times} deviation{'s' * (times > 1)}"
            ax.fill_between(frames, mean - times * deviation, mean + times * deviation, color=shade, linewidth=0, label=label)
        drawn = ax.plot(frames, samples[:lines].T, color=CYCLE[0], linewidth=0.8, alpha=0.55)
        drawn[0].set_label("samples")
        ax.plot(frames, mean, color=TRUTH, linewidth=1.6, label="true mean")
        ax.plot(frames, samples.mean(0), color=CYCLE[1], linestyle=(0, (4, 1.2)), linewidth=2, label="mean of samples")
        ax.plot(at, mean[at], label="keyframe", **MARK)
        ax.set_title(fill(name, 22))
        ax.set_xlim(frames[0] - 0.8, frames[-1] + 0.8)
    reach = 1.4 * float(np.max(np.abs(mean) + 2 * deviation))  # samples that diverge leave the picture
    axes[0, 0].set_ylim(-reach, reach)
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)
    for column in axes.T:
        [ax for ax in column if ax.axison][-1].tick_params(labelbottom=True)
        [ax for ax in column if ax.axison][-1].set_xlabel("frame")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return fig, axes


@style()
def scheme_errors(
    rows: Sequence[Mapping[str, object]], measures: Sequence[str] = ("mean_error_limit", "seam", "spread")
) -> tuple[Figure, np.ndarray]:
    """One line per scheme and a panel per measure: a dot, and a bar from what the true law gives. Divergence is said in words.

    Args:
        rows: of `mwlib.inbetweening.gaussian.table`; the first is the true law's, and gives the upright lines.
        measures: keys of the rows.

    Raises:
        ValueError: there is no row after the first.
    """
    truth, *found = rows
    if not found:
        raise ValueError("one row; expected the true law's and those of schemes")
    height = np.arange(len(found))[::-1]
    fig, axes = canvas(1, len(measures), height=0.9 + 0.24 * len(found), width=7.2, sharey=True)
    for ax, measure in zip(axes[0], measures, strict=True):
        _dots(ax, height, [None if row["diverged"] else row[measure] for row in found], truth[measure])
        ax.set_title(MEASURES[measure])
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
        ax.set_xlim(min(0, *ax.get_xlim()), None)
    axes[0, 0].set_yticks(height, [str(row["scheme"]) for row in found])
    axes[0, 0].set_ylim(-0.7, len(found) - 0.3)
    fig.supxlabel("upright line: the true law", fontsize=9, color=OBSERVED)
    return fig, axes[0]


def _dots(ax: Axes, height: np.ndarray, values: Sequence, truth) -> None:
    """Values as dots with a bar from the truth; None is a word."""
    ax.axvline(truth, color=TRUTH, linewidth=1.2, zorder=1)
    for y, value in zip(height, values, strict=True):
        ax.axhline(y, color=FAINT, linewidth=0.8, zorder=0)
        if value is None:
            ax.annotate("diverges", (truth, y), (6, 0), textcoords="offset points", va="center", color=CYCLE[5], fontsize=8)
            continue
        ax.plot([truth, value], [y, y], color=CYCLE[0], linewidth=3, alpha=0.3, solid_capstyle="butt")
        ax.plot(value, y, "o", color=CYCLE[0], markersize=5)
        away, side = ((-6, 0), "right") if value < truth else ((6, 0), "left")
        words = {"textcoords": "offset points", "va": "center", "ha": side, "color": INK, "fontsize": 8}
        ax.annotate(f"{value:.2f}", (value, y), away, **words)
    ax.margins(x=0.18)
