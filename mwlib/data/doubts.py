"""What a look at motion data finds wanting: clips too short to train on, and signs that something is wrong."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from mwlib.body.correspondence import to_h36m17
from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17
from mwlib.data.published import MOST_NAMES, frames_at
from mwlib.data.sides import unmirrored
from mwlib.data.stated import Reading
from mwlib.data.units import ADULT, height
from mwlib.data.upright import UPRIGHT, standing

GLITCH = 25.0  # metres per second; above it are the marker glitches of CMU, below it its good clips


def fastest(motion: Motion) -> float:
    """Fastest joint between two frames, metres per second."""
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1)
    return float(steps.max(initial=0.0)) * motion.fps


def left_out(clips: Sequence[tuple[str, Motion]], cut: tuple[float, int, int, int]) -> list[str]:
    """One line on the clips that give no window.

    Args:
        clips: file or clip name, motion.
        cut: rate, history, future and stride of the windows.
    """
    fps, history, future, _ = cut
    short = [name for name, motion in clips if frames_at(motion, fps) <= history + future]
    return [f"{len(short)} clips no longer than {history} + {future} frames at {fps:g} Hz: {_some(short)}"] if short else []


def looks_wrong(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """One line for each kind of doubt, with the names of the clips: size, axis, speed, copies, people, sides, skeletons.

    Args:
        clips: file or clip name, reading.
    """
    motions = [reading.motion for _, reading in clips]
    return [*_bodies(clips), *_copies(clips), *_people(motions), *_skeletons(clips)]


def _bodies(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """Size, up-axis and speed."""
    small, other, wild = [], [], []
    for name, reading in clips:
        m = reading.motion
        tall, stands = height(m.positions, m.skeleton), standing(m.positions, m.skeleton, m.up)
        small += [f"{name} ({tall:.3g} m)"] if not ADULT[0] <= tall <= ADULT[1] else []
        other += [f"{name} (along {stands.axis})"] if stands.is_clear or stands.share < UPRIGHT else []
        wild += [f"{name} ({fastest(m):.0f} m/s)"] if fastest(m) > GLITCH else []
    return [
        *([f"no adult's height: {_some(small)}. State the unit if that is wrong"] if small else []),
        *([f"not upright along the up-axis: {_some(other)}. People who lie, or another axis is up"] if other else []),
        *([f"faster than {GLITCH:g} m/s, so perhaps glitches: {_some(wild)}"] if wild else []),
    ]


def _copies(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    same: dict[bytes, list[str]] = {}
    for name, reading in clips:
        content = np.ascontiguousarray(reading.motion.positions, dtype=np.float32)
        same.setdefault(hashlib.sha256(content.tobytes()).digest(), []).append(name)
    twice = [" = ".join(names) for names in same.values() if len(names) > 1]
    return [f"the same clip twice, perhaps in training and test: {_some(twice)}"] if twice else []


def _people(motions: Sequence[Motion]) -> list[str]:
    people = {m.subject for m in motions}
    if len(people) != 1:
        return []
    who = f"one subject only, {next(iter(people))!r}" if people != {""} else "no clip has a subject"
    return [f"{who}: test clips will be of people trained on. A column subject in clips.csv tells people apart"]


def _skeletons(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """Skeletons as training will have them: without pairs, or more than one."""
    kinds: dict[str, list[tuple[str, Motion]]] = {}
    for name, reading in clips:
        m = reading.motion if to_h36m17(reading.motion.skeleton) is None else reading.motion.retarget(H36M17)
        kinds.setdefault(m.skeleton.name, []).append((name, m))
    reasons = [unmirrored([m for _, m in group]) for group in kinds.values()]
    found = [f"training will not mirror: {reason}" for reason in reasons if reason]
    if len(kinds) > 1:
        groups = "; ".join(f"{kind} ({_some([name for name, _ in group], 3)})" for kind, group in kinds.items())
        found.append(f"{len(kinds)} skeletons, and training takes one: {groups}")
    return found


def _some(names: Sequence[str], most: int = MOST_NAMES) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
