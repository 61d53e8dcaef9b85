"""Pictures of wavelets, filters, bases and phase codes (chapters 01 to 04)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pywt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mwlib.plots.lines import draw

from mwlib.plots.look import (  # isort: skip
    CYCLE, FAINT, INK, LOOKS, OBSERVED, TRUTH, WIDTH, Panel, Panels, Values, array, canvas, legend, limit, outer,
    panel, rule, style, tiled, titled,
)  # fmt: skip
from mwlib.plots.loops import Loop, photographed

LEVEL = 4  # how often the slow half of `same_spectrum` is halved again


@style()
def filters(wavelet: str) -> Panels:
    """The four filters of a wavelet, tap by tap; on the left those that analyse, on the right those that rebuild."""
    bank = pywt.Wavelet(wavelet)
    fig, axes = canvas(2, 2, height=3.6, sharex=True, sharey=True)
    names = ("analysis, low-pass", "analysis, high-pass", "synthesis, low-pass", "synthesis, high-pass")
    for ax, name, taps, colour in zip(axes.T.flat, names, bank.filter_bank, CYCLE[:2] * 2, strict=True):
        _stems(ax, np.arange(len(taps)), np.asarray(taps), colour)
        ax.set_title(f"{name}: {np.count_nonzero(np.abs(taps) > 1e-12)} of {len(taps)} taps")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.margins(y=0.12)
    outer(axes, "tap")
    fig.suptitle(wavelet, x=0.01, ha="left", weight="bold")
    return fig, axes


@style()
def signal_and_coefficients(signal: Values, wavelet: str, *, mode: str = "zero", fps: float) -> Panels:
    """A signal over its approximation and detail coefficients, each standing at the middle of the frames it sees.

    Args:
        signal: T values, metres.
        wavelet, mode: of the transform, as PyWavelets names them.
        fps: frames per second.
    """
    signal, bank = array(signal), pywt.Wavelet(wavelet)
    approximation, detail = pywt.dwt(signal, bank, mode)
    fig, axes = canvas(3, 1, height=4.6, sharex=True)
    axes[0, 0].plot(np.arange(len(signal)) / fps, signal, color=INK)
    axes[0, 0].set_title(f"signal: {len(signal)} frames")
    panels = ("approximation", approximation, bank.dec_lo, CYCLE[0]), ("detail", detail, bank.dec_hi, CYCLE[1])
    for ax, (name, values, taps, colour) in zip(axes[1:, 0], panels, strict=True):
        _stems(ax, _middles(len(values), taps) / fps, values, colour)
        ax.set_title(f"{name}: {len(values)} coefficients, largest {np.abs(values).max():.3g} m")
    outer(axes, "time (s)", "m")
    return fig, axes[:, 0]


@style()
def padding_modes(
    signal: Values,
    *,
    modes: Sequence[str] = ("zero", "symmetric", "constant", "periodic", "reflect", "smooth"),
    pad: int = 16,
) -> Panels:
    """How each extension mode continues a signal beyond its two ends before it is filtered; what goes far leaves the panel.

    Args:
        signal: T values, metres.
        modes: as PyWavelets names them.
        pad: frames added at each end; a filter of l taps asks for l - 1.

    Raises:
        ValueError: an unknown mode.
    """
    signal = array(signal)
    fig, axes = tiled(len(modes), frame=0.5, each=1.5)
    for ax, longer in titled(axes, {mode: pywt.pad(signal, pad, mode) for mode in modes}):
        places, end = np.arange(len(longer)) - pad, pad + len(signal) - 1  # periodization makes an odd length even first
        for outside in (slice(pad + 1), slice(end, None)):
            ax.plot(places[outside], longer[outside], color=CYCLE[1], linestyle=(0, (2, 0.8)))
        ax.plot(signal, color=INK)
        ax.axvspan(0, len(signal) - 1, color=FAINT, linewidth=0, zorder=0)
    low, high = min(signal.min(), 0.0), max(signal.max(), 0.0)
    room = 0.7 * ((high - low) or 1.0)
    axes[0, 0].set_ylim(low - room, high + room)
    outer(axes, "frame", "m")
    return fig, axes


@style()
def same_spectrum(signals: Mapping[str, Values], wavelet: str, *, fps: float) -> Panels:
    """Signals, each with its Fourier magnitude up to 6 Hz and its wavelet coefficients as tiles: across, when; upwards, how fast.

    Args:
        signals: name -> T values, metres, a column each; T divisible by 2 to the power of `LEVEL`.
        wavelet: of the tiles; the ends of a signal are joined.
        fps: samples per second.
    """
    tiles = {name: pywt.wavedec(array(signal), wavelet, "periodization", LEVEL) for name, signal in signals.items()}
    dark = max(limit(part) for parts in tiles.values() for part in parts)
    fig, axes = canvas(3, len(signals), height=5.0, sharey="row")
    for (top, middle, bottom), (name, signal) in zip(axes.T, signals.items(), strict=True):
        signal = array(signal)
        seconds = len(signal) / fps
        top.plot(np.arange(len(signal)) / fps, signal, color=INK)
        top.set(title=name, xlim=(0, seconds), xlabel="time (s)")
        middle.plot(np.fft.rfftfreq(len(signal), 1 / fps), np.abs(np.fft.rfft(signal)) / fps, color=CYCLE[0])
        middle.set(xlim=(0, 6), xlabel="frequency (Hz)")
        for row, part in enumerate(tiles[name]):  # the slowest below; each finer one has twice as many tiles, of half the width
            edges, look = np.linspace(0, seconds, len(part) + 1), {"edgecolors": FAINT, "linewidth": 0.3}
            bottom.pcolormesh(edges, [row, row + 1], np.abs(part)[None], cmap="Greys", vmin=0, vmax=dark, **look)
        bottom.set(xlim=(0, seconds), ylim=(0, LEVEL + 1), xlabel="time (s)")
    edges = [0, *(fps / 2**halved for halved in range(LEVEL + 1, 0, -1))]
    names = [f"{low:g} to {high:g}" for low, high in pairwise(edges)]
    axes[2, 0].set_yticks(np.arange(LEVEL + 1) + 0.5, names)
    for ax, label in zip(axes[:, 0], ("m", "|Fourier| (m s)", "wavelets (Hz)"), strict=True):
        ax.set_ylabel(label)
    fig.align_ylabels(axes[:, 0])
    return fig, axes


@style()
def tilings() -> Panels:
    """What a number of each kind tells: a tile of time (across) and frequency (upwards); all tiles have the same area."""
    fig, axes = canvas(1, 4, height=2.2, sharex=True, sharey=True)
    columns = {"samples": [16], "Fourier": [1] * 16, "short-time Fourier": [4] * 4, "wavelets": [1, 1, 2, 4, 8]}
    for ax, rows in titled(axes, columns):
        edges = np.cumsum([0, *rows]) / 16
        for count, (low, high) in zip(rows, pairwise(edges), strict=True):
            ax.vlines(np.linspace(0, 1, count + 1), low, high, color=INK, linewidth=1)
            ax.hlines([low, high], 0, 1, color=INK, linewidth=1)
        ax.set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[], xlabel="time")
        ax.spines[:].set_visible(True)
    axes[0, 0].set_ylabel("frequency")
    return fig, axes[0]


@style()
def responses(panels: Mapping[str, tuple[Values, Values]], hertz: Values, spectrum: Values) -> Panels:
    """What the two filters of each wavelet let through, over the spectrum of a movement.

    Args:
        panels: wavelet -> (|H|, |G|) at each frequency; two panels a row.
        hertz: the frequencies.
        spectrum: magnitude of the movement's Fourier transform there; drawn as a grey shape as high as the panel.
    """
    hertz, shape = array(hertz), array(spectrum) / array(spectrum).max()
    fig, axes = tiled(len(panels), 2, frame=0.7, each=1.6)
    top = 1.08 * max(float(array(part).max()) for pair in panels.values() for part in pair)
    for ax, (low, high) in titled(axes, panels):
        ax.fill_between(hertz, shape * top, color="#c9cdd3", linewidth=0, label="the movement, height arbitrary")
        draw(ax, {"|H|, low-pass": low, "|G|, high-pass": high}, hertz)
        ax.axvline(hertz[-1] / 2, color=OBSERVED, linewidth=0.8)
        ax.set(xlim=(0, hertz[-1]), ylim=(0, top))
    outer(axes, "frequency (Hz)", "amplitude")
    legend(axes[0, 0])
    return fig, axes


@style()
def cascade(rounds: Sequence[Values], *, support: float) -> Panels:
    """The staircase of each round of the cascade algorithm; its stairs are half as wide as those of the round before.

    Args:
        rounds: the samples after 0, 1, 2 ... rounds; after j rounds they stand 2^-j apart.
        support: length of the limit, samples of the signal.
    """
    fig, axes = tiled(len(rounds), frame=0.5, each=1.6)
    for number, (ax, values) in enumerate(zip(axes.flat, rounds, strict=False)):
        rule(ax)
        ax.stairs(array(values), np.arange(len(values) + 1) * 0.5**number, color=CYCLE[0], linewidth=1.5)
        ax.set(title=f"round {number}", xlim=(-0.2, support + 0.2))
    outer(axes, "position (samples)")
    return fig, axes


def sliding_filter(signal: Values, wavelet: str, *, mode: str = "zero", alt: str) -> Loop:
    """A low-pass filter that goes over a signal two samples at a time, and the coefficient that each place gives.

    Args:
        signal: T values.
        wavelet, mode: of the transform, as PyWavelets names them; the taps below 1e-12 are not drawn.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.

    Raises:
        ValueError: the alternative text is empty.
    """
    taps = np.asarray(pywt.Wavelet(wavelet).dec_lo)
    longer = pywt.pad(array(signal), len(taps) - 1, mode)
    coefficients = pywt.dwt(array(signal), wavelet, mode)[0]
    figures = (_slid(longer, taps, coefficients, k) for k in range(len(coefficients)))
    return Loop(map(photographed, figures), 350, alt)


@style()
def _slid(longer: np.ndarray, taps: np.ndarray, coefficients: np.ndarray, k: int) -> Figure:
    """Coefficient k is made: tap n stands over frame 2k + 1 - n."""
    fig, axes = canvas(3, 1, height=4.2, sharex=True)
    fig.set_dpi(600 / WIDTH)  # 600 pixels wide
    frames, inside = np.arange(len(longer)) - len(taps) + 1, slice(len(taps) - 1, len(longer) - len(taps) + 1)
    places, nonzero = 2 * k + 1 - np.arange(len(taps)), np.abs(taps) > 1e-12
    top, middle, bottom = axes[:, 0]
    for ax in axes[:, 0]:
        ax.axvspan(places.min() - 0.5, places.max() + 0.5, color="#fbe3d3", linewidth=0, zorder=0)
        rule(ax)
    top.plot(frames, longer, ".-", color=OBSERVED, linewidth=1)
    top.plot(frames[inside], longer[inside], ".-", color=INK)
    middle.vlines(places[nonzero], 0, taps[nonzero], color=CYCLE[1])
    middle.plot(places[nonzero], taps[nonzero], "o", color=CYCLE[1], markersize=4)
    centres = _middles(len(coefficients), taps)
    bottom.vlines(centres[: k + 1], 0, coefficients[: k + 1], color=CYCLE[0])
    bottom.plot(centres[k], coefficients[k], "o", color=CYCLE[0])
    room, edge = 0.15 * np.ptp(taps), 1.15 * limit(coefficients)
    product = f"their inner product: a[{k}] = {round(float(coefficients[k]), 2) + 0.0:.2f}"
    top.set(title="signal and its extension (grey)", xlim=(frames[0] - 1, frames[-1] + 1))
    middle.set(title="taps of the filter, reversed", ylim=(min(taps.min(), 0) - room, taps.max() + room))
    bottom.set(title=product, ylim=(-edge, edge), xlabel="frame")
    return fig


@style()
def dots(values: Mapping[str, Mapping[str, float]], *, xlabel: str, log: bool = False) -> Panel:
    """A row per name and a mark per series, told apart by colour, shape and a small step downwards.

    Args:
        values: series -> name -> value; the names of the first series are the rows, from the top, and others may lack some.
        xlabel: what, and its unit.
        log: a logarithmic axis, for values over many powers of ten.
    """
    names = list(next(iter(values.values())))
    fig, ax = panel(1.0 + (0.24 + 0.06 * len(values)) * len(names))
    step = min(0.2, 0.6 / len(values))
    for number, (series, row) in enumerate(values.items()):
        places = np.array([names.index(name) for name in row]) + (number - (len(values) - 1) / 2) * step
        ax.plot([*row.values()], places, "Dos^vP"[number % 6], color=CYCLE[number % len(CYCLE)], label=series)
    for edge in np.arange(0.5, len(names) - 1):
        ax.axhline(edge, color=FAINT, linewidth=1, zorder=0)
    ax.set(yticks=range(len(names)), yticklabels=names, xlabel=xlabel, xscale="log" if log else "linear")
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)
    legend(ax)
    return fig, ax


def _stems(ax: Axes, places: np.ndarray, values: np.ndarray, colour: str) -> None:
    rule(ax, zorder=1)
    ax.vlines(places, 0, values, color=colour, linewidth=1.5)
    ax.plot(places, values, "o", color=colour, markersize=4)


def _middles(count: int, taps: Sequence[float] | np.ndarray) -> np.ndarray:
    """Frame under the middle of each coefficient's taps, weighted by their squares; c[k] = sum_j taps[j] x[2k+1-j]."""
    return 2 * np.arange(count) + 1 - np.average(np.arange(len(taps)), weights=np.square(taps))


