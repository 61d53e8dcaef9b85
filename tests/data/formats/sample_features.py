"""A made-up person who wanders about, and features found slowly, joint by joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from mwlib.data.formats.humanml import HUMANML3D, FeatureLayout, joints_of, turned


def wandering(frames: int = 60, layout: FeatureLayout = HUMANML3D, seed: int = 0, rounds: float = 1.5) -> np.ndarray:
    """(T, J, 3) of a body that swings its limbs while it walks in circles, in the layout's units, y up."""
    rng = np.random.default_rng(seed)
    lengths = layout.bone_lengths or (150.0,) * len(layout.skeleton)
    pose = np.zeros((frames, len(layout.skeleton), 3))
    for before, joint in layout.skeleton.bones:
        swing = gaussian_filter1d(rng.normal(size=(frames, 3)), 5.0, axis=0)
        bone = layout.rests("correct")[joint] + swing
        pose[:, joint] = pose[:, before] + lengths[joint] * bone / np.linalg.norm(bone, axis=-1, keepdims=True)
    angle = 0.7 + np.linspace(0, 2 * np.pi * rounds, frames)
    pose = np.einsum("tab,tjb->tja", about_y(angle).as_matrix(), pose)
    size = lengths[4] / 10
    path = size * np.cumsum(np.stack([np.sin(angle), 0.1 * rng.normal(size=frames), np.cos(angle)], axis=-1), axis=0)
    return pose + path[:, None] + size * np.array([30.0, 5.0, -20.0])


def about_y(angle: np.ndarray) -> Rotation:
    """Turns from z towards x."""
    return Rotation.from_rotvec(np.multiply.outer(np.asarray(angle), [0.0, 1.0, 0.0]))


def arc(rest: np.ndarray, bone: np.ndarray) -> Rotation:
    """The smallest turn from one direction to another."""
    axis = np.cross(rest, bone)
    angle = np.arctan2(np.linalg.norm(axis), rest @ bone)
    return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))


def mirrored(features: np.ndarray, layout: FeatureLayout) -> np.ndarray:
    """Features of the mirror image in the plane x = 0: those of the other side's joints, with their signs."""
    pairs, mirror = layout.skeleton.mirror, features.copy()
    mirror[:, :2] *= -1
    for name, joints, signs in (
        ("positions", pairs[1:] - 1, (-1, 1, 1)),
        ("rotations", pairs[1:] - 1, (1, -1, -1, -1, 1, 1)),  # M R M with M = diag(-1, 1, 1), two columns of it
        ("velocities", pairs, (-1, 1, 1)),
        ("contacts", [2, 3, 0, 1], (1,)),
    ):
        block = features[:, layout.blocks[name]].reshape(len(features), len(joints), len(signs))
        mirror[:, layout.blocks[name]] = (block[:, joints] * signs).reshape(len(features), -1)
    return mirror


def published_rates(to_z: np.ndarray) -> np.ndarray:
    """Yaw rates as the published code has them: the arcsine of a product's part, whichever sign the product has."""
    half = np.arctan2(np.sin(to_z), np.cos(to_z)) / 2
    return np.arcsin(np.sin(np.diff(half)))


def joints_of_rotations(
    features: np.ndarray, lengths: Sequence[float], layout: FeatureLayout = HUMANML3D, heading: str = "correct"
) -> np.ndarray:
    """Joints that the block of rotations describes: kinematics along the chains, with bones of given lengths."""
    features = np.asarray(features, float)
    first, second = np.moveaxis(features[:, layout.blocks["rotations"]].reshape(len(features), -1, 2, 3), 2, 0)
    turns = np.stack([first, second, np.cross(first, second)], axis=-1)
    back = about_y(-turned(torch.from_numpy(features[:, 0])).numpy()).as_matrix()
    joints = np.zeros((len(features), len(layout.skeleton), 3))
    for chain in layout.chains:
        turn = back.swapaxes(1, 2) if heading == "humanml3d" else np.eye(3)
        for before, joint in zip(chain, chain[1:], strict=False):
            turn = turn @ turns[:, joint - 1]
            joints[:, joint] = joints[:, before] + lengths[joint] * (turn @ layout.rests(heading)[joint])
    world = joints if heading == "humanml3d" else np.einsum("tab,tjb->tja", back, joints)
    return world + joints_of(features, layout)[:, :1]


def slow_features(world: np.ndarray, layout: FeatureLayout, heading: str) -> np.ndarray:
    """What `features_of` should give for a clip that is placed already: frame by frame and joint by joint."""
    right_hip, left_hip, right_shoulder, left_shoulder = layout.face_joints
    sign = -1 if heading == "humanml3d" else 1
    across = sign * (world[:, right_hip] - world[:, left_hip]) + world[:, right_shoulder] - world[:, left_shoulder]
    across /= np.linalg.norm(across, axis=1)[:, None]
    forward = np.stack([across[:, 2], 0 * across[:, 0], -across[:, 0]], axis=1)
    kernel = np.exp(-0.5 * (np.arange(-80, 81) / 20) ** 2)
    padded = np.pad(forward, ((80, 80), (0, 0)), mode="edge")
    forward = np.stack([kernel @ padded[t : t + 161] for t in range(len(world))])
    to_z = about_y(-np.arctan2(forward[:, 0], forward[:, 2]))
    to_z = Rotation.concatenate([Rotation.identity(), *to_z[1:]])
    rows = []
    for t in range(len(world) - 1):
        yaw = (to_z[t + 1] * to_z[t].inv()).as_rotvec()[1] / 2
        step = world[t + 1] - world[t]
        local = to_z[t].apply(world[t] - world[t, 0] * [1, 0, 1])
        six = np.zeros((len(layout.skeleton), 6))
        for chain in layout.chains:
            above = to_z[t] if heading == "humanml3d" else Rotation.identity()
            for before, joint in zip(chain, chain[1:], strict=False):
                bone = world[t, joint] - world[t, before]
                whole = arc(layout.rests(heading)[joint], bone if heading == "humanml3d" else to_z[t].apply(bone))
                six[joint] = (above.inv() * whole).as_matrix()[:, :2].T.ravel()
                above = whole
        contact = [step[j] @ step[j] < layout.contact_threshold for j in layout.contact_joints]
        root = to_z[t + 1].apply(step[0])[[0, 2]]
        rows.append([yaw, *root, world[t, 0, 1], *local[1:].ravel(), *six[1:].ravel(), *to_z[t].apply(step).ravel(), *contact])
    return np.array(rows, float)
