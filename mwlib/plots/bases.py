"""Wavelet bases side by side: what is claimed of them and what is measured, and one basis on a card of its own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pywt
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mwlib.plots.coefficients import DIVERGING
from mwlib.plots.look import CYCLE, DASHES, FAINT, OBSERVED, array, canvas, limit, style
from mwlib.plots.tables import significant
from mwlib.transforms import WaveletTransform

Array = np.ndarray | torch.Tensor
MARKERS = ("D", "o", "s", "^", "v", "P")


@style()
def dots(
    values: Mapping[str, Mapping[str, float]],
    *,
    xlabel: str,
    log: bool = False,
    spread: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[Figure, Axes]:
    """A row per name and a mark per series, told apart by colour, shape and a small step downwards.

    Args:
        values: series -> name -> value; the names of the first series are the rows, from the top, and others may lack some.
        xlabel: what, and its unit.
        log: a logarithmic axis, for values over many powers of ten.
        spread: series -> name -> half length of a bar through the mark.
    """
    names = list(next(iter(values.values())))
    fig, axes = canvas(height=1.0 + (0.24 + 0.06 * len(values)) * len(names))
    ax, step = axes[0, 0], min(0.2, 0.6 / len(values))
    for number, (series, row) in enumerate(values.items()):
        places = np.array([names.index(name) for name in row]) + (number - (len(values) - 1) / 2) * step
        look = {"color": CYCLE[number % len(CYCLE)], "marker": MARKERS[number % len(MARKERS)], "linestyle": "none"}
        half = [(spread or {}).get(series, {}).get(name, 0.0) for name in row]
        ax.errorbar(list(row.values()), places, xerr=half if any(half) else None, label=series, **look)
    for edge in np.arange(0.5, len(names) - 1):
        ax.axhline(edge, color=FAINT, linewidth=1, zorder=0)
    ax.set(yticks=range(len(names)), yticklabels=names, xlabel=xlabel, xscale="log" if log else "linear")
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def basis_card(wavelet: str, x: Float[Array, "T C"], *, mode: str = "zero") -> tuple[Figure, np.ndarray]:
    """All of one basis: scaling function and wavelet, analysis filters, and what they make of a motion.

    Args:
        wavelet: any discrete PyWavelets wavelet.
        x: the motion, metres.
        mode: extension of the motion at its ends.

    Raises:
        ValueError: unknown wavelet or mode.
    """
    motion = torch.as_tensor(array(x), dtype=torch.float64)
    frames, channels = motion.shape
    transform = WaveletTransform(frames, channels, wavelet, mode)
    bank, bands = pywt.Wavelet(wavelet), transform.split(transform(motion))
    fig, axes = canvas(4, 2, height=7.9)
    _functions(axes[0], bank)
    for ax, taps, colour, name in zip(axes[1], (bank.dec_lo, bank.dec_hi), CYCLE, ("low", "high"), strict=False):
        ax.vlines(np.arange(len(taps)), 0, taps, color=colour)
        ax.plot(taps, "o", color=colour, markersize=4)
        ax.axhline(0, color=OBSERVED, linewidth=0.8, zorder=1)
        ax.set(title=f"{name}-pass: {np.count_nonzero(np.abs(taps) > 1e-12)} of {len(taps)} taps", xlabel="tap")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    for ax, name in zip(axes[2:].flat, ("aa", "ad", "da", "dd"), strict=True):
        band = bands[name].numpy()
        ax.imshow(band.T, cmap=DIVERGING, vmin=-limit(band), vmax=limit(band), aspect="auto")
        ax.set_title(f"{name}: largest {significant(limit(band), 2)} m")
        ax.set_xlabel("row k (time)" if name[0] == "d" else "")
        ax.spines[:].set_visible(True)
    for ax in axes[2:, 0]:
        ax.set_ylabel("column d (joints)")
    kind = "orthogonal" if bank.orthogonal else "biorthogonal"
    sizes = " × ".join(map(str, motion.shape)), " × ".join(map(str, transform.shape))
    fig.suptitle(f"{wavelet} ({kind}, {bank.symmetry}): {sizes[0]} → {sizes[1]}", x=0.01, ha="left", weight="bold")
    return fig, axes


def _functions(axes: np.ndarray, bank: pywt.Wavelet) -> None:
    """Scaling function and wavelet that analyse; where others rebuild, these are dashed."""
    *functions, support = bank.wavefun(level=7)
    note = " (dashed: synthesis)" if len(functions) == 4 else ""
    for column, (ax, title) in enumerate(zip(axes, ("scaling function φ", "wavelet ψ"), strict=True)):
        for values, colour, dashes in zip(functions[column::2], (CYCLE[column], CYCLE[4]), DASHES, strict=False):
            ax.plot(support, values, color=colour, linestyle=dashes)
        ax.axhline(0, color=OBSERVED, linewidth=0.8, zorder=1)
        ax.set(title=title + note, xlabel="position (samples)")
