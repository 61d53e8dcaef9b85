"""Gaits and gestures as poses of a synthetic person, and tracks of poses that they are laid on.

Gaits are foot paths as functions of the phase, with joint angles by inverse kinematics; gestures are tables of key poses.
"""

import re
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from mwlib.synthetic.person import AT, FPS, POSE, SIDES, Body, PerFrame, Poses

Tracks = Float[np.ndarray, "*T tracks"]


class Gait(NamedTuple):
    """One way of moving on two feet; lengths in leg lengths, angles in degrees, phase 0 to 1 from contact to contact.

    Args:
        clearance: phases, and heights of the foot joint there; the heel leaves the floor before the stance ends.
        cadence: cycles (two steps) per second.
        stride: length of a cycle.
        stance: share of the cycle in which the foot stays behind at constant speed.
        ahead: where the foot lands, in strides ahead of the hip; also the phase of the left leg at which the left foot is below
            the hip and the right one swings past it.
        height, bob: mean height of the hips and how much it rises over the stance leg.
        lean, swing, arm, elbow, elbow_swing, twist: trunk pitch, arm swing to either side, its mean, elbow flexion and how much
            more when the arm is in front, turn of the shoulders against the pelvis.
    """

    clearance: tuple[str, str]
    cadence: float
    stride: float
    stance: float
    ahead: float
    height: float
    bob: float
    lean: float
    swing: float
    arm: float
    elbow: float
    elbow_swing: float
    twist: float


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split()))


_STEP = "0 0.06 0.38 0.5 0.6 0.7 0.85 0.95 1", "0.015 0 0 0.03 0.1 0.16 0.09 0.045 0.015"
_STRIDE = "0 0.08 0.26 0.36 0.5 0.64 0.8 0.92 0.97 1", "0.02 0 0 0.1 0.36 0.42 0.25 0.11 0.05 0.02"
WALK = Gait(_STEP, *_numbers("0.95 1.42 0.6 0.26 0.96 0.026 3 20 0 16 16 7"))
MARCH = Gait(_STEP, *_numbers("1.15 0.08 0.6 0.3 0.985 0.008 2 5 2 16 5 2"))  # steps on the spot, to turn
RUN = Gait(_STRIDE, *_numbers("1.4 2.15 0.36 0.165 0.93 -0.02 11 34 -6 80 25 12"))
GAITS = {"walk": WALK, "run": RUN, "march": MARCH}

RETRACTION = 0.05  # share of the cycle before landing in which the foot already moves with the floor, so that it does not slide


def gait_pose(gait: Gait, body: Body, phase: PerFrame, size: float = 1.0) -> Poses:
    """Poses at the given phases of the left leg; the right leg is half a cycle later.

    In stance the foot moves back at constant speed on the floor and the hips bob over it; in swing it returns on a cubic.
    Knees follow from the cosine rule, so they only bend backward; arms swing against the legs, shoulders against the pelvis.
    Own choice: foot paths instead of tabulated joint angles, because they keep the feet on the floor for every body.

    Args:
        size: factor on the length of the step (1 = normal).
    """
    pose = np.zeros((len(phase), len(POSE)))
    turn = 2 * np.pi * phase
    high = gait.height + gait.bob * np.cos(2 * (turn - 2 * np.pi * gait.ahead)) - 0.02 * (size**2 - 1)
    clear = {}
    for side, sign in SIDES.items():
        own = (phase + (0.0 if side == "left" else 0.5)) % 1.0
        clear[side] = body.leg * np.sqrt(size) * _periodic(gait.clearance)(own)
        forward = body.leg * size * body.stride * gait.stride * _foot_path(gait)(own)
        # the foot falls inward of the hip, and the pelvis sways over the leg that stands
        outward = -0.045 - sign * (0.022 * body.sway * np.sin(turn))
        flex, abduction, knee = _leg_angles(body, forward, outward, body.leg * high - clear[side])
        back = np.cos(2 * np.pi * own)
        swing = gait.swing * body.swing * np.sqrt(size)
        limbs = {
            "hip_flex": flex,
            "hip_abd": abduction,
            "knee": knee,
            "arm_flex": np.deg2rad(gait.arm - swing * back),
            "arm_abd": np.deg2rad(7.0 + 3.0 * (gait.elbow > 50)),
            "arm_turn": np.deg2rad(-8.0 - 0.25 * gait.elbow * (1 - np.cos(2 * np.pi * own - 0.3)) / 2),
            "elbow": np.deg2rad(gait.elbow + gait.elbow_swing * body.swing * (1 - np.cos(2 * np.pi * own - 0.4)) / 2),
        }
        for limb, value in limbs.items():
            pose[:, AT[f"{side}_{limb}"]] = value
    pose[:, AT["lift"]] = np.minimum(clear["left"], clear["right"])
    # the trunk leans, rolls over the standing leg and turns with the leg in front
    twist = gait.twist * body.sway
    trunk = {
        "pelvis_pitch": 0.45 * gait.lean,
        "pelvis_roll": -2.5 * body.sway * np.sin(turn),
        "pelvis_yaw": -0.6 * twist * np.cos(turn),
        "spine_pitch": 0.55 * gait.lean + 1.2 * np.cos(2 * turn - 0.5),
        "spine_roll": 4.0 * body.sway * np.sin(turn),
        "spine_yaw": 1.6 * twist * np.cos(turn),
        "neck_pitch": -0.5 * gait.lean,
    }
    for name, degrees in trunk.items():
        pose[:, AT[name]] = np.deg2rad(degrees)
    return pose


