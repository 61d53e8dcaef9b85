"""Pictures of motions made from sentences (chapter 13)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from mwlib.body.motion import Motion
from mwlib.plots.chapters.diagrams import Array, arrow, box, image, row_of_bodies, sheet
from mwlib.plots.look import CYCLE, FAINT, OBSERVED, canvas, style

COLUMNS = 3
NARROWEST = 0.6  # metres to either side of a way, at least
STEPS = LinearSegmentedColormap.from_list("steps", ["#c8ccd2", CYCLE[0]])


@style()
def ways(rows: Mapping[str, Sequence[Motion]]) -> tuple[Figure, np.ndarray]:
    """Ways of the root on the floor, seen from above: a panel for each sentence, a line for each motion.

    All start at the dot and look up the page, so that left is left. The scale is the same in all panels.

    Args:
        rows: title -> motions; those with y up and those with z up may be mixed.

    Raises:
        ValueError: there is no motion.
    """
    if not rows or not all(rows.values()):
        raise ValueError(f"{len(rows)} rows, some perhaps without a motion; expected at least one motion in each")
    count = len(rows)
    columns = min(COLUMNS, count)
    fig, axes = canvas(-(-count // columns), columns, height=0.4 + 2.2 * -(-count // columns), sharex=True, sharey=True)
    paths = {title: [_seen_from_above(motion) for motion in motions] for title, motions in rows.items()}
    reach = max(NARROWEST, 1.08 * max(np.abs(path).max() for several in paths.values() for path in several))
    for ax, (title, several) in zip(axes.flat, paths.items(), strict=False):
        for number, path in enumerate(several):
            ax.plot(*path.T, color=CYCLE[number % len(CYCLE)], linewidth=1.6)
        ax.plot(0, 0, "o", color="black")
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        ax.set_title(_wrapped(title), fontsize=9.5)
        ax.grid(color=FAINT)
    for ax in axes.flat[count:]:
        ax.set_axis_off()
    for ax in axes.flat[max(count - columns, 0) : count]:  # the lowest of each column
        ax.set_xlabel("to the right (m)")
        ax.tick_params(labelbottom=True)
    for ax in axes[:, 0]:
        ax.set_ylabel("ahead (m)")
    return fig, axes


def _seen_from_above(motion: Motion) -> Float[np.ndarray, "T 2"]:
    """The root's way, metres: to the right and ahead of where the body looks in the first frame."""
    joints = motion.with_up("y").positions
    left, right = (list(side)[:1] for side in (motion.skeleton.left, motion.skeleton.right))
    across = (joints[0, right] - joints[0, left]).mean(axis=0)[[0, 2]]
    to_right = across / np.linalg.norm(across)
    ahead = np.array([to_right[1], -to_right[0]])  # a quarter turn: y up, z ahead, x to the left
    way = joints[:, 0][:, [0, 2]] - joints[0, 0, [0, 2]]
    return np.stack([way @ to_right, way @ ahead], axis=-1)


def _wrapped(text: str, width: int = 22) -> str:
    """Words on up to four lines that fit above a panel; what comes after them is cut off."""
    return textwrap.fill(text, width, max_lines=4, placeholder=" …")


@style()
def emerging_way(
    paths: Sequence[Float[Array, "T 2"]], levels: Sequence[float], *, limbs: Sequence[Float[Array, " T"]], fps: float
):
    """The clean estimate's way and the height of one joint, from the first denoising step (light) to the last (dark).

    Args:
        paths: ways on the floor, metres, one for each step shown.
        levels: share of noise in each.
        limbs: height of a joint over time, metres, one for each step.
        fps: frames per second.

    Returns:
        Figure and its two axes.

    Raises:
        ValueError: not equally many of each.
    """
    if not len(paths) == len(levels) == len(limbs):
        raise ValueError(f"{len(paths)} paths, {len(levels)} levels and {len(limbs)} limbs; expected equally many")
    fig, axes = canvas(1, 2, height=2.9)
    for number, (path, level, limb) in enumerate(zip(map(np.asarray, paths), levels, map(np.asarray, limbs), strict=True)):
        colour = STEPS(number / max(len(paths) - 1, 1))
        axes[0, 0].plot(*path.T, color=colour, label=f"noise {level:.2f}")
        axes[0, 1].plot(np.arange(len(limb)) / fps, limb, color=colour)
    axes[0, 0].set(title="way on the floor", xlabel="across (m)", ylabel="ahead (m)")
    axes[0, 0].set_aspect("equal", adjustable="datalim")
    axes[0, 1].set(title="height of a foot", xlabel="time (s)", ylabel="metres")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig, axes


@style()
def free_overview(features: Float[Array, "T D"], noisy: Float[Array, "T D"], motion: Motion, text: str) -> tuple[Figure, Axes]:
    """Free-T2M on one sheet (its Fig. 2): training with two losses, each at its own noise, around real data.

    Args:
        features: normalised features of a clip.
        noisy: the same with noise.
        motion: the clip.
        text: its caption.
    """
    fig, ax = sheet(3.9)
    moments = np.linspace(0, len(motion) - 1, 4).round().astype(int)
    box(ax, (0.1, 3.13, 2.0, 0.7), f"“{_wrapped(text, 30)}”", CYCLE[2])
    row_of_bodies(ax, (0.1, 2.05, 2.0, 0.85), "a clip", [(motion.with_up("z").positions[moments], "truth")], motion.skeleton)
    image(ax, (0.1, 1.0, 0.85, 0.75), "features $\\mathbf{y}_0$", np.clip(np.asarray(features).T, -3, 3))
    image(ax, (1.25, 1.0, 0.85, 0.75), "with noise $\\mathbf{y}_t$", np.clip(np.asarray(noisy).T, -3, 3))
    arrow(ax, (0.95, 1.37), (1.25, 1.37))
    box(ax, (2.55, 1.0, 1.15, 0.75), "network\n$\\hat{\\mathbf{y}}_0(\\mathbf{y}_t,t,c)$", CYCLE[0])
    arrow(ax, (2.1, 1.37), (2.55, 1.37))
    ax.plot([2.1, 3.12], [3.45, 3.45], color="black", linewidth=1.3)
    arrow(ax, (3.12, 3.47), (3.12, 1.75), "")
    ax.text(3.18, 2.5, "sentence $c$", fontsize=9, va="center")
    rows = (
        (2.75, "much noise: low-frequency loss\n$|P_K(\\hat{\\mathbf{y}}_0-\\mathbf{y}_0)|$", CYCLE[1]),
        (1.0, "always: main loss\n$|\\hat{\\mathbf{y}}_0-\\mathbf{y}_0|^2$", CYCLE[0]),
        (0.05, "little noise: semantic loss\n$1-\\cos$ of a critic's embeddings", CYCLE[3]),
    )
    for bottom, words, colour in rows:
        box(ax, (4.15, bottom, 2.15, 0.75), words, colour)
        arrow(ax, (3.7, 1.37), (4.15, bottom + 0.37))
    ax.text(
        0.1, 0.4, "In training two losses are added,\neach at its own share of noise.", fontsize=9, color=OBSERVED, va="center"
    )
    return fig, ax
