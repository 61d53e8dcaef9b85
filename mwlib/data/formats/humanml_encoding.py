"""Joint positions to features of HumanML3D and KIT-ML: placed on the floor, headings, rotations, velocities, contacts.

Source: the code published with HumanML3D, of which two known faults can be had by name ("humanml3d") or left out ("correct").
"""

from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from mwlib.body.kinematics import bone_lengths
from mwlib.data.formats.humanml import HUMANML3D, FeatureLayout
from mwlib.settings import choice

Heading = Literal["correct", "humanml3d"]
SMOOTHING = 20.0  # frames, deviation of the Gaussian over which the facing direction is averaged
OPPOSITE = 1e-9  # 1 + cosine of two directions: below this the shortest turn between them has no axis
LEAST = 1e-9  # length of a direction
LOWER_LEG = 2  # place in a leg's chain of the knee; the ankle follows


def features_of(
    positions: Float[np.ndarray, "T J 3"], layout: FeatureLayout = HUMANML3D, heading: Heading = "correct"
) -> Float[np.ndarray, "T-1 D"]:
    """Raw features of a motion, float32: one row less than there are positions, as each row looks at the next frame.

    The clip is `placed` first, so that turning it about y or moving it changes nothing. Headings are smoothed over frames.
    As published, that of the first frame is set to 0 afterwards, so that the first yaw rate holds what smoothing made of it
    (0.11 rad in the published example 012314, the ten after it about 0.005).

    "humanml3d" repeats two faults of the published code. Its heading adds shoulders to hips with the hips exchanged; as
    shoulders are wider it rarely faces backwards, but it is rough: its yaw rate has twice the size. Its rotations are found
    in the world and turned by the heading once more instead of back, so that they depend on where a body faces. Not
    repeated: the published yaw rate, an arcsine, has the wrong sign in a frame in which the heading passes straight
    backwards, where one half turn ends and the other begins; decoded, the body then goes off in another direction.

    Args:
        positions: in the layout's units, y up. Proportions stay as they are, see `with_bones`.
        layout: of the features.
        heading: "correct", or "humanml3d" for features like those of the published files.

    Raises:
        ValueError: another number of joints, fewer than two frames, positions that are not finite, or an unknown heading.
    """
    choice("heading", heading, get_args(Heading))
    world = placed(np.asarray(positions, float), layout)
    if len(world) < 2:
        raise ValueError("positions have 1 frame; expected at least 2, as each row of features looks at the next frame")
    forward = gaussian_filter1d(_facing(world, layout, heading), SMOOTHING, axis=0, mode="nearest")
    angle = np.arctan2(forward[:, 0], forward[:, 2])
    angle[0] = 0.0
    steps = _about_up(np.diff(world, axis=0), -angle[:-1])
    root = _about_up(np.diff(world[:, :1], axis=0), -angle[1:])
    local = world - world[:, :1] * [1, 0, 1]
    squared = np.square(np.diff(world[:, list(layout.contact_joints)], axis=0)).sum(axis=-1)
    columns = (
        -(np.remainder(np.diff(angle) + np.pi, 2 * np.pi) - np.pi) / 2,
        root[:, 0, [0, 2]],
        world[:-1, 0, 1],
        _about_up(local[:-1, 1:], -angle[:-1]),
        _rotations(world[:-1], angle[:-1], layout, heading)[..., :2].swapaxes(-1, -2),
        steps,
        squared < layout.contact_threshold,
    )  # in the order of `FeatureLayout.blocks`
    return np.concatenate([part.reshape(len(steps), -1) for part in columns], axis=1).astype(np.float32)


def placed(positions: Float[np.ndarray, "T J 3"], layout: FeatureLayout = HUMANML3D) -> Float[np.ndarray, "T J 3"]:
    """The clip where its features see it: lowest point at y = 0, the first root above the origin, facing +z in the first frame.

    Raises:
        ValueError: as in `features_of`.
    """
    expected = (len(layout.skeleton), 3)
    if positions.shape[1:] != expected or len(positions) == 0:
        raise ValueError(f"positions have shape {positions.shape}; expected (T, {expected[0]}, 3) for {layout.name}")
    if not np.isfinite(positions).all():
        frame, joint, _ = np.argwhere(~np.isfinite(positions))[0]
        raise ValueError(f"{layout.skeleton.joints[joint]} in frame {frame} is not finite; expected numbers")
    origin = positions[0, 0] * [1, 0, 1] + [0, positions[..., 1].min(), 0]
    x, _, z = _facing(positions[:1], layout, "correct")[0]
    return _about_up(positions - origin, -np.arctan2(x, z)[None]).astype(positions.dtype)


