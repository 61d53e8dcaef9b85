"""Motions: joint positions in metres over time, with the rotations behind them where known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Real

from mwlib.body.kinematics import AXES
from mwlib.body.rig import Rig, on_the_way
from mwlib.body.rotation import about, rotate, tensor64
from mwlib.body.skeleton import H36M17, HUMANML22, Skeleton, to_h36m17, to_humanml22
from mwlib.settings import choice, of_kind, real, shown, whole

RIG_SLACK = 1e-3, 1e-6  # metres, and share of the largest coordinate, between a position and its rig: more is another pose

FASTEST = 10_000.0  # frames per second
MOST_FRAMES = 1_000_000  # that resampling makes of fewer: own choice, hours of motion


@dataclass(frozen=True)
class Motion:
    """One clip of joint positions.

    Args:
        positions: (T, J+1, 3) metres, world coordinates, joint 0 is the root.
        fps: frames per second.
        skeleton: names and parents of the J+1 joints.
        subject, action, name: who, what, which clip.
        up: the axis that points away from the floor, "y" or "z".
        rig: rotations, offsets and the root's path, where known: forward kinematics of it gives `positions`. Who replaces
            `positions` alone has to drop it.

    Raises:
        ValueError: an argument is of another kind, shape, rate or up-axis make no sense, or the rig puts the first or last
            frame's joints elsewhere; the message says which and what was expected.

    >>> from mwlib.body.skeleton import H36M17
    >>> clip = Motion(np.zeros((101, 17, 3), np.float32), fps=50.0, skeleton=H36M17)
    >>> len(clip), clip.duration, len(clip.resample(20.0)), clip.rig is None
    (101, 2.0, 41, True)
    >>> clip
    Motion(101 frames of 17 joints, H36M17, 50 Hz, up z)
    """

    positions: Real[np.ndarray, "T joints 3"]  # floats from here on
    fps: float
    skeleton: Skeleton
    subject: str = ""
    action: str = ""
    name: str = ""
    up: str = "z"
    rig: Rig | None = None

    def __post_init__(self) -> None:
        joints = len(of_kind("skeleton", self.skeleton, Skeleton))
        for label in ("subject", "action", "name"):
            of_kind(label, getattr(self, label), str, "a text")
        if not isinstance(self.positions, np.ndarray) or self.positions.dtype.kind not in "fiu":
            raise ValueError(
                f"positions is {shown(self.positions)} of {getattr(self.positions, 'dtype', 'no numbers')}; "
                "expected a NumPy array of real numbers"
            )
        if self.positions.dtype.kind != "f":  # places between whole numbers would be cut off
            object.__setattr__(self, "positions", self.positions.astype(np.float64))
        if self.positions.shape[1:] != (joints, 3) or not len(self):
            raise ValueError(
                f"positions have shape {self.positions.shape}; expected (T, {joints}, 3) with T > 0 for {self.skeleton.name}"
            )
        if real("fps", self.fps) <= 0:
            raise ValueError(f"fps is {self.fps}; expected a positive number")
        choice("up", self.up, AXES)
        if self.rig is not None:
            self._check_rig(of_kind("rig", self.rig, Rig, "a Rig or None"))

    def _check_rig(self, rig: Rig) -> None:
        if len(rig.root) != len(self) or len(rig.points) != len(self.skeleton):
            raise ValueError(
                f"the rig has {len(rig.root)} frames and {len(rig.points)} points; "
                f"expected {len(self)} and {len(self.skeleton)}, as the positions have"
            )
        ends = np.array([0, len(self) - 1])
        away = np.linalg.norm(rig.pick(ends).positions() - self.positions[ends], axis=-1)
        if not away.max() <= RIG_SLACK[0] + RIG_SLACK[1] * np.abs(self.positions[ends]).max():  # True for nan
            frame, joint = np.unravel_index(away.argmax(), away.shape)
            raise ValueError(
                f"the rig puts {self.skeleton.joints[joint]} {away.max():.3g} m from its position in frame {ends[frame]}; "
                "expected the same place, or rig=None"
            )

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        """One line, for a reader who looks at a motion; arrays stay out of it."""
        said = [f"{key}={text!r}" for key in ("subject", "action", "name") if (text := getattr(self, key))]
        size = f"{len(self)} frames of {len(self.skeleton)} joints, {self.skeleton.name}, {self.fps:g} Hz, up {self.up}"
        return f"Motion({', '.join([size, *said, *['with rotations'] * bool(self.rig)])})"

    @property
    def duration(self) -> float:
        """Seconds from the first to the last frame."""
        return (len(self) - 1) / self.fps

    def resample(self, fps: float) -> Motion:
        """Resample by time; every new frame lies inside the old duration, and one that falls on an old frame is that frame.

        Between frames positions are interpolated linearly; with a rig, its rotations by slerp and the positions by its
        kinematics, so that bones keep their lengths. Own choice: 120 to 60 Hz keeps every second frame exactly.

        Raises:
            ValueError: no rate that a camera has; or more than a million frames, as of a clip whose rate is wrong.
        """
        if not 0 < real("fps", fps) <= FASTEST:
            raise ValueError(f"fps is {fps:g}; expected up to {FASTEST:g} frames per second")
        if fps == self.fps:
            return self
        if not self.duration * fps <= max(MOST_FRAMES, len(self)):
            raise ValueError(
                f"{self.name or 'a clip'} has {len(self)} frames at fps {self.fps:g}, {self.duration:.3g} s; "
                f"expected at most {MOST_FRAMES} frames at {fps:g} Hz"
            )
        frames = int(np.floor(self.duration * fps + 1e-6)) + 1
        at = np.minimum(np.arange(frames) * (self.fps / fps), len(self) - 1)
        low = np.minimum(at.astype(int), max(len(self) - 2, 0))
        high = np.minimum(low + 1, len(self) - 1)
        share = (at - low).astype(self.positions.dtype)
        positions = on_the_way(self.positions, low, high, share)
        if rig := self.rig and self.rig.between(low, high, share):
            between = (share > 0) & (share < 1)
            positions[between] = rig.pick(between).positions()
        return replace(self, positions=positions, fps=fps, rig=rig)

    def root_relative(self) -> Float[np.ndarray, "T C"]:
        """Joints minus root, root dropped, flattened joint-major with xyz fastest: the model's x, metres."""
        return (self.positions[:, 1:] - self.positions[:, :1]).reshape(len(self), -1)

    def with_up(self, up: str) -> Motion:
        """Turn the axes so that `up` points up; right-handed, so left stays left.

        Raises:
            ValueError: `up` is neither "y" nor "z".
        """
        choice("up", up, AXES)
        if up == self.up:
            return self
        x, y, z = np.moveaxis(self.positions, -1, 0)
        sign = 1 if up == "z" else -1
        positions = np.stack([x, -sign * z, sign * y], axis=-1)
        quarter = np.array([0.5, 0.5 * sign, 0.0, 0.0]) * np.sqrt(2)
        return replace(self, positions=positions, up=up, rig=self.rig and self.rig.turned(quarter))

    def turn(self, angle: float) -> Motion:
        """Turn the body about the up-axis through the world's origin, the first horizontal axis towards the second; radians.

        The same turn as `turn_heading` gives to the model's x.

        Raises:
            ValueError: the angle is no finite number.
        """
        angle = real("angle", angle) * (1 if self.up == "z" else -1)  # x to z is backward about y
        by = about(tensor64(np.eye(3)[AXES[self.up]]), tensor64(angle))
        positions = rotate(by, tensor64(self.positions)).numpy().astype(self.positions.dtype)
        return replace(self, positions=positions, rig=self.rig and self.rig.turned(by.numpy()))

    def mirror(self) -> Motion:
        """The mirror image across the plane x = 0, which is upright; left and right joints are exchanged.

        Raises:
            ValueError: left and right of the rig are not built alike.
        """
        order = self.skeleton.mirror
        flip = np.array([-1, 1, 1], self.positions.dtype)
        return replace(self, positions=self.positions[:, order] * flip, rig=self.rig and self.rig.mirrored(order))

    def retarget(self, skeleton: Skeleton) -> Motion:
        """Copy corresponding joints, or points between them, to another skeleton; rotations are dropped.

        Proportions stay the performer's. Own choice: a rotation of one skeleton says nothing about the bones of another, so the
        result has no rig; `mwlib.body.fitting.fit_rig` finds rotations for its positions.

        Raises:
            ValueError: `skeleton` is none, or no correspondence is known.
        """
        if of_kind("skeleton", skeleton, Skeleton) == self.skeleton:
            return self
        if skeleton == HUMANML22 and (shares := to_humanml22(self.skeleton)) is not None:
            positions = (shares @ self.positions).astype(self.positions.dtype)
            return replace(self, positions=positions, skeleton=skeleton, rig=None)
        picked = to_h36m17(self.skeleton) if skeleton == H36M17 else None
        if picked is None:
            ways = "skeletons that say which of their joints stand for it, to H36M17 and HUMANML22; CMU's tree to H36M17"
            raise ValueError(f"cannot carry {self.skeleton.name} over to {skeleton.name}; known: {ways}")
        return replace(self, positions=self.positions[:, picked], skeleton=skeleton, rig=None)

    def cut(self, start: int, stop: int) -> Motion:
        """Frames start to stop (exclusive), or to the last one if there are fewer.

        Raises:
            ValueError: there is no frame `start`, or `stop` is not behind it.
        """
        start = whole("start", start, 0, len(self) - 1)
        stop = whole("stop", stop, start + 1)
        return replace(self, positions=self.positions[start:stop], rig=self.rig and self.rig.pick(slice(start, stop)))
