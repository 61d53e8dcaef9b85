"""Figures with axes, and what panels share: labels, legends, rules, matrices, colour bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend

from mwlib.plots.look import DIVERGING, OBSERVED, WIDTH

Array = np.ndarray | torch.Tensor
Panel = tuple[Figure, Axes]
Panels = tuple[Figure, np.ndarray]  # of axes
Curves = Mapping[str, Float[Array, " n"]]  # name -> values


def canvas(rows: int = 1, columns: int = 1, *, height: float, width: float = WIDTH, **subplots) -> Panels:
    """A figure with (rows, columns) axes, unknown to pyplot: nothing is shown twice and nothing has to be closed."""
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.07, h_pad=0.07))
    return figure, figure.subplots(rows, columns, squeeze=False, **subplots)


def panel(height: float, width: float = WIDTH) -> Panel:
    """A figure with one axes."""
    figure, axes = canvas(height=height, width=width)
    return figure, axes[0, 0]


def tiled(count: int, columns: int = 3, *, frame: float, each: float, width: float = WIDTH, shared: bool = True) -> Panels:
    """A figure with so many axes, at most so many in a row; places that are left over stay empty.

    Args:
        frame: inches of height for the legend and the lowest labels; each: for a row.
        shared: whether all have one scale.
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    figure, axes = canvas(rows, columns, height=frame + each * rows, sharex=shared, sharey=shared, width=width)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    return figure, axes


def outer(axes: np.ndarray, xlabel: str = "", ylabel: str = "", *, lowest: bool = False) -> None:
    """Labels of a grid of axes: left of each row, and below the last row, or below the lowest axes of each column."""
    for column in axes.T:
        last = [ax for ax in column if ax.get_visible() or not lowest][-1]
        last.set_xlabel(xlabel)
        last.tick_params(labelbottom=True)
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)


def legend(ax: Axes, columns: int = 3, place: str = "outside upper left") -> Legend:
    """What the lines of one axes mean, outside of all axes."""
    figure: Any = ax.get_figure()
    return figure.legend(*ax.get_legend_handles_labels(), loc=place, ncols=columns)


def rule(ax: Axes, height: float = 0, **look: Any) -> None:
    """A thin grey line across the axes."""
    ax.axhline(height, **{"color": OBSERVED, "linewidth": 0.8} | look)


def signed(ax: Axes, values: np.ndarray, edge: float | None = None) -> AxesImage:
    """A matrix whose numbers are white at zero, and darkest at the edge or beyond; None: at the largest."""
    edge = limit(values) if edge is None else edge
    return ax.imshow(values, cmap=DIVERGING, vmin=-edge, vmax=edge, aspect="auto")


def array(values) -> np.ndarray:
    """Tensor on any device, list or array -> numpy array."""
    return values.detach().cpu().numpy() if isinstance(values, torch.Tensor) else np.asarray(values)


Item = TypeVar("Item")


def named(items: Mapping[str, Item] | Item) -> dict[str, Item]:
    """A lone item becomes a mapping with an empty name, so that one drawing routine serves both."""
    return dict(items) if isinstance(items, Mapping) else {"": items}


def limit(values: np.ndarray) -> float:
    """The symmetric colour or axis limit that holds all values; never zero."""
    return float(np.abs(values).max()) or 1.0


def colourbar(image, axes: Axes | list[Axes], label: str, *, cut: bool = False) -> None:
    """A slim colour bar beside the axes; pointed where values run off the scale."""
    ends = "both" if cut else "neither"
    bar = image.get_figure().colorbar(image, ax=axes, label=label, extend=ends, pad=0.02, fraction=0.05, aspect=25)
    bar.outline.set_visible(False)
