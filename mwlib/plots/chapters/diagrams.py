"""Diagrams of the methods, with real data in their insets."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import camera, draw_bodies, poses, project
from mwlib.plots.look import CYCLE, DIVERGING, FAINT, INK, OBSERVED, WIDTH, Array, Panel, array, limit, panel, style

FOUR_LINES = {"max_lines": 4, "placeholder": " …"}
SPACING = 0.8  # metres between bodies
Place = str  # four numbers in inches: left, bottom, width, height


def sheet(height: float) -> Panel:
    """An empty sheet whose data unit is an inch."""
    fig, ax = panel(height)
    fig.set_layout_engine("none")
    ax.set(position=(0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    return fig, ax


def box(ax: Axes, place: Place, text: str, colour: str = INK) -> None:
    """A rounded box with words in it."""
    left, bottom, width, height = inches(place)
    look = {"boxstyle": "round,pad=0,rounding_size=0.08", "facecolor": FAINT, "edgecolor": colour, "linewidth": 1.4}
    ax.add_patch(FancyBboxPatch((left, bottom), width, height, **look))
    spacing = 1.5 if "$" in text else 1.2  # hats and bars of a formula stand above its line
    words(ax, left + width / 2, bottom + height / 2, text, linespacing=spacing)


def inches(numbers: str) -> list[float]:
    """The numbers of a text."""
    return [float(number) for number in numbers.split()]


def arrows(ax: Axes, ways: str, text: str = "") -> None:
    """Arrows, parted by bars, each from a point to another: x, y, x, y; with words above their middles."""
    look = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.3, "shrinkA": 2, "shrinkB": 2}
    for left, low, x, y in map(inches, ways.split("|")):
        ax.annotate("", (x, y), (left, low), arrowprops=look)
        if text:
            words(ax, (left + x) / 2, (low + y) / 2 + 0.06, text, va="bottom")


def heading(ax: Axes, x: float, y: float, text: str) -> None:
    """The title of a part."""
    ax.text(x, y, text, fontsize=10.5, fontweight="bold", va="center")


def words(ax: Axes, x: float, y: float, text: str, **look: Any) -> None:
    """Small words, about this place or where `look` aligns them."""
    ax.text(x, y, text, **{"ha": "center", "va": "center", "fontsize": 9} | look)


def inset(ax: Axes, place: Place, title: str) -> Axes:
    """A small frame with a title."""
    left, bottom, width, height = inches(place)
    frame = ax.inset_axes((left, bottom, width, height), transform=ax.transData)
    frame.set(xticks=[], yticks=[])
    frame.spines[:].set_visible(True)
    words(ax, left + width / 2, bottom + height + 0.05, title, va="bottom")
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
def overview(
    x: Float[Array, "T C"],
    y: Float[Array, "rows columns"],
    y_t: Float[Array, "rows columns"],
    futures: Float[Array, "S F C"],
    skeleton: Skeleton,
    *,
    history: int,
) -> Panel:
    """The whole method (the paper's Fig. 1): training above, prediction below, with real data in the insets.

    Args:
        x: a whole motion, metres.
        y: its coefficients; time runs downwards, as in `subbands`.
        y_t: the same with noise.
        futures: sampled futures of its history, metres.
        history: observed frames H.
    """
    fig, ax = sheet(5.3)
    _overview_training(ax, array(x), y, y_t, skeleton, history)
    ax.plot([0.08, WIDTH - 0.08], [3.05, 3.05], color=OBSERVED, linewidth=0.8)
    _overview_prediction(ax, array(x), y, array(futures), skeleton, history)
    return fig, ax


def _overview_training(ax: Axes, x: Array, y: Array, y_t: Array, skeleton: Skeleton, history: int) -> None:
    """The upper half."""
    heading(ax, 0.08, 5.1, "Training")
    middle = len(x) // 2
    moments = [(x[[0, history - 1]], "observed"), (x[[middle, -1]], "truth")]
    row_of_bodies(ax, "0.05 3.4 1.75 1.1", "motion $\\mathbf{x}$, $T\\times C$", moments, skeleton)
    box(ax, "2.05 3.7 0.6 0.5", "DWT")
    image(ax, "2.95 3.4 0.95 1.1", "$\\mathbf{y}^{(0)}$, $K\\times4D$", y)
    arrows(ax, "3.9 3.95 4.4 3.95", text="noise")
    image(ax, "4.4 3.4 0.95 1.1", "$\\mathbf{y}^{(t)}$", y_t)
    box(ax, "5.6 3.62 0.75 0.66", "network\n$\\epsilon_\\theta$", CYCLE[0])
    words(ax, 5.97, 3.56, "learns to\nremove noise", va="top")
    arrows(ax, "1.8 3.95 2.05 3.95 | 2.65 3.95 2.95 3.95 | 5.36 3.95 5.6 3.95")
    ax.plot([0.3, 0.3, 2.05], [4.5, 4.92, 4.92], color=INK, linewidth=1.3)
    words(ax, 1.4, 4.97, "history, padded", va="bottom")
    box(ax, "2.05 4.76 0.6 0.32", "DWT")
    ax.plot([2.65, 5.97, 5.97], [4.92, 4.92, 4.5], color=INK, linewidth=1.3)
    arrows(ax, "5.97 4.6 5.97 4.28")


def _overview_prediction(ax: Axes, x: Array, y: Array, futures: Array, skeleton: Skeleton, history: int) -> None:
    """The lower half."""
    heading(ax, 0.08, 2.85, "Prediction")
    last = x[[0, history // 2, history - 1]]
    row_of_bodies(ax, "0.05 1.35 1.3 1.1", "history, padded", [(last, "observed")], skeleton)
    box(ax, "1.5 1.65 0.55 0.5", "DWT")
    box(ax, "2.45 1.5 0.95 0.8", "network\n$\\epsilon_\\theta$\n+ CFG, TABG", CYCLE[0])
    box(ax, "2.45 0.45 0.95 0.55", "DDIM step,\nWMSG", CYCLE[0])
    words(ax, 2.92, 0.18, "repeat, $t=M,\\dots,1$")
    noise = np.random.default_rng(0).normal(size=y.shape)
    image(ax, "1.1 0.25 0.8 0.75", "start: noise", noise)
    box(ax, "3.75 0.47 0.6 0.5", "iDWT")
    ends = [(futures[: min(4, len(futures)), -1], "predicted")]
    row_of_bodies(ax, "4.55 0.2 1.8 1.15", "many futures (last frames)", ends, skeleton)
    arrows(
        ax,
        "1.35 1.9 1.5 1.9 | 2.05 1.9 2.45 1.9 | 3.15 1.5 3.15 1.0 | 2.7 1.0 2.7 1.5 | 1.9 0.65 2.45 0.72"
        " | 3.4 0.72 3.75 0.72 | 4.35 0.72 4.6 0.72",
    )


@style()
def tabg_diagram(
    y_t: Float[Array, "rows columns"],
    attention: Float[Array, "rows rows"],
    a_t: Float[Array, " rows"],
    mask: Bool[Array, " rows"],
    y_hat: Float[Array, "rows columns"],
    *,
    threshold: float = 1.0,
) -> Panel:
    """Attention guidance (TABG, the paper's Fig. 2), with one real step in the insets. Rows run to the right everywhere.

    Args:
        y_t: noisy coefficients.
        attention: mean of the middle two blocks and heads; rows ask, columns are looked at.
        a_t: its column sums, mean 1.
        mask: rows that are noised once more.
        y_hat: the same with those rows noised.
        threshold: phi.
    """
    fig, ax = sheet(4.55)
    shown = limit(np.quantile(np.abs(array(y_t)), 0.99))
    attention = np.minimum(array(attention), np.quantile(array(attention), 0.995))  # else one bright spot hides the rest
    image(ax, "0.1 2.65 1.0 1.15", "$\\mathbf{y}^{(t)}$", np.clip(array(y_t).T, -shown, shown))
    box(ax, "1.35 2.9 0.95 0.65", "TransLinear\n$\\epsilon_\\theta(\\mathbf{y}^{(t)})$", CYCLE[0])
    image(ax, "2.55 2.65 1.15 1.15", "attention, middle blocks", attention, "viridis")
    _hits(ax, "4.55 2.65 1.3 1.15", array(a_t), array(mask), threshold)
    arrows(ax, "3.7 3.22 4.55 3.22", text="sum over\nqueries")
    image(ax, "4.7 0.65 1.0 1.15", "$\\hat{\\mathbf{y}}^{\\,(t)}$: those rows noised", np.clip(array(y_hat).T, -shown, shown))
    ax.plot([0.6, 0.6, 6.25, 6.25], [4.1, 4.3, 4.3, 1.22], color=INK, linewidth=1.3)
    words(ax, 3.42, 4.34, "$\\mathbf{y}^{(t)}$: the other rows stay as they are", va="bottom")
    words(ax, 5.2, 0.27, "$\\sigma\\mathbf{z}$ (Eq. 9)", va="top")
    box(ax, "3.2 0.87 1.05 0.7", "TransLinear\n$\\epsilon_\\theta(\\hat{\\mathbf{y}}^{\\,(t)})$", CYCLE[0])
    eq11 = "Eq. 11\n$\\tilde\\epsilon=\\epsilon+s\\,(\\epsilon_{\\mathrm{spoilt}}-\\epsilon)$"
    box(ax, "1.0 0.85 1.6 0.75", eq11, CYCLE[1])
    arrows(ax, "3.2 1.22 2.6 1.22", text="$\\epsilon_{\\mathrm{spoilt}}$")
    ax.text(1.9, 2.25, "$\\epsilon$", fontsize=10, va="center")
    words(ax, 0.5, 1.28, "to CFG", va="bottom")
    arrows(
        ax,
        "1.1 3.22 1.35 3.22 | 2.3 3.22 2.55 3.22 | 5.2 2.65 5.2 2.08 | 6.28 1.22 5.7 1.22 | 5.2 0.3 5.2 0.65"
        " | 4.7 1.22 4.25 1.22 | 1.82 2.9 1.82 1.6 | 1.0 1.22 0.15 1.22",
    )
    return fig, ax


def _hits(ax: Axes, place: Place, a_t: np.ndarray, mask: np.ndarray, threshold: float) -> None:
    """A_t over its threshold; rows in the mask shaded."""
    curve, top = inset(ax, place, "$A_t$ and the mask $M_t$"), float(a_t.max()) * 1.05
    curve.stairs(top * mask, np.arange(len(a_t) + 1) - 0.5, fill=True, color=CYCLE[1], alpha=0.3)
    curve.plot(a_t, color=CYCLE[0])
    curve.axhline(threshold, color=INK, linewidth=0.9, linestyle="--")
    curve.set(ylim=(0, top), xlim=(-0.5, len(a_t) - 0.5))
    curve.yaxis.tick_right()
    curve.set_yticks([threshold], ["$\\varphi$"], fontsize=10)


@style()
def bridging_overview(
    x: Float[Array, "T ..."],
    y: Float[Array, "rows columns"],
    y_t: Float[Array, "rows columns"],
    samples: Float[Array, "S T ..."],
    skeleton: Skeleton,
) -> Panel:
    """In-betweening by an unconditional model (FreqDiffusionBridge, Fig. 2): training, network, sampling, around real data.

    Args:
        x: a whole clip, (T, C) about the root or (T, J+1, 3), metres; its first and last frame are the keyframes.
        y: its cosine coefficients.
        y_t: the same with noise.
        samples: in-betweens of its keyframes, as x.
        skeleton: of all of them.
    """
    fig, ax = sheet(4.95)
    for place, title in ((0.08, "Training"), (2.3, "Network"), (4.3, "Sampling")):
        heading(ax, place, 4.78, title)
    for place in (2.16, 4.2):
        ax.plot([place, place], [0.08, 4.87], color=OBSERVED, linewidth=0.8)
    _bridging_training(ax, array(x), array(y), array(y_t), skeleton)
    _bridging_network(ax)
    _bridging_sampling(ax, array(x), array(samples), array(y).shape, skeleton)
    return fig, ax


def _bridging_training(ax: Axes, x: np.ndarray, y: np.ndarray, y_t: np.ndarray, skeleton: Skeleton) -> None:
    """On the left: a whole clip, its coefficients, noise, losses."""
    moments = np.linspace(0, len(x) - 1, 4).round().astype(int)
    row_of_bodies(ax, "0.08 3.5 1.95 0.9", "whole clip $\\mathbf{x}$", [(x[moments], "truth")], skeleton)
    box(ax, "0.2 2.85 0.6 0.35", "DCT")
    low = min(len(y), 24)  # what lies above is next to nothing
    top = limit(np.quantile(np.abs(y[1:low]), 0.98))
    image(ax, "0.12 1.6 0.76 0.8", "$\\mathbf{y}_0$", np.clip(y[:low], -top, top))
    noisy = limit(np.quantile(np.abs(y_t[1:low]), 0.98))
    image(ax, "1.25 1.6 0.76 0.8", "$\\mathbf{y}_t$", np.clip(y_t[:low], -noisy, noisy))
    words(ax, 1.07, 2.46, "noise")
    box(ax, "0.12 0.2 1.9 0.95", "losses: noise; after iDCT\ndiversity, smoothness,\nbone length, bone angle", CYCLE[1])
    arrows(ax, "0.5 3.5 0.5 3.2 | 0.5 2.85 0.5 2.58 | 0.88 2.0 1.25 2.0")
    arrows(ax, "2.01 2.15 2.45 4.05 | 2.45 0.68 2.02 0.68")


def _bridging_network(ax: Axes) -> None:
    """In the middle: what becomes of the coefficients."""
    boxes = (
        (3.7, 0.62, "linear layer,\n+ step $t$, + frequency"),
        (2.6, 0.62, "self-attention over\nall frequencies"),
        (1.6, 0.62, "linear layers"),
        (0.4, 0.55, "linear layer:\nnoise $\\hat\\epsilon$"),
    )
    for bottom, height, layer in boxes:
        box(ax, f"2.45 {bottom} 1.5 {height}", layer, CYCLE[0])
    for (above, _, _), (below, height, _) in zip(boxes[:-1], boxes[1:], strict=True):
        arrows(ax, f"3.2 {above} 3.2 {below + height}")
    ax.add_patch(FancyBboxPatch((2.36, 1.48), 1.68, 1.86, boxstyle="round,pad=0,rounding_size=0.08", fill=False, linestyle="--"))
    words(ax, 3.27, 1.3, "repeated", ha="left")


def _bridging_sampling(ax: Axes, x: np.ndarray, samples: np.ndarray, shape: tuple[int, ...], skeleton: Skeleton) -> None:
    """On the right: keyframes join at each step, noised as much as what lies between."""
    row_of_bodies(ax, "4.32 3.65 0.95 0.8", "start, end", [(x[[0, -1]], "truth")], skeleton)
    noise = np.random.default_rng(0).normal(size=(min(shape[0], 24), shape[1]))
    image(ax, "5.5 3.72 0.7 0.7", "noise $\\mathbf{y}_M$", noise)
    box(ax, "4.32 2.92 0.95 0.42", "noise of\nstep $t$", CYCLE[1])
    box(ax, "5.5 2.92 0.7 0.42", "iDCT")
    box(ax, "4.32 2.2 1.88 0.4", "© join over time, DCT", CYCLE[1])
    box(ax, "4.32 1.5 1.88 0.4", "network, step $t\\to t-1$", CYCLE[0])
    ax.plot([6.2, 6.31, 6.31], [1.7, 1.7, 3.13], color=INK, linewidth=1.3)
    middles = samples[: min(3, len(samples)), samples.shape[1] // 2]
    rows = [(x[:1], "truth"), (middles, "predicted"), (x[-1:], "truth")]
    row_of_bodies(ax, "4.25 0.1 2.1 0.92", "start, middles of samples, end", rows, skeleton)
    arrows(
        ax,
        "4.8 3.65 4.8 3.34 | 5.85 3.72 5.85 3.34 | 4.8 2.92 4.8 2.6 | 5.85 2.92 5.85 2.6 | 5.2 2.2 5.2 1.9"
        " | 6.34 3.13 6.2 3.13 | 5.2 1.5 5.2 1.24",
    )


@style()
def free_overview(features: Float[Array, "T D"], noisy: Float[Array, "T D"], motion: Motion, text: str) -> Panel:
    """Free-T2M on one sheet (its Fig. 2): training with two losses, each at its own noise, around real data.

    Args:
        features: normalised features of a clip.
        noisy: the same with noise.
        motion: the clip.
        text: its caption.
    """
    fig, ax = sheet(3.9)
    moments = np.linspace(0, len(motion) - 1, 4).round().astype(int)
    box(ax, "0.1 3.13 2.0 0.7", f"“{fill(text, 30, **FOUR_LINES)}”", CYCLE[2])
    row_of_bodies(ax, "0.1 2.05 2.0 0.85", "a clip", [(motion.with_up("z").positions[moments], "truth")], motion.skeleton)
    image(ax, "0.1 1.0 0.85 0.75", "features $\\mathbf{y}_0$", np.clip(np.asarray(features).T, -3, 3))
    image(ax, "1.25 1.0 0.85 0.75", "with noise $\\mathbf{y}_t$", np.clip(np.asarray(noisy).T, -3, 3))
    box(ax, "2.55 1.0 1.15 0.75", "network\n$\\hat{\\mathbf{y}}_0(\\mathbf{y}_t,t,c)$", CYCLE[0])
    ax.plot([2.1, 3.12], [3.45, 3.45], color="black", linewidth=1.3)
    words(ax, 3.18, 2.5, "sentence $c$", ha="left")
    rows = (
        (2.75, "much noise: low-frequency loss\n$|P_K(\\hat{\\mathbf{y}}_0-\\mathbf{y}_0)|$", CYCLE[1]),
        (1.0, "always: main loss\n$|\\hat{\\mathbf{y}}_0-\\mathbf{y}_0|^2$", CYCLE[0]),
        (0.05, "little noise: semantic loss\n$1-\\cos$ of a critic's embeddings", CYCLE[3]),
    )
    for bottom, loss, colour in rows:
        box(ax, f"4.15 {bottom} 2.15 0.75", loss, colour)
        arrows(ax, f"3.7 1.37 4.15 {bottom + 0.37}")
    words(ax, 0.1, 0.4, "In training two losses are added,\neach at its own share of noise.", ha="left", color=OBSERVED)
    arrows(ax, "0.95 1.37 1.25 1.37 | 2.1 1.37 2.55 1.37 | 3.12 3.47 3.12 1.75")
    return fig, ax
