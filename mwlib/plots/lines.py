"""Lines, fans and bars of numbers, and matrices of coefficients."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.container import BarContainer
from matplotlib.ticker import FuncFormatter, NullFormatter

from mwlib.plots.look import (  # isort: skip
    AFTER_TRUTH, BAND_NAMES, CYCLE, FAINT, HATCHES, INK, LOOKS, MANY_LOOKS, OBSERVED, PREDICTED, TRUTH, WIDTH, Array, Curves,
    Look, Matrix, Panel, Panels, Values, array, canvas, colourbar, legend, limit, outer, panel, rule, signed, style, titled,
)  # fmt: skip
from mwlib.plots.tables import significant


def draw(
    ax: Axes,
    rows: Curves,
    x: Sequence[float] | Values | None = None,
    *,
    looks: Sequence[Look] = LOOKS,
    start: int = 0,
    marks: Mapping[str, int | np.ndarray] | None = None,
    what: str = "rows",
    **common: Any,
) -> None:
    """Rows of numbers as lines with names, told apart by colour and dashes.

    Args:
        rows: name -> values; where they are fewer than x they belong to its end.
        x: places; None counts from `start`.
        looks: of one row after the other.
        marks: name -> numbers of the values that get a dot.
        what: what an error calls the rows.
        common: what all lines have in common.

    Raises:
        ValueError: there are more rows than looks.
    """
    if len(rows) > len(looks):
        raise ValueError(f"{len(rows)} {what}; expected at most {len(looks)}, told apart by colour and dashes")
    marks = marks or {}
    for (name, values), look in zip(rows.items(), looks, strict=False):
        values = array(values)
        places = start + np.arange(len(values)) if x is None else array(x)[-len(values) :]
        ax.plot(places, values, **{"label": name, **look, **common})
        if name in marks:
            marked = np.atleast_1d(marks[name])
            ax.plot(places[marked], values[marked], "o", color=look["color"])


@style()
def curves(
    lines: Curves,
    x: Sequence[float] | Values | None = None,
    *,
    xlabel: str,
    ylabel: str,
    log: str = "",
    **options: Any,
) -> Panel:
    """Several functions of one variable, told apart by colour and dashes.

    Args:
        lines: name -> values at x; one called "truth" is black and solid.
        x: where; None counts from 0.
        xlabel, ylabel: what, and its unit.
        log: axes with a logarithmic scale: "", "x", "y" or "xy".
        options: as `draw` takes them: `marks` for dots on lines, `start` of the count, ...

    Raises:
        ValueError: there are more lines than can be told apart.
    """
    fig, ax = panel(3.0)
    looks = [{"color": INK} if name == "truth" else look for name, look in zip(lines, MANY_LOOKS, strict=False)]
    draw(ax, lines, x, looks=looks, **options)
    ax.set(xlabel=xlabel, ylabel=ylabel, **{f"{axis}scale": "log" for axis in log})
    ax.grid(axis="y")
    legend(ax)
    return fig, ax


@style()
def small_multiples(panels: Mapping[str, Curves], x: Sequence[float] | None = None, *, xlabel: str, ylabel: str) -> Panels:
    """The same curves under several circumstances, side by side, each on a scale of its own with 0 as a line.

    Args:
        panels: title -> name -> values at x; each panel has the same names.
        x: where; None counts from 0.
        xlabel, ylabel: what, and its unit.

    Raises:
        ValueError: there are more lines than can be told apart.
    """
    fig, axes = canvas(1, len(panels), height=3.0, sharex=True)
    for ax, lines in titled(axes, panels):
        draw(ax, lines, x, looks=MANY_LOOKS)
        rule(ax)
        ax.grid(axis="y")
    outer(axes, xlabel, ylabel)
    legend(axes[0, 0])
    return fig, axes[0]


@style()
def trajectories(truth: Values, futures: Float[Array, "S F"], *, fps: float, ylabel: str = "position (m)") -> Panel:
    """One coordinate over time: observed grey, truth black dashed, of many futures their median and the middle 50 and 90 %.

    Args:
        truth: (T,) observed and true future frames, T = H + F.
        futures: S samples.
        fps: frames per second; time 0 is the last observed frame.
        ylabel: what the coordinate is.
    """
    truth, futures = array(truth), array(futures)
    history = len(truth) - futures.shape[1]
    time = (np.arange(len(truth)) - (history - 1)) / fps
    fig, ax = panel(3.0)
    for share in (0.9, 0.5) if len(futures) > 1 else ():
        low, high = np.quantile(futures, [(1 - share) / 2, (1 + share) / 2], axis=0)
        ax.fill_between(time[history:], low, high, color=PREDICTED, alpha=0.2, linewidth=0)
    ax.plot(time[history:], np.median(futures, axis=0), color=PREDICTED, label="predicted")
    ax.plot(time[:history], truth[:history], color=OBSERVED, linewidth=2.4, label="observed")
    ax.plot(time[history - 1 :], truth[history - 1 :], color=TRUTH, linestyle=(0, (3, 1)), label="truth")
    ax.axvline(0, color=OBSERVED, linewidth=0.8)
    ax.set(xlabel="time (s); shaded: the middle 50 and 90 % of the samples", ylabel=ylabel, xlim=(time[0], time[-1]))
    legend(ax, 4)
    return fig, ax


@style()
def predicted_curves(rows: Mapping[str, Curves], *, fps: float, history: int) -> Panels:
    """One coordinate and its velocity, a row per window: the truth, and what each method predicts of it.

    Args:
        rows: title -> name -> metres; "truth" has T frames, every prediction the last T-H of them.
        fps: frames per second.
        history: observed frames H; time 0 is the last of them.
    """
    fig, axes = canvas(len(rows), 2, height=0.7 + 2.1 * len(rows), sharex=True)
    for (left, right), (title, lines) in zip(axes, rows.items(), strict=True):
        seconds = (np.arange(len(lines["truth"])) - (history - 1)) / fps
        for order, ax in enumerate((left, right)):
            ax.axvspan(seconds[0], 0, color=FAINT, linewidth=0, zorder=0)
            changes = {name: np.diff(array(values), order) * fps**order for name, values in lines.items()}
            truth = {"truth": changes.pop("truth")}
            draw(ax, truth | changes, seconds, looks=[{"color": INK, "linewidth": 2.2}, *AFTER_TRUTH])
        left.set(title=title, ylabel="position (m)")
        right.set_ylabel("velocity (m/s)")
    for ax in axes[-1]:
        ax.set_xlabel("time (s); shaded: observed")
    legend(axes[0, 0], 4)
    return fig, axes


def bars(
    ax: Axes, series: Mapping[str, Sequence[float]], *, room: float, fill: float, upright: bool = False
) -> list[BarContainer]:
    """Groups of bars, one in each group for every series.

    Args:
        series: name -> lengths; NaN leaves a gap.
        room: that a group takes, of the distance from group to group.
        fill: that a bar takes, of its own room.
        upright: bars rise from the x axis; otherwise they lie.

    Returns:
        The bars of each series.
    """
    drawn = []
    thick = room / len(series)
    for number, (name, lengths) in enumerate(series.items()):
        places = np.arange(len(lengths)) + (number - (len(series) - 1) / 2) * thick
        look: Look = {"color": CYCLE[number % len(CYCLE)], "hatch": HATCHES[number % len(HATCHES)], "edgecolor": "white"}
        drawn.append((ax.bar if upright else ax.barh)(places, lengths, fill * thick, label=name, linewidth=0, **look))
    return drawn


@style()
def bars_per_action(values: Mapping[str, Mapping[str, float]], *, xlabel: str) -> Panel:
    """One metric for every action, a bar per method; actions in the order of the first method's mapping.

    Args:
        values: method -> action -> value; an action that a method lacks has no bar.
        xlabel: the metric and its unit.
    """
    actions = list(next(iter(values.values())))
    fig, ax = panel(0.9 + len(actions) * (0.11 * len(values) + 0.12))
    series = {method: [scores.get(action, np.nan) for action in actions] for method, scores in values.items()}
    bars(ax, series, room=0.82, fill=0.9)
    ax.set(yticks=range(len(actions)), yticklabels=actions, xlabel=xlabel, ylim=(len(actions) - 0.5, -0.5))
    ax.grid(axis="x")
    if len(values) > 1:
        legend(ax)
    return fig, ax


@style()
def evidence(scores: Mapping[str, Sequence[float]], *, beyond: float = 2.0) -> Panel:
    """Strips of comparisons in units of their errors: as claimed to the right, the other way to the left, undecided in a band.

    Args:
        scores: name of a strip -> differences over their errors, positive as claimed.
        beyond: half the width of the band.
    """
    edge = 12.0  # marks that lie farther out are triangles there
    fig, ax = panel(0.9 + 0.46 * len(scores))
    ax.axvspan(-beyond, beyond, color=FAINT, linewidth=0)
    for height, values in enumerate(scores.values()):
        places: dict[float, int] = {}  # marks that would cover each other are stacked around the strip's line
        for value in sorted(values):
            x = round(float(np.clip(value, -edge, edge)) / 0.45) * 0.45
            places[x] = (number := places.get(x, 0)) + 1
            colour = CYCLE[0] if value > beyond else CYCLE[1] if value < -beyond else OBSERVED
            mark = "o" if abs(value) < edge else ">" if value > 0 else "<"
            ax.plot(x, height + 0.12 * (-1) ** number * ((number + 1) // 2), mark, color=colour, markersize=4)
    ax.set(yticks=range(len(scores)), yticklabels=list(scores), ylim=(len(scores) - 0.4, -0.6), xlim=(-edge - 1, edge + 1))
    ax.set_xlabel("the other way  <  difference over its error  <  as claimed")
    return fig, ax


def plain(axis: Axis) -> None:
    """Plain figures at the ticks of a logarithmic axis, 0.1 and 100, and none between them."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


