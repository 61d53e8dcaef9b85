"""Rotations: Euler angles, matrices and unit quaternions (w, x, y, z), scalar first, for column vectors.

The functions on angles are NumPy and serve files; those on quaternions are torch: leading axes are free, gradients pass.
"""

from __future__ import annotations

import functools
import warnings
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial.transform import Rotation
from torch import Tensor
from torch.nn.functional import normalize

Quaternions = Float[Tensor, "*#lead 4"]
Vectors = Float[Tensor, "*#lead 3"]
QuaternionParts = Float[Tensor, "4 *#lead"]
OverTime = Float[np.ndarray, "T *joints 4"]  # quaternions
Angles = TypeVar("Angles", np.ndarray, Tensor)


def euler_matrices(axes: str, angles: Float[np.ndarray, "T turns"]) -> Float[np.ndarray, "T 3 3"]:
    """R = R_axes[0](angle 0) R_axes[1](angle 1) ..., for column vectors; one angle or more, radians.

    By rotation vectors, one axis at a time: SciPy's own Euler angles take ten times as long.
    """
    vectors = angles.T[:, :, None] * np.eye(3)[["xyz".index(axis) for axis in axes], None]
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3)
    return functools.reduce(np.matmul, turns)


def euler_quaternions(axes: str, angles: Float[np.ndarray, "*lead turns"]) -> Float[np.ndarray, "*lead 4"]:
    """Unit quaternions of `euler_matrices`; no angle is no turn.

    Args:
        axes: one letter of xyz per angle, the first turn outermost.
        angles: radians.
    """
    units, still = torch.eye(3, dtype=torch.float64), torch.eye(4, dtype=torch.float64)[0].repeat(*angles.shape[:-1], 1)
    turns = [about(units["xyz".index(axis)], angle) for axis, angle in zip(axes, tensor64(angles).unbind(-1), strict=True)]
    return functools.reduce(multiply, turns, still).numpy()


def euler_angles(axes: str, quaternions: OverTime) -> Float[np.ndarray, "T *joints turns"]:
    """Inverse of `euler_quaternions`: radians that pass from frame to frame without a jump.

    Of the two sets of three angles that make a turn, the one nearer to the frame before is taken. Fewer axes make what they
    can of it; who wants to know turns the angles back.

    Args:
        axes: up to three different letters of xyz.
    """
    angles = _three_angles(axes, quaternions) if len(axes) == 3 else _few_angles(axes, quaternions)
    angles[0] = wrapped(angles[0])
    return np.unwrap(angles, axis=0)


def _three_angles(axes: str, quaternions: OverTime) -> Float[np.ndarray, "T *joints 3"]:
    with warnings.catch_warnings(action="ignore"):  # gimbal lock: the third angle is free, SciPy takes 0 and says so
        turns = Rotation.from_quat(quaternions[..., [1, 2, 3, 0]].reshape(-1, 4)).as_euler(axes.upper())
    one = turns.reshape(*quaternions.shape[:-1], 3)
    other = np.stack([one[..., 0] + np.pi, np.pi - one[..., 1], one[..., 2] + np.pi], axis=-1)
    stay, swap = (np.abs(wrapped(after - one[:-1])).sum(axis=-1) for after in (one[1:], other[1:]))
    is_other = np.zeros(one.shape[:-1], bool)
    is_other[1:] = np.cumsum(swap < stay, axis=0) % 2
    return np.where(is_other[..., None], other, one)


def _few_angles(axes: str, quaternions: OverTime) -> Float[np.ndarray, "T *joints turns"]:
    """By q = (cos a + i sin a)(cos b + j sin b), a and b half the angles about axes i and j; k = i j."""
    if len(axes) < 2:
        return 2 * np.arctan2(quaternions[..., [1 + "xyz".index(axis) for axis in axes]], quaternions[..., :1])
    i, j = ("xyz".index(axis) for axis in axes)
    is_cyclic = (j - i) % 3 == 1
    w, qi, qj, qk = np.moveaxis(quaternions, -1, 0)[[0, 1 + i, 1 + j, 4 - i - j]]
    qk = qk if is_cyclic else -qk
    a = np.where(w**2 + qi**2 > qj**2 + qk**2, np.arctan2(qi, w), np.arctan2(qk, qj))
    b = np.arctan2(np.cos(a) * qj + np.sin(a) * qk, np.cos(a) * w + np.sin(a) * qi)
    return 2 * np.stack([a, b], axis=-1)


