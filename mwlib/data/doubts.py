"""Doubts about what motions mean: up-axis, rate, first frame, people, order of joints; and rows of a clips.csv without files."""

import difflib
import os
import re
from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from mwlib.body.kinematics import AXES, bone_lengths
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton, is_cmu
from mwlib.data.collections.cmu import recorded_at
from mwlib.data.mirroring import way_to
from mwlib.data.untrusted import PACKED, MotionFormatError, bare_name

from mwlib.data.meaning import (  # isort: skip
    LEVELS_UP, STATE_AXIS, TURN, Places, Reading, head_and_feet, leaning, looked_at, rows_of, standing,
)  # fmt: skip

Clips = Sequence[tuple[str, Reading]]  # names, such as the files', and what was read
MOST_NAMES = 12


def doubted(clips: Clips) -> list[str]:
    """A sentence on each kind of doubt about what numbers mean, with the clips and what settles it."""
    return [*_up_doubts(clips), *told(clips, recorded_slower, SLOWER), *_people_doubts(clips), *told(clips, misnamed, MISNAMED)]


SLOWER = "CMU recorded them at 60 Hz, and their files say otherwise: {}; say fps 60 in clips.csv, or file_fps=60"
MISNAMED = (
    "joints likely have each other's names: {}; expected joint names in the order of the columns, left ones on the left, and "
    "right-handed axes"
)


def told(clips: Clips, reason: Callable[[Reading], str], sentence: str) -> list[str]:
    """A sentence on the clips for which there is a reason; none if there is none for any."""
    names = [f"{name} ({why})" for name, reading in clips if (why := reason(reading))]
    return [sentence.format(some(names))] if names else []


def jump(reading: Reading) -> str:
    """From which row a clip jumps to which, as an added T-pose makes it; "" if it does not, or if the user keeps it so."""
    count = 0 if reading.first.is_users else unsettled(reading.motion)
    first, pose = reading.first.value, ", which is the rest pose" if _is_at_rest(reading.motion) else ""
    return f"from row {first}{pose}, to row {first + count}: first_frame {first + count}" if count else ""


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


def _up_doubts(clips: Clips) -> list[str]:
    found: dict[str, list[str]] = {}
    for name, reading in clips:
        if axis := other_axis(reading):
            up, remedy = reading.up.value, f"say up={axis}" if axis in AXES else TURN
            said = f"the figure stands along {axis}, and {up} up was assumed, as {reading.up.source} has it: {{}}"
            found.setdefault(f"{said}; {remedy} {STATE_AXIS}; if somebody lies there, up={up}", []).append(name)
    return [sentence.format(some(names)) for sentence, names in found.items()]


def _people_doubts(clips: Clips) -> list[str]:
    """Subjects that differ in capitals, signs or zeros in front: one person may then be in training and test."""
    spellings: dict[str, dict[str, None]] = {}
    for _, reading in clips:
        plain = re.sub(r"(?<!\d)0+(?=\d)", "", re.sub(r"[\W_]+", " ", reading.motion.subject.casefold()).strip())
        spellings.setdefault(plain, {})[reading.motion.subject] = None
    alike = [" and ".join(map(repr, names)) for names in spellings.values() if len(names) > 1]
    remedy = "give one person one name in the column subject of clips.csv, and two people names that differ more"
    return [f"subjects of like names are taken for several people: {some(alike)}; {remedy}"] if alike else []


BACKWARDS = 0.05  # mean sine of the knees' bend, away from where knees bend; recorded people have -0.067 and less
UNEVEN = 0.15  # by how much of themselves bones of both sides differ, over all pairs


def misnamed(reading: Reading) -> str:
    """Why a body likely has the joints' names in another order than their places; "" without a doubt.

    Own choice: both sides have bones of like lengths, heads are above feet in most frames, and knees bend forwards: thigh x shin
    points to the left, whichever axis is up.
    """
    motion, skeleton = reading.motion, reading.motion.skeleton
    places = looked_at(motion.positions).astype(float)
    lengths = np.append(0.0, np.median(bone_lengths(places, skeleton), axis=0))  # of the root none
    left, right = lengths[[*skeleton.left]], lengths[[*skeleton.right]]
    if np.abs(left - right).sum() > UNEVEN * np.maximum(left, right).sum():
        joint = int(np.argmax(np.abs(left - right)))
        first, second = skeleton.joints[skeleton.left[joint]], skeleton.joints[skeleton.right[joint]]
        return f"bones to {first} and {second} are {left[joint]:.2g} and {right[joint]:.2g} m long"
    if standing(places, skeleton, motion.up)[::2] == (f"-{motion.up}", True):
        return f"the head is below the feet along {motion.up}, which {reading.up.source} says is up"
    return "knees bend backwards" if _bend(places, skeleton) < -BACKWARDS else ""