@cache
def _foot_path(gait: Gait) -> CubicHermiteSpline:
    """Foot ahead of the hip, in strides: linear in stance and just before it lands, a cubic of matching speed in between."""
    keys = np.array([0.0, gait.stance, 1.0 - RETRACTION, 1.0])
    return CubicHermiteSpline(keys, gait.ahead - keys + (keys > gait.stance), np.full(len(keys), -1.0))


@cache
def _periodic(keys: tuple[str, str]) -> PchipInterpolator:
    """Interpolate without overshoot through keys that repeat every cycle."""
    phase, value = np.array([*map(_numbers, keys)])
    around = np.concatenate([phase[:-1] - 1, phase, phase[1:] + 1])
    return PchipInterpolator(around, np.concatenate([value[:-1], value, value[1:]]))


def _leg_angles(body: Body, forward: PerFrame, outward: PerFrame, down: PerFrame) -> tuple[PerFrame, PerFrame, PerFrame]:
    """Hip flexion, hip abduction and knee flexion that put the foot there, seen from the hip; out of reach: nearly straight."""
    thigh, shin = body.thigh, body.shin
    reach = np.minimum(np.sqrt(forward**2 + outward**2 + down**2), 0.998 * body.leg)
    knee = np.arccos(np.clip((reach**2 - thigh**2 - shin**2) / (2 * thigh * shin), -1.0, 1.0))
    along = thigh + shin * np.cos(knee)
    abduction = np.arcsin(np.clip(outward / along, -1.0, 1.0))
    flex = np.arctan2(forward, down) + np.arctan2(shin * np.sin(knee), along * np.cos(abduction))
    return flex, abduction, knee


class Gesture(NamedTuple):
    """Key values spread evenly over the duration, interpolated without overshoot; pose entries not named are left alone.

    Args:
        tracks: pose entry -> key values, degrees (`lift`: metres). Limbs are `near_` (the acting side), `far_` or `both_`.
        seconds: duration at tempo 1.
        onset: seconds over which the gesture takes over, and later lets go.
    """

    tracks: dict[str, tuple[float, ...]]
    seconds: float
    onset: float


def _read(table: str) -> dict[str, Gesture]:
    """Lines of "name: seconds onset", each with indented lines of tracks below it: an entry and its keys, parted by bars."""
    found = {}
    for name, times, lines in re.findall(r"(\w+): (.*)((?:\n +.*)+)", table):
        tracks = (track.split(maxsplit=1) for track in re.split(r"[|\n]", lines.strip()))
        found[name] = Gesture({entry: _numbers(keys) for entry, keys in tracks}, *_numbers(times))
    return found


