"""Doubts about what motions mean: up-axis, rate, first frame, people, order of joints; and rows of a clips.csv without files."""

import difflib
import os
import re
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import AXES, bone_lengths
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton, is_cmu
from mwlib.data.collections.cmu import recorded_at
from mwlib.data.meaning import LEVELS_UP, OTHERWISE, STATE_AXIS, UPRIGHT, Reading, head_and_feet, looked_at, rows_of, standing
from mwlib.data.mirroring import way_to
from mwlib.data.untrusted import PACKED, MotionFormatError, bare_name

MOST_NAMES = 12


def doubted(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """A sentence on each kind of doubt about what numbers mean, with the clips and what settles it.

    Args:
        clips: names, such as the files', and what was read.
    """
    return [text for kind in (_up_doubts, _rate_doubts, _people_doubts, _order_doubts) for text in kind(clips)]


def begin_with_a_jump(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """A sentence on the clips that begin with a jump, as an added T-pose makes it; none where first_frame was stated."""
    names = []
    for name, reading in clips:
        if not reading.first.is_users and (count := unsettled(reading.motion)):
            first = reading.first.value
            pose = ", which is the rest pose" if _is_at_rest(reading.motion) else ""
            names.append(f"{name} (from row {first}{pose}, to row {first + count}: first_frame {first + count})")
    remedy = "such a column in clips.csv cuts that off, or keeps it"
    return [f"they begin with a jump, as after an added T-pose: {some(names)}; {remedy}"] if names else []


BEGINNING = 10  # steps in which a clip may settle
JUMPY, LEAST = 2.0, 5.0  # as fast as hardly any later step, and metres per second: clips of LaFAN1 and Bandai-Namco have none
AT_REST = np.deg2rad(10)


def unsettled(motion: Motion) -> int:
    """How many steps at the beginning are faster than a clip ever is again: joints jump from a pose that was put before it.

    Own choice: twice as fast as 99 in 100 later steps. Programs that make BVH of other data add a T-pose, and then their fingers
    take three rows to come down.
    """
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1).max(axis=1, initial=0.0) * motion.fps
    if len(steps) < 4 * BEGINNING:
        return 0
    is_fast = steps[:BEGINNING] > max(JUMPY * np.percentile(steps[BEGINNING:], 99), LEAST)
    return int(np.argmin(is_fast))


def _is_at_rest(motion: Motion) -> bool:
    """Whether hardly a joint but the root is turned in the first frame."""
    if motion.rig is None:
        return False
    turning = [j for j, names in enumerate(motion.rig.channels) if j and any(name.endswith("rotation") for name in names or ())]
    angles = 2 * np.arccos(np.clip(np.abs(motion.rig.rotations[0, turning, 0]), 0, 1))
    return bool(turning and np.percentile(angles, 90) < AT_REST)


def some(names: Sequence[str], most: int = MOST_NAMES) -> str:
    """Names in a sentence, the first of many."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _up_doubts(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    found: dict[tuple[str, str, str], list[str]] = {}
    for name, reading in clips:
        if axis := other_axis(reading):
            found.setdefault((axis, reading.up.value, reading.up.source), []).append(name)
    sentences = []
    for (axis, up, source), names in found.items():
        remedy = f"say up={axis}" if axis in AXES else "turn them so that y or z points up, and say which by up="
        said = f"the figure stands along {axis}, and {up} up was assumed, as {source} has it: {some(names)}"
        sentences.append(f"{said}; {remedy} {STATE_AXIS}; if somebody lies there, up={up}")
    return sentences


def _rate_doubts(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    names = [f"{name} ({reading.fps.value:g} Hz)" for name, reading in clips if recorded_slower(reading)]
    remedy = "say fps 60 in clips.csv, or file_fps=60"
    return [f"CMU recorded them at 60 Hz, and their files say otherwise: {some(names)}; {remedy}"] if names else []


def _people_doubts(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """Subjects that differ in capitals, signs or zeros in front: one person may then be in training and test."""
    spellings: dict[str, dict[str, None]] = {}
    for _, reading in clips:
        plain = re.sub(r"(?<!\d)0+(?=\d)", "", re.sub(r"[\W_]+", " ", reading.motion.subject.casefold()).strip())
        spellings.setdefault(plain, {})[reading.motion.subject] = None
    alike = [" and ".join(map(repr, names)) for names in spellings.values() if len(names) > 1]
    remedy = "give one person one name in the column subject of clips.csv, and two people names that differ more"
    return [f"subjects of like names are taken for several people: {some(alike)}; {remedy}"] if alike else []


def _order_doubts(clips: Sequence[tuple[str, Reading]]) -> list[str]:
    """Joints that likely have each other's names."""
    names = [f"{name} ({reason})" for name, reading in clips if (reason := misnamed(reading))]
    remedy = "joint names in the order of the columns, left ones on the left, and right-handed axes"
    return [f"joints likely have each other's names: {some(names)}; expected {remedy}"] if names else []


BACKWARDS = 0.05  # mean sine of the knees' bend, away from where knees bend; recorded people have -0.067 and less
UNEVEN = 0.15  # by how much of themselves bones of both sides differ, over all pairs


def misnamed(reading: Reading) -> str:
    """Why a body likely has the joints' names in another order than their places; "" without a doubt.

    Own choice: both sides have bones of like lengths, heads are above feet in most frames, and knees bend forwards: thigh x shin
    points to the left, whichever axis is up.
    """
    motion, skeleton = reading.motion, reading.motion.skeleton
    places = looked_at(motion.positions).astype(float)
    lengths = dict(zip((child for _, child in skeleton.bones), np.median(bone_lengths(places, skeleton), axis=0), strict=True))
    left, right = (np.array([lengths.get(joint, 0.0) for joint in side]) for side in (skeleton.left, skeleton.right))
    if np.abs(left - right).sum() > UNEVEN * np.maximum(left, right).sum():
        joint = int(np.argmax(np.abs(left - right)))
        first, second = skeleton.joints[skeleton.left[joint]], skeleton.joints[skeleton.right[joint]]
        return f"bones to {first} and {second} are {left[joint]:.2g} and {right[joint]:.2g} m long"
    if standing(places, skeleton, motion.up)[::2] == (f"-{motion.up}", True):
        return f"the head is below the feet along {motion.up}, which {reading.up.source} says is up"
    return "knees bend backwards" if _bend(places, skeleton) < -BACKWARDS else ""


def _bend(places: Float[np.ndarray, "T joints 3"], skeleton: Skeleton) -> float:
    """Mean sine of the angle by which knees bend forwards; 0 where no legs are known."""
    pairs = dict(zip(skeleton.left, skeleton.right, strict=True))
    feet = [joint for joint in head_and_feet(skeleton)[1] if joint in pairs]
    left = [joint for joint in way_to(feet[-1], skeleton) if joint in pairs] if feet else []
    if len(left) < 3:
        return 0.0
    lengths = np.median(np.linalg.norm(np.diff(places[:, left], axis=1), axis=-1), axis=0)
    hip = int(np.argmax(np.minimum(lengths[1:], lengths[:-1])))  # the two longest bones in a row are thigh and shin
    leg = left[hip : hip + 3]
    sines = []
    for side in (leg, [pairs[joint] for joint in leg]):
        (thigh, shin), across = np.diff(places[:, side], axis=1).swapaxes(0, 1), places[:, leg[0]] - places[:, pairs[leg[0]]]
        size = np.prod([np.linalg.norm(way, axis=-1) for way in (thigh, shin, across)], axis=0)
        sines.append((np.cross(thigh, shin) * across).sum(-1) / np.maximum(size, 1e-9))
    return float(np.mean(sines))


def recorded_slower(reading: Reading) -> bool:
    """Whether CMU recorded the trial of this name at 60 Hz, while the file says another rate, and nobody else a rate."""
    trial = re.fullmatch(r"(\d+)_(\d+)", reading.motion.name)
    if trial is None or reading.fps.is_users or not is_cmu(reading.motion.skeleton):
        return False
    return recorded_at(*trial.groups()) == 60.0 and abs(reading.fps.value - 60.0) > 1.0


LIMB = 0.2  # of the longest way from the root to an end: shorter twigs, such as fingers, are no limbs
ALIKE = 0.05  # by how much of themselves two limbs of a pair differ at most
LEGS = 1.1  # by how much legs are longer than arms, at least
FLATTER = 1.5  # how much further than along the axis said to be up a body reaches along the other one: without limbs only


def other_axis(reading: Reading) -> str:
    """The axis along which a body of nameless joints stands, as "z", where nobody stated another one; "" without a doubt.

    Own choice: the longer of two pairs of like limbs are legs, and from their ends to where the arms part is upwards, whatever
    the arms do. Where limbs cannot be told apart: the body reaches much further along the other axis that is up in files.
    """
    motion, skeleton = reading.motion, reading.motion.skeleton
    if reading.up.is_users or all(head_and_feet(skeleton)):
        return ""
    places = looked_at(motion.positions)
    here = AXES[motion.up]
    limbs = _limbs(places, skeleton)
    if limbs is None:
        extent = np.median(np.ptp(places, axis=1), axis=0)
        other = next(axis for axis in AXES if axis != motion.up)
        return other if extent[AXES[other]] > FLATTER * extent[here] else ""
    feet, chest = limbs
    way = places[:, chest] - places[:, feet].mean(axis=1)
    lean = np.median(way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9), axis=0)
    axis = int(np.argmax(np.abs(lean)))
    is_other = abs(lean[axis]) > OTHERWISE and lean[here] < UPRIGHT
    return "-" * bool(lean[axis] < 0) + "xyz"[axis] if is_other else ""