def wrapped(angle: Angles) -> Angles:
    """The same angles from -pi to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def tensor64(values: Float[np.ndarray, "*shape"] | float) -> Float[Tensor, "*shape"]:
    """A copy as float64, for torch."""
    return torch.from_numpy(np.array(values, np.float64))


def about(axis: Vectors, angle: Float[Tensor, "*#lead"]) -> Quaternions:
    """Turns about unit vectors; radians."""
    half = angle[..., None] / 2
    return torch.cat([half.cos(), half.sin() * axis], dim=-1)


def multiply(a: Quaternions, b: Quaternions) -> Quaternions:
    """Hamilton product: the turn b, then the turn a.

    >>> quarter = torch.tensor([0.5**0.5, 0.0, 0.0, 0.5**0.5])  # about z
    >>> multiply(quarter, quarter).round(decimals=4)
    tensor([0., 0., 0., 1.])
    """
    return multiply_parts(a.movedim(-1, 0), b.movedim(-1, 0)).movedim(0, -1)


def multiply_parts(a: QuaternionParts, b: QuaternionParts) -> QuaternionParts:
    """`multiply` with the four numbers on the first axis: each lies in one piece of memory, which is several times faster."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a.unbind(0), b.unbind(0)
    product = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return torch.stack(product)


def inverse(q: Quaternions) -> Quaternions:
    """The turn back."""
    return q * q.new_tensor([1.0, -1.0, -1.0, -1.0])


def rotate(q: Quaternions, vectors: Vectors) -> Vectors:
    """Turn vectors by unit quaternions."""
    return rotate_parts(q.movedim(-1, 0), vectors.movedim(-1, 0)).movedim(0, -1)


def rotate_parts(q: QuaternionParts, vectors: Float[Tensor, "3 *#lead"]) -> Float[Tensor, "3 *#lead"]:
    """`rotate` with numbers on the first axis: v + 2 w (u x v) + 2 u x (u x v) for q = (w, u)."""
    (w, x, y, z), (a, b, c) = q.unbind(0), vectors.unbind(0)
    k, m, n = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return torch.stack((a + w * k + y * n - z * m, b + w * m + z * k - x * n, c + w * n + x * m - y * k))


def matrix(q: Quaternions) -> Float[Tensor, "*lead 3 3"]:
    """Rotation matrices of unit quaternions."""
    return rotate(q[..., None, :], torch.eye(3).to(q)).mT


def continuous(q: Float[Tensor, "*lead T joints 4"]) -> Float[Tensor, "*lead T joints 4"]:
    """The same turns with signs such that no quaternion lies opposite to the one before.

    Source: what the metrics of LaFAN1 (Harvey et al. 2020) presuppose: q and -q are one turn, but two far-apart numbers.
    """
    against = (q[..., 1:, :, :] * q[..., :-1, :, :]).sum(dim=-1, keepdim=True) < 0
    signs = torch.ones_like(q[..., :1])
    signs[..., 1:, :, :] = torch.where(against, -1.0, 1.0).to(q).cumprod(dim=-3)
    return q * signs


def slerp(a: Quaternions, b: Quaternions, share: Float[Tensor, "*#lead"]) -> Quaternions:
    """Spherical interpolation along the shorter way: a at share 0, b (or -b) at 1."""
    b = torch.where((a * b).sum(dim=-1, keepdim=True) < 0, -b, b)
    angle = 2 * torch.atan2((b - a).norm(dim=-1, keepdim=True), (b + a).norm(dim=-1, keepdim=True))
    share = share[..., None]
    is_small = angle < 1e-4  # sin(s t) / sin t is s to 2e-9
    safe = torch.where(is_small, torch.ones_like(angle), angle)
    weights = [torch.where(is_small, s, torch.sin(s * safe) / torch.sin(safe)) for s in (1 - share, share)]
    return normalize(weights[0] * a + weights[1] * b, dim=-1)


