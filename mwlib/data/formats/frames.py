"""Frames of files with rotations: computed block by block, and the T-pose that some begin with."""

from collections.abc import Callable, Iterator

import numpy as np
import torch
from jaxtyping import Float

from mwlib.body.kinematics import horizontal
from mwlib.body.rig import ROTATION_DTYPE
from mwlib.body.rotation import continuous

POINTS_AT_ONCE = 2**15  # frames times joints: what a block computes stays within a processor's cache
FEWEST_FRAMES = 512  # of a block: each joint is a step of its own, however short the block


def blocks(frames: int, joints: int) -> Iterator[slice]:
    """Slices of frames that together are all of them."""
    step = max(FEWEST_FRAMES, POINTS_AT_ONCE // joints)
    return (slice(start, min(start + step, frames)) for start in range(0, frames, step))


def in_blocks(
    compute: Callable[[slice], Float[np.ndarray, "n points 3"]], frames: int, joints: int
) -> Float[np.ndarray, "frames points 3"]:
    """What `compute` gives for each block of frames, as one array."""
    whole = np.empty(0)
    for part in blocks(frames, joints):
        found = compute(part)
        whole = np.empty((frames, *found.shape[1:])) if part.start == 0 else whole
        whole[part] = found
    return whole


def rotation_track(
    compute: Callable[[slice], Float[np.ndarray, "n joints 4"]], frames: int, joints: int
) -> Float[np.ndarray, "frames joints 4"]:
    """The unit quaternions that `compute` gives for each block of frames, without a sign jump, as a rig keeps them."""
    track = np.empty((frames, joints, 4), ROTATION_DTYPE)
    before, signs = np.empty((0, joints, 4)), np.ones((joints, 1))
    for part in blocks(frames, joints):
        turns = compute(part)
        signed = continuous(torch.from_numpy(np.concatenate([before, turns]))).numpy()[len(before) :] * signs
        signs = np.where(np.sum(signed[-1] * turns[-1], axis=-1, keepdims=True) < 0, -1.0, 1.0)
        before = turns[-1:]
        track[part] = signed
    return track


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
