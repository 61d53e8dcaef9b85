"""Why wavelets, in pictures: tiles of time and frequency, what a filter lets through, how it slides, what it converges to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pywt
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, OBSERVED, WIDTH, array, canvas, style
from mwlib.plots.loops import Loop

Array = np.ndarray | torch.Tensor
TILES = {"samples": (16, 1), "Fourier": (1, 16), "short-time Fourier": (4, 4)}  # along time, along frequency


@style()
def same_spectrum(
    signals: Mapping[str, Float[Array, " T"]], wavelet: str, *, fps: float, level: int = 4, most: float = 6.0, unit: str = "m"
) -> tuple[Figure, np.ndarray]:
    """Signals, each with its Fourier magnitude and its wavelet coefficients as tiles: across, when; upwards, how fast.

    Args:
        signals: name -> T values, a column each; T divisible by 2 to the power of `level`.
        wavelet: of the tiles; the ends of a signal are joined.
        fps: samples per second.
        level: how often the slow half is halved again.
        most: hertz, up to which the Fourier magnitude is drawn.
        unit: of the values.
    """
    values = {name: array(signal) for name, signal in signals.items()}
    tiles = {name: pywt.wavedec(signal, wavelet, "periodization", level) for name, signal in values.items()}
    dark = max(float(np.abs(part).max()) for parts in tiles.values() for part in parts)
    fig, axes = canvas(3, len(values), height=5.0, sharey="row")
    for column, (name, signal) in enumerate(values.items()):
        top, middle, bottom = axes[:, column]
        seconds = len(signal) / fps
        top.plot(np.arange(len(signal)) / fps, signal, color=INK)
        top.set(title=name, xlim=(0, seconds), xlabel="time (s)")
        hertz = np.fft.rfftfreq(len(signal), 1 / fps)
        middle.plot(hertz, np.abs(np.fft.rfft(signal)) / fps, color=CYCLE[0])
        middle.set(xlim=(0, most), xlabel="frequency (Hz)")
        _tiles(bottom, tiles[name], seconds, dark)
        bottom.set(xlim=(0, seconds), ylim=(0, level + 1), xlabel="time (s)")
    edges = [fps / 2 ** (level + 1 - row) for row in range(level + 1)]
    names = [f"{low:g} to {high:g}" for low, high in zip([0, *edges], edges, strict=False)]
    axes[2, 0].set_yticks(np.arange(level + 1) + 0.5, names)
    for ax, label in zip(axes[:, 0], (unit, f"|Fourier| ({unit} s)", "wavelets (Hz)"), strict=True):
        ax.set_ylabel(label)
    fig.align_ylabels(axes[:, 0])
    return fig, axes


@style()
def tilings() -> tuple[Figure, np.ndarray]:
    """What a number of each kind tells: a tile of time (across) and frequency (upwards); all tiles have the same area."""
    fig, axes = canvas(1, 4, height=2.2, sharex=True, sharey=True)
    for ax, (name, (columns, rows)) in zip(axes[0], TILES.items(), strict=False):
        for row in range(rows):
            _grid(ax, np.linspace(0, 1, columns + 1), row / rows, (row + 1) / rows)
        ax.set_title(name)
    low = 0.0
    for columns in (1, 1, 2, 4, 8):
        high = low + columns / 16
        _grid(axes[0, 3], np.linspace(0, 1, columns + 1), low, high)
        low = high
    axes[0, 3].set_title("wavelets")
    for ax in axes[0]:
        ax.set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[], xlabel="time")
        ax.spines[:].set_visible(True)
    axes[0, 0].set_ylabel("frequency")
    return fig, axes[0]


@style()
def responses(
    panels: Mapping[str, tuple[Float[Array, " F"], Float[Array, " F"]]], hertz: Float[Array, " F"], spectrum: Float[Array, " F"]
) -> tuple[Figure, np.ndarray]:
    """What the two filters of each wavelet let through, over the spectrum of a movement.

    Args:
        panels: wavelet -> (|H|, |G|) at each frequency; two panels a row.
        hertz: the frequencies.
        spectrum: magnitude of the movement's Fourier transform there; drawn as a grey shape as high as the panel.
    """
    hertz, shape = array(hertz), array(spectrum) / array(spectrum).max()
    rows = -(-len(panels) // 2)
    fig, axes = canvas(rows, 2, height=0.7 + 1.6 * rows, sharex=True, sharey=True)
    top = 1.08 * max(float(array(part).max()) for pair in panels.values() for part in pair)
    for ax, (name, pair) in zip(axes.flat, panels.items(), strict=False):
        ax.fill_between(hertz, shape * top, color="#c9cdd3", linewidth=0, label="the movement")
        for part, colour, dashes, label in zip(pair, CYCLE, DASHES, ("|H|, low-pass", "|G|, high-pass"), strict=False):
            ax.plot(hertz, array(part), color=colour, linestyle=dashes, label=label)
        ax.axvline(hertz[-1] / 2, color=OBSERVED, linewidth=0.8)
        ax.set(title=name, xlim=(0, hertz[-1]), ylim=(0, top))
    for ax in axes[-1]:
        ax.set_xlabel("frequency (Hz)")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return fig, axes


@style()
def cascade(rounds: Sequence[Float[Array, " S"]], *, support: float) -> tuple[Figure, np.ndarray]:
    """The staircase of each round of the cascade algorithm; its stairs are half as wide as those of the round before.

    Args:
        rounds: the samples after 0, 1, 2 ... rounds; after j rounds they stand 2^-j apart.
        support: length of the limit, samples of the signal.
    """
    rows = -(-len(rounds) // 3)
    fig, axes = canvas(rows, 3, height=0.5 + 1.6 * rows, sharex=True, sharey=True)
    for number, (ax, values) in enumerate(zip(axes.flat, rounds, strict=False)):
        step = 0.5**number
        ax.axhline(0, color=OBSERVED, linewidth=0.8)
        ax.stairs(array(values), np.arange(len(values) + 1) * step, color=CYCLE[0], linewidth=1.5)
        ax.set(title=f"round {number}", xlim=(-0.2, support + 0.2))
    for ax in axes[-1]:
        ax.set_xlabel("position (samples)")
    return fig, axes


def sliding_filter(
    signal: Float[Array, " T"], wavelet: str, *, mode: str = "zero", alt: str, milliseconds: int = 350, width: int = 600
) -> Loop:
    """A low-pass filter that goes over a signal two samples at a time, and the coefficient that each place gives.

    Args:
        signal: T values.
        wavelet, mode: of the transform, as PyWavelets names them; the taps below 1e-12 are not drawn.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        milliseconds: how long each picture stays; the last one stays a second.
        width: pixels.

    Raises:
        ValueError: the alternative text is empty.
    """
    taps = np.asarray(pywt.Wavelet(wavelet).dec_lo)
    longer = pywt.pad(array(signal), len(taps) - 1, mode)
    coefficients = pywt.dwt(array(signal), wavelet, mode)[0]
    figures = (_slid(longer, taps, coefficients, k, width) for k in range(len(coefficients)))
    return Loop.of_figures(figures, milliseconds, alt)


@style()
def _slid(longer: np.ndarray, taps: np.ndarray, coefficients: np.ndarray, k: int, width: int) -> Figure:
    """Coefficient k is made: tap n stands over frame 2k + 1 - n."""
    fig, axes = canvas(3, 1, height=4.2, sharex=True)
    fig.set_dpi(width / WIDTH)
    frames, pad = np.arange(len(longer)) - len(taps) + 1, len(taps) - 1
    places = 2 * k + 1 - np.arange(len(taps))
    nonzero = np.abs(taps) > 1e-12
    top, middle, bottom = axes[:, 0]
    for ax in axes[:, 0]:
        ax.axvspan(places.min() - 0.5, places.max() + 0.5, color="#fbe3d3", linewidth=0, zorder=0)
        ax.axhline(0, color=OBSERVED, linewidth=0.8)
    top.plot(frames, longer, ".-", color=OBSERVED, linewidth=1)
    top.plot(frames[pad : len(longer) - pad], longer[pad : len(longer) - pad], ".-", color=INK)
    middle.vlines(places[nonzero], 0, taps[nonzero], color=CYCLE[1])
    middle.plot(places[nonzero], taps[nonzero], "o", color=CYCLE[1], markersize=4)
    centres = 2 * np.arange(len(coefficients)) + 1 - np.average(np.arange(len(taps)), weights=taps**2)
    bottom.vlines(centres[: k + 1], 0, coefficients[: k + 1], color=CYCLE[0])
    bottom.plot(centres[k], coefficients[k], "o", color=CYCLE[0])
    top.set(title="signal and its extension (grey)", xlim=(frames[0] - 1, frames[-1] + 1))
    middle.set(
        title="taps of the filter, reversed", ylim=(min(taps.min(), 0) - 0.15 * np.ptp(taps), taps.max() + 0.15 * np.ptp(taps))
    )
    edge = 1.15 * float(np.abs(coefficients).max())
    bottom.set(
        title=f"their inner product: a[{k}] = {round(float(coefficients[k]), 2) + 0.0:.2f}", ylim=(-edge, edge), xlabel="frame"
    )
    return fig


def _tiles(ax: Axes, parts: Sequence[np.ndarray], seconds: float, dark: float) -> None:
    """The slowest part below; each finer one above it has twice as many tiles, of half the width."""
    for row, part in enumerate(parts):
        edges = np.linspace(0, seconds, len(part) + 1)
        ax.pcolormesh(edges, [row, row + 1], np.abs(part)[None], cmap="Greys", vmin=0, vmax=dark, edgecolors=FAINT, linewidth=0.3)


def _grid(ax: Axes, edges: np.ndarray, low: float, high: float) -> None:
    ax.vlines(edges, low, high, color=INK, linewidth=1)
    ax.hlines([low, high], edges[0], edges[-1], color=INK, linewidth=1)
