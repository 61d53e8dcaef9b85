"""A small set of clips that looks like LaFAN1: its 22 joints with End Sites, its axes, its file names, and random motion."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.skeleton import LAFAN1, Skeleton

# From each joint's parent, metres, y up, facing z; then turned so that, as in LaFAN1, the hips' x points up and their y ahead.
STANDING = np.array([
    [0, 0.9, 0], [0.1, 0, 0], [0, -0.43, 0], [0, -0.42, 0], [0, -0.05, 0.15], [-0.1, 0, 0], [0, -0.43, 0], [0, -0.42, 0],
    [0, -0.05, 0.15], [0, 0.07, 0], [0, 0.12, 0], [0, 0.12, 0], [0, 0.25, 0], [0, 0.12, 0], [0.06, 0.19, 0], [0.11, 0, 0],
    [0.33, 0, 0], [0.25, 0, 0], [-0.06, 0.19, 0], [-0.11, 0, 0], [-0.33, 0, 0], [-0.25, 0, 0],
])  # fmt: skip
HIPS = Rotation.from_matrix(np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]))
ENDS = (4, 8, 13, 17, 21)
TREE = Skeleton(
    "rig",
    (*LAFAN1.joints, *(f"{LAFAN1.joints[joint]}/End" for joint in ENDS)),
    (*LAFAN1.parents, *ENDS),
)

# A model for the benchmark: settings beside those of `sample.small`.
TASK = dict(
    fps=30.0, state="rotations", past=10, between=45, shortest=5, tokens="sines", rows=16, coast=8.0, departure_scale="each",
    train_subjects=("1", "2", "4"), test_subjects=("5",), validation_subjects=(),
)  # fmt: skip


def clip(name: str, subject: str, frames: int, size: float = 1.0) -> Motion:
    """A body of this size that wanders about and waves its limbs; every clip moves in its own way."""
    rng = np.random.default_rng([frames, int(1000 * size), *name.encode()])
    offsets = np.concatenate([HIPS.inv().apply(STANDING) * size, np.full((len(ENDS), 3), 0.05)])
    waves = 0.25 * rng.normal(size=(4, 22, 3)) / (1 + np.arange(4))[:, None, None]
    phase = rng.uniform(0, 2 * np.pi, (4, 22, 3))
    t = np.arange(frames)[:, None, None, None] / 30
    bends = (waves * np.sin((1 + np.arange(4))[:, None, None] * 2 * t + phase)).sum(1)  # (frames, 22, 3) radians
    turns = Rotation.from_rotvec(bends.reshape(-1, 3)).as_quat().reshape(frames, 22, 4)
    heading = Rotation.from_rotvec(np.outer(rng.uniform(0, 6) + rng.normal() * t.ravel(), [0, 1.0, 0]))
    turns[:, 0] = (heading * Rotation.from_quat(turns[:, 0]) * HIPS).as_quat()
    rotations = np.tile([1.0, 0, 0, 0], (frames, len(TREE), 1))
    rotations[:, :22] = np.roll(turns, 1, axis=-1)
    against = np.sum(rotations[1:] * rotations[:-1], axis=-1, keepdims=True) < 0
    rotations[1:] *= np.cumprod(np.where(against, -1, 1), axis=0)
    root = np.cumsum(rng.normal(size=2) * 0.02 + 0.01 * np.sin(t[..., 0, 0] + [0, 1]), axis=0) + 3 * rng.normal(size=2)
    height = size * (0.9 + 0.03 * np.sin(5 * t.ravel()))
    path = np.stack([root[:, 0], height, root[:, 1]], axis=-1)
    channels = (MOVES + ANGLES, *[ANGLES] * 21, *[None] * len(ENDS))
    rig = Rig(TREE, offsets, rotations, path, tuple(range(22)), channels)
    positions = rig.positions().astype(np.float32)
    return Motion(positions, 30.0, LAFAN1, subject, "walk", name, up="y", rig=rig)


def small_set() -> list[Motion]:
    """Five clips, the first of them with the body that the benchmark uses for all; 2 + 4 training and 2 + 2 test windows."""
    return [
        clip("aiming1_subject1", "1", 90),
        clip("dance1_subject2", "2", 111, size=1.05),
        clip("walk1_subject5", "5", 145, size=1.1),  # a third window would end with the last frame
        clip("walk2_subject5", "5", 110, size=0.95),
        clip("walk3_subject4", "4", 50),  # no window
    ]