def shortest_arc(a: Vectors, b: Vectors) -> Quaternions:
    """The smallest turn that carries the direction of a to that of b; opposite ones by some axis across a, zeros not at all."""
    dtype = torch.promote_types(a.dtype, b.dtype)
    a, b = torch.broadcast_tensors(a.double(), b.double())  # nearly opposite ones cancel
    a, b = (normalize(v, dim=-1) for v in (a, b))
    w = 1 + (a * b).sum(dim=-1, keepdim=True)
    shortest = torch.eye(3, dtype=a.dtype, device=a.device)[a.abs().argmin(dim=-1)]
    axis = torch.where(w < 1e-12, torch.linalg.cross(a, shortest), torch.linalg.cross(a, b))
    return normalize(torch.cat([w, axis], dim=-1), dim=-1).to(dtype)


def six(q: Quaternions) -> Float[Tensor, "*#lead 6"]:
    """The first two columns of each rotation matrix, one after the other: numbers without jumps and without signs to choose.

    Source: Zhou et al. 2019, "On the continuity of rotation representations".
    """
    return matrix(q)[..., :2].mT.flatten(-2)


def from_six(numbers: Float[Tensor, "*lead 6"]) -> Quaternions:
    """The unit quaternions nearest in Gram and Schmidt's sense: the first column keeps its direction. Inverse of `six`.

    >>> quarter = torch.tensor([0.5**0.5, 0.0, 0.0, 0.5**0.5])
    >>> from_six(2 * six(quarter)).round(decimals=4)  # lengths do not matter
    tensor([0.7071, 0.0000, 0.0000, 0.7071])
    """
    return from_matrix(matrix_parts(numbers.movedim(-1, 0)).movedim((0, 1), (-2, -1)))


def matrix_parts(numbers: Float[Tensor, "6 *lead"]) -> Float[Tensor, "3 3 *lead"]:
    """The rotation matrices that six numbers stand for, by Gram and Schmidt; both with their parts on the first axes.

    Source: Zhou et al. 2019, Eq. 15. Sums over parts are written out: torch reduces a short axis slowly.
    """
    x, across = _unit(numbers[:3]), numbers[3:]
    y = _unit(across - (x * across).sum(0) * x)
    (a, b, c), (d, e, f) = x.unbind(0), y.unbind(0)
    return torch.stack((x, y, torch.stack((b * f - c * e, c * d - a * f, a * e - b * d))), dim=1)


def _unit(parts: Float[Tensor, "3 *lead"]) -> Float[Tensor, "3 *lead"]:
    """Of length 1, but for zeros; `normalize`, whose norm of a first axis takes ten times as long."""
    return parts * parts.square().sum(0).clamp_min(1e-24).rsqrt()


def from_matrix(m: Float[Tensor, "*lead 3 3"]) -> Quaternions:
    """Unit quaternions of rotation matrices, w at least 0 where it is the largest part. Inverse of `matrix`; gradients pass.

    Source: Shepperd 1978: of the four ways to solve for the quaternion, the one that divides by the largest of its parts.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (row.unbind(-1) for row in m.unbind(-2))
    one = torch.ones_like(xx)
    rows = (
        one + xx + yy + zz, zy - yz, xz - zx, yx - xy,
        zy - yz, one + xx - yy - zz, yx + xy, xz + zx,
        xz - zx, yx + xy, one - xx + yy - zz, zy + yz,
        yx - xy, xz + zx, zy + yz, one - xx - yy + zz,
    )  # fmt: skip
    ways = torch.stack(rows, dim=-1).unflatten(-1, (4, 4))  # 4 q_i q: each row is the quaternion, times four of its parts
    largest = torch.diagonal(ways, dim1=-2, dim2=-1).argmax(dim=-1)
    chosen = torch.take_along_dim(ways, largest[..., None, None], dim=-2).squeeze(-2)
    return normalize(chosen, dim=-1)
