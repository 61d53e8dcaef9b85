"""A synthetic person on the 22 joints of HumanML3D: the poses of 17 joints, and spine, collar bones and toes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.skeleton import H36M17, HUMANML22
from mwlib.data.synthetic.person import AT, SIDES, Body, draw_body, joint_angles, root_path

ANKLES = [HUMANML22.joints.index(f"{side}_ankle") for side in SIDES]
TOES = [HUMANML22.joints.index(f"{side}_foot") for side in SIDES]
LARGEST_PITCH = np.deg2rad(65.0)  # of a foot whose toes point down
LEAST_PITCH = np.deg2rad(-22.0)  # of a foot whose toes point up
SCAPULA = 0.12  # share of the arm's elevation by which the collar bone rises

_SPINE = ("spine1", "spine2", "spine3")
_STANDS = 0.012  # metres: an ankle no higher above its height in stance belongs to a foot that stands
_FLAT = 0.035  # metres: from here on a foot may hold its toes up as far as it can


@dataclass(frozen=True)
class Figure:
    """A body on 22 joints.

    Args:
        body: the person, with the manner in which it moves.
        offsets: (22, 3) metres, joint from parent in the rest pose: x forward, y left, z up. Both feet stand flat in it.
    """

    body: Body
    offsets: Float[np.ndarray, "joints 3"]


def draw_figure(rng: np.random.Generator) -> Figure:
    """A random adult, built around `draw_body`.

    Own choice: the legs and arms are the body's own; the trunk is parted as in SMPL's mean body, hips and shoulders are a
    little narrower than in Human3.6M's marker model, and the foot's length is that of an adult of this leg length.
    """
    body = draw_body(rng)
    old, at = H36M17.joints.index, HUMANML22.joints.index
    trunk = body.offsets[old("spine"), 2] + body.offsets[old("thorax"), 2]
    shoulder, hip = (body.offsets[old(f"left_{joint}"), 1] for joint in ("shoulder", "hip"))
    foot = body.leg * rng.uniform(0.15, 0.17)
    offsets = np.zeros((len(HUMANML22), 3))
    for joint, forward, up in (("spine1", -0.03, 0.24), ("spine2", 0.02, 0.27), ("spine3", 0.02, 0.11), ("neck", -0.03, 0.44)):
        offsets[at(joint)] = forward * trunk, 0.0, up * trunk
    offsets[at("head")] = body.offsets[old("neck")] * [1.2, 1.0, 1.0]
    for side, sign in SIDES.items():
        offsets[at(f"{side}_hip")] = 0.0, sign * 0.72 * hip, -0.1 * trunk
        offsets[at(f"{side}_knee"), 2] = -body.thigh
        offsets[at(f"{side}_ankle"), 2] = -body.shin
        offsets[at(f"{side}_foot")] = 0.9 * foot, sign * 0.12 * foot, -0.4 * foot
        offsets[at(f"{side}_collar")] = 0.0, sign * 0.46 * shoulder, 0.26 * trunk
        offsets[at(f"{side}_shoulder")] = -0.01, sign * 0.74 * shoulder, 0.04 * trunk
        offsets[at(f"{side}_elbow")] = body.offsets[old(f"{side}_elbow")]
        offsets[at(f"{side}_wrist")] = body.offsets[old(f"{side}_wrist")]
    return Figure(body, offsets)


def figure_positions(
    pose: Float[np.ndarray, "T pose"],
    heading: Float[np.ndarray, " T"],
    figure: Figure,
    fps: float,
    travel: Float[np.ndarray, "T 2"] | None = None,
) -> Float[np.ndarray, "T joints 3"]:
    """World positions of 22 joints, metres, y up, the person's left at +x while it faces +z; the toes of a foot that stands at 0.

    The root follows from the feet as in `positions_of`. A foot that stands keeps its direction while the body turns above it.

    Args:
        pose: rows of `POSE`; `lift` is the height of the lower foot.
        heading: radians, 0 faces +z, positive turns to the left: counterclockwise seen from above.
        fps: frames per second.
        travel: metres forward and to the left, in the world, that the body covers besides, in flight.
    """
    turns = _local_turns(joint_angles(pose, HUMANML22, _SPINE))
    pelvis = turns[:, 0].copy()
    for side in SIDES:  # leg angles are measured against the upright
        hip = HUMANML22.joints.index(f"{side}_hip")
        turns[:, hip] = np.swapaxes(pelvis, -1, -2) @ turns[:, hip]
    turns[:, 0] = _local_turns(np.stack([0 * heading, 0 * heading, heading], axis=-1)) @ pelvis
    joints = forward_kinematics(turns, figure.offsets, np.zeros((len(pose), 3)), HUMANML22)
    joints += root_path(joints[:, ANKLES], pose[:, AT["lift"]], fps)[:, None]
    if travel is not None:
        joints[..., :2] += travel[:, None]
    joints[:, TOES] = joints[:, ANKLES] + _feet(joints, heading, figure)
    joints[..., 2] -= figure.offsets[TOES[0], 2]
    return joints[..., [1, 2, 0]]


def _local_turns(angles: Float[np.ndarray, "*axes 3"]) -> Float[np.ndarray, "*axes 3 3"]:
    """Rotation matrices for angles about y, then x, then z, moving axes; arms lift their collar bones."""
    angles = angles.copy()
    if angles.ndim == 3:
        for side, sign in SIDES.items():
            collar, shoulder = (HUMANML22.joints.index(f"{side}_{joint}") for joint in ("collar", "shoulder"))
            angles[:, collar, 1] = sign * SCAPULA * np.linalg.norm(angles[:, shoulder, :2], axis=-1)
    (cy, cx, cz), (sy, sx, sz) = np.moveaxis(np.cos(angles), -1, 0), np.moveaxis(np.sin(angles), -1, 0)
    rows = (
        (cy * cz + sy * sx * sz, sy * sx * cz - cy * sz, sy * cx),
        (cx * sz, cx * cz, -sx),
        (cy * sx * sz - sy * cz, sy * sz + cy * sx * cz, cy * cx),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _feet(joints: Float[np.ndarray, "T joints 3"], heading: Float[np.ndarray, " T"], figure: Figure) -> np.ndarray:
    """From ankle to toes, (T, 2, 3) metres, x forward, y left, z up in the world: flat in stance, following the shin in swing."""
    toes = np.zeros((len(joints), 2, 3))
    for column, side in enumerate(SIDES):
        ankle, knee = (HUMANML22.joints.index(f"{side}_{joint}") for joint in ("ankle", "knee"))
        ahead, outward, down = figure.offsets[TOES[column]]
        flat = np.hypot(ahead, outward)
        length, rest = np.hypot(flat, down), np.arctan2(-down, flat)
        height = joints[:, ankle, 2]
        shin = joints[:, knee] - joints[:, ankle]
        along = shin[:, 0] * np.cos(heading) + shin[:, 1] * np.sin(heading)
        neutral = 0.75 * np.arctan2(along, shin[:, 2])
        # the toes neither pass through the floor nor does a foot near it hold them up
        deepest = np.arcsin(np.clip((height - down) / length, -1.0, 1.0)) - rest
        highest = LEAST_PITCH * np.clip(height / _FLAT, 0.0, 1.0)
        pitch = rest + np.minimum(np.clip(neutral, highest, LARGEST_PITCH), deepest)
        yaw = _held(heading, height < _STANDS) + np.arctan2(outward, ahead)
        forward = length * np.cos(pitch)
        toes[:, column] = np.stack([forward * np.cos(yaw), forward * np.sin(yaw), -length * np.sin(pitch)], axis=-1)
    return toes


def _held(heading: Float[np.ndarray, " T"], stands: Bool[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """The heading, but constant (its mean) in every run of frames in which the foot stands, and straight lines in between."""
    if not stands.any():
        return heading
    frames = np.flatnonzero(stands)
    run = np.cumsum(np.diff(frames, prepend=frames[0]) > 1)
    mean = np.bincount(run, heading[frames]) / np.bincount(run)
    return np.interp(np.arange(len(heading)), frames, mean[run])
