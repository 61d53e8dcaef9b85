"""Rotations for a motion that has positions only: a rig with bones of fixed length, fitted from the root outward."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, ROTATION_DTYPE, Rig
from mwlib.body.rotation import about, continuous, from_matrix, inverse, multiply, rotate, shortest_arc, wrapped
from mwlib.body.skeleton import Skeleton

ROUNDS = 3  # of averaging the shape of several children; on real motion the fourth changes less than 1e-4 m
LEAST_TWIST = 1e-9  # weight, against the bones themselves, of not turning where the bones leave it open
JUMP = np.pi / 4  # radians of twist from one frame to the next that no body makes

Turns = Float[Tensor, "T 4"]
Directions = Float[Tensor, "T 3"]
Bones = Float[Tensor, "children 3"]
Seen = Float[Tensor, "T children 3"]
Angles = Float[Tensor, " T"]


class FitError(NamedTuple):
    """Distance of a rig's joints from given positions: mean and largest over frames and joints, metres."""

    mean: float
    max: float


class Fit(NamedTuple):
    """A fitted rig and how far it is from the positions."""

    rig: Rig
    error: FitError


def fit_rig(motion: Motion) -> Fit:
    """Find rotations and bones of fixed length whose forward kinematics comes close to the motion's positions.

    Bones have their median lengths. From the root outward, a joint with one child is turned by the shortest arc towards it,
    a joint with several by the rotation that fits them best (Kabsch 1976), both from where the joints before have come to
    stand, so that errors do not add up. A twist about a single bone cannot be seen in positions: it is none, except that it
    never jumps. Own choice: the rest pose is the mean posture, upright and facing +z with y up, as BVH is drawn; it lies
    amid the directions that a bone takes and so keeps shortest arcs away from half turns.

    Args:
        motion: positions; a rig that it may have is not used.

    Raises:
        ValueError: positions are not finite.

    >>> from mwlib.body.skeleton import Skeleton
    >>> arm = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))
    >>> bent = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [0, 1, 0], [-1, 1, 0]]], np.float32)
    >>> fit_rig(Motion(bent, 30.0, arm, up="y")).error.max < 1e-6
    True
    """
    target = np.asarray(motion.with_up("y").positions, np.float64)
    if not np.isfinite(target).all():
        frame, joint, _ = np.argwhere(~np.isfinite(target))[0]
        raise ValueError(f"the position of {motion.skeleton.joints[joint]} in frame {frame} is not finite; expected numbers")
    rest, rotations = _fit(torch.from_numpy(target), motion.skeleton)
    joints, rotations = len(rest), continuous(rotations).numpy().astype(ROTATION_DTYPE)
    channels = MOVES + ANGLES, *[ANGLES] * (joints - 1)
    rig = Rig(motion.skeleton, rest.numpy(), rotations, target[:, 0], tuple(range(joints)), channels)
    if motion.up == "z":
        rig = rig.turned(np.array([0.5, 0.5, 0.0, 0.0]) * np.sqrt(2))
    return Fit(rig, distance(rig, motion))


def distance(rig: Rig, motion: Motion) -> FitError:
    """Distance of a rig's joints from a motion's positions."""
    away = np.linalg.norm(rig.positions() - motion.positions, axis=-1)
    return FitError(float(away.mean()), float(away.max()))


def _fit(
    target: Float[Tensor, "T joints 3"], skeleton: Skeleton
) -> tuple[Float[Tensor, "joints 3"], Float[Tensor, "T joints 4"]]:
    """Offsets and local rotations, one joint after the other, all frames at once."""
    rest = torch.zeros_like(target[0])
    still = target.new_tensor([1.0, 0.0, 0.0, 0.0]).expand(len(target), 4)
    rotations, turns = still[:, None].repeat(1, len(skeleton), 1), {-1: still}
    places = {0: target[:, 0]}
    for joint, parent in enumerate(skeleton.parents):
        below, above = [bone[1] for bone in skeleton.bones if bone[0] == joint], turns[parent]
        if below:
            seen = rotate(inverse(above)[:, None], target[:, below] - places[joint][:, None])
            lengths = (target[:, below] - target[:, joint, None]).norm(dim=-1).median(dim=0).values
            start = _mean_direction(seen) if joint else _rest_of_root(target, skeleton, below)
            rest[below] = _shape(start, seen, lengths)
            turned = aimed(rest[below], seen)
            rotations[:, joint] = turned if len(below) > 1 else _steady(turned, rest[below[0]])
        turns[joint] = multiply(above, rotations[:, joint])
        for child in below:
            places[child] = places[joint] + rotate(turns[joint], rest[child])
    return rest, rotations