def _limbs(places: Float[np.ndarray, "T joints 3"], skeleton: Skeleton) -> tuple[list[int], int] | None:
    """Ends of both legs, and the joint where the arms part; None if there are not two pairs of limbs."""
    lengths = dict(zip(skeleton.bones, np.median(bone_lengths(places, skeleton), axis=0), strict=True))
    way, end, size = np.zeros(len(skeleton)), np.arange(len(skeleton)), np.ones(len(skeleton))
    for (parent, child), length in reversed(lengths.items()):
        size[parent] += size[child]
        if way[child] + length > way[parent]:
            way[parent], end[parent] = way[child] + length, end[child]
    pairs = []
    for joint in range(len(skeleton)):
        branches = [(way[b] + length, b) for (a, b), length in lengths.items() if a == joint]
        for (one, first), (two, second) in combinations(branches, 2):
            is_pair = size[first] == size[second] and abs(one - two) < ALIKE * max(one, two)
            if is_pair and min(one, two) > LIMB * way[0]:
                pairs.append((min(one, two), joint, [int(end[first]), int(end[second])]))
    pairs.sort(key=lambda pair: -pair[0])
    if len(pairs) != 2 or pairs[0][0] < LEGS * pairs[1][0] or pairs[0][1] == pairs[1][1]:
        return None
    return pairs[0][2], pairs[1][1]


