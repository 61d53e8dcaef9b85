"""The rig of an ASF/AMC motion: its bones as BVH has them, joints where bones begin and End Sites where the last ones end."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.rotation import euler_quaternions
from mwlib.body.skeleton import Skeleton
from mwlib.data.formats.asf import ROOT_ORDER, TURNS, Body, far_ends
from mwlib.data.formats.blocks import rotation_track
from mwlib.data.naming import rig_skeleton

Tracks = dict[str, dict[str, Float[np.ndarray, " T"]]]  # bone -> degree of freedom -> values, radians or file units


def root_path(tracks: Tracks, body: Body) -> Float[np.ndarray, "T 3"]:
    """Where the root is, file units."""
    return body.position + np.stack([tracks["root"][d] for d in ROOT_ORDER[:3]], axis=-1)


def asf_rig(tracks: Tracks, body: Body, tree: Skeleton, bones: list[str], metres: float) -> Rig:
    """The rig whose joints stand where the bones begin; a bone's far end is its first child's joint, or its End Site.

    G = G_parent C Rz Ry Rx C^-1 makes C R C^-1 the local rotation, and the parent bone's own vector is the joint's offset,
    so the points are exactly the same.

    Args:
        tree: root and bones, joints named by bone.
        bones: the motion's joints, by bone.
        metres: per unit of the file.
    """
    names, parents = _depth_first(tree)
    skeleton = rig_skeleton(names, parents)
    vectors = np.array([body.bones[name].offset if name in body.bones else np.zeros(3) for name in names])

    def rotations(part: slice) -> Float[np.ndarray, "n rig 4"]:
        found = np.zeros((part.stop - part.start, len(names), 4))
        found[..., 0] = 1.0
        for joint, name in enumerate(names):
            turns = [dof for dof in reversed(TURNS) if dof in tracks.get(name, {})]  # z, y, x: Rz Ry Rx
            if turns:
                angles = np.stack([tracks[name][dof][part] for dof in turns], axis=-1)
                found[:, joint] = euler_quaternions("".join(dof[1] for dof in turns), angles)
                found[:, joint, 1:] @= _axis(body, name).T  # C R C^-1: R about the turned axis
        return found

    ends = far_ends(skeleton)
    return Rig(
        skeleton,
        np.concatenate([body.position[None], vectors[list(parents[1:])]]) * metres,
        rotation_track(rotations, len(tracks["root"]["tx"]), len(names)),
        root_path(tracks, body) * metres,
        tuple(ends[names.index(bone)] for bone in bones),
        tuple(None if name.endswith("/End") else (MOVES if joint == 0 else ()) + ANGLES for joint, name in enumerate(names)),
    )


def _axis(body: Body, name: str) -> Float[np.ndarray, "3 3"]:
    return body.bones[name].axis if name in body.bones else body.root_axis


def _depth_first(tree: Skeleton) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names and parents in the order of a BVH file, an End Site under each bone without children."""
    children: list[list[int]] = [[] for _ in tree.joints]
    for parent, child in tree.bones:
        children[parent].append(child)
    names: list[str] = []
    parents: list[int] = []
    waiting = [(0, -1)]
    while waiting:
        joint, parent = waiting.pop()
        here = len(names)
        names.append(tree.joints[joint])
        parents.append(parent)
        waiting += [(child, here) for child in reversed(children[joint])]
        if not children[joint]:
            names.append(f"{tree.joints[joint]}/End")
            parents.append(here)
    return tuple(names), tuple(parents)
