"""Feet that stand: held in place, and above the floor, by legs of two bones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import find_objects, label

from mwlib.body.kinematics import horizontal
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton

# Own choices, all of them: the next two by measurement on LaFAN1 and Bandai-Namco, the others on validation people of CMU.
LEFT_BEHIND = 0.7  # share of its hip's speed up to which a low foot is taken for one that stands: a walking body leaves it behind
BRIEF = 0.3  # seconds; feet of motions no longer than that follow from both ends better than from this share
SLOW = 0.6  # metres per second up to which it is, however fast the hip
LOW = 0.08  # metres above the floor up to which a foot is low
SHORTEST = 0.1  # seconds that a foot stands at least
STRAIGHT = 0.999  # share of its length to which a leg stretches

Path = Float[np.ndarray, "T 3"]


def standing(motion: Motion, floor: float) -> Motion:
    """The motion with feet that stand where they stand, and none below the floor; the first and last frame stay as they are.

    A foot stands that is low, and slow or well slower than its hip. It is held at the mean of its places, or where it is in the
    first or last frame if it stands there; in between, what it is moved by goes over from one stand to the next. Hips stay; knees
    keep the side that they bend to.
    Source: own choice; two-bone inverse kinematics by the law of cosines.

    Args:
        motion: positions alone count; a rig is dropped.
        floor: height of the lowest foot that stands, metres along the up-axis.
    """
    positions = motion.positions.astype(np.float64)
    *flat, vertical = horizontal(motion.up)
    for hip, knee, foot in legs(motion.skeleton):
        path = positions[:, foot]
        moved = _held(path, _stands(path, positions[:, hip], vertical, floor, motion.fps), flat)
        moved[1:-1, vertical] = np.maximum(moved[1:-1, vertical], min(floor, path[[0, -1], vertical].min()))
        leg = bent(positions[:, hip], positions[:, knee], path, moved)
        positions[1:-1, [knee, foot]] = np.stack(leg, axis=1)[1:-1]
    return replace(motion, positions=positions.astype(motion.positions.dtype), rig=None)


def legs(skeleton: Skeleton) -> list[tuple[int, int, int]]:
    """Hip, knee and foot of each leg by the knees' names; none where the names are others, or joints lie between."""
    knees = [joint for joint, name in enumerate(skeleton.joints) if "knee" in name.lower()]
    return [(skeleton.parents[knee], knee, skeleton.parents.index(knee)) for knee in knees if skeleton.parents.count(knee) == 1]


def _stands(path: Path, hip: Path, vertical: int, floor: float, fps: float) -> list[slice]:
    """Stretches of frames in which a foot stands."""
    speed, of_hip = (np.linalg.norm(np.diff(each, axis=0), axis=-1) * fps for each in (path, hip))
    slow = speed <= np.maximum(SLOW, LEFT_BEHIND * of_hip * (len(of_hip) > BRIEF * fps))
    low = path[:, vertical] <= floor + LOW
    slow = np.pad(slow, 1)
    found = find_objects(label(low & (slow[1:] | slow[:-1]))[0])  # pyright: ignore[reportIndexIssue]  (no `output` was given)
    return [part for (part,) in found if part.stop - part.start >= SHORTEST * fps]


def _held(path: Path, stands: list[slice], flat: list[int]) -> Path:
    """The path with the foot held where it stands."""
    last, lack = len(path) - 1, np.zeros((len(path), len(flat)))
    set_at = np.zeros(len(path), bool)
    set_at[[0, last]] = True
    for part in stands:
        here = path[part][:, flat]
        place = here.mean(0)
        if part.start == 0 or part.stop > last:  # from a keyframe, or to one, or slowly from one to the other
            ends = path[[0 if part.start == 0 else last, last if part.stop > last else 0]][:, flat]
            place = np.linspace(ends[0], ends[1], len(here))
        lack[part], set_at[part] = place - here, True
    known, frames = np.flatnonzero(set_at), np.arange(len(path))
    after = np.searchsorted(known, frames).clip(1, len(known) - 1)
    low, high = known[after - 1], known[after]
    share = (frames - low) / (high - low)
    share = (share**2 * (3 - 2 * share))[:, None]
    moved = path.copy()
    moved[:, flat] += lack[low] * (1 - share) + lack[high] * share
    return moved


def bent(hip: Path, knee: Path, foot: Path, goal: Path) -> tuple[Path, Path]:
    """Knee and foot of a leg whose foot is to be at the goal, or as near as it reaches. Bones keep their lengths, and the knee
    the side that it bends to.

    >>> hip, knee, foot = np.array([[[0.0, 0, 2]], [[0.1, 0, 1]], [[0.0, 0, 0]]])
    >>> knee, foot = bent(hip, knee, foot, np.array([[0.0, 0.0, 0.5]]))
    >>> foot.round(6).tolist(), bool(knee[0, 0] > 0.5), float(np.linalg.norm(knee - hip).round(6))
    ([[0.0, 0.0, 0.5]], True, 1.004988)
    """
    thigh, shin = (np.linalg.norm(a - b, axis=-1) for a, b in ((knee, hip), (foot, knee)))
    way = goal - hip
    long = np.linalg.norm(way, axis=-1)
    reach = np.clip(
        long, np.abs(thigh - shin) / STRAIGHT, np.maximum(np.linalg.norm(foot - hip, axis=-1), STRAIGHT * (thigh + shin))
    ).clip(1e-9)  # a leg without length has a reach, too
    axis = way / long[:, None].clip(1e-9)
    aside_of = np.where(np.linalg.norm(np.cross(axis, knee - hip), axis=-1, keepdims=True) > 1e-6, knee - hip, axis[:, [1, 2, 0]])
    out = aside_of - (aside_of * axis).sum(-1, keepdims=True) * axis
    out /= np.linalg.norm(out, axis=-1, keepdims=True).clip(1e-9)
    along = (thigh**2 + reach**2 - shin**2) / (2 * reach)
    aside = np.sqrt((thigh**2 - along**2).clip(0))
    return hip + along[:, None] * axis + aside[:, None] * out, hip + reach[:, None] * axis
