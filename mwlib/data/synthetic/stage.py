"""A clip under construction: what the legs do, gestures over it, and where the body heads, with nothing left to chance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from mwlib.data.synthetic.figure import Figure, figure_positions
from mwlib.data.synthetic.gait import MARCH, RUN, WALK, gait_pose
from mwlib.data.synthetic.gestures import gesture_tracks, stand_pose
from mwlib.data.synthetic.person import AT, Body
from mwlib.data.synthetic.script import involuntary, smooth_rise

RATE = 40.0  # frames per second at which poses are made; every second one is kept
CLIP_FPS = 20.0
LONGEST = 6.1  # seconds
GRAVITY = 9.81  # m/s2

_GAITS = {"walk": WALK, "run": RUN, "march": MARCH}
_LARGEST_STEP = {"walk": 1.15, "run": 1.25, "march": 1.15}  # in usual steps: beyond it no leg reaches
_BEFORE = 12  # frames made before the clip and cut off


def air_time(height: float) -> float:
    """Seconds from take-off to landing of a jump that rises so many metres."""
    return float(2 * np.sqrt(2 * height / GRAVITY))


class Stage:
    """Poses of one person, 40 frames a second: every event overlays what it sets on what was going on before.

    Args:
        figure: who moves.
        rng: for what nobody does on purpose.
    """

    def __init__(self, figure: Figure, rng: np.random.Generator) -> None:
        self.figure, self.rng = figure, rng
        frames = int(LONGEST * RATE) + 2 * _BEFORE
        self.time = (np.arange(frames) - _BEFORE) / RATE
        self.pose = np.tile(stand_pose(), (frames, 1))
        self.heading, self.travel = np.zeros(frames), np.zeros((frames, 2))
        self._gestures: list[tuple[list[int], np.ndarray, np.ndarray]] = []
        self._since, self._step = 0.0, 0.0  # when a foot swung past the other, and seconds until the other does

    @property
    def body(self) -> Body:
        """Bones and manner of who moves."""
        return self.figure.body

    def rise(self, start: float, seconds: float) -> Float[np.ndarray, " T"]:
        """0 before start, 1 after start + seconds."""
        return smooth_rise(self.time, start, seconds)

    def go(self, gait: Literal["walk", "run", "march"], at: float, speed: float | None = None, backward: bool = False) -> None:
        """Set off, or go on in another way, at this speed (m/s; None: steps of the usual size at the usual rate).

        Faster walkers take longer and more steps: both grow with a power of the speed, until the leg is too short.
        """
        kind, body = _GAITS[gait], self.body
        usual = kind.cadence * kind.stride * body.leg * body.stride
        ratio = 1.0 if speed is None else speed / usual
        size = min(ratio**0.55, _LARGEST_STEP[gait] / body.stride)
        cadence = kind.cadence * ratio / size
        phase = kind.midstance + 0.5 * (self.rng.random() < 0.5) + (-1 if backward else 1) * cadence * (self.time - at)
        pose = gait_pose(kind, body, phase, size)
        self._since, self._step = at, 0.5 / cadence
        self.pose += self.rise(at - 0.05, self.rng.uniform(0.25, 0.4))[:, None] * (pose - self.pose)

    def halt(self, at: float) -> float:
        """Stand from the next moment at which a foot swings past the other; returns when that is."""
        at = self._since + np.ceil((at - self._since) / self._step) * self._step
        self.pose += self.rise(at - 0.05, self.rng.uniform(0.25, 0.35))[:, None] * (stand_pose() - self.pose)
        return at

    def turn(self, at: float, angle: float, seconds: float) -> None:
        """Change the heading by so many radians, to the left where positive."""
        self.heading += angle * self.rise(at, seconds)

    def curve(self, rate: float) -> None:
        """Change the heading all the time, radians per second."""
        self.heading += rate * self.time

    def gesture(
        self,
        name: str,
        near: str,
        at: float,
        seconds: float,
        onset: float,
        share: Float[np.ndarray, " T"] | None = None,
        scale: Mapping[str, float] | None = None,
    ) -> None:
        """Lay a gesture over whatever goes on.

        Args:
            near: the acting side.
            seconds: until it is over.
            onset: seconds over which it takes over, and later lets go.
            share: how far it has come at every frame, 0 to 1; None: it passes once, evenly.
            scale: what to multiply a limb's angles with, "hip_flex" or "near_hip_flex".
        """
        share = (self.time - at) / seconds if share is None else share
        entries, values = gesture_tracks(name, near, share)
        for limb, factor in (scale or {}).items():
            limb = limb.replace("near", near)
            for side in ("", "left_", "right_"):
                if (entry := AT.get(side + limb)) in entries:
                    values[:, entries.index(entry)] *= factor
        self.overlay(entries, values, at, seconds, onset)

    def overlay(self, entries: list[int], values: Float[np.ndarray, "T tracks"], at: float, seconds: float, onset: float) -> None:
        """Lay values over these entries of the pose, from `at` on, for so many seconds; later ones cover earlier ones."""
        self._gestures.append((entries, values, self.rise(at - onset / 2, onset) - self.rise(at + seconds - onset, 1.3 * onset)))

    def fly(self, at: float, height: float, forward: float = 0.0) -> None:
        """Leave the floor at this moment, rise so high (metres), and go ahead at so many metres per second until it lands."""
        seconds = air_time(height)
        share = np.clip((self.time - at) / seconds, 0.0, 1.0)
        self.overlay([AT["lift"]], (4 * height * share * (1 - share))[:, None], at, seconds + 0.02, 0.02)
        ahead = np.stack([np.cos(self.heading), np.sin(self.heading)], axis=-1)
        self.travel += gaussian_filter1d(forward * seconds * share, 0.05 * RATE)[:, None] * ahead

    def film(self, seconds: float) -> Float[np.ndarray, "T 22 3"]:
        """Positions from time 0 on, metres, y up, 20 frames a second; the first frame stands over the origin and faces +z."""
        pose = self.pose.copy()
        for entries, values, weight in self._gestures:
            pose[:, entries] += weight[:, None] * (values - pose[:, entries])
        end = 2 * _BEFORE + int(round(seconds * RATE))
        pose = involuntary(pose[:end], self.heading[:end], self.body, self.rng, RATE)
        heading = self.heading[:end] - self.heading[_BEFORE]
        positions = figure_positions(pose, heading, self.figure, RATE, self.travel[:end])[_BEFORE : end - _BEFORE + 1 : 2]
        return positions - positions[0, 0] * [1.0, 0.0, 1.0]
