"""The T-pose that the cgspeed conversions of CMU put before the first frame."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import horizontal

WIDE = (0.85, 1.15)  # arm span by height
DEEP = 0.3  # front to back by height, at most
JUMP = 0.1  # metres that some joint moves to the next row, at least


def starts_in_tpose(turn: Float[np.ndarray, "T angles"], positions: Float[np.ndarray, "T joints 3"], up: str) -> bool:
    """Whether row 0 is an added T-pose: not turned at all, arms stretched along x, and the next row is elsewhere.

    Own choice: no recorded row has three root angles of exactly zero. All files of CMU at hand agree with what is known
    of them.

    Args:
        turn: the root's rotation as the file has it; zero means not turned.
        positions: joints, metres.
        up: the up-axis.
    """
    if len(positions) < 2 or turn.shape[1] == 0 or np.any(turn[0]) or not np.any(turn[1]):
        return False
    across, along, above = horizontal(up)
    width, depth, height = np.ptp(positions[0], axis=0)[[across, along, above]]
    jump = np.linalg.norm(positions[1] - positions[0], axis=-1).max()
    return bool(WIDE[0] * height < width < WIDE[1] * height and depth < DEEP * height and jump > JUMP)