GESTURES = _read("""
wave: 1.8 0.2
  near_arm_flex 10 15 15 | near_arm_abd 80 92 92 90 | near_arm_turn 60 75 75 | near_elbow 105 65 110 62 108 64 110 66 108
  spine_roll -3 -5 -4 | neck_roll 4
box: 1.6 0.28
  near_hip_flex 48 24 24 24 24 24 24 24 40 | near_knee 70 20 20 20 20 20 20 20 60 | far_hip_flex -6 | far_knee 24
  near_hip_abd 5 | far_hip_abd 7 | spine_pitch 10 | neck_pitch 4 | spine_yaw 0 0 -16 0 18 0 0 -16 0 0
  near_arm_flex 46 46 84 48 46 46 48 86 48 46 | near_elbow 126 128 12 115 128 128 126 10 115 126
  near_arm_abd 8 8 -6 8 8 8 8 -6 8 8 | near_arm_turn -25 | far_arm_flex 46 46 46 48 86 50 46 46 46 46
  far_elbow 126 128 130 124 10 114 130 130 126 126 | far_arm_abd 8 8 8 8 -14 8 8 8 8 8 | far_arm_turn -25
kick: 1.3 0.15
  near_hip_flex 0 -22 -6 82 62 20 0 | near_knee 12 45 72 8 50 48 10 | near_hip_abd 2 3 2 2 4 3 3 | far_hip_flex 5 7 8 2 5 6 5
  far_knee 10 16 18 14 14 14 10 | far_hip_abd 0 -2 -2 -2 -2 0 1 | pelvis_pitch 0 6 4 -12 -6 0 0 | spine_pitch 4 8 8 8 6 4 2
  near_arm_flex 0 30 20 -35 -25 -5 0 | near_arm_abd 15 25 30 42 35 20 10 | near_elbow 20 40 40 30 30 20 15
  far_arm_flex 0 -25 -15 50 35 10 0 | far_arm_abd 15 25 30 35 30 20 10 | far_elbow 20 30 40 50 45 30 15
jump: 1.6 0.2
  both_hip_flex 5 25 50 54 40 4 8 18 14 12 34 40 28 12 6 4 | both_knee 10 48 88 94 66 7 14 30 24 20 62 70 48 22 10 8
  both_arm_flex 0 -30 -45 -30 25 90 130 145 130 100 65 40 25 10 4 2 | both_elbow 15 20 25 30 45 25 20 25 30 40 45 40 30 20 15 15
  both_arm_abd 10 14 18 18 14 14 18 22 24 24 24 22 18 12 10 8 | pelvis_pitch 0 12 24 25 16 2 0 2 4 6 14 16 10 4 1 0
  spine_pitch 2 8 14 14 8 0 0 2 4 6 12 12 8 4 2 2 | lift 0 0 0 0 0 0.02 0.21 0.3 0.29 0.19 0 0 0 0 0 0
sit: 3.4 0.3
  both_hip_flex 8 66 84 85 85 85 84 62 8 | both_knee 14 88 94 92 92 92 96 86 14 | both_hip_abd 3 6 8 8 8 8 8 6 3
  both_arm_flex 0 30 32 28 28 28 36 34 0 | both_elbow 15 30 55 62 62 62 50 28 15
  both_arm_turn -10 -15 -20 -20 -20 -20 -20 -15 -10 | pelvis_pitch 4 26 8 0 0 2 22 28 4 | spine_pitch 4 24 12 6 5 6 22 24 4
  neck_pitch 2 -12 0 2 2 2 -10 -12 2
pick_up: 2.2 0.22
  near_hip_flex 10 54 80 76 46 8 | near_knee 18 84 112 106 70 12 | near_hip_abd 3 6 8 8 6 3 | far_hip_flex 6 44 66 62 36 6
  far_knee 14 80 108 102 66 12 | far_hip_abd 3 6 8 8 6 3 | pelvis_pitch 4 28 42 40 22 2 | spine_pitch 6 26 38 36 18 4
  spine_roll 0 4 8 8 3 0 | neck_pitch 0 -10 -15 -14 -6 0 | near_arm_flex 10 50 78 76 46 30 | near_elbow 20 18 8 12 60 80
  near_arm_abd 6 8 4 4 6 6 | far_arm_flex 0 20 30 30 12 0 | far_elbow 20 50 70 70 40 18
reach: 1.7 0.2
  near_arm_flex 20 95 138 142 110 30 | near_elbow 50 70 14 12 70 60 | near_arm_abd 6 4 2 2 6 8 | near_arm_turn -10
  spine_pitch 2 0 -3 -3 0 2 | spine_roll 0 -4 -8 -8 -3 0 | spine_yaw 0 | neck_pitch 0 -12 -20 -18 -8 0
direct: 2.4 0.16
  near_arm_flex 80 88 88 84 30 6 6 6 | near_arm_abd 0 0 0 20 70 90 92 90 | near_arm_turn 0 0 0 0 10 10
  near_elbow 60 12 8 8 10 8 6 8 | far_arm_flex 5 5 10 60 70 70 70 70 | far_arm_abd 8 8 10 15 10 10 10 10
  far_arm_turn -10 -10 0 20 20 | far_elbow 20 25 40 60 120 60 120 60 | neck_roll 0
""")
CAPTIONED = _read("""
squat: 1.5 0.2
  both_hip_flex 6 40 88 96 88 40 6 | both_knee 12 56 110 118 110 56 12 | both_hip_abd 3 6 10 10 10 6 3
  pelvis_pitch 2 14 28 30 28 14 2 | spine_pitch 2 6 10 10 10 6 2 | neck_pitch 0 -8 -16 -18 -16 -8 0
  both_arm_flex 4 50 104 112 104 50 4 | both_elbow 15 18 12 10 12 18 15 | both_arm_abd 8 6 4 4 4 6 8
bow: 2 0.2
  both_hip_flex 4 3 0 0 3 4 | both_knee 8 8 6 6 8 8 | pelvis_pitch 0 24 46 46 24 0 | spine_pitch 2 20 36 36 20 2
  neck_pitch 2 8 14 14 8 2 | both_arm_flex 1 14 28 28 14 1
punch: 0.62 0.3
  near_hip_flex 22 | near_knee 20 | far_hip_flex -6 | far_knee 24 | near_hip_abd 5 | far_hip_abd 7 | spine_pitch 8
  neck_pitch 4 | spine_yaw 2 2 -10 -20 -10 0 2 | near_arm_flex 48 47 70 88 72 50 48 | near_elbow 126 127 70 8 60 118 126
  near_arm_abd 8 8 0 -8 0 8 8 | near_arm_turn -25 | far_arm_flex 48 | far_elbow 128 | far_arm_abd 8 | far_arm_turn -25
reach_forward: 1.7 0.2
  near_arm_flex 15 60 84 86 60 20 | near_elbow 40 70 12 8 60 40 | near_arm_abd 6 3 0 0 3 8 | near_arm_turn -10
  spine_pitch 2 8 18 18 8 2 | spine_yaw 0 -6 -16 -16 -6 0 | neck_pitch 0 -2 -8 -8 -2 0
stand: 1 0
  both_hip_flex 4 | both_hip_abd 2 | both_knee 8 | both_arm_flex 1 | both_arm_abd 8 | both_arm_turn -10 | both_elbow 15
  spine_pitch 2 | neck_pitch 2
""")  # gestures of the captioned set alone, and the pose under all others
_TABLES = GESTURES | CAPTIONED


