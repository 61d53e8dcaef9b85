"""What of a clip of joint positions tells actions apart: heights, speeds and angles over time, in the body's own frame."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from mwlib.body.skeleton import HUMANML22

SIDES = ("left", "right")
_AT = {name: joint for joint, name in enumerate(HUMANML22.joints)}


class BodySignals:
    """Signals of one clip, each a row of T values or one per side (left, right).

    Args:
        positions: (T, 22, 3) metres, y up, on the joints of HumanML3D.
        fps: frames per second.

    Raises:
        ValueError: another shape, fewer than half a second, or positions that are not finite.
    """

    def __init__(self, positions: Float[np.ndarray, "T J 3"], fps: float) -> None:
        if positions.shape[1:] != (len(HUMANML22), 3) or len(positions) < fps / 2:
            raise ValueError(f"positions have shape {positions.shape}; expected (T, 22, 3) with at least {fps / 2:g} frames")
        if not np.isfinite(positions).all():
            raise ValueError("positions hold values that are not finite; expected metres")
        self.positions, self.fps = np.asarray(positions, float), fps

    def joint(self, name: str) -> Float[np.ndarray, "T 3"]:
        """Positions of one joint."""
        return self.positions[:, _AT[name]]

    def both(self, name: str) -> Float[np.ndarray, "2 T 3"]:
        """Positions of a joint of the left and of the right side."""
        return np.stack([self.joint(f"{side}_{name}") for side in SIDES])

    def smooth(self, values: np.ndarray, seconds: float) -> np.ndarray:
        """Gaussian average over time (the first axis) of this standard deviation."""
        return gaussian_filter1d(values, seconds * self.fps, axis=0, mode="nearest")

    @cached_property
    def leg(self) -> float:
        """Metres from hip to ankle with the knee straight."""
        hip, knee, ankle = (self.both(joint) for joint in ("hip", "knee", "ankle"))
        return float(np.median(np.linalg.norm(hip - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)))

    @cached_property
    def forward(self) -> Float[np.ndarray, "T 3"]:
        """Unit vector along the floor to where hips and shoulders face."""
        left = sum((np.subtract(*self.both(joint)) for joint in ("hip", "shoulder")), np.zeros(3))
        ahead = np.cross(left, [0.0, 1.0, 0.0])
        return ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)

    @cached_property
    def facing(self) -> Float[np.ndarray, " T"]:
        """Where hips and shoulders face, degrees, growing to the left, without jumps."""
        return np.rad2deg(np.unwrap(np.arctan2(self.forward[:, 0], self.forward[:, 2])))

    @cached_property
    def heading(self) -> Float[np.ndarray, " T"]:
        """`facing`, smoothed over a step."""
        return self.smooth(self.facing, 0.2)

    @cached_property
    def velocity(self) -> Float[np.ndarray, "T 3"]:
        """Of the root along the floor, metres per second, smoothed over a tenth of a second."""
        root = self.smooth(self.joint("pelvis") * [1.0, 0.0, 1.0], 0.1)
        return np.gradient(root, axis=0) * self.fps

    @cached_property
    def ankles(self) -> Float[np.ndarray, "2 T"]:
        """Height of the ankles over where they are on the floor, metres."""
        height = self.both("ankle")[..., 1]
        return height - height.min()

    @cached_property
    def wrists(self) -> Float[np.ndarray, "2 T"]:
        """Height of the wrists over the shoulder of their side, metres."""
        return self.both("wrist")[..., 1] - self.both("shoulder")[..., 1]

    @cached_property
    def extension(self) -> Float[np.ndarray, "2 T"]:
        """Distance of the wrist from its shoulder as a share of the arm's length."""
        shoulder, elbow, wrist = (self.both(joint) for joint in ("shoulder", "elbow", "wrist"))
        arm = np.linalg.norm(shoulder - elbow, axis=-1) + np.linalg.norm(elbow - wrist, axis=-1)
        return np.linalg.norm(wrist - shoulder, axis=-1) / np.maximum(arm, 1e-9)

    def ahead(self, joint: str) -> Float[np.ndarray, "2 T"]:
        """How far a joint of either side is ahead of the root, metres."""
        return np.sum((self.both(joint) - self.joint("pelvis")) * self.forward, axis=-1)

    def upright(self, joint: str) -> Float[np.ndarray, " T"]:
        """Height of a joint over the lower ankle as a share of its height when the body stands."""
        height = self.joint(joint)[:, 1] - self.both("ankle")[..., 1].min(axis=0)
        return height / np.maximum(np.quantile(height, 0.95), 1e-9)

    @cached_property
    def moving(self) -> Bool[np.ndarray, " T"]:
        """Whether root and feet get somewhere within the second around."""
        feet = self.both("ankle").mean(axis=0)
        far = [self._covered(places) for places in (self.joint("pelvis"), feet)]
        return (far[0] > 0.36) & (far[1] > 0.3)

    def _covered(self, places: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, " T"]:
        """Metres along the floor within the second around, scaled up where the clip ends sooner."""
        half, last = int(self.fps / 2), len(places) - 1
        frames = np.arange(len(places))
        first, end = np.maximum(frames - half, 0), np.minimum(frames + half, last)
        apart = (places[end] - places[first])[:, [0, 2]]
        return np.linalg.norm(apart, axis=-1) * 2 * half / (end - first)

    def spells(self, happens: Bool[np.ndarray, " T"], shortest: float, gap: float = 0.0) -> list[slice]:
        """Runs of frames in which something happens for at least so many seconds; interruptions up to `gap` seconds count."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], happens, [False]]).astype(int)))
        runs = edges.reshape(-1, 2).tolist()
        joined: list[list[int]] = []
        for start, stop in runs:
            if joined and start - joined[-1][1] <= gap * self.fps:
                joined[-1][1] = stop
            else:
                joined.append([start, stop])
        return [slice(start, stop) for start, stop in joined if stop - start >= shortest * self.fps]

    def around(self, spells: list[slice], seconds: float) -> Bool[np.ndarray, " T"]:
        """Frames within so many seconds of any of these spells."""
        near = np.zeros(len(self.positions), bool)
        for spell in spells:
            near[max(0, int(spell.start - seconds * self.fps)) : int(spell.stop + seconds * self.fps)] = True
        return near
