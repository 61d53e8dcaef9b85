"""One look for every picture: colours, sizes, type, and what figures and their panels share.

No setting of matplotlib changes until `style()` or `use_style()` is called.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib.style as mpl_style
import numpy as np
import torch
from cycler import cycler
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.layout_engine import ConstrainedLayoutEngine

# Own choice: the hues of petroff10, with the lightness of each spread evenly from 23 to 61 (CIE L*), so that the six survive
# greyscale printing and the common colour-vision deficiencies, and all keep 3:1 contrast with white.
CYCLE = ("#004b7b", "#e96e20", "#087b5e", "#6f0044", "#ab5ad9", "#af1e02")
# Lines of one axes differ in their dashes too: colour alone must never tell them apart.
DASHES = ("-", (0, (5, 1.2)), (0, (1.2, 1)), (0, (5, 1, 1.2, 1)), (0, (9, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
Look = Mapping[str, Any]  # what matplotlib's `plot` takes
LOOKS, AFTER_TRUTH = (  # of lines; and of lines beside a solid one
    [{"color": colour, "linestyle": dash} for colour, dash in zip(CYCLE, dashes, strict=True)]
    for dashes in (DASHES, DASHES[1:] + DASHES[:1])
)
MANY_LOOKS = LOOKS + AFTER_TRUTH
HATCHES = ("", "////", "....", "xxxx", "----", "oooo")  # the same for bars
PREDICTED = CYCLE[0]
TRUTH = "#000000"
OBSERVED = "#7b818a"
INK = "#22262e"
FAINT = "#e9ebee"
BAND_NAMES = {
    "aa": "aa: slow (time), smooth (coordinates)",
    "da": "da: fast (time), smooth (coordinates)",
    "ad": "ad: slow (time), rough (coordinates)",
    "dd": "dd: fast (time), rough (coordinates)",
}
DIVERGING = "RdBu_r"  # blue and red differ for every common kind of colour vision; white is zero
WIDTH = 6.4  # inches: one notebook column, still legible on a phone

STYLE = {
    "figure.dpi": 120, "figure.facecolor": "white", "figure.titlesize": 11, "font.size": 10, "legend.fontsize": 9,
    "axes.titlesize": 10.5, "axes.titlelocation": "left", "axes.labelsize": 10, "xtick.labelsize": 9, "ytick.labelsize": 9,
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "axes.titlecolor", "xtick.color", "ytick.color"), INK),
    "axes.linewidth": 0.8, "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True,
    "axes.unicode_minus": True, "axes.prop_cycle": cycler(color=CYCLE), "grid.color": FAINT, "lines.linewidth": 1.8,
    "lines.markersize": 5, "patch.linewidth": 0.8, "legend.frameon": False, "image.cmap": "viridis",
    "image.interpolation": "nearest", "pdf.fonttype": 42, "svg.hashsalt": "mwlib", "savefig.dpi": 120,
}  # fmt: skip


@contextmanager
def style() -> Iterator[None]:
    """Draw with mwlib's look alone inside a `with` block, or as a decorator; the reader's settings come back afterwards."""
    with mpl_style.context(["default", STYLE]):
        yield


def use_style() -> None:
    """Give mwlib's look to everything drawn from here on, the reader's own plots included."""
    mpl_style.use(["default", STYLE])


Array = np.ndarray | torch.Tensor
Panel = tuple[Figure, Axes]
Panels = tuple[Figure, np.ndarray]  # of axes
Values = Float[Array, " n"]
Matrix = Float[Array, "rows columns"]
Curves = Mapping[str, Values]  # by name


def canvas(rows: int = 1, columns: int = 1, *, height: float, width: float = WIDTH, **subplots) -> Panels:
    """A figure with (rows, columns) axes, unknown to pyplot: nothing is shown twice and nothing has to be closed."""
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.07, h_pad=0.07))
    return figure, figure.subplots(rows, columns, squeeze=False, **subplots)


def panel(height: float, width: float = WIDTH) -> Panel:
    """A figure with one axes."""
    figure, axes = canvas(height=height, width=width)
    return figure, axes[0, 0]


def tiled(count: int, columns: int = 3, *, frame: float, each: float, shared: bool = True) -> Panels:
    """A figure with so many axes, at most so many in a row; places that are left over stay empty.

    Args:
        frame: inches of height for the legend and the lowest labels; each: for a row.
        shared: whether all have one scale.
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    figure, axes = canvas(rows, columns, height=frame + each * rows, sharex=shared, sharey=shared)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    return figure, axes


def titled(axes: np.ndarray, panels: Mapping[str, Any]) -> Iterator[tuple[Axes, Any]]:
    """Axes one after the other, each under its title and with what it is to show."""
    for ax, (title, shown) in zip(axes.flat, panels.items(), strict=False):
        ax.set_title(title)
        yield ax, shown


def outer(axes: np.ndarray, xlabel: str = "", ylabel: str = "") -> None:
    """Labels of a grid of axes: left of each row, and below the lowest axes of each column."""
    for column in axes.T:
        last = [ax for ax in column if ax.get_visible()][-1]
        last.set_xlabel(xlabel)
        last.tick_params(labelbottom=True)
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)


def legend(ax: Axes, columns: int = 3, place: str = "outside upper left") -> None:
    """What the lines of one axes mean, outside of all axes."""
    ax.figure.legend(*ax.get_legend_handles_labels(), loc=place, ncols=columns)  # pyright: ignore[reportArgumentType]


def rule(ax: Axes, height: float = 0, **look: Any) -> None:
    """A thin grey line across the axes."""
    ax.axhline(height, **{"color": OBSERVED, "linewidth": 0.8} | look)


def signed(ax: Axes, values: np.ndarray, edge: float | None = None) -> AxesImage:
    """A matrix whose numbers are white at zero, and darkest at the edge or beyond; None: at the largest."""
    edge = edge or limit(values)
    return ax.imshow(values, cmap=DIVERGING, vmin=-edge, vmax=edge, aspect="auto")


def array(values) -> np.ndarray:
    """Tensor on any device, list or array -> numpy array."""
    return values.detach().cpu().numpy() if isinstance(values, torch.Tensor) else np.asarray(values)


def limit(values: np.ndarray) -> float:
    """The symmetric colour or axis limit that holds all values; never zero."""
    return float(np.abs(values).max()) or 1.0


def colourbar(image, axes: Axes | list[Axes], label: str = "", **look: Any) -> None:
    """A slim colour bar beside the axes."""
    bar = image.get_figure().colorbar(image, ax=axes, label=label, pad=0.02, fraction=0.05, aspect=25, **look)
    bar.outline.set_visible(False)
