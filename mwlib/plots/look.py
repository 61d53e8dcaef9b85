"""One look for every picture: colours, sizes, type. Nothing here acts until `style()` or `use_style()` is called."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TypeVar

import matplotlib.style as mpl_style
import numpy as np
import torch
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

# Own choice: the hues of petroff10, with the lightness of each spread evenly from 23 to 61 (CIE L*), so that the six survive
# greyscale printing and the common colour-vision deficiencies, and all keep 3:1 contrast with white.
CYCLE = ("#004b7b", "#e96e20", "#087b5e", "#6f0044", "#ab5ad9", "#af1e02")
# Lines of one axes differ in their dashes too: colour alone must never tell them apart.
DASHES = ("-", (0, (5, 1.2)), (0, (1.2, 1)), (0, (5, 1, 1.2, 1)), (0, (9, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
HATCHES = ("", "////", "....", "xxxx", "----", "oooo")  # the same for bars
LEFT, RIGHT = CYCLE[:2]
PREDICTED = CYCLE[0]
TRUTH = "#000000"
OBSERVED = "#7b818a"
INK = "#22262e"
FAINT = "#e9ebee"
BAND_NAMES = {
    "aa": "aa: slow (time), smooth (joints)",
    "da": "da: fast (time), smooth (joints)",
    "ad": "ad: slow (time), rough (joints)",
    "dd": "dd: fast (time), rough (joints)",
}
WIDTH = 6.4  # inches: one notebook column, still legible on a phone

STYLE = {
    "figure.dpi": 120,
    "figure.facecolor": "white",
    "font.size": 10,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 10,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "legend.fontsize": 9,
    "figure.titlesize": 11,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.titlecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": FAINT,
    "lines.linewidth": 1.8,
    "lines.markersize": 5,
    "patch.linewidth": 0.8,
    "legend.frameon": False,
    "image.cmap": "viridis",
    "image.interpolation": "nearest",
    "axes.prop_cycle": cycler(color=CYCLE),
    "pdf.fonttype": 42,
    "svg.hashsalt": "mwlib",
    "savefig.dpi": 120,
}


@contextmanager
def style() -> Iterator[None]:
    """Draw with mwlib's look alone inside a `with` block, or as a decorator; the reader's settings come back afterwards."""
    with mpl_style.context(["default", STYLE]):
        yield


def use_style() -> None:
    """Give mwlib's look to everything drawn from here on, the reader's own plots included."""
    mpl_style.use(["default", STYLE])


def canvas(rows: int = 1, columns: int = 1, *, height: float, width: float = WIDTH, **subplots) -> tuple[Figure, np.ndarray]:
    """A figure with (rows, columns) axes, unknown to pyplot: nothing is shown twice and nothing has to be closed."""
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.07, h_pad=0.07))
    return figure, figure.subplots(rows, columns, squeeze=False, **subplots)


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


def bar_look(number: int) -> dict[str, object]:
    """Colour and hatch of the bars of a series."""
    look = {"edgecolor": "white", "linewidth": 0}
    return {"color": CYCLE[number % len(CYCLE)], "hatch": HATCHES[number % len(HATCHES)], **look}


def colourbar(image, axes: Axes | list[Axes], label: str, *, cut: bool = False) -> None:
    """A slim colour bar beside the axes; pointed where values run off the scale."""
    ends = "both" if cut else "neither"
    bar = image.get_figure().colorbar(image, ax=axes, label=label, extend=ends, pad=0.02, fraction=0.05, aspect=25)
    bar.outline.set_visible(False)
