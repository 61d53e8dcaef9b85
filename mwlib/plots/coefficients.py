"""Many coefficients at once: matrices, sub-bands, their energy, and what projecting onto the manifold changes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from mwlib.plots.axes import Array, Panel, Panels, array, canvas, colourbar, limit, outer, panel, signed
from mwlib.plots.lines import bars
from mwlib.plots.look import BAND_NAMES, CYCLE, INK, WIDTH, style
from mwlib.plots.tables import significant


@style()
def matrix(
    values: Float[Array, "rows columns"],
    *,
    title: str = "",
    xlabel: str = "frame",
    ylabel: str = "coefficient",
    split: int | None = None,
    unit: str = "",
) -> Panel:
    """A matrix as a picture, white where it is zero.

    Args:
        values: (rows, columns).
        split: first row of the lower half, e.g. K in an analysis matrix: approximations above, details below.
        unit: of the values.
    """
    values = array(values)
    rows, columns = values.shape
    height = float(np.clip(4.6 * rows / columns, 2.0, 5.0))
    fig, ax = panel(height + 0.6, width=min(WIDTH, height * columns / rows + 1.8))
    image = signed(ax, values)
    if split is not None:
        ax.axhline(split - 0.5, color=INK, linewidth=1)
        for place, word in (((split - 1) / 2, "approximation"), ((split + rows - 1) / 2, "detail")):
            ax.annotate(word, (1, place), (4, 0), ("axes fraction", "data"), "offset points", rotation=-90, va="center")
    ax.set(title=title, xlabel=xlabel, ylabel=ylabel)
    ax.spines[:].set_visible(True)
    colourbar(image, ax, unit)
    return fig, ax


@style()
def subbands(
    bands: Mapping[str, Float[Array, "rows columns"]], *, common: bool = False, share: float = 1.0, unit: str = "m"
) -> Panels:
    """The four sub-bands of one motion: time runs downwards, channels to the right, as in the matrix of the coefficients.

    Args:
        bands: "aa", "da", "ad", "dd" -> (K, D), time letter first, as `WaveletTransform.split` returns them.
        common: one colour scale for all four, which shows how small some are; otherwise each has its own.
        share: part of the coefficients that the colour scale holds; below 1 the largest, at the boundary, run off it.
        unit: of the coefficients.

    Raises:
        KeyError: a band is missing.
    """
    values = {name: array(bands[name]) for name in ("aa", "ad", "da", "dd")}
    fig, axes = canvas(2, 2, height=4.2, sharex=True, sharey=True)
    edges = {name: float(np.quantile(np.abs(band), share)) or limit(band) for name, band in values.items()}
    for ax, (name, band) in zip(axes.flat, values.items(), strict=True):
        image = signed(ax, band, max(edges.values()) if common else edges[name])
        ax.set_title(BAND_NAMES[name])
        ax.spines[:].set_visible(True)
        if not common:
            colourbar(image, ax, unit, cut=share < 1)
    if common:
        colourbar(image, list(axes.flat), unit, cut=share < 1)
    outer(axes, "column d (coordinates)", "row k (time)")
    return fig, axes


@style()
def energy_bars(energies: Mapping[str, float] | Mapping[str, Mapping[str, float]]) -> Panel:
    """Share of the energy (sum of squares) that each sub-band holds, in percent.

    Args:
        energies: band -> energy, or name (of a wavelet, an action ...) -> band -> energy; shares are taken within each name.
    """
    nested = isinstance(next(iter(energies.values())), Mapping)
    series: Mapping[str, Any] = energies if nested else {"": energies}
    bands = list(next(iter(series.values())))
    shares = {name: [100 * row[band] / sum(row.values()) for band in bands] for name, row in series.items()}
    fig, ax = panel(0.7 + 0.24 * len(bands) * (len(series) + 0.7))
    for place, share in bars(ax, shares, room=0.84, fill=0.88):
        ax.annotate(f"{significant(share)} %", (share, place), (4, 0), textcoords="offset points", va="center", size=9)
    ax.set(yticks=range(len(bands)), yticklabels=bands, xlabel="share of the energy (%)", xlim=(0, 112))
    ax.invert_yaxis()
    if nested:
        ax.legend(loc="lower right")
    return fig, ax


@style()
def projection_change(analysis: Float[Array, "rows T"], synthesis: Float[Array, "T rows"], *, title: str = "") -> Panels:
    """Which coefficients change when they go to the motion and back: P = analysis · synthesis, against the identity.

    A bar is the Euclidean length of a row of P - I.

    Args:
        analysis: (2K, T), approximation rows over detail rows (`WaveletTransform.analysis_time`).
        synthesis: (T, 2K) (`WaveletTransform.synthesis_time`).
        title: set before the count of changed rows.
    """
    analysis, synthesis = array(analysis), array(synthesis)
    change = np.linalg.norm(analysis @ synthesis - np.eye(len(analysis)), axis=1)
    changed = change > 1e-9 * max(change.max(), 1.0)
    half = len(change) // 2
    fig, axes = canvas(2, 1, height=3.6, sharex=True, sharey=True)
    halves = ("approximation", slice(half), CYCLE[0]), ("detail", slice(half, None), CYCLE[1])
    for ax, (name, rows, colour) in zip(axes[:, 0], halves, strict=True):
        ax.bar(np.arange(half), change[rows], color=colour, width=0.8)
        ax.plot(np.flatnonzero(~changed[rows]), np.zeros((~changed[rows]).sum()), "|", color=INK, markersize=4)
        ax.set(title=f"{name}: {changed[rows].sum()} of {half} rows change", ylabel="‖row of P − I‖")
    axes[1, 0].set_xlabel("row k (time); a tick marks a row that stays as it is")
    fig.suptitle(f"{title}: {changed.sum()} of {len(change)} rows change" if title else "", x=0.01, ha="left")
    return fig, axes[:, 0]