def rows_without_files(files: Sequence[Path]) -> list[str]:
    """A sentence on each clips.csv beside and above some files of which rows match no file, with files that may have been meant.

    A table that cannot be read is passed over: its error is told when a file is read.
    """
    folders = {folder for parent in {file.parent for file in files} for folder in _levels(parent.resolve())}
    found = []
    for table in sorted(folder / "clips.csv" for folder in folders):
        try:
            rows = rows_of(table) if table.is_file() else {}
        except MotionFormatError:
            continue
        if alone := [row["file"] for key, row in rows.items() if not _is_there(key, table.parent)]:
            names = {bare_name(file).lower(): os.path.relpath(file.resolve(), table.parent) for file in files}

            def told(word: str, names: dict[str, str] = names) -> str:
                """A row's file, and the one that may have been meant."""
                near = difflib.get_close_matches(bare_name(Path(word)).lower(), names, n=1, cutoff=0.9)
                return repr(word[:80]) + "".join(f" (did you mean {names[name]!r}?)" for name in near)

            words = [told(word) for word in alone[:MOST_NAMES]] + alone[MOST_NAMES:]
            expected = f"paths from the table's folder or one above, at most {LEVELS_UP - 1} folders deep"
            found.append(f"{table}: {len(alone)} rows match no file: {some(words)}; expected {expected}")
    return found


def _levels(folder: Path) -> tuple[Path, ...]:
    return (folder, *folder.parents)[:LEVELS_UP]


def _is_there(key: str, folder: Path) -> bool:
    """Whether a file is below the folder of a clips.csv whose row is found by this key."""
    parts, above = tuple(key.split("/")), folder.parts
    for start in range(len(parts)):
        inside = parts[start:]
        if len(inside) <= LEVELS_UP and ".." not in inside and (not start or above[-start:] == parts[:start]):
            if any(os.path.isfile(str(folder.joinpath(*inside)) + packing) for packing in ("", *PACKED)):
                return True
    return False