def _rest_of_root(target: Float[Tensor, "T joints 3"], skeleton: Skeleton, below: list[int]) -> Bones:
    """The root's children where the body stands tallest, turned so that left is +x."""
    tallest = (target[..., 1].amax(dim=1) - target[..., 1].amin(dim=1)).argmax()
    bones = target[tallest, below] - target[tallest, 0]
    pairs = zip(skeleton.left, skeleton.right, strict=True)
    across = sum((target[tallest, a] - target[tallest, b] for a, b in pairs if a in below), torch.zeros_like(bones[0]))
    across = across * across.new_tensor([1.0, 0.0, 1.0])
    return rotate(shortest_arc(across, across.new_tensor([1.0, 0.0, 0.0])), bones)


def _mean_direction(seen: Seen) -> Bones:
    """Unit vectors; the first frame's where the directions cancel out, up where there are none."""
    units = normalize(seen, dim=-1)
    mean = units.mean(dim=0)
    mean = torch.where(mean.norm(dim=-1, keepdim=True) < 0.1, units[0], mean)
    up = mean.new_tensor([0.0, 1.0, 0.0])
    return normalize(torch.where(mean.norm(dim=-1, keepdim=True) < 0.1, up, mean), dim=-1)


def _shape(start: Bones, seen: Seen, lengths: Float[Tensor, " children"]) -> Bones:
    """Bones of given lengths as they lie to each other on average: generalised Procrustes analysis."""
    shape = normalize(start, dim=-1) * lengths[:, None]
    for _ in range(ROUNDS if len(start) > 1 else 0):
        mean = rotate(inverse(kabsch(shape, seen))[:, None], seen).mean(dim=0)
        shape = normalize(mean, dim=-1) * lengths[:, None]
    return shape


def aimed(rest: Float[Tensor, "*#T children 3"], seen: Seen) -> Turns:
    """The rotations that carry several bones nearest to `seen`; of a single one, the smallest that does."""
    return kabsch(rest, seen) if seen.shape[1] > 1 else shortest_arc(rest[..., 0, :], seen[:, 0])


def kabsch(rest: Float[Tensor, "*#T children 3"], seen: Seen) -> Turns:
    """The rotations that carry `rest` nearest to `seen`; where the bones lie on one line, with the least twist.

    Source: Kabsch 1976. Bones weigh as their squared lengths.
    """
    products = seen.mT @ rest
    size = products.norm(dim=(-2, -1), keepdim=True) + 1e-12
    u, _, v = torch.linalg.svd(products / size + LEAST_TWIST * torch.eye(3, dtype=rest.dtype))
    sign = torch.ones_like(products[:, 0])
    sign[:, 2] = torch.det(u @ v).sign()
    return from_matrix(u @ (sign[:, :, None] * v))


def _steady(turns: Turns, bone: Float[Tensor, " 3"]) -> Turns:
    """The same directions of `bone`, its twist made to go on where it would jump, as near a half turn."""
    axis = normalize(bone, dim=-1).expand(len(turns), 3)
    return multiply(turns, about(axis, -twist_jumps(turns, axis, JUMP)))


def twist_jumps(turns: Turns, axis: Directions, most: float) -> Angles:
    """Sum up to each frame of the twists about an axis, radians, that are larger than `most` from one frame to the next."""
    pointing = rotate(turns, axis)
    carried = multiply(shortest_arc(pointing[:-1], pointing[1:]), turns[:-1])
    twisted = multiply(inverse(carried), turns[1:])
    angle = wrapped(2 * torch.atan2((twisted[:, 1:] * axis[1:]).sum(dim=-1), twisted[:, 0]))
    return torch.cat([angle.new_zeros(1), torch.where(angle.abs() > most, angle, 0.0).cumsum(dim=0)])
