"""Kinematics of a tree of joints: bone lengths, forward kinematics, turning about the up-axis."""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import groupby, pairwise

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import pad

from mwlib.body.rotation import matrix_parts, multiply_parts, rotate_parts
from mwlib.body.skeleton import Skeleton

AXES = {"y": 1, "z": 2}


def bone_lengths(positions: Float[np.ndarray, "... joints 3"], skeleton: Skeleton) -> Float[np.ndarray, "... bones"]:
    """Length of every bone, metres, in the order of `skeleton.bones`."""
    parent, child = np.transpose(skeleton.bones)
    return np.linalg.norm(positions[..., child, :] - positions[..., parent, :], axis=-1)


def forward_kinematics(
    rotations: Float[np.ndarray, "... joints 3 3"],
    offsets: Float[np.ndarray, "... joints 3"],
    root: Float[np.ndarray, "... 3"],
    skeleton: Skeleton,
) -> Float[np.ndarray, "... joints 3"]:
    """Positions from local rotations: R_j = R_parent r_j, p_j = p_parent + R_parent o_j.

    Args:
        rotations: local rotation matrix of each joint relative to its parent (column vectors).
        offsets: from parent to joint in the parent's frame; the root's own offset is not used.
        root: root position. Lengths come out in the unit of `offsets` and `root`.
    """
    turned, places = [rotations[..., 0, :, :]], [np.asarray(root)]
    for parent, joint in skeleton.bones:
        turned.append(turned[parent] @ rotations[..., joint, :, :])
        places.append(places[parent] + (turned[parent] @ offsets[..., joint, :, None])[..., 0])
    return np.stack(places, axis=-2)


def fk(
    rotations: Float[Tensor, "*lead joints 4"],
    offsets: Float[Tensor, "*offsets joints 3"],
    root: Float[Tensor, "*lead 3"],
    skeleton: Skeleton,
) -> tuple[Float[Tensor, "*lead joints 3"], Float[Tensor, "*lead joints 4"]]:
    """Forward kinematics of unit quaternions in torch: positions, and turns against the world. Gradients pass.

    All joints of one depth of the tree, in all frames, are one operation.

    Args:
        rotations: of each joint against its parent, (w, x, y, z).
        offsets: from parent to joint in the parent's frame; the root's own is not used. Leading axes none, or those of
            `rotations`.
        root: root position. Lengths come out in the unit of `offsets` and `root`.

    Two bones, the first joint a quarter turn about z:

    >>> arm = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))
    >>> turns = torch.tensor([[0.5**0.5, 0.0, 0.0, 0.5**0.5], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    >>> offsets = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    >>> fk(turns, offsets, torch.zeros(3), arm)[0].round(decimals=4)
    tensor([[0., 0., 0.],
            [0., 1., 0.],
            [0., 2., 0.]])
    """
    joints, above, order = _levels(skeleton.parents, rotations.device)
    local, offsets = rotations.movedim(-1, 0), offsets.movedim(-1, 0)
    places, turns = [root.movedim(-1, 0)[..., None]], [local[..., :1]]
    for row, parents in zip(joints[1:].split([*map(len, above)]), above, strict=True):
        turned = turns[-1].index_select(-1, parents)
        steps = rotate_parts(turned, offsets.index_select(-1, row))
        places.append(places[-1].index_select(-1, parents) + steps)
        turns.append(multiply_parts(turned, local.index_select(-1, row)))
    positions, world = (torch.cat(parts, dim=-1).index_select(-1, order).movedim(0, -1) for parts in (places, turns))
    return positions, world


def places(
    numbers: Float[Tensor, "*lead joints 6"],
    offsets: Float[Tensor, "*#lead joints 3"],
    root: Float[Tensor, "*lead 3"],
    skeleton: Skeleton,
) -> Float[Tensor, "*lead joints 3"]:
    """The positions alone of forward kinematics, from six numbers per rotation, for trainings: a quarter of `fk`'s time.

    Six numbers are two columns of a matrix, so no quaternion is made. Joints without children are not turned. Gradients pass.

    Args:
        numbers: of each joint's rotation against its parent, see `rotation.from_six`.
        offsets: from parent to joint in the parent's frame; the root's own is not used.
        root: root position. Lengths come out in the unit of `offsets` and `root`.

    >>> arm = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))
    >>> turns = torch.tensor([[0.0, 2.0, 0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
    >>> offsets = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    >>> places(turns, offsets, torch.zeros(3), arm)
    tensor([[0., 0., 0.],
            [0., 1., 0.],
            [0., 2., 0.]])
    """
    joints, above, holders = _levels(skeleton.parents, numbers.device, of_parents=True)
    local = matrix_parts(numbers.index_select(-2, joints).movedim((-1, -2), (0, 1)).contiguous())
    first, *others = local.split([1, *map(len, above)], dim=2)
    turns = [first]
    for parents, turn in zip(above, others, strict=True):
        turns.append(_times(turns[-1].index_select(2, parents), turn))
    bones = offsets.expand(*root.shape[:-1], *offsets.shape[-2:])[..., 1:, :].movedim((-1, -2), (0, 1))
    steps = _times(torch.cat(turns, dim=2).index_select(2, holders), bones[:, None])[:, 0]
    ways = torch.einsum("kj,xj...->kx...", _sums(skeleton, steps), steps)
    return torch.cat([root.movedim(-1, 0)[None], ways + root.movedim(-1, 0)]).movedim((0, 1), (-2, -1))


