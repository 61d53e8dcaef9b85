"""Frames of files with rotations: turns about axes as matrices and quaternions, and the T-pose that some begin with."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float

from mwlib.body.kinematics import horizontal
from mwlib.body.rig import ROTATION_DTYPE
from mwlib.body.rotation import continuous, euler_matrices, euler_quaternions

POINTS_AT_ONCE = 2**15  # frames times joints: what a block computes stays within a processor's cache
FEWEST_FRAMES = 512  # of a block: each joint is a step of its own, however short the block


class Turn(NamedTuple):
    """How a joint turns against its parent: C R_axes[0](angle 0) R_axes[1](angle 1) ... C^-1.

    Args:
        axes: one letter of xyz for each angle; "" for a joint that cannot turn.
        angles: in every frame, radians.
        frame: C, whose columns are the axes that the joint turns about; None: they are its parent's.
    """

    axes: str
    angles: Float[np.ndarray, "T turns"]
    frame: Float[np.ndarray, "3 3"] | None = None


def matrices(turns: Sequence[Turn], part: slice) -> Float[np.ndarray, "n joints 3 3"]:
    """Rotation matrices of the joints in a part of the frames."""
    found = np.broadcast_to(np.eye(3), (len(turns[0].angles[part]), len(turns), 3, 3)).copy()
    for joint, (axes, angles, frame) in enumerate(turns):
        if axes:
            turn = euler_matrices(axes, angles[part])
            found[:, joint] = turn if frame is None else frame @ turn @ frame.T
    return found


def quaternions(turns: Sequence[Turn], part: slice = slice(None)) -> Float[np.ndarray, "n joints 4"]:
    """The same as unit quaternions without a sign jump, as a rig keeps them."""
    found = np.empty((len(turns[0].angles[part]), len(turns), 4), ROTATION_DTYPE)
    for joint, (axes, angles, frame) in enumerate(turns):
        turn = euler_quaternions(axes, angles[part])
        if frame is not None:
            turn[:, 1:] @= frame.T  # C R C^-1: R about the turned axis
        found[:, joint] = turn
    return continuous(torch.from_numpy(found)).numpy()


def blocks(frames: int, joints: int) -> list[slice]:
    """Parts of the frames that together are all of them."""
    step = max(FEWEST_FRAMES, POINTS_AT_ONCE // joints)
    return [slice(start, start + step) for start in range(0, frames, step)]


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
    if len(positions) < 2 or np.any(turn[0]) or not np.any(turn[1]):
        return False
    width, depth, height = np.ptp(positions[0], axis=0)[[*horizontal(up)]]
    jump = np.linalg.norm(positions[1] - positions[0], axis=-1).max()
    return bool(WIDE[0] * height < width < WIDE[1] * height and depth < DEEP * height and jump > JUMP)