@style()
def windows_and_sinusoids(panels: Mapping[str, tuple[Values, Values]], *, fps: float, ylabel: str = "") -> Panels:
    """Windows of a signal, each with the one sinusoid that stands for it.

    Args:
        panels: title -> (window, sinusoid), N samples each; time 0 is the middle.
        fps: samples per second.
        ylabel: what, and its unit.
    """
    fig, axes = canvas(1, len(panels), height=2.4, sharey=True)
    for ax, (window, sinusoid) in titled(axes, panels):
        seconds = (np.arange(len(window)) - len(window) // 2) / fps
        draw(ax, {"window": window, "its sinusoid": sinusoid}, seconds, looks=[{"color": TRUTH}, LOOKS[1]])
    outer(axes, "time (s)", ylabel)
    legend(axes[0, 0], 2)
    return fig, axes[0]


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
    for ax, lines in titled(axes, panels):
        for number, (name, (sizes, errors)) in enumerate(lines.items()):
            ax.plot(sizes, errors, "o^sDvP"[number], markersize=10 if len(sizes) == 1 else 5, label=name, **LOOKS[number])
        ax.set_yscale("log")
        ax.grid(axis="y")
    outer(axes, xlabel, ylabel)
    legend(axes[0, 0], 2)
    return fig, axes[0]