def _bend(places: Places, skeleton: Skeleton) -> float:
    """Mean sine of the angle by which knees bend forwards; 0 where no legs are known."""
    pairs = dict(zip(skeleton.left, skeleton.right, strict=True))
    feet = [joint for joint in head_and_feet(skeleton)[1] if joint in pairs]
    left = [joint for joint in way_to(feet[-1], skeleton) if joint in pairs] if feet else []
    if len(left) < 3:
        return 0.0
    lengths = np.median(np.linalg.norm(np.diff(places[:, left], axis=1), axis=-1), axis=0)
    hip = int(np.argmax(np.minimum(lengths[1:], lengths[:-1])))  # the two longest bones in a row are thigh and shin
    leg = left[hip : hip + 3]
    thigh, shin = np.moveaxis(np.diff(places[:, [leg, [pairs[joint] for joint in leg]]], axis=2), 2, 0)
    across = (places[:, leg[0]] - places[:, pairs[leg[0]]])[:, None]
    size = np.linalg.norm(thigh, axis=-1) * np.linalg.norm(shin, axis=-1) * np.linalg.norm(across, axis=-1)
    return float(np.mean((np.cross(thigh, shin) * across).sum(-1) / np.maximum(size, 1e-9)))


def recorded_slower(reading: Reading) -> str:
    """The rate in the file of a trial that CMU recorded at 60 Hz; "" where it is that one, or somebody else said one."""
    trial = re.fullmatch(r"(\d+)_(\d+)", reading.motion.name)
    if trial is None or reading.fps.is_users or not is_cmu(reading.motion.skeleton):
        return ""
    return f"{reading.fps.value:g} Hz" * (recorded_at(*trial.groups()) == 60.0 and abs(reading.fps.value - 60.0) > 1.0)


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
    limbs = _limbs(places, skeleton)
    if limbs is None:
        extent = np.median(np.ptp(places, axis=1), axis=0)
        other = next(axis for axis in AXES if axis != motion.up)
        return other if extent[AXES[other]] > FLATTER * extent[AXES[motion.up]] else ""
    feet, chest = limbs
    found = leaning(places[:, chest] - places[:, feet].mean(axis=1), motion.up)
    return found.axis if found.is_clear else ""


def _limbs(places: Places, skeleton: Skeleton) -> tuple[list[int], int] | None:
    """Ends of both legs, and the joint where the arms part; None if there are not two pairs of limbs."""
    lengths = dict(zip(skeleton.bones, np.median(bone_lengths(places, skeleton), axis=0), strict=True))
    way, end, size = np.zeros(len(skeleton)), np.arange(len(skeleton)), np.ones(len(skeleton))
    reach = {}  # of the branch that begins with the bone to a joint
    for (parent, child), length in reversed(lengths.items()):
        size[parent] += size[child]
        reach[child] = way[child] + length
        if reach[child] > way[parent]:
            way[parent], end[parent] = reach[child], end[child]
    pairs = []
    for (joint, one), (other, two) in combinations(skeleton.bones, 2):
        short, long = sorted((reach[one], reach[two]))
        if joint == other and size[one] == size[two] and long - short < ALIKE * long and short > LIMB * way[0]:
            pairs.append((short, joint, [int(end[one]), int(end[two])]))
    pairs.sort(reverse=True)
    if len(pairs) != 2 or pairs[0][0] < LEGS * pairs[1][0] or pairs[0][1] == pairs[1][1]:
        return None
    return pairs[0][2], pairs[1][1]


def rows_without_files(files: Sequence[Path]) -> list[str]:
    """A sentence on each clips.csv beside and above some files of which rows match no file, with files that may have been meant.

    A table that cannot be read is passed over: its error is told when a file is read.
    """
    parents = {file.parent.resolve() for file in files}
    found = []
    for table in sorted({folder / "clips.csv" for parent in parents for folder in (parent, *parent.parents)[:LEVELS_UP]}):
        try:
            rows = rows_of(table) if table.is_file() else {}
        except MotionFormatError:
            continue
        if alone := [row["file"] for key, row in rows.items() if not _is_there(key, table.parent)]:
            names = {bare_name(file).lower(): os.path.relpath(file.resolve(), table.parent) for file in files}
            words = [_meant(word, names) for word in alone[:MOST_NAMES]] + alone[MOST_NAMES:]
            expected = f"paths from the table's folder or one above, at most {LEVELS_UP - 1} folders deep"
            found.append(f"{table}: {len(alone)} rows match no file: {some(words)}; expected {expected}")
    return found


def _meant(word: str, names: dict[str, str]) -> str:
    """A row's file, and the one that may have been meant."""
    near = difflib.get_close_matches(bare_name(Path(word)).lower(), names, n=1, cutoff=0.9)
    return repr(word[:80]) + "".join(f" (did you mean {names[name]!r}?)" for name in near)


def _is_there(key: str, folder: Path) -> bool:
    """Whether a file is below the folder of a clips.csv whose row is found by this key."""
    parts, above = tuple(key.split("/")), folder.parts
    for start in range(len(parts)):
        inside = parts[start:]
        if len(inside) <= LEVELS_UP and ".." not in inside and (not start or above[-start:] == parts[:start]):
            if any(os.path.isfile(str(folder.joinpath(*inside)) + packing) for packing in ("", *PACKED)):
                return True
    return False
