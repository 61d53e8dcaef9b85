"""Motions of any form made ready to be shown moving: in one world with z up, on one floor, at one rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Num

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import Array
from mwlib.plots.look import array

Shown = Motion | Num[Array, "..."]
FLOOR_SHARE = 0.01  # of the frames may reach below the floor


@dataclass(frozen=True)
class Actor:
    """One body over time.

    Args:
        positions: (T, J+1, 3) metres, z up, the floor at height 0.
        skeleton: names and parents of the joints.
        start: frame of the film at which it begins.
        rooted: whether its path is known; without, the root stays on its spot.
        offset: what was subtracted from the given positions, metres.
    """

    positions: Float[np.ndarray, "T joints 3"]
    skeleton: Skeleton
    start: int
    rooted: bool
    offset: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Stage:
    """All bodies of a film by name, with its rate in frames per second and its number of frames."""

    actors: dict[str, Actor]
    fps: float
    frames: int


def stage(motions: object, skeleton: Skeleton | None, fps: float | None, history: int) -> Stage:
    """Motions, or arrays with a skeleton and a rate, as bodies of one film.

    With a history a body that is shorter than the longest is its end, as in `storyboard`: a prediction fits beside the whole
    truth. Without, all begin together, and the shorter ones stay as they ended. Own choice: the floor is where the lowest joints
    of the first body are, one frame in a hundred aside; bodies without a root have a floor of their own.

    Args:
        motions: a `Motion`, a list of them, an array, or a mapping from names to these. An array is (T, 3J) about the root or
            (T, J+1, 3), metres, z up; with a further axis in front it is several motions.
        skeleton: of the arrays; a `Motion` has its own.
        fps: rate of the arrays, and of the film; None takes that of the first `Motion`. Motions of another rate are resampled.
        history: observed frames H.

    Raises:
        TypeError: something is neither a motion nor an array of numbers.
        ValueError: there are no motions, a shape does not fit the skeleton, a number is not finite, an array comes without
            skeleton or rate, or the history is longer than the film.
    """
    given = _named(motions)
    if not given:
        raise ValueError("motions are empty; expected at least one")
    rates = [motion.fps for motion in given.values() if isinstance(motion, Motion)]
    fps = fps or next(iter(rates), None)
    if fps is None or not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps is {fps}; expected the frames per second of the arrays")
    found = {name: _placed(name, motion, skeleton, fps) for name, motion in given.items()}
    frames = max(len(positions) for positions, _, _ in found.values())
    if not 0 <= history <= frames:
        raise ValueError(f"history is {history} frames; expected 0 to {frames}, the length of the longest motion")
    floors = {rooted: _origin(positions, rooted) for positions, _, rooted in reversed(found.values())}
    actors = {
        name: Actor(positions - floors[rooted], own, frames - len(positions) if history else 0, rooted, floors[rooted])
        for name, (positions, own, rooted) in found.items()
    }
    return Stage(actors, float(fps), frames)


def placed_pose(name: str, pose: Shown, actor: Actor) -> Float[np.ndarray, "joints 3"]:
    """A single pose where it stands on an actor's stage.

    Args:
        name: what an error calls it.
        pose: a `Motion` of one frame, (3J,) about the root or (J+1, 3), metres.

    Raises:
        ValueError: the shape does not fit the actor's skeleton, or the actor has a root where the pose has none, or none where
            it has one.
    """
    lone = pose if isinstance(pose, Motion) else array(pose)[None]
    positions, skeleton, rooted = _placed(name, lone, actor.skeleton, None)
    if len(positions) != 1 or len(skeleton) != len(actor.skeleton):
        raise ValueError(f"{name} has {len(positions)} frames of {skeleton.name}; expected one of {actor.skeleton.name}")
    if rooted != actor.rooted:
        has = {True: "with its root", False: "without its root"}
        raise ValueError(f"{name} is given {has[rooted]}, the motions {has[actor.rooted]}; expected the same of both")
    return positions[0] - actor.offset


def _named(motions: object) -> dict[str, Shown]:
    """Every motion by a name of its own; several in one array are counted."""
    if isinstance(motions, Mapping):
        items = list(motions.items())
    elif isinstance(motions, Sequence):
        items = [(_called(motion, f"motion {number}"), motion) for number, motion in enumerate(motions, 1)]
    else:
        items = [(_called(motions, ""), motions)]
    found: dict[str, Shown] = {}
    for name, motion in items:
        parts: dict[Any, Any] = {name: motion}
        if not isinstance(motion, Motion) and _several(values := array(motion)):
            parts = {f"{name} {number}".strip(): part for number, part in enumerate(values, 1)}
        for part, shown in parts.items():
            found[str(part) if part not in found else f"{part} ({len(found) + 1})"] = shown
    return found


def _called(motion: object, otherwise: str) -> str:
    return (motion.name or motion.action or otherwise) if isinstance(motion, Motion) else otherwise


def _several(values: np.ndarray) -> bool:
    return values.ndim == 4 or (values.ndim == 3 and values.shape[-1] != 3)


def _placed(name: str, motion: Shown, skeleton: Skeleton | None, fps: float | None) -> tuple[np.ndarray, Skeleton, bool]:
    """Positions (T, J+1, 3) with z up, their skeleton, and whether they have a root."""
    label = f"motion {name!r}" if name else "motion"
    if isinstance(motion, Motion):
        motion = motion.resample(fps or motion.fps).with_up("z")
        positions, skeleton, rooted = np.asarray(motion.positions, np.float64), motion.skeleton, True
    else:
        values = array(motion)
        if values.dtype.kind not in "fiu":
            raise TypeError(f"{label} is {type(motion).__name__} of {values.dtype}; expected a Motion or an array of numbers")
        if skeleton is None:
            raise ValueError(f"{label} is an array; expected skeleton=, to tell which joint is which")
        positions, rooted = _with_root(label, values.astype(np.float64), skeleton)
    if not np.isfinite(positions).all():
        frame, joint = np.argwhere(~np.isfinite(positions))[0, :2]
        raise ValueError(f"{label} has a number that is not finite at frame {frame}, {skeleton.joints[joint]}; expected metres")
    return positions, skeleton, rooted


def _with_root(label: str, values: np.ndarray, skeleton: Skeleton) -> tuple[np.ndarray, bool]:
    joints = len(skeleton)
    if values.ndim == 3 and values.shape[1:] == (joints, 3) and len(values):
        return values, True
    if values.ndim == 2 and values.shape[1] == 3 * (joints - 1) and len(values):
        relative = values.reshape(len(values), joints - 1, 3)
        return np.concatenate([np.zeros_like(relative[:, :1]), relative], axis=1), False
    takes = f"(T, {3 * joints - 3}) or (T, {joints}, 3) with T > 0"
    raise ValueError(f"{label} has shape {values.shape}; {skeleton.name} takes {takes}, metres")


def _origin(positions: np.ndarray, rooted: bool) -> np.ndarray:
    """The place on the floor below the root's first position."""
    floor = np.quantile(positions[..., 2].min(axis=1), FLOOR_SHARE)
    return np.array([*positions[0, 0, :2], floor]) if rooted else np.array([0.0, 0.0, floor])
