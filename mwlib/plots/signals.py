"""One signal and one wavelet: filters, boundary extension, coefficients over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pywt
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mwlib.plots.look import CYCLE, FAINT, INK, OBSERVED, array, canvas, style

Array = np.ndarray | torch.Tensor


@style()
def filters(wavelet: str) -> tuple[Figure, np.ndarray]:
    """The four filters of a wavelet, tap by tap; on the left those that analyse, on the right those that rebuild."""
    bank = pywt.Wavelet(wavelet)
    panels = {
        "analysis, low-pass": bank.dec_lo,
        "synthesis, low-pass": bank.rec_lo,
        "analysis, high-pass": bank.dec_hi,
        "synthesis, high-pass": bank.rec_hi,
    }
    fig, axes = canvas(2, 2, height=3.6, sharex=True, sharey=True)
    for ax, (name, taps), colour in zip(axes.flat, panels.items(), np.repeat(CYCLE[:2], 2), strict=True):
        taps = np.asarray(taps)
        _stems(ax, np.arange(len(taps)), taps, colour)
        ax.margins(y=0.12)
        ax.set_title(f"{name}: {np.count_nonzero(np.abs(taps) > 1e-12)} of {len(taps)} taps")
    for ax in axes[1]:
        ax.set_xlabel("tap")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    fig.suptitle(wavelet, x=0.01, ha="left", weight="bold")
    return fig, axes


@style()
def scaling_and_wavelet(wavelet: str, level: int = 8) -> tuple[Figure, np.ndarray]:
    """The scaling function and wavelet that the filters converge to; a biorthogonal family rebuilds with a second pair."""
    *pairs, support = pywt.Wavelet(wavelet).wavefun(level=level)
    rows = ["analysis", "synthesis"] if len(pairs) == 4 else [""]
    fig, axes = canvas(len(rows), 2, height=0.6 + 1.5 * len(rows), sharex=True)
    for ax, values, column in zip(axes.flat, pairs, [0, 1] * len(rows), strict=True):
        ax.axhline(0, color=OBSERVED, linewidth=0.8)
        ax.plot(support, values, color=CYCLE[column])
    for ax, row in zip(axes[:, 0], rows, strict=True):
        ax.set_ylabel(row)
    for ax, title in zip(axes[0], (f"{wavelet}: scaling function φ", f"{wavelet}: wavelet ψ"), strict=True):
        ax.set_title(title)
    for ax in axes[-1]:
        ax.set_xlabel("position (samples)")
    return fig, axes


@style()
def signal_and_coefficients(
    signal: Float[Array, " T"], wavelet: str, *, mode: str = "zero", fps: float, unit: str = "m"
) -> tuple[Figure, np.ndarray]:
    """A signal over its approximation and detail coefficients, each standing at the middle of the frames it sees.

    Args:
        signal: T values.
        wavelet, mode: of the transform, as PyWavelets names them.
        fps: frames per second.
        unit: of the values.
    """
    signal, bank = array(signal), pywt.Wavelet(wavelet)
    approximation, detail = pywt.dwt(signal, bank, mode)
    fig, axes = canvas(3, 1, height=4.6, sharex=True)
    panels = ("approximation", approximation, bank.dec_lo, CYCLE[0]), ("detail", detail, bank.dec_hi, CYCLE[1])
    axes[0, 0].plot(np.arange(len(signal)) / fps, signal, color=INK)
    axes[0, 0].set(title=f"signal: {len(signal)} frames", ylabel=unit)
    for ax, (name, values, taps, colour) in zip(axes[1:, 0], panels, strict=True):
        _stems(ax, _middles(len(values), np.asarray(taps)) / fps, values, colour)
        ax.set(title=f"{name}: {len(values)} coefficients, largest {np.abs(values).max():.3g} {unit}", ylabel=unit)
    axes[2, 0].set_xlabel("time (s)")
    return fig, axes[:, 0]


@style()
def padding_modes(
    signal: Float[Array, " T"],
    *,
    modes: Sequence[str] = ("zero", "symmetric", "constant", "periodic", "reflect", "smooth"),
    pad: int = 16,
    unit: str = "m",
) -> tuple[Figure, np.ndarray]:
    """How each extension mode continues a signal beyond its two ends before it is filtered; what goes far leaves the panel.

    Args:
        signal: T values.
        modes: as PyWavelets names them.
        pad: frames added at each end; a filter of l taps asks for l - 1.
        unit: of the values.

    Raises:
        ValueError: an unknown mode.
    """
    signal, columns = array(signal), min(len(modes), 3)
    rows = -(-len(modes) // columns)
    fig, axes = canvas(rows, columns, height=0.5 + 1.5 * rows, sharex=True, sharey=True)
    inside = np.arange(len(signal))
    for ax in axes.flat[len(modes) :]:
        ax.set_visible(False)
    for ax, mode in zip(axes.flat, modes, strict=False):
        longer = pywt.pad(signal, pad, mode)
        for outside in (slice(0, pad + 1), slice(pad + len(signal) - 1, None)):  # periodization makes an odd length even first
            ax.plot(np.arange(-pad, len(longer) - pad)[outside], longer[outside], color=CYCLE[1], linestyle=(0, (2, 0.8)))
        ax.plot(inside, signal, color=INK)
        ax.axvspan(0, len(signal) - 1, color=FAINT, linewidth=0, zorder=0)
        ax.set_title(mode)
    low, high = min(signal.min(), 0.0), max(signal.max(), 0.0)
    room = 0.7 * ((high - low) or 1.0)
    axes[0, 0].set_ylim(low - room, high + room)
    for ax in axes[-1]:
        ax.set_xlabel("frame")
    for ax in axes[:, 0]:
        ax.set_ylabel(unit)
    return fig, axes


def _stems(ax: Axes, places: np.ndarray, values: np.ndarray, colour: str) -> None:
    ax.axhline(0, color=OBSERVED, linewidth=0.8, zorder=1)
    ax.vlines(places, 0, values, color=colour, linewidth=1.5)
    ax.plot(places, values, "o", color=colour, markersize=4)


def _middles(count: int, taps: np.ndarray) -> np.ndarray:
    """Frame under the middle of each coefficient's taps, weighted by their squares; c[k] = sum_j taps[j] x[2k+1-j]."""
    return 2 * np.arange(count) + 1 - np.average(np.arange(len(taps)), weights=taps**2)
