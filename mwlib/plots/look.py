"""One look for every picture: colours, sizes, type. Nothing here acts until `style()` or `use_style()` is called."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib.style as mpl_style
from cycler import cycler

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
LEFT, RIGHT = CYCLE[:2]
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


def bar_look(number: int) -> dict[str, Any]:
    """Colour and hatch of the bars of a series."""
    look = {"edgecolor": "white", "linewidth": 0}
    return {"color": CYCLE[number % len(CYCLE)], "hatch": HATCHES[number % len(HATCHES)], **look}
