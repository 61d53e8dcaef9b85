"""Whether a figure can be read."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.text import Text

from mwlib import plots


def luminance(colour) -> float:
    """Relative, after WCAG 2."""
    rgb = np.array(to_rgb(colour))
    return float(np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])


def contrast(colour, page="white") -> float:
    """With the page, after WCAG 2."""
    low, high = sorted((luminance(colour), luminance(page)))
    return (high + 0.05) / (low + 0.05)


def legible(fig, least: float = 4.5) -> None:
    """It fits a notebook, nothing is cut off, no word is small or paler than the least contrast; pyplot does not know of it."""
    with plots.style():
        fig.draw_without_rendering()
        box = fig.get_tightbbox()
    width, height = fig.get_size_inches()
    assert width <= 6.4 + 1e-9 and height <= 8.5 and not plt.get_fignums()
    assert box.x0 > -0.02 and box.y0 > -0.02 and box.x1 < width + 0.02 and box.y1 < height + 0.02
    texts = [text for text in fig.findobj(Text) if text.get_text() and text.get_visible()]
    shown = [text for text in texts if text.axes is None or text.axes.get_visible()]
    assert all(text.get_fontsize() >= 9 and contrast(text.get_color()) >= least for text in shown)
