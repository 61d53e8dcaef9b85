"""Pictures of phase codes (chapter 04)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.figure import Figure

from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, OBSERVED, TRUTH, array, canvas, limit, style

Array = np.ndarray | torch.Tensor
MARKERS = "o^sDvP"


@style()
def windows_and_sinusoids(
    panels: Mapping[str, tuple[Float[Array, " N"], Float[Array, " N"]]], *, fps: float, ylabel: str = ""
) -> tuple[Figure, np.ndarray]:
    """Windows of a signal, each with the one sinusoid that stands for it.

    Args:
        panels: title -> (window, sinusoid), N samples each; time 0 is the middle.
        fps: samples per second.
        ylabel: what, and its unit.
    """
    fig, axes = canvas(1, len(panels), height=2.4, sharey=True)
    for ax, (title, (window, sinusoid)) in zip(axes[0], panels.items(), strict=True):
        seconds = (np.arange(len(window)) - len(window) // 2) / fps
        ax.plot(seconds, array(window), color=TRUTH, label="window")
        ax.plot(seconds, array(sinusoid), color=CYCLE[1], linestyle=DASHES[1], label="its sinusoid")
        ax.set(title=title, xlabel="time (s)")
    axes[0, 0].set_ylabel(ylabel)
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return fig, axes[0]


@style()
def phase_circles(codes: Mapping[str, Float[Array, "T 2M"]], *, channels: Sequence[int]) -> tuple[Figure, np.ndarray]:
    """The path of a phase code in the plane of each channel, from its first frame (ring) to its last (dot).

    Args:
        codes: name -> (T, 2M): A sin 2πS of all channels, then A cos 2πS; a row each.
        channels: which of the M, a column each.
    """
    planes = {name: np.split(array(code), 2, axis=-1) for name, code in codes.items()}
    edge = 1.1 * max(limit(plane[:, channels]) for pair in planes.values() for plane in pair)
    fig, axes = canvas(len(codes), len(channels), height=0.6 + 1.6 * len(codes), sharex=True, sharey=True)
    for row, (name, (sine, cosine)) in zip(axes, planes.items(), strict=True):
        for ax, channel in zip(row, channels, strict=True):
            x, y = cosine[:, channel], sine[:, channel]
            ax.plot(0, 0, "+", color=OBSERVED)
            ax.plot(x, y, color=CYCLE[0], linewidth=1.4)
            ax.plot(x[:1], y[:1], "o", color=CYCLE[0], markerfacecolor="white")
            ax.plot(x[-1:], y[-1:], "o", color=CYCLE[0])
            ax.set(xlim=(-edge, edge), ylim=(-edge, edge), aspect="equal")
            ax.locator_params(nbins=3)
        row[0].set_ylabel(f"{name}\nA sin 2πS")
    for ax, channel in zip(axes[0], channels, strict=True):
        ax.set_title(f"channel {channel + 1}")
    for ax in axes[-1]:
        ax.set_xlabel("A cos 2πS")
    return fig, axes


@style()
def error_by_size(
    panels: Mapping[str, Mapping[str, tuple[Sequence[float], Sequence[float]]]], *, xlabel: str, ylabel: str
) -> tuple[Figure, np.ndarray]:
    """What a representation loses, against how many numbers it keeps; one number alone is a single large mark.

    Args:
        panels: title -> name -> (numbers kept, errors); the same names in every panel.
        xlabel, ylabel: what, and its unit.
    """
    fig, axes = canvas(1, len(panels), height=3.2, sharex=True, sharey=True)
    for ax, (title, lines) in zip(axes[0], panels.items(), strict=True):
        for number, (name, (sizes, errors)) in enumerate(lines.items()):
            look = {"color": CYCLE[number], "marker": MARKERS[number], "linestyle": DASHES[number]}
            ax.plot(sizes, errors, markersize=10 if len(sizes) == 1 else 5, label=name, **look)
        ax.set(title=title, xlabel=xlabel, yscale="log")
        ax.grid(axis="y")
    axes[0, 0].set_ylabel(ylabel)
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return fig, axes[0]


@style()
def predicted_curves(
    rows: Mapping[str, Mapping[str, Float[Array, " T"]]], *, fps: float, history: int, unit: str = "m"
) -> tuple[Figure, np.ndarray]:
    """One coordinate and its velocity, a row per window: the truth, and what each method predicts of it.

    Args:
        rows: title -> name -> values; "truth" has T frames, every prediction the last T-H of them.
        fps: frames per second.
        history: observed frames H; time 0 is the last of them.
        unit: of the values.
    """
    fig, axes = canvas(len(rows), 2, height=0.7 + 2.1 * len(rows), sharex=True)
    for (left, right), (title, lines) in zip(axes, rows.items(), strict=True):
        truth = array(lines["truth"])
        seconds = (np.arange(len(truth)) - (history - 1)) / fps
        others = [(name, array(values)) for name, values in lines.items() if name != "truth"]
        for ax, change in ((left, False), (right, True)):
            ax.axvspan(seconds[0], 0, color=FAINT, linewidth=0, zorder=0)
            drawn = np.diff(truth) * fps if change else truth
            ax.plot(seconds[-len(drawn) :], drawn, color=INK, linewidth=2.2, label="truth")
            for (name, values), colour, dashes in zip(others, CYCLE, DASHES[1:], strict=False):
                drawn = np.diff(values) * fps if change else values
                ax.plot(seconds[-len(drawn) :], drawn, color=colour, linestyle=dashes, label=name)
        left.set(title=title, ylabel=f"position ({unit})")
        right.set_ylabel(f"velocity ({unit}/s)")
    for ax in axes[-1]:
        ax.set_xlabel("time (s); shaded: observed")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return fig, axes
