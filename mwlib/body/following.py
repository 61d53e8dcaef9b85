"""A user's own rig that follows the joint positions of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.interpolate import CubicSpline
from torch import Tensor
from torch.nn.functional import normalize

from mwlib.body.fitting import JUMP, Directions, Turns, aimed, twist_jumps
from mwlib.body.motion import Motion
from mwlib.body.rig import MOVES, ROTATION_DTYPE, Rig, axes_of

from mwlib.body.rotation import (  # isort: skip
    about, continuous, euler_angles, euler_quaternions, inverse, multiply, rotate, tensor64, wrapped,
)  # fmt: skip
from mwlib.body.skeleton import H36M17, to_h36m17

COINCIDENT = 5e-3  # metres of bones: a joint so near another says nothing of its direction
FASTEST = 24.0  # radians of twist a second that a body makes, 45 degrees a frame at 30 Hz: own choice
STRAIGHT = 0.05  # product of the sines of two bends of a limb, 13 degrees each: straighter ones keep their twist

LIMBS = [H36M17.joints.index(name) for name in ("right_hip", "left_hip", "right_shoulder", "left_shoulder")]


def on_rig(motion: Motion, poses: Motion, at: Sequence[float] | Float[np.ndarray, " K"]) -> Motion:
    """The motion of a model on the body that the model was given poses of: all its joints, bones and channels, at its rate.

    From the root outward each joint turns as little as it must so that the joints below it which the model knows lie in their
    directions: several by Kabsch 1976, one by the shortest arc. Hips and shoulders also twist, so that knees and elbows bend in
    the model's plane. A twist that would jump, as near a half turn, goes on and is made up for on the way. What the model does
    not know, like fingers, toes and other twists, is interpolated by slerp between the poses, and held after the last; a model of
    rotations says it itself. The root follows. Poses stay as they are, and what the fit leaves of them is blended out. Own
    choice, all of it: bones keep their lengths, so joints may be off the model's; positions are splined in time.

    Args:
        motion: positions, of the skeleton of `poses` or of H36M17.
        poses: frames of the user's motion, with its rig, in the world of `motion`.
        at: for each the frame of `motion` that it is at, rising; fractions of frames, and frames before or behind `motion`, too.

    Returns:
        A motion at the rate of `poses`, from the first of them to the end of `motion` or the last of them. Where the rates do not
        fit, each pose is at the nearest frame.

    Raises:
        ValueError: `poses` have no rig or another skeleton, or `at` does not say one frame after the other.

    >>> from mwlib.body.fitting import fit_rig
    >>> from mwlib.synthetic.motions import synthetic_motions
    >>> walk = synthetic_motions(subjects=1, seconds=1.0)[0]
    >>> own = replace(walk, rig=(rig := fit_rig(walk).rig), positions=rig.positions())
    >>> back = on_rig(replace(own, rig=None), own.cut(0, 1), [0])
    >>> back.rig.skeleton == rig.skeleton, np.allclose(back.positions, own.positions, atol=1e-3)
    (True, True)
    """
    rig, ratio = poses.rig, poses.fps / motion.fps
    seventeen = to_h36m17(poses.skeleton)
    picked = range(len(poses.skeleton)) if motion.skeleton == poses.skeleton else seventeen
    if not rig or not picked or motion.skeleton not in (poses.skeleton, H36M17):
        raise ValueError(
            f"the poses are of {poses.skeleton.name}, {'with' if rig else 'without'} rotations; "
            f"expected rotations, and a skeleton that stands for {motion.skeleton.name}"
        )
    times = np.asarray(at, np.float64)
    given = np.floor((times - times[:1]) * ratio + 0.5 + 1e-6).astype(int)  # halves go up, all of them
    if times.shape != (len(poses),) or not (np.diff(given) > 0).all():
        raise ValueError(f"at is {[*at]} for {len(poses)} poses at {poses.fps:g} Hz; expected a frame for each, rising")
    line = _timeline(given, times, ratio, len(motion) - 1)
    motion = motion.with_up(poses.up)
    held = _told(rig.between(line.low, line.high, line.share), motion, line.times, rig.points[0])
    path = CubicSpline(np.arange(len(motion)), motion.positions.astype(np.float64))(line.times)
    points = [rig.points[joint] for joint in picked]
    limbs = [rig.points[seventeen[joint]] for joint in LIMBS] if seventeen else []  # whose bones end in hinges
    jump = np.inf if motion.rig else min(JUMP, FASTEST / poses.fps)  # what a model of rotations says is so
    rig = _meeting(_followed(held, path, points, limbs, line, jump), rig, line)
    return replace(poses, positions=rig.positions().astype(poses.positions.dtype), rig=rig, name=motion.name)


class Timeline(NamedTuple):
    """For each of T frames made: the poses before and behind, the share of the way between them, and the time in the motion.

    `given` says for each pose which frame it is.
    """

    given: Int[np.ndarray, " K"]
    low: Int[np.ndarray, " T"]
    high: Int[np.ndarray, " T"]
    share: Float[np.ndarray, " T"]
    times: Float[np.ndarray, " T"]


def _timeline(given: Int[np.ndarray, " K"], at: Float[np.ndarray, " K"], ratio: float, last: int) -> Timeline:
    """The frames to be made.

    Args:
        given: which of them the poses are.
        at: times of the poses in the motion.
        ratio: frames made per frame of the motion.
        last: frame of the motion.
    """
    frames = np.arange(given[-1] + 1 + max(0, int((last - at[-1]) * ratio + 1e-6)))
    low = np.searchsorted(given, frames, side="right") - 1
    high = np.minimum(low + 1, len(given) - 1)
    share = (frames - given[low]) / np.maximum(given[high] - given[low], 1)
    times = np.interp(frames, given, at) + np.maximum(frames - given[-1], 0) / ratio
    return Timeline(given, low, high, share, times.clip(0, last))


def _told(held: Rig, motion: Motion, times: Float[np.ndarray, " T"], root: int) -> Rig:
    """The rig with the rotations that a motion has itself: those of joints of the same names, and at the root the world's."""
    if motion.rig is None:
        return held
    low = times.astype(int)
    own = motion.rig.between(low, np.minimum(low + 1, len(motion) - 1), times - low)
    rotations = held.rotations.copy()
    for joint, name in enumerate(own.skeleton.joints):
        if name in held.skeleton.joints:
            rotations[:, held.skeleton.joints.index(name)] = own.rotations[:, joint]
    above = tensor64(held.world()[1][:, max(held.skeleton.parents[root], 0)])
    turns = tensor64(own.world()[1][:, own.points[0]])
    rotations[:, root] = (multiply(inverse(above), turns) if root else turns).numpy()
    return replace(held, rotations=rotations)