def with_bones(positions: Float[np.ndarray, "T J 3"], layout: FeatureLayout = HUMANML3D) -> Float[np.ndarray, "T J 3"]:
    """The same motion of the layout's body: bones in their directions with its lengths, the root's path scaled as the legs are.

    This is how the published data were given one body; its own has the leg of one side measured, this the mean of both.

    Args:
        positions: layout's units.
        layout: whose joints these are.

    Raises:
        ValueError: the layout has no lengths.
    """
    wanted = layout.bone_lengths
    if wanted is None:
        raise ValueError(f"bone_lengths of {layout.name} is None; expected {len(layout.skeleton)} lengths")
    own = bone_lengths(positions, layout.skeleton)  # of joints 1, 2, ...
    legs = [joint for chain in layout.chains[:2] for joint in chain[LOWER_LEG : LOWER_LEG + 2]]
    scale = np.sum(np.asarray(wanted)[legs]) / np.median(own, axis=0)[np.subtract(legs, 1)].sum()
    out = np.empty_like(positions)
    out[:, 0] = positions[:, 0] * scale
    for before, joint in layout.skeleton.bones:
        factor = wanted[joint] / np.maximum(own[:, joint - 1 : joint], LEAST)
        out[:, joint] = out[:, before] + factor * (positions[:, joint] - positions[:, before])
    return out


def _facing(positions: Float[np.ndarray, "T J 3"], layout: FeatureLayout, heading: str) -> Float[np.ndarray, "T 3"]:
    """Horizontal directions in which the body looks; shorter than 1 where hips and shoulders are tilted."""
    right_hip, left_hip, right_shoulder, left_shoulder = layout.face_joints
    hips = positions[:, right_hip] - positions[:, left_hip]
    across = (-hips if heading == "humanml3d" else hips) + positions[:, right_shoulder] - positions[:, left_shoulder]
    across = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), LEAST)
    return np.cross([0.0, 1.0, 0.0], across)


def _rotations(
    world: Float[np.ndarray, "T J 3"], angle: Float[np.ndarray, " T"], layout: FeatureLayout, heading: str
) -> Float[np.ndarray, "T J-1 3 3"]:
    """Of each joint but the root, the rotation of the bone that leads to it against the one before in its chain.

    Each bone is turned from its rest by the shortest arc; a twist cannot be seen in positions.
    """
    before, after = np.array([pair for chain in layout.chains for pair in pairwise(chain)]).T
    begins = [joint == chain[1] for chain in layout.chains for joint in chain[1:]]
    bones = world[:, after] - world[:, before]
    if heading == "correct":  # every chain begins without a turn, as the pose is seen in its heading
        bones, start = _about_up(bones, -angle), np.eye(3)
    else:  # as published: with the heading undone
        start = _about_up(np.broadcast_to(np.eye(3), (len(angle), 3, 3)), -angle).swapaxes(-1, -2)[:, None]
    whole = np.empty((len(world), len(layout.skeleton), 3, 3))
    whole[:, after] = _arcs(layout.rests(heading)[after], bones)
    above = whole[:, before]
    above[:, begins] = start
    local = np.empty_like(whole)
    local[:, after] = above.swapaxes(-1, -2) @ whole[:, after]
    return local[:, 1:]


def _arcs(rest: Float[np.ndarray, "bones 3"], bones: Float[np.ndarray, "T bones 3"]) -> Float[np.ndarray, "T bones 3 3"]:
    """The smallest rotations that carry unit vectors to the directions of bones: 1 + K + K K / (1 + cosine)."""
    towards = bones / np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), LEAST)
    k = np.cross(np.eye(3), np.cross(rest, towards)[..., None, :])
    more = 1 + np.sum(rest * towards, axis=-1)[..., None, None]
    arcs = np.eye(3) + k + k @ k / np.maximum(more, OPPOSITE)
    side = np.roll(rest, 1, axis=-1)  # at a right angle to a vector along an axis
    half_turns = 2 * side[:, :, None] * side[:, None, :] - np.eye(3)
    return np.where(more > OPPOSITE, arcs, half_turns)


def _about_up(vectors: Float[np.ndarray, "T n 3"], angle: Float[np.ndarray, "#T"]) -> Float[np.ndarray, "T n 3"]:
    """Turned about y, from z towards x."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)
