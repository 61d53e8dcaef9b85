"""Rotation matrices from Euler angles over time."""

from __future__ import annotations

import functools

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation


def euler_matrices(axes: str, angles: Float[np.ndarray, "T turns"]) -> Float[np.ndarray, "T 3 3"]:
    """R = R_axes[0](angle 0) R_axes[1](angle 1) ..., for column vectors; one angle or more, radians.

    By rotation vectors, one axis at a time: SciPy's own Euler angles take ten times as long.
    """
    vectors = angles.T[:, :, None] * np.eye(3)[["xyz".index(axis) for axis in axes], None]
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3)
    return functools.reduce(np.matmul, turns)
