"""Pictures of motions made from sentences (chapter 13)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from jaxtyping import Float
from matplotlib.colors import LinearSegmentedColormap

from mwlib.body.motion import Motion
from mwlib.plots.axes import Array, Panels, array, canvas, legend, outer, tiled
from mwlib.plots.chapters.diagrams import FOUR_LINES
from mwlib.plots.look import CYCLE, FAINT, style

NARROWEST = 0.6  # metres to either side of a way, at least
STEPS = LinearSegmentedColormap.from_list("steps", ["#c8ccd2", CYCLE[0]])


@style()
def ways(rows: Mapping[str, Sequence[Motion]]) -> Panels:
    """Ways of the root on the floor, seen from above: a panel for each sentence, a line for each motion.

    All start at the dot and look up the page, so that left is left. The scale is the same in all panels.

    Args:
        rows: title -> motions; those with y up and those with z up may be mixed.

    Raises:
        ValueError: there is no motion.
    """
    if not rows or not all(rows.values()):
        raise ValueError(f"{len(rows)} rows, some perhaps without a motion; expected at least one motion in each")
    fig, axes = tiled(len(rows), frame=0.4, each=2.2)
    paths = {title: [_seen_from_above(motion) for motion in motions] for title, motions in rows.items()}
    reach = max(NARROWEST, 1.08 * max(np.abs(path).max() for several in paths.values() for path in several))
    for ax, (title, several) in zip(axes.flat, paths.items(), strict=False):
        for number, path in enumerate(several):
            ax.plot(*path.T, color=CYCLE[number % len(CYCLE)], linewidth=1.6)
        ax.plot(0, 0, "o", color="black")
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        ax.set_title(fill(title, 22, **FOUR_LINES), fontsize=9.5)
        ax.grid(color=FAINT)
    outer(axes, "to the right (m)", "ahead (m)", lowest=True)
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


@style()
def emerging_way(
    paths: Sequence[Float[Array, "T 2"]], levels: Sequence[float], *, limbs: Sequence[Float[Array, " T"]], fps: float
) -> Panels:
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
    left, right = axes[0]
    for number, (path, level, limb) in enumerate(zip(paths, levels, limbs, strict=True)):
        colour = STEPS(number / max(len(paths) - 1, 1))
        left.plot(*array(path).T, color=colour, label=f"noise {level:.2f}")
        right.plot(np.arange(len(limb)) / fps, array(limb), color=colour)
    left.set(title="way on the floor", xlabel="across (m)", ylabel="ahead (m)")
    left.set_aspect("equal", adjustable="datalim")
    right.set(title="height of a foot", xlabel="time (s)", ylabel="metres")
    legend(left, place="outside lower center")
    return fig, axes
