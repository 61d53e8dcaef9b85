"""Motion: joint positions in metres over time, and what one does with them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from .skeleton import H36M17, TO_H36M17, Skeleton

AXES = {"y": 1, "z": 2}


@dataclass(frozen=True)
class Motion:
    """One clip of joint positions.

    Args:
        positions: (T, J+1, 3) metres, world coordinates, joint 0 is the root.
        fps: frames per second.
        skeleton: names and parents of the J+1 joints.
        subject, action, name: who, what, which clip.
        up: the axis that points away from the floor, "y" or "z".

    Raises:
        ValueError: shape, rate or up-axis make no sense; the message says which and what was expected.
    """

    positions: Float[np.ndarray, "T joints 3"]
    fps: float
    skeleton: Skeleton
    subject: str = ""
    action: str = ""
    name: str = ""
    up: str = "z"

    def __post_init__(self) -> None:
        expected = (len(self.skeleton), 3)
        if self.positions.ndim != 3 or self.positions.shape[1:] != expected or len(self.positions) == 0:
            raise ValueError(
                f"positions have shape {self.positions.shape}; expected (T, {expected[0]}, 3) with T > 0 for {self.skeleton.name}"
            )
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise ValueError(f"fps is {self.fps}; expected a positive number")
        if self.up not in AXES:
            raise ValueError(f"up is {self.up!r}; expected one of {sorted(AXES)}")

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last frame."""
        return (len(self) - 1) / self.fps

    def resample(self, fps: float) -> Motion:
        """Resample by time, linearly between frames; every new frame lies inside the old duration.

        Own choice: linear, so that 120 to 60 Hz keeps every second frame exactly.
        """
        if fps == self.fps:
            return self
        frames = int(np.floor(self.duration * fps + 1e-6)) + 1
        at = np.minimum(np.arange(frames) * (self.fps / fps), len(self) - 1)
        low = np.minimum(at.astype(int), max(len(self) - 2, 0))
        high = np.minimum(low + 1, len(self) - 1)
        share = (at - low)[:, None, None].astype(self.positions.dtype)
        positions = self.positions[low] * (1 - share) + self.positions[high] * share
        return replace(self, positions=positions, fps=fps)

    def root_relative(self) -> Float[np.ndarray, "T C"]:
        """Joints minus root, root dropped, flattened joint-major with xyz fastest: the model's x, metres."""
        relative = self.positions[:, 1:] - self.positions[:, :1]
        return relative.reshape(len(self), -1)

    def with_up(self, up: str) -> Motion:
        """Turn the axes so that `up` points up; right-handed, so left stays left."""
        if up == self.up:
            return self
        x, y, z = np.moveaxis(self.positions, -1, 0)
        turned = (x, -z, y) if (self.up, up) == ("y", "z") else (x, z, -y)
        return replace(self, positions=np.stack(turned, axis=-1), up=up)

    def retarget(self, skeleton: Skeleton) -> Motion:
        """Copy corresponding joints to another skeleton; proportions stay the performer's.

        Raises:
            ValueError: no correspondence is known; the message lists the known ones.
        """
        if skeleton == self.skeleton:
            return self
        if skeleton != H36M17 or self.skeleton.name not in TO_H36M17:
            raise ValueError(f"cannot carry {self.skeleton.name} over to {skeleton.name}; known: {sorted(TO_H36M17)} to H36M17")
        names = TO_H36M17[self.skeleton.name].split()
        picked = [self.skeleton.joints.index(name) for name in names]
        return replace(self, positions=self.positions[:, picked], skeleton=skeleton)

    def cut(self, start: int, stop: int) -> Motion:
        """Frames start to stop (exclusive)."""
        return replace(self, positions=self.positions[start:stop])


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
    offsets = np.broadcast_to(offsets, (*rotations.shape[:-3], len(skeleton), 3))
    for joint in range(1, len(skeleton)):
        above = turned[skeleton.parents[joint]]
        turned.append(above @ rotations[..., joint, :, :])
        places.append(places[skeleton.parents[joint]] + (above @ offsets[..., joint, :, None])[..., 0])
    return np.stack(places, axis=-2)
