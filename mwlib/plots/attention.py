"""What the network looks at: which frames a row of coefficients holds, attention vectors, and both over steps and heads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mwlib.plots.look import CYCLE, FAINT, INK, OBSERVED, array, canvas, colourbar, style

Array = np.ndarray | torch.Tensor


@style()
def row_support(analysis: Float[Array, "rows T"], *, history: int, split: int) -> tuple[Figure, np.ndarray]:
    """Which frames each row of coefficients sees, approximation and detail side by side; the observed frames are shaded.

    Args:
        analysis: the transform's matrix along time, approximation rows above detail rows.
        history: observed frames H.
        split: K, number of approximation rows.
    """
    analysis = array(analysis)
    fig, axes = canvas(1, 2, height=3.6, sharey=True)
    for ax, block, name in zip(axes[0], (analysis[:split], analysis[split:]), ("approximation", "detail"), strict=True):
        ax.axvspan(-0.5, history - 0.5, color=OBSERVED, alpha=0.25, linewidth=0)
        for row, values in enumerate(block):
            seen = np.flatnonzero(np.abs(values) > 1e-12)
            if not len(seen):  # a short filter beyond the end sees padding only
                continue
            observed, future = seen[-1] < history, seen[0] >= history
            colour = CYCLE[0] if observed else CYCLE[1] if future else INK
            ax.plot([seen[0] - 0.5, seen[-1] + 0.5], [row, row], color=colour, linewidth=2.2, solid_capstyle="butt")
        ax.set(title=name, xlabel="frame", xlim=(-0.5, analysis.shape[1] - 0.5))
    axes[0, 0].set_ylabel("row of coefficients")
    axes[0, 0].invert_yaxis()
    names = ("observed frames only", "future frames only", "both")
    handles = [axes[0, 0].plot([], [], color=colour, linewidth=3)[0] for colour in (CYCLE[0], CYCLE[1], INK)]
    fig.legend(handles, names, loc="outside upper left", ncols=3)
    return fig, axes[0]


@style()
def attention_vectors(
    attention: Float[Array, "rows rows"], *, history_rows: int, mask: Bool[Array, " rows"] | None = None, row: int | None = None
) -> tuple[Figure, np.ndarray]:
    """Attention vectors of all rows with their mean, and that of one row (the paper's Fig. 12a and b).

    Args:
        attention: rows ask, columns are looked at; each row sums to 1.
        history_rows: rows before this one see observed frames only; they are shaded.
        mask: rows that TABG noises, marked below the curves of the first panel.
        row: which row the second panel shows; None = the middle one.
    """
    attention = array(attention)
    row = len(attention) // 2 if row is None else row
    fig, axes = canvas(2, 1, height=4.6, sharex=True)
    upper, lower = axes[:, 0]
    for ax in (upper, lower):
        ax.axvspan(-0.5, history_rows - 0.5, color=OBSERVED, alpha=0.25, linewidth=0)
        ax.axhline(1 / len(attention), color=INK, linewidth=0.9, linestyle="--")
        ax.set(ylabel="attention weight", xlim=(-0.5, len(attention) - 0.5))
    upper.plot(attention.T, color=CYCLE[0], linewidth=0.7, alpha=0.25)
    mean = upper.plot(attention.mean(0), color=CYCLE[1], linewidth=2.2, label="mean over the rows, $A_t/K$")
    upper.plot([], [], color=CYCLE[0], linewidth=0.9, label="each row")
    upper.set_ylim(0, 1.15 * float(np.quantile(attention, 0.998)))
    if mask is not None:
        rows = np.flatnonzero(array(mask))
        upper.plot(rows, np.zeros(len(rows)), "s", color=CYCLE[3], markersize=4, clip_on=False, label="rows that TABG noises")
    lower.plot(attention[row], color=CYCLE[0], label=f"row {row}")
    lower.axvline(row, color=CYCLE[0], linewidth=0.9, linestyle=":")
    lower.set_ylim(bottom=0)
    upper.set_title("(a) every row")
    lower.set(
        title=f"(b) row {row}, the middle one" if row == len(attention) // 2 else f"(b) row {row}", xlabel="row of coefficients"
    )
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    fig.legend(handles=[*mean, *[line for line in upper.lines if line not in mean and not line.get_label().startswith("_")]],
               loc="outside upper left", ncols=3)  # fmt: skip
    return fig, axes[:, 0]


@style()
def attention_over_steps(
    a: Float[Array, "steps rows"], masks: Bool[Array, "steps rows"], ts: Sequence[int], *, history_rows: int
) -> tuple[Figure, np.ndarray]:
    """Accumulated attention A_t and the mask M_t while the sampler runs; noise at the top.

    Args:
        a: A_t of each step, mean 1.
        masks: rows that TABG noises.
        ts: diffusion index of each step.
        history_rows: rows before this one see observed frames only: left of the line.
    """
    fig, axes = canvas(1, 2, height=2.9, sharey=True)
    pictures = ((array(a), "viridis", "$A_t$"), (array(masks).astype(float), "Greys", "mask $M_t$ (dark = noised)"))
    for ax, (values, cmap, title) in zip(axes[0], pictures, strict=True):
        top = float(np.quantile(values, 0.99)) if cmap == "viridis" else 1.4
        image = ax.imshow(values, cmap=cmap, vmin=0, vmax=top, aspect="auto")
        ax.axvline(history_rows - 0.5, color="white" if cmap == "viridis" else CYCLE[1], linewidth=1.6, linestyle="--")
        ax.set(title=title, xlabel="row of coefficients")
        if cmap == "viridis":
            colourbar(image, ax, "", cut=True)
    axes[0, 0].set(ylabel="diffusion index t", yticks=range(len(ts)), yticklabels=[str(t) for t in ts])
    return fig, axes[0]


@style()
def attention_heads(attention: Float[Array, "2 heads rows rows"], *, history_rows: int) -> tuple[Figure, np.ndarray]:
    """The maps of every head of the middle two blocks, on one colour scale.

    Args:
        attention: rows ask, columns are looked at.
        history_rows: rows before this one see observed frames only: above and left of the lines.
    """
    attention = array(attention)
    blocks, heads = attention.shape[:2]
    fig, axes = canvas(blocks, heads, height=3.6, sharex=True, sharey=True)
    top = float(np.quantile(attention, 0.99))
    for block in range(blocks):
        for head in range(heads):
            ax = axes[block, head]
            image = ax.imshow(attention[block, head], cmap="viridis", vmin=0, vmax=top)
            for line in (ax.axvline, ax.axhline):
                line(history_rows - 0.5, color=FAINT, linewidth=0.9, linestyle="--")
            ax.set_title(f"block {'AB'[block]}, head {head}")
    axes[-1, 0].set(xlabel="row looked at", ylabel="row that asks")
    colourbar(image, list(axes.ravel()), "", cut=True)
    return fig, axes


@style()
def attention_part(attention: Float[Array, "rows rows"], *, history_rows: int, title: str = "") -> tuple[Figure, Axes]:
    """One map with the attention its rows receive on top of it.

    Args:
        attention: rows ask, columns are looked at.
        history_rows: rows before this one see observed frames only.
    """
    attention = array(attention)
    fig, axes = canvas(2, 1, height=4.4, width=4.4, sharex=True, gridspec_kw={"height_ratios": (1, 3)})
    upper, lower = axes[:, 0]
    upper.plot(attention.sum(0), color=CYCLE[0])
    upper.axhline(1, color=INK, linewidth=0.9, linestyle="--")
    upper.set(ylabel="received", title=title, ylim=(0, None))
    lower.imshow(attention, cmap="viridis", vmin=0, vmax=float(np.quantile(attention, 0.99)), aspect="auto")
    for line in (lower.axvline, lower.axhline, upper.axvline):
        line(history_rows - 0.5, color=OBSERVED, linewidth=1.2, linestyle="--")
    lower.set(xlabel="row looked at", ylabel="row that asks")
    return fig, lower
