"""Diagrams of the methods, with real data in their insets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import camera, draw_bodies, poses, project

from mwlib.plots.look import (  # isort: skip
    CYCLE, DIVERGING, FAINT, INK, OBSERVED, WIDTH, Array, Matrix, Panel, Values, array, limit, panel, style,
)  # fmt: skip

FOUR_LINES = {"max_lines": 4, "placeholder": " …"}
SPACING = 0.8  # metres between bodies
Place = str  # numbers in inches: left, bottom, and of what has a size width, height


def sheet(height: float) -> Panel:
    """An empty sheet whose data unit is an inch."""
    fig, ax = panel(height)
    fig.set_layout_engine("none")
    ax.set(position=(0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    return fig, ax


def boxes(ax: Axes, texts: Mapping[Place, str], colour: str = INK) -> None:
    """Rounded boxes with words in them."""
    look = {"boxstyle": "round,pad=0,rounding_size=0.08", "facecolor": FAINT, "edgecolor": colour, "linewidth": 1.4}
    for place, text in texts.items():
        left, bottom, width, height = inches(place)
        ax.add_patch(FancyBboxPatch((left, bottom), width, height, **look))
        spacing = 1.5 if "$" in text else 1.2  # hats and bars of a formula stand above its line
        words(ax, {f"{left + width / 2} {bottom + height / 2}": text}, linespacing=spacing)


def inches(numbers: str) -> list[float]:
    """The numbers of a text."""
    return [float(number) for number in numbers.split()]


def arrows(ax: Axes, ways: str, text: str = "") -> None:
    """Arrows, parted by bars, each from a point to another: x, y, x, y; with words above their middles."""
    look = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.3, "shrinkA": 2, "shrinkB": 2}
    for left, low, x, y in map(inches, ways.split("|")):
        ax.annotate("", (x, y), (left, low), arrowprops=look)
        words(ax, {f"{(left + x) / 2} {(low + y) / 2 + 0.06}": text}, va="bottom")


def headings(ax: Axes, texts: Mapping[Place, str]) -> None:
    """The titles of parts."""
    words(ax, texts, ha="left", fontsize=10.5, fontweight="bold")


def words(ax: Axes, texts: Mapping[Place, str], **look: Any) -> None:
    """Small words, about their places or where `look` aligns them."""
    for place, text in texts.items():
        x, y = inches(place)
        ax.text(x, y, text, **{"ha": "center", "va": "center", "fontsize": 9} | look)


def inset(ax: Axes, place: Place, title: str) -> Axes:
    """A small frame with a title."""
    left, bottom, width, height = inches(place)
    frame = ax.inset_axes((left, bottom, width, height), transform=ax.transData)
    frame.set(xticks=[], yticks=[])
    frame.spines[:].set_visible(True)
    words(ax, {f"{left + width / 2} {bottom + height + 0.05}": title}, va="bottom")
    return frame


def image(ax: Axes, place: Place, title: str, values: Array, cmap: str = DIVERGING) -> None:
    """A matrix in a small frame."""
    values = array(values)
    low = -limit(values) if cmap == DIVERGING else 0
    inset(ax, place, title).imshow(values, cmap=cmap, vmin=low, vmax=limit(values), aspect="auto")


def row_of_bodies(ax: Axes, place: Place, title: str, rows: Sequence[tuple[Array, str]], skeleton: Skeleton) -> None:
    """Several poses side by side in an inset; each item is (poses (n, C), kind)."""
    frame = inset(ax, place, title)
    frame.spines[:].set_visible(False)
    bodies = [(poses(motion, skeleton), kind) for motion, kind in rows]
    view = camera(bodies[0][0][0], skeleton)
    flat = [(pose, kind) for body, kind in bodies for pose in project(body, view)]
    for column, (pose, kind) in enumerate(flat):
        draw_bodies(frame, (pose + [SPACING * column, 0.0])[None], skeleton, kind, width=1.5)
    heights = np.concatenate([pose[:, 1] for pose, _ in flat])
    frame.set(xlim=(-SPACING * 0.6, SPACING * (len(flat) - 0.4)), ylim=(heights.min() - 0.08, heights.max() + 0.12))
    frame.set_aspect("equal")


@style()
def overview(x: Matrix, y: Matrix, y_t: Matrix, futures: Float[Array, "S F C"], skeleton: Skeleton, *, history: int) -> Panel:
    """The whole method (the paper's Fig. 1): training above, prediction below, with real data in the insets.

    Args:
        x: (T, C), a whole motion, metres.
        y: (rows, columns), its coefficients; time runs downwards, as in `subbands`.
        y_t: the same with noise.
        futures: sampled futures of its history, metres.
        history: observed frames H.
    """
    x, futures = array(x), array(futures)
    fig, ax = sheet(5.3)
    headings(ax, {"0.08 5.1": "Training", "0.08 2.85": "Prediction"})
    ax.plot([0.08, WIDTH - 0.08], [3.05, 3.05], color=OBSERVED, linewidth=0.8)
    moments = [(x[[0, history - 1]], "observed"), (x[[len(x) // 2, -1]], "truth")]
    row_of_bodies(ax, "0.05 3.4 1.75 1.1", "motion $\\mathbf{x}$, $T\\times C$", moments, skeleton)
    last = x[[0, history // 2, history - 1]]
    row_of_bodies(ax, "0.05 1.35 1.3 1.1", "history, padded", [(last, "observed")], skeleton)
    row_of_bodies(ax, "4.55 0.2 1.8 1.15", "many futures (last frames)", [(futures[:4, -1], "predicted")], skeleton)
    image(ax, "2.95 3.4 0.95 1.1", "$\\mathbf{y}^{(0)}$, $K\\times4D$", y)
    image(ax, "4.4 3.4 0.95 1.1", "$\\mathbf{y}^{(t)}$", y_t)
    image(ax, "1.1 0.25 0.8 0.75", "start: noise", np.random.default_rng(0).normal(size=y.shape))
    transforms = {"2.05 3.7 0.6 0.5": "DWT", "2.05 4.76 0.6 0.32": "DWT", "1.5 1.65 0.55 0.5": "DWT", "3.75 0.47 0.6 0.5": "iDWT"}
    boxes(ax, transforms)
    networks = {
        "5.6 3.62 0.75 0.66": "network\n$\\epsilon_\\theta$",
        "2.45 1.5 0.95 0.8": "network\n$\\epsilon_\\theta$\n+ CFG, TABG",
        "2.45 0.45 0.95 0.55": "DDIM step,\nWMSG",
    }
    boxes(ax, networks, CYCLE[0])
    words(ax, {"2.92 0.18": "repeat, $t=M,\\dots,1$"})
    words(ax, {"5.97 3.56": "learns to\nremove noise"}, va="top")
    words(ax, {"1.4 4.97": "history, padded"}, va="bottom")
    ax.plot([0.3, 0.3, 2.05], [4.5, 4.92, 4.92], color=INK, linewidth=1.3)
    ax.plot([2.65, 5.97, 5.97], [4.92, 4.92, 4.5], color=INK, linewidth=1.3)
    arrows(ax, "3.9 3.95 4.4 3.95", text="noise")
    arrows(
        ax,
        "1.8 3.95 2.05 3.95 | 2.65 3.95 2.95 3.95 | 5.36 3.95 5.6 3.95 | 5.97 4.6 5.97 4.28"
        " | 1.35 1.9 1.5 1.9 | 2.05 1.9 2.45 1.9 | 3.15 1.5 3.15 1.0 | 2.7 1.0 2.7 1.5 | 1.9 0.65 2.45 0.72"
        " | 3.4 0.72 3.75 0.72 | 4.35 0.72 4.6 0.72",
    )
    return fig, ax


@style()
def tabg_diagram(
    y_t: Matrix, attention: Matrix, a_t: Values, mask: Bool[Array, " rows"], y_hat: Matrix, *, threshold: float = 1.0
) -> Panel:
    """Attention guidance (TABG, the paper's Fig. 2), with one real step in the insets. Rows run to the right everywhere.

    Args:
        y_t: (rows, columns), noisy coefficients.
        attention: (rows, rows), mean of the middle two blocks and heads; rows ask, columns are looked at.
        a_t: its column sums, mean 1.
        mask: rows that are noised once more.
        y_hat: the same with those rows noised.
        threshold: phi.
    """
    fig, ax = sheet(4.55)
    y_t, y_hat, attention = map(array, (y_t, y_hat, attention))
    shown = limit(np.quantile(np.abs(y_t), 0.99))
    attention = np.minimum(attention, np.quantile(attention, 0.995))  # else one bright spot hides the rest
    image(ax, "0.1 2.65 1.0 1.15", "$\\mathbf{y}^{(t)}$", np.clip(y_t.T, -shown, shown))
    networks = {
        "1.35 2.9 0.95 0.65": "TransLinear\n$\\epsilon_\\theta(\\mathbf{y}^{(t)})$",
        "3.2 0.87 1.05 0.7": "TransLinear\n$\\epsilon_\\theta(\\hat{\\mathbf{y}}^{\\,(t)})$",
    }
    boxes(ax, networks, CYCLE[0])
    image(ax, "2.55 2.65 1.15 1.15", "attention, middle blocks", attention, "viridis")
    a_t, top = array(a_t), 1.05 * float(array(a_t).max())
    hits = inset(ax, "4.55 2.65 1.3 1.15", "$A_t$ and the mask $M_t$")
    hits.stairs(top * array(mask), np.arange(len(a_t) + 1) - 0.5, fill=True, color=CYCLE[1], alpha=0.3)
    hits.plot(a_t, color=CYCLE[0])
    hits.axhline(threshold, color=INK, linewidth=0.9, linestyle="--")
    hits.set(ylim=(0, top), xlim=(-0.5, len(a_t) - 0.5))
    hits.yaxis.tick_right()
    hits.set_yticks([threshold], ["$\\varphi$"], fontsize=10)
    arrows(ax, "3.7 3.22 4.55 3.22", text="sum over\nqueries")
    image(ax, "4.7 0.65 1.0 1.15", "$\\hat{\\mathbf{y}}^{\\,(t)}$: those rows noised", np.clip(y_hat.T, -shown, shown))
    ax.plot([0.6, 0.6, 6.25, 6.25], [4.1, 4.3, 4.3, 1.22], color=INK, linewidth=1.3)
    words(ax, {"3.42 4.34": "$\\mathbf{y}^{(t)}$: the other rows stay as they are", "0.5 1.28": "to CFG"}, va="bottom")
    words(ax, {"5.2 0.27": "$\\sigma\\mathbf{z}$ (Eq. 9)"}, va="top")
    eq11 = "Eq. 11\n$\\tilde\\epsilon=\\epsilon+s\\,(\\epsilon_{\\mathrm{spoilt}}-\\epsilon)$"
    boxes(ax, {"1.0 0.85 1.6 0.75": eq11}, CYCLE[1])
    arrows(ax, "3.2 1.22 2.6 1.22", text="$\\epsilon_{\\mathrm{spoilt}}$")
    words(ax, {"1.9 2.25": "$\\epsilon$"}, ha="left", fontsize=10)
    arrows(
        ax,
        "1.1 3.22 1.35 3.22 | 2.3 3.22 2.55 3.22 | 5.2 2.65 5.2 2.08 | 6.28 1.22 5.7 1.22 | 5.2 0.3 5.2 0.65"
        " | 4.7 1.22 4.25 1.22 | 1.82 2.9 1.82 1.6 | 1.0 1.22 0.15 1.22",
    )
    return fig, ax


@style()
def bridging_overview(
    x: Float[Array, "T ..."], y: Matrix, y_t: Matrix, samples: Float[Array, "S T ..."], skeleton: Skeleton
) -> Panel:
    """In-betweening by an unconditional model (FreqDiffusionBridge, Fig. 2): training, network, sampling, around real data.

    Args:
        x: a whole clip, (T, C) about the root or (T, J+1, 3), metres; its first and last frame are the keyframes.
        y: its cosine coefficients.
        y_t: the same with noise.
        samples: in-betweens of its keyframes, as x.
        skeleton: of all of them.
    """
    x, y, y_t, samples = map(array, (x, y, y_t, samples))
    fig, ax = sheet(4.95)
    headings(ax, {"0.08 4.78": "Training", "2.3 4.78": "Network", "4.3 4.78": "Sampling"})
    for place in (2.16, 4.2):
        ax.plot([place, place], [0.08, 4.87], color=OBSERVED, linewidth=0.8)
    ends, moments = x[[0, -1]], np.linspace(0, len(x) - 1, 4).round().astype(int)
    row_of_bodies(ax, "0.08 3.5 1.95 0.9", "whole clip $\\mathbf{x}$", [(x[moments], "truth")], skeleton)
    row_of_bodies(ax, "4.32 3.65 0.95 0.8", "start, end", [(ends, "truth")], skeleton)
    filled = [(ends[:1], "truth"), (samples[:3, samples.shape[1] // 2], "predicted"), (ends[1:], "truth")]
    row_of_bodies(ax, "4.25 0.1 2.1 0.92", "start, middles of samples, end", filled, skeleton)
    for place, title, values in (("0.12 1.6 0.76 0.8", "$\\mathbf{y}_0$", y), ("1.25 1.6 0.76 0.8", "$\\mathbf{y}_t$", y_t)):
        low = values[:24]  # what lies above is next to nothing
        top = limit(np.quantile(np.abs(low[1:]), 0.98))
        image(ax, place, title, np.clip(low, -top, top))
    image(ax, "5.5 3.72 0.7 0.7", "noise $\\mathbf{y}_M$", np.random.default_rng(0).normal(size=y[:24].shape))
    boxes(ax, {"0.2 2.85 0.6 0.35": "DCT", "5.5 2.92 0.7 0.42": "iDCT"})
    own = {
        "0.12 0.2 1.9 0.95": "losses: noise; after iDCT\ndiversity, smoothness,\nbone length, bone angle",
        "4.32 2.92 0.95 0.42": "noise of\nstep $t$",
        "4.32 2.2 1.88 0.4": "© join over time, DCT",
    }
    boxes(ax, own, CYCLE[1])
    layers = {
        "2.45 3.7 1.5 0.62": "linear layer,\n+ step $t$, + frequency",
        "2.45 2.6 1.5 0.62": "self-attention over\nall frequencies",
        "2.45 1.6 1.5 0.62": "linear layers",
        "2.45 0.4 1.5 0.55": "linear layer:\nnoise $\\hat\\epsilon$",
        "4.32 1.5 1.88 0.4": "network, step $t\\to t-1$",
    }
    boxes(ax, layers, CYCLE[0])
    ax.add_patch(FancyBboxPatch((2.36, 1.48), 1.68, 1.86, boxstyle="round,pad=0,rounding_size=0.08", fill=False, linestyle="--"))
    words(ax, {"1.07 2.46": "noise"})
    words(ax, {"3.27 1.3": "repeated"}, ha="left")
    ax.plot([6.2, 6.31, 6.31], [1.7, 1.7, 3.13], color=INK, linewidth=1.3)
    arrows(
        ax,
        "0.5 3.5 0.5 3.2 | 0.5 2.85 0.5 2.58 | 0.88 2.0 1.25 2.0 | 2.01 2.15 2.45 4.05 | 2.45 0.68 2.02 0.68"
        " | 3.2 3.7 3.2 3.22 | 3.2 2.6 3.2 2.22 | 3.2 1.6 3.2 0.95 | 4.8 3.65 4.8 3.34 | 5.85 3.72 5.85 3.34"
        " | 4.8 2.92 4.8 2.6 | 5.85 2.92 5.85 2.6 | 5.2 2.2 5.2 1.9 | 6.34 3.13 6.2 3.13 | 5.2 1.5 5.2 1.24",
    )
    return fig, ax


@style()
def free_overview(features: Matrix, noisy: Matrix, motion: Motion, text: str) -> Panel:
    """Free-T2M on one sheet (its Fig. 2): training with two losses, each at its own noise, around real data.

    Args:
        features: (T, D), normalised features of a clip.
        noisy: the same with noise.
        motion: the clip.
        text: its caption.
    """
    fig, ax = sheet(3.9)
    moments = np.linspace(0, len(motion) - 1, 4).round().astype(int)
    boxes(ax, {"0.1 3.13 2.0 0.7": f"“{fill(text, 30, **FOUR_LINES)}”"}, CYCLE[2])
    row_of_bodies(ax, "0.1 2.05 2.0 0.85", "a clip", [(motion.with_up("z").positions[moments], "truth")], motion.skeleton)
    image(ax, "0.1 1.0 0.85 0.75", "features $\\mathbf{y}_0$", np.clip(np.asarray(features).T, -3, 3))
    image(ax, "1.25 1.0 0.85 0.75", "with noise $\\mathbf{y}_t$", np.clip(np.asarray(noisy).T, -3, 3))
    always = {
        "2.55 1.0 1.15 0.75": "network\n$\\hat{\\mathbf{y}}_0(\\mathbf{y}_t,t,c)$",
        "4.15 1.0 2.15 0.75": "always: main loss\n$|\\hat{\\mathbf{y}}_0-\\mathbf{y}_0|^2$",
    }
    boxes(ax, always, CYCLE[0])
    low = "much noise: low-frequency loss\n$|P_K(\\hat{\\mathbf{y}}_0-\\mathbf{y}_0)|$"
    boxes(ax, {"4.15 2.75 2.15 0.75": low}, CYCLE[1])
    boxes(ax, {"4.15 0.05 2.15 0.75": "little noise: semantic loss\n$1-\\cos$ of a critic's embeddings"}, CYCLE[3])
    ax.plot([2.1, 3.12], [3.45, 3.45], color="black", linewidth=1.3)
    words(ax, {"3.18 2.5": "sentence $c$"}, ha="left")
    words(ax, {"0.1 0.4": "In training two losses are added,\neach at its own share of noise."}, ha="left", color=OBSERVED)
    ways = "0.95 1.37 1.25 1.37 | 2.1 1.37 2.55 1.37 | 3.12 3.47 3.12 1.75"
    arrows(ax, f"{ways} | 3.7 1.37 4.15 3.12 | 3.7 1.37 4.15 1.37 | 3.7 1.37 4.15 0.42")
    return fig, ax
