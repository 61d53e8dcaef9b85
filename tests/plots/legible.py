"""Whether a figure can be read."""

from __future__ import annotations

import matplotlib.pyplot as plt
from matplotlib.text import Text

from mwlib import plots


def legible(fig) -> None:
    """It fits a notebook, nothing is cut off, no word is small; pyplot does not know of it."""
    with plots.style():
        fig.draw_without_rendering()
        box = fig.get_tightbbox()
    width, height = fig.get_size_inches()
    assert width <= 6.4 + 1e-9 and height <= 8.5 and not plt.get_fignums()
    assert box.x0 > -0.02 and box.y0 > -0.02 and box.x1 < width + 0.02 and box.y1 < height + 0.02
    assert all(text.get_fontsize() >= 9 for text in fig.findobj(Text) if text.get_text())