def _followed(
    held: Rig, targets: Float[np.ndarray, "T points 3"], points: list[int], limbs: list[int], line: Timeline, jump: float
) -> Rig:
    """The rig, its root moved and its joints turned from the root outward, so that its points come to lie at the targets."""
    goals = dict(zip(points, tensor64(targets).unbind(1), strict=True))
    seen, seen_turns = map(tensor64, held.world())
    held = _carried(held, goals[points[0]] - seen[:, points[0]], seen_turns, points[0])
    ends, local, spans = _ends(held, points), tensor64(held.rotations), tensor64(held.spans)
    none = local.new_tensor([1.0, 0.0, 0.0, 0.0]).expand(len(local), 4)
    places, turns = {0: tensor64(held.root)}, {-1: none}
    for joint, above in enumerate(held.skeleton.parents):
        if joint:
            places[joint] = places[above] + rotate(turns[above], spans[:, joint])
        turns[joint] = multiply(turns[above], local[:, joint])
        axes, below = axes_of(held.channels[joint] or ()), ends[joint]
        if not below or not axes:
            continue
        moved = multiply(turns[joint], inverse(seen_turns[:, joint]))
        arms = rotate(moved[:, None], seen[:, below] - seen[:, [joint]])
        swing = aimed(arms, torch.stack([goals[end] for end in below], dim=1) - places[joint][:, None])
        if joint in limbs and len(below) == 1 and len(tip := ends[below[0]]) == 1:
            bent = rotate(multiply(swing, moved), seen[:, tip[0]] - seen[:, below[0]])
            swing = multiply(_twist(goals[below[0]] - places[joint], bent, goals[tip[0]] - goals[below[0]]), swing)
        found = multiply(inverse(turns[above]), multiply(swing, turns[joint]))
        if len(below) == 1:
            found = _steady(found, rotate(inverse(turns[joint]), arms[:, 0]), line, jump)
        local[:, joint] = _turnable(axes, found)
        turns[joint] = multiply(turns[above], local[:, joint])
    return replace(held, rotations=continuous(local).numpy().astype(ROTATION_DTYPE))