def stand_pose() -> Poses:
    """Standing at ease, arms hanging."""
    entries, values = gesture_tracks("stand", "left", np.zeros(1))
    pose = np.zeros(len(POSE))
    pose[entries] = values[0]
    return pose


def gesture_tracks(name: str, near: str, share: PerFrame) -> tuple[list[int], Tracks]:
    """The entries of the pose that a gesture sets, and their values.

    Args:
        near: the acting side, "left" or "right".
        share: time as a share of the duration; clamped to 0 to 1.
    """
    far = "right" if near == "left" else "left"
    sides = {"near": (near,), "far": (far,), "both": (near, far)}
    share = np.clip(share, 0.0, 1.0)
    found: dict[int, Any] = {}
    for track, curve in _curves(name).items():
        unit = 1.0 if track == "lift" else np.deg2rad(1.0)
        if track.endswith(("_roll", "_yaw")):
            unit *= SIDES[near]  # the tables roll and turn the trunk as the left hand would
        who, _, limb = track.partition("_")
        names = [f"{side}_{limb}" for side in sides[who]] if who in sides else [track]
        found |= dict.fromkeys([AT[name] for name in names], unit * curve(share))
    return [*found], np.stack([*found.values()], axis=1)


@cache
def _curves(name: str) -> dict[str, PchipInterpolator]:
    """Every track of a gesture as a function of the share of its duration; a single key is held."""
    tracks = {track: keys if len(keys) > 1 else keys * 2 for track, keys in _TABLES[name].tracks.items()}
    return {track: PchipInterpolator(np.linspace(0.0, 1.0, len(keys)), keys) for track, keys in tracks.items()}


