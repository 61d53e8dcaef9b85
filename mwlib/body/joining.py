"""Two motions of one body: whether it is one, the second brought to where the first ends, and both as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from mwlib.body.kinematics import bone_lengths, heading, horizontal
from mwlib.body.motion import Motion
from mwlib.body.rig import Rig
from mwlib.body.skeleton import H36M17

ALIKE = 5e-3  # metres by which a bone of one rig may differ: own choice, far above rounding, far below two people
ROUGHLY = 0.05  # the same of positions without a rig, whose bones are measured: own choice
FIRM = ("knee", "foot", "elbow", "wrist")  # joints of H36M17 at the ends of single bones; its others are spans of the trunk


def check_one_body(first: Motion, second: Motion) -> None:
    """Refuse two motions of different bodies.

    Args:
        first, second: of rigs: joints and bones are compared; else the bones between positions of one skeleton, roughly.

    Raises:
        ValueError: joints have other names or parents, or a bone is longer in one; the message says which.
    """
    if first.rig and second.rig:
        (one, other), close = (_bones_of_rig(motion.rig) for motion in (first, second) if motion.rig), ALIKE
    elif first.skeleton == second.skeleton:
        (one, other), close = (_bones_of_positions(motion) for motion in (first, second)), ROUGHLY
    else:
        return
    what = "start and end are of different bodies"
    if lost := sorted(one.keys() ^ other.keys()):
        joint, parent = lost[0]
        only = "start" if lost[0] in one else "end"
        raise ValueError(f"{what}: only {only} has {joint} under {parent}; expected the same joints ({len(lost)} are not)")
    for (joint, parent), length in one.items():
        if not abs(length - other[joint, parent]) <= close:
            raise ValueError(
                f"{what}: from {parent} to {joint} it is {length:.3f} m in start and {other[joint, parent]:.3f} m in end; "
                "expected bones of the same length"
            )


def _bones_of_rig(rig: Rig) -> dict[tuple[str, str], float]:
    """Lengths by joint and parent, metres, of what hangs from the motion's root."""
    names, parents, lengths = rig.skeleton.joints, rig.skeleton.parents, np.linalg.norm(rig.spans[0], axis=-1)
    return {(names[joint], names[parents[joint]]): lengths[joint] for joint in rig.hanging()[1:]}


def _bones_of_positions(motion: Motion) -> dict[tuple[str, str], float]:
    """Median lengths by joint and parent, metres."""
    lengths, names = np.median(bone_lengths(motion.positions, motion.skeleton), axis=0), motion.skeleton.joints
    bones = zip(motion.skeleton.bones, lengths, strict=True)
    return {
        (names[joint], names[parent]): float(length)
        for (parent, joint), length in bones
        if motion.skeleton != H36M17 or names[joint].endswith(FIRM)
    }


def rig_of(motion: Motion) -> Rig:
    """The rig of a motion.

    Raises:
        ValueError: it has none.
    """
    if motion.rig is None:
        raise ValueError(f"{motion.name or 'a motion'} has positions only; expected rotations, as BVH and AMC files have")
    return motion.rig


def aligned(motion: Motion, to: Motion) -> Motion:
    """A motion turned about the up-axis and moved along the floor: its first frame faces and stands as the last of another.

    Args:
        motion: to be moved.
        to: the other one, with the same up-axis.

    Raises:
        ValueError: a skeleton has no left and right joints, which say where a body faces.
    """
    angles = [heading(torch.from_numpy(m.root_relative()[n]), m.skeleton, m.up) for m, n in ((to, -1), (motion, 0))]
    motion = motion.turn(float(angles[0] - angles[1]))
    way = (to.positions[-1, 0] - motion.positions[0, 0]).astype(np.float64)
    way[horizontal(motion.up)[2]] = 0
    return replace(
        motion,
        positions=motion.positions + way.astype(motion.positions.dtype),
        rig=motion.rig and replace(motion.rig, root=motion.rig.root + way),
    )


def joined(first: Motion, second: Motion) -> Motion:
    """All frames of the first motion, then all of the second, on the first one's rig.

    Args:
        first, second: of one body (see `check_one_body`), one up-axis and one rate, both with a rig.

    Raises:
        ValueError: one of them has no rig.
    """
    one, other = rig_of(first), rig_of(second)
    order = [other.skeleton.joints.index(name) for name in one.skeleton.joints]
    moves = None
    if one.moves is not None:
        moves = np.concatenate([one.moves, np.broadcast_to(other.spans, other.rotations[..., :3].shape)[:, order]])
    rotations = np.concatenate([one.rotations, other.rotations[:, order]])
    rig = replace(one, rotations=rotations, root=np.concatenate([one.root, other.root]), moves=moves)
    return replace(first, positions=rig.positions().astype(first.positions.dtype), rig=rig)
