"""Synthetic people: bones, manner, and joint positions of their poses.

A pose is a row of `POSE`: joint angles in radians and one length. Zero is standing straight with hanging arms. Signs are the
clinic's, the same on both sides: flexion swings a limb forward and bends knees backward and elbows forward, abduction moves it
away from the midline, turn rotates it outward. The trunk pitches forward, rolls to the left, yaws to the left.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.rotation import euler_matrices
from mwlib.body.skeleton import H36M17, HUMANML22, Skeleton

FPS = 50.0

_TRUNK = tuple("pelvis_pitch pelvis_roll pelvis_yaw spine_pitch spine_roll spine_yaw neck_pitch neck_roll".split())
_LIMBS = tuple("hip_flex hip_abd hip_turn knee arm_flex arm_abd arm_turn elbow".split())
SIDES = {"left": 1.0, "right": -1.0}  # sign of the side's y axis: x forward, y left, z up
# `lift` is the height of the lower foot above the floor, metres.
POSE = (*_TRUNK, *(f"{side}_{limb}" for side in SIDES for limb in _LIMBS), "lift")
AT = {name: i for i, name in enumerate(POSE)}

FEET = [H36M17.joints.index(f"{side}_foot") for side in SIDES]

_CONTACT = 0.008  # metres: a foot this much higher than the other bears a third of its share of the ground contact
_FLIGHT = 0.03  # metres: with the lower foot this high nothing holds the body


PerFrame = Float[np.ndarray, " T"]
Poses = Float[np.ndarray, "*T pose"]
Positions = Float[np.ndarray, "T joints 3"]
Turns = Float[np.ndarray, "*axes 3 3"]


class Body(NamedTuple):
    """Bones and manner of one synthetic person.

    Args:
        offsets: (17, 3) metres, joint from parent in the rest pose: x forward, y left, z up.
        thigh, shin: metres.
        posture: (len(POSE),) radians added to every pose.
        pace, stride, swing, sway, tempo, liveliness: factors around 1 on step rate, step length, arm swing, trunk movement in
            gait, speed of gestures, and involuntary movement.
    """

    offsets: Float[np.ndarray, "joints 3"]
    thigh: float
    shin: float
    posture: Poses
    pace: float
    stride: float
    swing: float
    sway: float
    tempo: float
    liveliness: float

    @property
    def leg(self) -> float:
        """Metres from hip to foot with the knee straight."""
        return self.thigh + self.shin


# joint, length of the bone to it as a share of body height, and where the bone points in the rest pose, on the left if on a side
_BONES = """
hip 0.074 0 1 0
knee 0.252 0 0 -1
foot 0.248 0 0 -1
spine 0.136 0 0 1
thorax 0.146 0 0 1
neck 0.067 0.3 0 0.95
head 0.065 -0.2 0 0.98
shoulder 0.088 0 1 -0.1
elbow 0.163 0 0 -1
wrist 0.147 0 0 -1
"""


def draw_body(rng: np.random.Generator) -> Body:
    """A random adult.

    Own choice: mean segment lengths are rounded textbook shares of body height; height spans 1.55 to 1.92 m, and every
    segment varies by a few per cent of its own, so that people differ in proportion and not only in size.
    """
    height, offsets, bones = rng.uniform(1.55, 1.92), np.zeros((len(H36M17), 3)), {}
    for joint, share, *direction in (line.split() for line in _BONES.strip().splitlines()):
        bones[joint] = height * float(share) * rng.uniform(0.94, 1.06)
        vector = bones[joint] * np.array(direction, float)
        for name, sign in ((f"left_{joint}", 1.0), (f"right_{joint}", -1.0), (joint, 1.0)):
            if name in H36M17.joints[1:]:
                offsets[H36M17.joints.index(name)] += vector * [1.0, sign, 1.0]
    posture = np.deg2rad(rng.normal(0.0, 2.0, len(POSE)))
    legs = [AT[f"{side}_{limb}"] for side in SIDES for limb in ("hip_flex", "knee", "hip_turn", "hip_abd")]
    posture[[*legs, AT["lift"]]] = 0.0  # or no foot would stand where the gait puts it
    posture[[AT["pelvis_roll"], AT["pelvis_yaw"], AT["spine_roll"], AT["spine_yaw"]]] *= 0.4
    manner = rng.uniform([0.92, 0.9, 0.7, 0.7, 0.85, 0.7], [1.1, 1.1, 1.4, 1.5, 1.2, 1.4])
    return Body(offsets, bones["knee"], bones["foot"], posture, *manner)


def positions_of(pose: Poses, heading: PerFrame, body: Body) -> Positions:
    """World positions (metres, z up, floor at z = 0) of a person who assumes these poses facing `heading` (radians).

    The root is not given but follows: its height puts the lower foot at `lift`, and it moves so that the foot on the floor stays
    where it is; in flight it keeps the speed it had around. Own choice: any sequence of poses then stands, walks or jumps without
    sliding, at no cost in the root-relative channels that models see.
    """
    angles = joint_angles(pose, H36M17, ("spine", "thorax"))
    local = euler_matrices("yxz", angles.reshape(-1, 3)).reshape(*angles.shape, 3)
    _set_upright(local, euler_matrices("z", heading[:, None]), H36M17)
    standing = forward_kinematics(local, body.offsets, np.zeros((len(pose), 3)), H36M17)
    return standing + root_path(standing[:, FEET], pose[:, AT["lift"]])[:, None]


def _set_upright(local: Turns, heading: Turns, skeleton: Skeleton) -> None:
    """Turn the body into its heading; leg angles are measured against the upright, not a pelvis that tilts and sways."""
    pelvis = local[:, 0].copy()
    for side in SIDES:
        hip = skeleton.joints.index(f"{side}_hip")
        local[:, hip] = np.swapaxes(pelvis, -1, -2) @ local[:, hip]
    local[:, 0] = heading @ pelvis


def joint_angles(pose: Poses, skeleton: Skeleton, spine: tuple[str, ...]) -> Positions:
    """Angles about y, x, z (in this order, moving axes) of every joint's local rotation, radians.

    Args:
        skeleton: with joints neck, hip, knee, shoulder and elbow; those that a pose does not know stay straight.
        spine: the joints that share the bend of the spine, in equal parts.
    """
    euler = np.zeros((len(pose), len(skeleton), 3))

    def put(joint: str, entries: str, *signs: float) -> None:
        """Set the angles of one joint, radians."""
        columns = [AT[entry] for entry in entries.split()]
        euler[:, skeleton.joints.index(joint), : len(columns)] = pose[:, columns] * signs

    put(skeleton.joints[0], "pelvis_pitch pelvis_roll pelvis_yaw", 1, -1, 1)
    for joint in spine:
        put(joint, "spine_pitch spine_roll spine_yaw", 1, -1, 1)
        euler[:, skeleton.joints.index(joint)] /= len(spine)
    put("neck", "neck_pitch neck_roll", 1, -1)
    for side, sign in SIDES.items():
        put(f"{side}_hip", f"{side}_hip_flex {side}_hip_abd {side}_hip_turn", -1, sign, sign)
        put(f"{side}_knee", f"{side}_knee", 1)
        put(f"{side}_shoulder", f"{side}_arm_flex {side}_arm_abd {side}_arm_turn", -1, sign, sign)
        put(f"{side}_elbow", f"{side}_elbow", -1)
    return euler


def root_path(feet: Positions, lift: PerFrame, fps: float = FPS) -> Float[np.ndarray, "T 3"]:
    """Root path, metres, for feet given relative to the root: see `positions_of`."""
    frames = fps / FPS
    height = feet[..., 2]
    share = np.exp(-(height - height.min(axis=1, keepdims=True)) / _CONTACT)
    share /= share.sum(axis=1, keepdims=True)
    share = (share[1:] + share[:-1]) / 2
    held = -np.sum(share[..., None] * np.diff(feet[..., :2], axis=0), axis=1)
    grip = np.exp(-((np.maximum(lift[1:], lift[:-1]) / _FLIGHT) ** 4))[:, None]
    around = gaussian_filter1d(held * grip, 4.0 * frames, axis=0) / (gaussian_filter1d(grip, 4.0 * frames, axis=0) + 1e-6)
    step = grip * held + (1 - grip) * around
    root = np.zeros((len(feet), 3))
    root[1:, :2] = np.cumsum(step, axis=0)
    root[:, 2] = lift - height.min(axis=1)
    return gaussian_filter1d(root, 1.5 * frames, axis=0, mode="nearest")  # the body's mass rounds the corners where feet change


ANKLES = [HUMANML22.joints.index(f"{side}_ankle") for side in SIDES]
TOES = [HUMANML22.joints.index(f"{side}_foot") for side in SIDES]
LARGEST_PITCH = np.deg2rad(65.0)  # of a foot whose toes point down
LEAST_PITCH = np.deg2rad(-22.0)  # of a foot whose toes point up
SCAPULA = 0.12  # share of the arm's elevation by which the collar bone rises

_SPINE = ("spine1", "spine2", "spine3")
_STANDS = 0.012  # metres: an ankle no higher above its height in stance belongs to a foot that stands
_FLAT = 0.035  # metres: from here on a foot may hold its toes up as far as it can


class Figure(NamedTuple):
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
        offsets[at(f"{side}_foot")] = 0.9 * foot, sign * 0.12 * foot, -0.4 * foot
        offsets[at(f"{side}_collar")] = 0.0, sign * 0.46 * shoulder, 0.26 * trunk
        offsets[at(f"{side}_shoulder")] = -0.01, sign * 0.74 * shoulder, 0.04 * trunk
        for joint, own in (("knee", "knee"), ("ankle", "foot"), ("elbow", "elbow"), ("wrist", "wrist")):
            offsets[at(f"{side}_{joint}")] = body.offsets[old(f"{side}_{own}")]
    return Figure(body, offsets)


def figure_positions(
    pose: Poses, heading: PerFrame, figure: Figure, fps: float, travel: Float[np.ndarray, "T 1 2"] | float = 0.0
) -> Positions:
    """World positions of 22 joints, metres, y up, the person's left at +x while it faces +z; the toes of a foot that stands at 0.

    The root follows from the feet as in `positions_of`. A foot that stands keeps its direction while the body turns above it.

    Args:
        pose: rows of `POSE`; `lift` is the height of the lower foot.
        heading: radians, 0 faces +z, positive turns to the left: counterclockwise seen from above.
        fps: frames per second.
        travel: metres forward and to the left, in the world, that the body covers besides, in flight.
    """
    angles = joint_angles(pose, HUMANML22, _SPINE)
    for side, sign in SIDES.items():  # arms lift their collar bones
        collar, shoulder = (HUMANML22.joints.index(f"{side}_{joint}") for joint in ("collar", "shoulder"))
        angles[:, collar, 1] = sign * SCAPULA * np.linalg.norm(angles[:, shoulder, :2], axis=-1)
    turns = _local_turns(angles)
    _set_upright(turns, _local_turns(heading[:, None] * [0.0, 0.0, 1.0]), HUMANML22)
    joints = forward_kinematics(turns, figure.offsets, np.zeros((len(pose), 3)), HUMANML22)
    joints += root_path(joints[:, ANKLES], pose[:, AT["lift"]], fps)[:, None]
    joints[..., :2] += travel
    joints[:, TOES] = joints[:, ANKLES] + _feet(joints, heading, figure)
    joints[..., 2] -= figure.offsets[TOES[0], 2]
    return joints[..., [1, 2, 0]]


def _local_turns(angles: Float[np.ndarray, "*axes 3"]) -> Turns:
    """Rotation matrices for angles about y, then x, then z, moving axes."""
    (cy, cx, cz), (sy, sx, sz) = np.moveaxis(np.cos(angles), -1, 0), np.moveaxis(np.sin(angles), -1, 0)
    rows = (
        (cy * cz + sy * sx * sz, sy * sx * cz - cy * sz, sy * cx),
        (cx * sz, cx * cz, -sx),
        (cy * sx * sz - sy * cz, sy * sz + cy * sx * cz, cy * cx),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _feet(joints: Positions, heading: PerFrame, figure: Figure) -> Positions:
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


def _held(heading: PerFrame, stands: Bool[np.ndarray, " T"]) -> PerFrame:
    """The heading, but constant (its mean) in every run of frames in which the foot stands, and straight lines in between."""
    if not stands.any():
        return heading
    frames = np.flatnonzero(stands)
    run = np.cumsum(np.diff(frames, prepend=frames[0]) > 1)
    mean = np.bincount(run, heading[frames]) / np.bincount(run)
    return np.interp(np.arange(len(heading)), frames, mean[run])