NOISE_FRAMES = 16.0  # standard deviation of the smoothing: involuntary movement below about half a hertz
NOISE = np.deg2rad([0.5 if "hip" in name or "knee" in name else 0.0 if name == "lift" else 1.6 for name in POSE])


class PoseTrack:
    """Poses of a clip under construction: every event overlays what it sets on what was going on before.

    Args:
        body: who moves.
        rng: for everything left to chance.
        frames: of the clip.
        margin: frames made before and after the clip, to be cut off.
        fps: frames per second.
    """

    def __init__(self, body: Body, rng: np.random.Generator, frames: int, margin: int, fps: float) -> None:
        self.body, self.rng, self.fps = body, rng, fps
        self.time = (np.arange(frames + 2 * margin) - margin) / fps
        self.pose = np.tile(stand_pose(), (len(self.time), 1))
        self.heading = np.zeros(len(self.time))
        self._gestures: list[tuple[list[int], Tracks, PerFrame]] = []

    def rise(self, start: float, seconds: float) -> PerFrame:
        """0 before start, 1 after start + seconds, with zero slope and curvature at both ends."""
        share = np.clip((self.time - start) / seconds, 0.0, 1.0)
        return share**3 * (10 - 15 * share + 6 * share**2)

    def change_to(self, pose: Poses, at: float, seconds: float) -> None:
        """Go over to another pose, or row of poses, within so many seconds."""
        self.pose += self.rise(at - 0.05, seconds)[:, None] * (pose - self.pose)

    def overlay(self, entries: list[int], values: Tracks, at: float, seconds: float, onset: float) -> None:
        """Lay values, or a row for each frame, over these entries of the pose from `at` on, for so many seconds.

        Later ones cover earlier ones.
        """
        self._gestures.append((entries, values, self.rise(at - onset / 2, onset) - self.rise(at + seconds - onset, 1.3 * onset)))

    def finished(self, end: int | None = None) -> Poses:
        """The first `end` frames (None: all): gestures over legs, then what nobody does on purpose.

        That is a posture, leading with the shoulders into a turn, swaying, and trembling.
        """
        for entries, values, weight in self._gestures:
            self.pose[:, entries] += weight[:, None] * (values - self.pose[:, entries])
        pose = self.pose[:end] + self.body.posture
        turning = np.gradient(self.heading[:end]) * self.fps
        for name, share in (("spine_yaw", 0.07), ("spine_roll", 0.02), ("pelvis_roll", 0.01)):
            pose[:, AT[name]] += share * turning
        frames = NOISE_FRAMES * self.fps / FPS
        noise = gaussian_filter1d(self.rng.normal(size=pose.shape), frames, axis=0, mode="reflect")
        noise *= np.sqrt(2 * np.sqrt(np.pi) * frames) * self.body.liveliness
        shift = np.deg2rad(1.8) * noise[:, AT["lift"]]  # the weight goes from leg to leg: both tilt the same way
        pose += NOISE * noise
        for side, sign in SIDES.items():
            pose[:, AT[f"{side}_hip_abd"]] += sign * shift
        bent = [AT[f"{side}_{joint}"] for side in SIDES for joint in ("knee", "elbow")]
        pose[:, bent] = np.maximum(pose[:, bent], np.deg2rad(2.0))
        return gaussian_filter1d(pose, 1.2 * self.fps / FPS, axis=0, mode="nearest")  # rounds the corners left by keys and limits
