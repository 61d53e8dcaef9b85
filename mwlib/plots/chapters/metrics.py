"""Pictures of what each metric measures (chapter 07)."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from mwlib.metrics import prediction as metrics
from mwlib.plots.look import CYCLE, OBSERVED, PREDICTED, TRUTH, Panels, legend, style, tiled
from mwlib.plots.tables import significant

WORDS = {
    "apd": "mean distance between two samples,\neach taken as one long vector",
    "ade": "of the sample nearest to the truth:\ndistance, mean over time",
    "fde": "of the sample that ends nearest to the truth:\ndistance in the last frame",
    "mmade": "ADE against every truth that began alike,\nmean over these truths",
    "mmfde": "FDE against every truth that began alike,\nmean over these truths",
}


def _bundle(angles: tuple[int, ...], bends: tuple[int, ...], reach: tuple[float, ...]) -> np.ndarray:
    """Paths (len(angles), 7, 2) that leave the origin at an angle and bend, degrees."""
    time = np.arange(1, 8) / 7
    start, bend, far = np.array([angles, bends, reach])[..., None]
    heading = np.radians(start + bend * time)
    return (far[..., None] / 7 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)).cumsum(axis=1)


# The built-in example; of the truths, whose beginnings are alike, the first is the window's own.
FUTURES = _bundle((44, 19, -36, -40), (14, -4, 76, -25), (0.85, 0.98, 1.16, 0.8))
TRUTHS = _bundle((14, 42, -34), (-6, 25, -8), (1.05, 1.0, 1.0))
PAST = np.stack([np.linspace(-0.55, 0, 6), -0.12 * np.linspace(1, 0, 6) ** 2], axis=-1)


@style()
def metric_picture() -> Panels:
    """What APD, ADE, FDE, MMADE and MMFDE measure: the distances that enter are drawn in orange, the value is computed."""
    fig, axes = tiled(len(WORDS), 2, frame=0.3, each=2.6)
    shown = axes.ravel()[: len(WORDS)]
    for ax, name in zip(shown, WORDS, strict=True):
        _picture(ax, name)
    legend(shown[-1], 4, "outside lower left")
    return fig, shown


def _picture(ax: Axes, name: str) -> None:
    truths = TRUTHS[: 0 if name == "apd" else None if name.startswith("mm") else 1]
    p, gs = torch.as_tensor(FUTURES)[None], torch.as_tensor(truths)
    value = metrics.apd(p) if name == "apd" else getattr(metrics, name)(p, [gs] if name.startswith("mm") else gs)
    links, used = _links(name, truths)
    ax.plot(*PAST.T, ".-", color=OBSERVED, label="observed")
    for number, path in enumerate(sorted(range(len(FUTURES)), key=lambda sample: sample not in used)):
        alpha = 1.0 if path in used else 0.35
        ax.plot(*FUTURES[path].T, ".-", color=PREDICTED, alpha=alpha, label=None if number else "sample")
    for number, path in enumerate(truths):
        ax.plot(*path.T, ".", color=TRUTH, linestyle=(0, (3, 1)), label=None if number else "truth")
    ax.add_collection(LineCollection(links, colors=CYCLE[1], linewidths=1.5, zorder=1.5, label="distance"))
    ax.set_title(f"{name.upper()} = {significant(float(value))} m", weight="bold", pad=32)
    ax.text(0, 1.02, WORDS[name], transform=ax.transAxes, size=9, va="bottom")
    ax.set(aspect="equal", xticks=[], yticks=[])
    ax.spines[:].set_visible(False)


def _links(name: str, truths: np.ndarray) -> tuple[list, set[int]]:
    """The distances that enter a metric, as segments, and the samples at their ends."""
    if name == "apd":
        pairs = combinations(FUTURES, 2)
        return [segment for a, b in pairs for segment in zip(a, b, strict=True)], set(range(len(FUTURES)))
    last = slice(-1, None) if name.endswith("fde") else slice(None)
    links, used = [], set()
    for truth in truths:
        best = int(np.argmin(np.linalg.norm(FUTURES - truth, axis=-1)[:, last].mean(axis=1)))
        links += zip(FUTURES[best, last], truth[last], strict=True)
        used.add(best)
    return links, used