def _times(a: Float[Tensor, "3 3 *lead"], b: Float[Tensor, "3 columns *#lead"]) -> Float[Tensor, "3 columns *lead"]:
    """Product of matrices whose parts are on the first axes."""
    (x, y, z), (i, j, k) = a.unbind(1), b.unbind(0)
    return x[:, None] * i + y[:, None] * j + z[:, None] * k


@lru_cache(maxsize=256)
@torch.inference_mode(False)  # what is kept must serve training, too
def _levels(
    parents: tuple[int, ...], device: torch.device, of_parents: bool = False
) -> tuple[Int[Tensor, " order"], list[Tensor], Int[Tensor, " found"]]:
    """Joints, depth by depth; for each depth below the root their parents' places one depth above; and where each joint stands.

    With `of_parents` joints without children are left out, and where the parents of joints 1, 2, ... stand is said instead.
    """
    depth, wanted = _depths(parents), parents[1:] if of_parents else range(len(parents))
    order = sorted({*wanted}, key=lambda joint: (depth[joint], joint))
    rows = [[*row] for _, row in groupby(order, depth.__getitem__)]
    above = [[up.index(parents[joint]) for joint in row] for up, row in pairwise(rows)]
    found = [order.index(joint) for joint in wanted]
    numbers = partial(torch.tensor, device=device)
    return numbers(order), [numbers(places) for places in above], numbers(found)


def _depths(parents: tuple[int, ...]) -> list[int]:
    """Bones between the root and each joint."""
    depth = [0]
    for parent in parents[1:]:
        depth.append(depth[parent] + 1)
    return depth


def turn_heading(x: Float[Tensor, "*#lead F C"], angle: Float[Tensor, "*#lead"], up: str = "z") -> Float[Tensor, "*lead F C"]:
    """Turn flattened joints about the up-axis, the first horizontal axis towards the second; radians, one per sequence."""
    cos, sin = (f(angle).to(x)[..., None, None] for f in (torch.cos, torch.sin))
    a, b, _ = horizontal(up)
    turned = x.clone()
    turned[..., a::3] = cos * x[..., a::3] - sin * x[..., b::3]
    turned[..., b::3] = sin * x[..., a::3] + cos * x[..., b::3]
    return turned


def heading(pose: Float[Tensor, "*lead C"], skeleton: Skeleton, up: str = "z") -> Float[Tensor, "*lead"]:
    """The heading of a body: the angle of the line from the right hip to the left one, seen from above; radians.

    ``turn_heading(x, -heading(pose, skeleton))`` puts the left hip of `pose` straight along the first horizontal axis. Hips
    are the pair of sides nearest the root.

    Args:
        pose: flattened joints without the root, metres.
        skeleton: whose joints these are.
        up: the up-axis.

    Raises:
        ValueError: no joint of the skeleton has a side.
    """
    if not skeleton.left:
        raise ValueError(f"{skeleton.name} has no left and right joints; expected some, to tell where a body faces")
    depth = _depths(skeleton.parents)
    left, right = min(zip(skeleton.left, skeleton.right, strict=True), key=lambda pair: depth[pair[0]])
    a, b, _ = horizontal(up)
    joints = pose.unflatten(-1, (-1, 3))
    across = joints[..., left - 1, :] - joints[..., right - 1, :]
    return torch.atan2(across[..., b], across[..., a])


def scale_bones(
    x: Float[Tensor, "*lead C"], factor: Float[Tensor, "*#lead bones"], skeleton: Skeleton
) -> Float[Tensor, "*lead C"]:
    """Poses with every bone in its direction and so many times as long, built from the root outwards.

    Args:
        x: flattened joints without the root, metres.
        factor: of the bones to joints 1, 2, ...; its leading axes may be 1.
        skeleton: whose joints these are.

    >>> arm = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))
    >>> scale_bones(torch.tensor([0.0, 0.0, 2.0, 0.0, 3.0, 2.0]), torch.tensor([0.5, 2.0]), arm)
    tensor([0., 0., 1., 0., 6., 1.])
    """
    return (_sums(skeleton, x) @ (bones_of(x, skeleton) * factor[..., None])).flatten(-2)


def bones_of(x: Float[Tensor, "*lead C"], skeleton: Skeleton) -> Float[Tensor, "*lead bones 3"]:
    """The vector from each joint's parent to it, for joints 1, 2, ..., the root being at the origin."""
    joints = x.unflatten(-1, (-1, 3))
    return joints - pad(joints, (0, 0, 1, 0))[..., list(skeleton.parents[1:]), :]


def _sums(skeleton: Skeleton, like: Tensor) -> Float[Tensor, "bones bones"]:
    """The matrix that adds up the bones from the root to each joint."""
    chain = np.eye(len(skeleton))
    for parent, joint in skeleton.bones:
        chain[joint] += chain[parent]
    return torch.as_tensor(chain[1:, 1:]).to(like)


def horizontal(up: str) -> tuple[int, int, int]:
    """Indices of the two horizontal axes and of the vertical one."""
    return 0, 3 - AXES[up], AXES[up]
