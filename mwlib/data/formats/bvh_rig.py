"""What the nodes of a BVH file are: which skeleton they make, and the rig behind it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from mwlib.body.rig import MOVES, Rig
from mwlib.body.rotation import euler_quaternions
from mwlib.body.skeleton import BANDAI21, CMU, SKELETONS, Skeleton
from mwlib.data.formats.asf import CMU_BONES, far_ends
from mwlib.data.formats.blocks import in_blocks, rotation_track
from mwlib.data.naming import own_skeleton, rig_skeleton

# The parents of the 31 cgspeed joints, and the node that stands at each point of CMU. The file has no length for the
# thorax and wrist bones: their far ends coincide with their near ones.
CGSPEED_PARENTS = tuple(
    int(p) for p in "-1 0 1 2 3 4 0 6 7 8 9 0 11 12 13 14 15 13 17 18 19 20 21 20 13 24 25 26 27 28 27".split()
)
CGSPEED_POINTS = (
    "Hips LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftToeBase/End RightUpLeg RightLeg RightFoot RightToeBase RightToeBase/End "
    "Spine Spine1 Neck Neck1 Head Head/End LeftArm LeftForeArm LeftHand LeftFingerBase LFingers LFingers/End LThumb/End "
    "RightArm RightForeArm RightHand RightFingerBase RFingers RFingers/End RThumb/End"
).split()


@dataclass
class Node:
    """A joint, or an End Site (named after its joint, without channels)."""

    name: str
    parent: int
    offset: list[float] | None = None
    channels: list[str] | None = None
    is_end: bool = False


def bvh_skeleton(nodes: list[Node]) -> tuple[Skeleton, list[int]]:
    """The skeleton of a file, and which node each of its joints is."""
    names = [n.name for n in nodes]
    joints = [i for i, n in enumerate(nodes) if not n.is_end]
    own = own_skeleton(tuple(names[i] for i in joints), tuple(joints.index(nodes[i].parent) if i else -1 for i in joints))
    if own.parents == CGSPEED_PARENTS and set(CGSPEED_POINTS) <= set(names):
        return CMU, [names.index(n) for n in CGSPEED_POINTS]
    if _same_tree(own, replace(CMU, joints=CMU_BONES)):
        ends = far_ends(rig_skeleton(tuple(names), tuple(n.parent for n in nodes)))
        return CMU, [ends[names.index(bone)] for bone in CMU_BONES]
    for known in SKELETONS.values():
        if _same_tree(own, known) or (known is BANDAI21 and _same_tree(own, _under("joint_Root", known))):
            return known, [names.index(name) for name in known.joints]
    return own, joints


def _same_tree(one: Skeleton, other: Skeleton) -> bool:
    """Whether the same names hang from the same names, in whichever order they are listed."""
    trees = [{s.joints[j]: s.joints[p] if p >= 0 else None for j, p in enumerate(s.parents)} for s in (one, other)]
    return trees[0] == trees[1]


def _under(root: str, skeleton: Skeleton) -> Skeleton:
    """The skeleton with one more joint above its root."""
    return Skeleton("", (root, *skeleton.joints), (-1, *(parent + 1 for parent in skeleton.parents)))


def frame_offsets(nodes: list[Node], table: Float[np.ndarray, "T channels"]) -> Float[np.ndarray, "T nodes 3"]:
    """Offsets in every frame, the file's unit: position channels replace those of the hierarchy."""
    offsets = np.tile(np.array([n.offset for n in nodes]), (len(table), 1, 1))
    column = 0
    for joint, node in enumerate(nodes):
        for name in node.channels or ():
            if name in MOVES:
                offsets[:, joint, MOVES.index(name)] = table[:, column]
            column += 1
    return offsets


def bvh_rig(nodes: list[Node], table: Float[np.ndarray, "T channels"], points: list[int], metres: float) -> Rig:
    """The rig of a file: every node, End Sites among them.

    Args:
        table: the rows of MOTION, degrees and the file's unit.
        points: which node stands at each joint of the motion.
        metres: per unit of the file.
    """
    columns: dict[str, list[tuple[int, list[int]]]] = defaultdict(list)  # axes -> joints that turn about these, their columns
    start = 0
    for joint, node in enumerate(nodes):
        names = node.channels or []
        angles = [i for i, name in enumerate(names) if name.endswith("rotation")]
        columns["".join(names[i][0] for i in angles)].append((joint, [start + i for i in angles]))
        start += len(names)

    def rotations(part: slice) -> Float[np.ndarray, "n nodes 4"]:
        found = np.empty((part.stop - part.start, len(nodes), 4))
        for axes, joints in columns.items():
            angles = table[part, np.array([c for _, c in joints], dtype=int).reshape(len(joints), len(axes))]
            found[:, [joint for joint, _ in joints]] = euler_quaternions(axes, np.deg2rad(angles))
        return found

    def moves(part: slice) -> Float[np.ndarray, "n nodes 3"]:
        return frame_offsets(nodes, table[part]) * metres

    is_moving = any(name in MOVES for node in nodes[1:] for name in node.channels or ())
    return Rig(
        rig_skeleton(tuple(n.name for n in nodes), tuple(n.parent for n in nodes)),
        np.array([n.offset for n in nodes]) * metres,
        rotation_track(rotations, len(table), len(nodes)),
        frame_offsets(nodes[:1], table)[:, 0] * metres,
        tuple(points),
        tuple(None if n.is_end else tuple(n.channels or ()) for n in nodes),
        in_blocks(moves, len(table), len(nodes)) if is_moving else None,
    )