@style()
def matrix(
    values: Matrix,
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
def subbands(bands: Mapping[str, Matrix], *, common: bool = False) -> Panels:
    """The four sub-bands of one motion: time runs downwards, channels to the right, as in the matrix of the coefficients.

    Args:
        bands: "aa", "da", "ad", "dd" -> (K, D) in metres, time letter first, as `WaveletTransform.split` returns them.
        common: one colour scale for all four, which shows how small some are; otherwise each has its own.

    Raises:
        KeyError: a band is missing.
    """
    values = {name: array(bands[name]) for name in ("aa", "ad", "da", "dd")}
    fig, axes = canvas(2, 2, height=4.2, sharex=True, sharey=True)
    edge = max(map(limit, values.values())) if common else None
    for ax, (name, band) in zip(axes.flat, values.items(), strict=True):
        image = signed(ax, band, edge)
        ax.set_title(re.sub(r" \(\w+\)", "", BAND_NAMES[name]) if common else BAND_NAMES[name])
        ax.spines[:].set_visible(True)
        if not common:
            colourbar(image, ax, "m")
    if common:
        colourbar(image, list(axes.flat), "m")
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
    for drawn in bars(ax, shares, room=0.84, fill=0.88):
        ax.bar_label(drawn, fmt=lambda share: f"{significant(share)} %", padding=4, size=9)
    widest = max(map(max, shares.values()))
    ax.set(yticks=range(len(bands)), yticklabels=bands, xlabel="share of the energy (%)", xlim=(0, 1.15 * widest))
    ax.invert_yaxis()
    if nested:
        ax.legend(loc="lower right")
    return fig, ax


@style()
def projection_change(analysis: Matrix, synthesis: Matrix, *, title: str) -> Panels:
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
    fig.suptitle(f"{title}: {changed.sum()} of {len(change)} rows change", x=0.01, ha="left")
    return fig, axes[:, 0]
