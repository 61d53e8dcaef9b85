"""Pictures of phase codes (chapter 04)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from mwlib.plots.axes import Array, Panels, array, canvas, legend, limit, outer
from mwlib.plots.lines import draw
from mwlib.plots.look import CYCLE, LOOKS, OBSERVED, TRUTH, style

MARKERS = "o^sDvP"


@style()
def windows_and_sinusoids(
    panels: Mapping[str, tuple[Float[Array, " N"], Float[Array, " N"]]], *, fps: float, ylabel: str = ""
) -> Panels:
    """Windows of a signal, each with the one sinusoid that stands for it.

    Args:
        panels: title -> (window, sinusoid), N samples each; time 0 is the middle.
        fps: samples per second.
        ylabel: what, and its unit.
    """
    fig, axes = canvas(1, len(panels), height=2.4, sharey=True)
    for ax, (title, (window, sinusoid)) in zip(axes[0], panels.items(), strict=True):
        seconds = (np.arange(len(window)) - len(window) // 2) / fps
        draw(ax, {"window": window, "its sinusoid": sinusoid}, seconds, looks=[{"color": TRUTH}, LOOKS[1]])
        ax.set_title(title)
    outer(axes, "time (s)", ylabel)
    legend(axes[0, 0], 2)
    return fig, axes[0]


@style()
def phase_circles(codes: Mapping[str, Float[Array, "T 2M"]], *, channels: Sequence[int]) -> Panels:
    """The path of a phase code in the plane of each channel, from its first frame (ring) to its last (dot).

    Args:
        codes: name -> (T, 2M): A sin 2πS of all channels, then A cos 2πS; a row each.
        channels: which of the M, a column each.
    """
    planes = {name: np.split(array(code), 2, axis=-1) for name, code in codes.items()}
    edge = 1.1 * max(limit(plane[:, channels]) for pair in planes.values() for plane in pair)
    fig, axes = canvas(len(codes), len(channels), height=0.6 + 1.6 * len(codes), sharex=True, sharey=True)
    outer(axes, "A cos 2πS")
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
    return fig, axes


@style()
def error_by_size(
    panels: Mapping[str, Mapping[str, tuple[Sequence[float], Sequence[float]]]], *, xlabel: str, ylabel: str
) -> Panels:
    """What a representation loses, against how many numbers it keeps; one number alone is a single large mark.

    Args:
        panels: title -> name -> (numbers kept, errors); the same names in every panel.
        xlabel, ylabel: what, and its unit.
    """
    fig, axes = canvas(1, len(panels), height=3.2, sharex=True, sharey=True)
    for ax, (title, lines) in zip(axes[0], panels.items(), strict=True):
        for number, (name, (sizes, errors)) in enumerate(lines.items()):
            look = LOOKS[number] | {"marker": MARKERS[number], "markersize": 10 if len(sizes) == 1 else 5}
            ax.plot(sizes, errors, label=name, **look)
        ax.set(title=title, yscale="log")
        ax.grid(axis="y")
    outer(axes, xlabel, ylabel)
    legend(axes[0, 0], 2)
    return fig, axes[0]