def _carried(rig: Rig, way: Directions, turns: Float[Tensor, "T rig 4"], point: int) -> Rig:
    """The whole body moved, by the place of the joint nearest above `point` that has one of its own."""
    while point > 0 and not {*MOVES} <= {*(rig.channels[point] or ())}:
        point = rig.skeleton.parents[point]
    if point == 0 or rig.moves is None:
        return replace(rig, root=rig.root + way.numpy())
    moves = rig.moves.copy()
    moves[:, point] += rotate(inverse(turns[:, rig.skeleton.parents[point]]), way).numpy()
    return replace(rig, moves=moves)


def _ends(rig: Rig, points: list[int]) -> list[list[int]]:
    """For each joint at or below the first point the points next below it that do not stand where it does itself."""
    lengths = np.linalg.norm(rig.spans[0], axis=-1)
    ends: list[list[int]] = [[] for _ in lengths]
    for point in points[1:]:
        joint, way = point, 0.0
        while joint not in (0, points[0]) and (joint == point or joint not in points):
            way, joint = way + lengths[joint], rig.skeleton.parents[joint]
            if way > COINCIDENT:
                ends[joint].append(point)
    return ends


def _twist(bone: Directions, bent: Directions, wanted: Directions) -> Turns:
    """The turn about a bone that brings what is bent at its end into the plane that is wanted; little where it is straight."""
    axis, a, b = (normalize(v, dim=-1) for v in (bone, bent, wanted))
    a, b = (v - (v * axis).sum(dim=-1, keepdim=True) * axis for v in (a, b))
    return about(axis, torch.atan2((axis * torch.linalg.cross(a, b)).sum(dim=-1), (a * b).sum(dim=-1).clamp_min(0) + STRAIGHT))


def _steady(turns: Turns, bone: Directions, line: Timeline, jump: float) -> Turns:
    """The same directions of a bone, its twist made to go on where it would jump, and to end as it does at the next pose."""
    axis = normalize(bone, dim=-1)
    back = -twist_jumps(turns, axis, jump)
    start, way = back[line.given[line.low]], wrapped(back[line.given[line.high]] - back[line.given[line.low]])
    return multiply(turns, about(axis, back - start - torch.from_numpy(line.share) * way))


def _turnable(axes: str, turns: Turns) -> Turns:
    """What a joint with these channels can do of it, of length 1."""
    turns = normalize(turns, dim=-1)  # else lengths drift, twice as far with each joint down the tree
    return turns if len(axes) == 3 else tensor64(euler_quaternions(axes, euler_angles(axes, turns.numpy())))


def _meeting(rig: Rig, poses: Rig, line: Timeline) -> Rig:
    """The rig with what it lacks to the poses at their frames, and a share of that in between."""
    found = rig.pick(line.given)
    lacking = replace(
        found,
        rotations=multiply(inverse(tensor64(found.rotations)), tensor64(poses.rotations)).numpy(),
        root=poses.root - found.root,
        moves=None if found.moves is None else poses.spans - found.moves,
    ).between(line.low, line.high, line.share)
    turns = continuous(multiply(tensor64(rig.rotations), tensor64(lacking.rotations)))
    return replace(
        rig,
        rotations=normalize(turns, dim=-1).numpy().astype(ROTATION_DTYPE),
        root=rig.root + lacking.root,
        moves=None if rig.moves is None else rig.moves + lacking.spans,
    )
