"""One clip as its file has it: a strip of skeletons on axes in metres, to see at a glance whether it was read rightly."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mwlib.body.kinematics import horizontal
from mwlib.body.motion import Motion
from mwlib.plots.bodies import draw_bodies
from mwlib.plots.look import FAINT, canvas, style

LEAST = 0.6  # metres from the middle to the edge of a picture, at least
SPARE = 0.08  # of the height, above and below


@style()
def filmstrip(motion: Motion, frames: int = 5) -> tuple[Figure, np.ndarray]:
    """A clip at a few moments, seen along both horizontal axes; left limbs and right limbs in two colours, right ones dashed.

    Nothing is turned: what the file calls up is up, and its height is the file's, in metres. Sideways the root is in the middle.
    A line marks the floor, height 0.

    Args:
        frames: how many moments, spread evenly over the clip.
    """
    at = np.unique(np.linspace(0, len(motion) - 1, frames).round().astype(int))
    across, along, up = horizontal(motion.up)
    places = motion.positions[at]
    low, high = float(places[..., up].min()), float(places[..., up].max())
    edge = SPARE * max(high - low, LEAST)
    sides = places - places[:, :1]
    half = max(LEAST, 1.08 * float(np.abs(sides[..., [across, along]]).max()))
    tall = 6.0 / len(at) * (high - low + 2 * edge) / (2 * half)
    fig, axes = canvas(2, len(at), height=2 * min(tall, 3.2) + 1.5, sharex=True, sharey=True)
    for row, axis in enumerate((across, along)):
        for column, frame in enumerate(at):
            ax, points = axes[row, column], np.stack([sides[column, :, axis], places[column, :, up]], axis=-1)
            ax.axhline(0.0, color=FAINT, linewidth=2.0, zorder=0)
            draw_bodies(ax, points[None], motion.skeleton, "predicted")
            ax.set(aspect="equal", xlim=(-half, half), ylim=(low - edge, high + edge), xticks=(-0.5, 0, 0.5))
            ax.set_xticklabels(("\N{MINUS SIGN}.5", "0", ".5"))
            ax.tick_params(labelbottom=True)
            if row == 0:
                ax.set_title(f"{frame / motion.fps:.2f} s")
        axes[row, 0].set_ylabel(f"{'xyz'[up]}, up (m)")
        axes[row, len(at) // 2].set_xlabel(f"{'xyz'[axis]} from the root (m)")
    fig.suptitle(f"{motion.name or 'clip'}: {motion.skeleton.name}, {len(motion)} frames at {motion.fps:g} Hz")
    return fig, axes
