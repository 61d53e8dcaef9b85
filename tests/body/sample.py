"""A rig as animators have them: prefixed names, fingers, End Sites, a twist bone, other orders of channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.rotation import continuous, euler_quaternions
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.mirroring import own_skeleton
from tests.inbetweening.sample import lafan_offsets

PREFIX = "mixamorig:"
MORE = {  # joint -> its parent and offset, metres; without channels where it is an End Site
    "LeftHandIndex1": ("LeftHand", (0.09, 0.0, 0.0)), "LeftHandIndex2": ("LeftHandIndex1", (0.04, 0.0, 0.0)),
    "LeftHandIndex2/End": ("LeftHandIndex2", (0.03, 0.0, 0.0)), "RightHandIndex1": ("RightHand", (0.09, 0.0, 0.0)),
    "RightHandIndex1/End": ("RightHandIndex1", (0.03, 0.0, 0.0)), "LeftArmTwist": ("LeftArm", (0.16, 0.0, 0.0)),
    "LeftArmTwist/End": ("LeftArmTwist", (0.1, 0.0, 0.0)), "Head/End": ("Head", (0.18, 0.0, 0.0)),
    "LeftToe/End": ("LeftToe", (0.05, 0.0, 0.0)), "RightToe/End": ("RightToe", (0.05, 0.0, 0.0)),
}  # fmt: skip
ORDERS = (ANGLES, ("yrotation", "xrotation", "zrotation"), ("xrotation", "zrotation", "yrotation"))


def animators_motion(
    frames: int = 25, fps: float = 30.0, seed: int = 0, moving: tuple[str, ...] = (), size: float = 1.0, bend: float = 0.35
) -> Motion:
    """Such a body, which moves smoothly; y up.

    Args:
        moving: joints that turn; () for all.
        bend: radians, how far.
    """
    above = {
        name: (LAFAN1.joints[LAFAN1.parents[j]], tuple(lafan_offsets()[j])) for j, name in enumerate(LAFAN1.joints) if j
    } | MORE
    order = _depth_first(above)
    names = tuple(PREFIX + name for name in order)
    parents = (-1, *(order.index(above[name][0]) for name in order[1:]))
    offsets = size * np.array([(0.0, 0.9, 0.0), *(above[name][1] for name in order[1:])])
    rng, time = np.random.default_rng(seed), np.linspace(0, 1, frames)[:, None, None]
    angles = bend * np.sin(2 * np.pi * rng.uniform(0.3, 0.7, (len(order), 3)) * time + rng.uniform(0, 6, (len(order), 3)))
    if moving:
        angles[:, [name not in moving for name in order]] = angles[:1, [name not in moving for name in order]]
    angles[:, [name.endswith("/End") for name in order]] = 0
    for name, upright in {"Hips": np.pi / 2, "LeftUpLeg": np.pi, "RightUpLeg": np.pi, "LeftFoot": 1.4, "RightFoot": 1.4}.items():
        angles[:, order.index(name), 0] += upright
    turns = continuous(torch.from_numpy(euler_quaternions("zyx", angles))).numpy().astype(np.float32)
    channels = [None if name.endswith("/End") else ORDERS[j % 3] for j, name in enumerate(order)]
    joints = [j for j, name in enumerate(order) if not name.endswith("/End")]
    skeleton = own_skeleton(tuple(names[j] for j in joints), tuple(joints.index(parents[j]) if j else -1 for j in joints))
    root = np.stack([time[:, 0, 0], 0.9 + 0.05 * np.sin(6 * time[:, 0, 0]), 0.5 * time[:, 0, 0] ** 2], axis=1)
    tree = own_skeleton(names, parents)
    rig = Rig(tree, offsets, turns, root, tuple(joints), (MOVES + ORDERS[1], *channels[1:]))
    return Motion(rig.positions().astype(np.float32), fps, skeleton, name="animated", up="y", rig=rig)


def rigged(motion: Motion, **changes) -> Motion:
    """The motion that its rig makes when some of it is changed."""
    rig = replace(motion.rig, **changes)
    return replace(motion, positions=rig.positions().astype(np.float32), rig=rig)


def _depth_first(above: dict[str, tuple]) -> list[str]:
    order, waiting = [], ["Hips"]
    while waiting:
        order.append(waiting.pop())
        waiting += [name for name, (parent, _) in reversed(above.items()) if parent == order[-1]]
    return order


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Degrees between unit quaternions."""
    one, other = (q.astype(np.float64) for q in (one, other))
    nearest = np.minimum(np.linalg.norm(one - other, axis=-1), np.linalg.norm(one + other, axis=-1))
    return np.degrees(4 * np.arcsin(np.clip(nearest / 2, 0, 1)))
