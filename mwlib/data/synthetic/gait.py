"""Walking and running as poses: foot paths as functions of the phase, joint angles by inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from mwlib.data.synthetic.person import AT, POSE, SIDES, Body


@dataclass(frozen=True)
class Gait:
    """One way of moving on two feet; lengths in leg lengths, angles in degrees, phase 0 to 1 from contact to contact.

    Args:
        cadence: cycles (two steps) per second.
        stride: length of a cycle.
        stance: share of the cycle in which the foot stays behind at constant speed.
        ahead: where the foot lands, in strides ahead of the hip.
        clearance: phases and heights of the foot joint there; the heel leaves the floor before the stance ends.
        height, bob: mean height of the hips and how much it rises over the stance leg.
        lean, swing, arm, elbow, elbow_swing, twist: trunk pitch, arm swing to either side, its mean, elbow flexion and how much
            more when the arm is in front, turn of the shoulders against the pelvis.
    """

    cadence: float
    stride: float
    stance: float
    ahead: float
    clearance: tuple[tuple[float, ...], tuple[float, ...]]
    height: float
    bob: float
    lean: float
    swing: float
    arm: float
    elbow: float
    elbow_swing: float
    twist: float

    @property
    def midstance(self) -> float:
        """Phase of the left leg at which the left foot is below the hip and the right one swings past it."""
        return self.ahead


_STEP = ((0.0, 0.06, 0.38, 0.5, 0.6, 0.7, 0.85, 0.95, 1.0), (0.015, 0.0, 0.0, 0.03, 0.1, 0.16, 0.09, 0.045, 0.015))
WALK = Gait(0.95, 1.42, 0.6, 0.26, _STEP, 0.96, 0.026, 3, 20, 0, 16, 16, 7)
MARCH = Gait(1.15, 0.08, 0.6, 0.3, _STEP, 0.985, 0.008, 2, 5, 2, 16, 5, 2)  # steps on the spot, to turn
_STRIDE = ((0.0, 0.08, 0.26, 0.36, 0.5, 0.64, 0.8, 0.92, 0.97, 1.0), (0.02, 0.0, 0.0, 0.1, 0.36, 0.42, 0.25, 0.11, 0.05, 0.02))
RUN = Gait(1.4, 2.15, 0.36, 0.165, _STRIDE, 0.93, -0.02, 11, 34, -6, 80, 25, 12)

RETRACTION = 0.05  # share of the cycle before landing in which the foot already moves with the floor, so that it does not slide


def gait_pose(gait: Gait, body: Body, phase: Float[np.ndarray, " T"], size: float = 1.0) -> Float[np.ndarray, "T pose"]:
    """Poses at the given phases of the left leg; the right leg is half a cycle later.

    In stance the foot moves back at constant speed on the floor and the hips bob over it; in swing it returns on a cubic.
    Knees follow from the cosine rule, so they only bend backward; arms swing against the legs, shoulders against the pelvis.
    Own choice: foot paths instead of tabulated joint angles, because they keep the feet on the floor for every body.

    Args:
        size: factor on the length of the step (1 = normal).
    """
    pose = np.zeros((len(phase), len(POSE)))
    turn = 2 * np.pi * phase
    high = gait.height + gait.bob * np.cos(2 * (turn - 2 * np.pi * gait.midstance)) - 0.02 * (size**2 - 1)
    clear = {}
    for side, sign in SIDES.items():
        own = (phase + (0.0 if side == "left" else 0.5)) % 1.0
        clear[side] = body.leg * np.sqrt(size) * _periodic(gait.clearance)(own)
        forward = body.leg * size * body.stride * gait.stride * _foot_path(gait)(own)
        # the foot falls inward of the hip, and the pelvis sways over the leg that stands
        sway = 0.022 * body.sway * np.sin(turn)
        side_step = np.broadcast_to(-0.045 + sign * -sway, own.shape)
        flex, abduction, knee = _leg_angles(body, forward, side_step, body.leg * high - clear[side])
        back = np.cos(2 * np.pi * own)
        swing = gait.swing * body.swing * np.sqrt(size)
        limbs = {"hip_flex": flex, "hip_abd": abduction, "knee": knee}
        limbs["arm_flex"] = np.deg2rad(gait.arm - swing * back)
        limbs["arm_abd"] = np.deg2rad(7.0 + 3.0 * (gait.elbow > 50) + 0 * own)
        limbs["arm_turn"] = np.deg2rad(-8.0 - 0.25 * gait.elbow * (1 - np.cos(2 * np.pi * own - 0.3)) / 2)
        limbs["elbow"] = np.deg2rad(gait.elbow + gait.elbow_swing * body.swing * (1 - np.cos(2 * np.pi * own - 0.4)) / 2)
        for limb, value in limbs.items():
            pose[:, AT[f"{side}_{limb}"]] = value
    pose[:, AT["lift"]] = np.minimum(clear["left"], clear["right"])
    _trunk(pose, gait, body, turn)
    return pose


def _trunk(pose: np.ndarray, gait: Gait, body: Body, turn: np.ndarray) -> None:
    """Fill in pelvis, spine and neck: they lean, roll over the standing leg and turn with the leg in front."""
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


@cache
def _foot_path(gait: Gait) -> CubicHermiteSpline:
    """Foot ahead of the hip, in strides: linear in stance and just before it lands, a cubic of matching speed in between."""
    keys = np.array([0.0, gait.stance, 1.0 - RETRACTION, 1.0])
    return CubicHermiteSpline(keys, gait.ahead - keys + (keys > gait.stance), np.full(len(keys), -1.0))


@cache
def _periodic(keys: tuple[tuple[float, ...], tuple[float, ...]]) -> PchipInterpolator:
    """Interpolate without overshoot through keys that repeat every cycle."""
    phase, value = np.array(keys)
    around = np.concatenate([phase[:-1] - 1, phase, phase[1:] + 1])
    return PchipInterpolator(around, np.concatenate([value[:-1], value, value[1:]]))


def _leg_angles(
    body: Body, forward: np.ndarray, outward: np.ndarray, down: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hip flexion, hip abduction and knee flexion that put the foot there, seen from the hip; out of reach: nearly straight."""
    thigh, shin = body.thigh, body.shin
    reach = np.minimum(np.sqrt(forward**2 + outward**2 + down**2), 0.998 * body.leg)
    knee = np.arccos(np.clip((reach**2 - thigh**2 - shin**2) / (2 * thigh * shin), -1.0, 1.0))
    along = thigh + shin * np.cos(knee)
    abduction = np.arcsin(np.clip(outward / along, -1.0, 1.0))
    flex = np.arctan2(forward, down) + np.arctan2(shin * np.sin(knee), along * np.cos(abduction))
    return flex, abduction, knee
