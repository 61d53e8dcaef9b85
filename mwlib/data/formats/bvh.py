"""Reading BVH: CMU (cgspeed and Daz conversions), LaFAN1, Bandai-Namco, and any other skeleton."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Container, Iterator
from dataclasses import dataclass
from itertools import chain, repeat
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.rig import ANGLES, MOVES, Rig, axes_of
from mwlib.body.rotation import euler_matrices, euler_quaternions
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.collections import SKELETONS
from mwlib.data.collections.bandai_namco import BANDAI21
from mwlib.data.formats.asf_amc import CMU_BONES, OF_CMU, far_ends, same_tree
from mwlib.data.formats.frames import in_blocks, rotation_track, starts_in_tpose
from mwlib.data.meaning import FASTEST, FILE, FORMAT, SLOWEST, Hints, Reading, Stated, infer_unit
from mwlib.data.mirroring import own_skeleton, rig_skeleton

from mwlib.data.untrusted import (  # isort: skip
    LONGEST_WORD, MOST_JOINTS, MOST_POINTS, MotionFormatError, allowed, number, number_table, read_text, words_of,
)  # fmt: skip

# The parents of the 31 cgspeed joints, and the node that stands at each point of CMU. The file has no length for the
# thorax and wrist bones: their far ends coincide with their near ones.
CGSPEED_PARENTS = tuple(
    int(p) for p in "-1 0 1 2 3 4 0 6 7 8 9 0 11 12 13 14 15 13 17 18 19 20 21 20 13 24 25 26 27 28 27".split()
)
CGSPEED_POINTS = (
    "Hips LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftToeBase/End RightUpLeg RightLeg RightFoot RightToeBase RightToeBase/End "
    "Spine Spine1 Neck Neck1 Head Head/End LeftArm LeftForeArm LeftHand LeftFingerBase LFingers LFingers/End LThumb/End "
    "RightArm RightForeArm RightHand RightFingerBase RFingers RFingers/End RThumb/End"
).split()


@dataclass
class Node:
    """A joint and the columns of its channels, or an End Site (named after its joint, without channels)."""

    name: str
    parent: int
    offset: list[float] | None = None
    channels: dict[str, int] | None = None
    is_end: bool = False

    def columns(self, kind: Container[str]) -> dict[str, int]:
        """Those of the channels of one kind, in the file's order."""
        return {name: column for name, column in (self.channels or {}).items() if name in kind}


def bvh_skeleton(nodes: list[Node]) -> tuple[Skeleton, list[int]]:
    """The skeleton of a file, and which node each of its joints is."""
    names = [n.name for n in nodes]
    joints = [i for i, n in enumerate(nodes) if not n.is_end]
    own = own_skeleton(tuple(names[i] for i in joints), tuple(joints.index(nodes[i].parent) if i else -1 for i in joints))
    if own.parents == CGSPEED_PARENTS and set(CGSPEED_POINTS) <= set(names):
        return CMU, [names.index(n) for n in CGSPEED_POINTS]
    if same_tree(own, OF_CMU):
        ends = far_ends(rig_skeleton(tuple(names), tuple(n.parent for n in nodes)))
        return CMU, [ends[names.index(bone)] for bone in CMU_BONES]
    for known in SKELETONS.values():
        if same_tree(own, known) or (known is BANDAI21 and same_tree(own, _under("joint_Root", known))):
            return known, [names.index(name) for name in known.joints]
    return own, joints


def _under(root: str, skeleton: Skeleton) -> Skeleton:
    """The skeleton with one more joint above its root."""
    return Skeleton("", (root, *skeleton.joints), (-1, *(parent + 1 for parent in skeleton.parents)))


def frame_offsets(nodes: list[Node], table: Float[np.ndarray, "T channels"]) -> Float[np.ndarray, "T nodes 3"]:
    """Offsets in every frame, the file's unit: position channels replace those of the hierarchy."""
    offsets = np.tile(np.array([n.offset for n in nodes]), (len(table), 1, 1))
    for joint, node in enumerate(nodes):
        for name, column in node.columns(MOVES).items():
            offsets[:, joint, MOVES.index(name)] = table[:, column]
    return offsets


def bvh_rig(nodes: list[Node], table: Float[np.ndarray, "T channels"], points: list[int], metres: float) -> Rig:
    """The rig of a file: every node, End Sites among them.

    Args:
        table: the rows of MOTION, degrees and the file's unit.
        points: which node stands at each joint of the motion.
        metres: per unit of the file.
    """
    turning: dict[str, list[int]] = defaultdict(list)  # axes -> joints that turn about these
    for joint, node in enumerate(nodes):
        turning[axes_of(node.columns(ANGLES))].append(joint)

    def rotations(part: slice) -> Float[np.ndarray, "n nodes 4"]:
        """Quaternions of the nodes in a part of the frames."""
        found = np.empty((part.stop - part.start, len(nodes), 4))
        for axes, joints in turning.items():
            columns = np.array([[*nodes[joint].columns(ANGLES).values()] for joint in joints], dtype=int)
            found[:, joints] = euler_quaternions(axes, np.deg2rad(table[part, columns]))
        return found

    def moves(part: slice) -> Float[np.ndarray, "n nodes 3"]:
        """Offsets of the nodes in a part of the frames, metres."""
        return frame_offsets(nodes, table[part]) * metres

    is_moving = any(node.columns(MOVES) for node in nodes[1:])
    return Rig(
        rig_skeleton(tuple(n.name for n in nodes), tuple(n.parent for n in nodes)),
        np.array([n.offset for n in nodes]) * metres,
        rotation_track(rotations, len(table), len(nodes)),
        frame_offsets(nodes[:1], table)[:, 0] * metres,
        tuple(points),
        tuple(None if n.is_end else tuple(n.channels or ()) for n in nodes),
        in_blocks(moves, len(table), len(nodes)) if is_moving else None,
        metres,
    )


DEEPEST = 200
END = "the end of the hierarchy"  # in place of words behind its last one
COMMON_RATES = (24, 25, 30, 48, 50, 60, 72, 75, 90, 100, 120, 144, 150, 180, 200, 240)  # hertz


def read_bvh(file: Path, hints: Hints) -> Reading:
    """Read one BVH file: joint positions in metres, y up unless `hints` say otherwise, and the rotations behind them.

    Position channels replace the offset. An added T-pose row is dropped. The cgspeed skeleton becomes CMU's 31 points, and so
    does an ASF skeleton that `write_bvh` wrote; one with the joints of a known skeleton becomes that one (Bandai-Namco's
    without joint_Root); any other keeps its joints without End Sites. The rig keeps them all.

    Raises:
        MotionFormatError: the file is malformed, or its unit cannot be told (see `infer_unit`).
    """
    text = read_text(file)
    split = re.search(r"^[ \t]*MOTION\b", text, re.MULTILINE)
    if split is None:
        raise MotionFormatError(file, "end of HIERARCHY", "no MOTION section", "a line MOTION")
    nodes = _hierarchy(chain(words_of(text, split.start()), repeat(END)), file)
    skeleton, picked = bvh_skeleton(nodes)
    if len(skeleton) < 2:
        raise MotionFormatError(file, "HIERARCHY", "one joint", "at least two")
    table, fps = _motion(text, split.end(), nodes, file)
    del text  # the clip needs its memory
    positions = _positions(nodes, table, picked)
    unit = hints.unit or infer_unit(positions, skeleton, file)
    up, rate = hints.up or Stated("y", FORMAT), hints.fps or Stated(fps, FILE)
    positions *= unit.value
    turns = table[:, [*nodes[0].columns(ANGLES).values()]]
    first = int(hints.first_frame is None and starts_in_tpose(turns, positions, up.value))
    rig = bvh_rig(nodes, table[first:], picked, unit.value)
    return hints.reading(file, positions[first:], skeleton, unit, up, rate, Stated(first, FILE), rig)


def _hierarchy(rest: Iterator[str], file: Path) -> list[Node]:
    """The nodes in file order: parents before children."""
    first = next(rest)
    if first != "HIERARCHY":
        raise MotionFormatError(file, "start", repr(first[:40]), "HIERARCHY")
    nodes: list[Node] = []
    stack: list[int] = []
    while (word := next(rest)) != END:
        place = f"joint {nodes[stack[-1]].name}" if stack else "HIERARCHY"
        if word in ("ROOT", "JOINT", "End"):
            if (word == "ROOT") == bool(stack) or (nodes and not stack):
                raise MotionFormatError(file, place, word, "one ROOT, everything else inside it")
            _open(word, rest, nodes, stack, file, place)
        elif word == "}" and stack:
            node = nodes[stack.pop()]
            missing = [name for name, value in (("OFFSET", node.offset), ("CHANNELS", node.channels)) if value is None]
            if missing:
                raise MotionFormatError(file, f"joint {node.name}", f"no {' and no '.join(missing)}", "both")
        elif word == "OFFSET" and stack and nodes[stack[-1]].offset is None:
            nodes[stack[-1]].offset = [number(next(rest), file, f"{place}, OFFSET") for _ in range(3)]
        elif word == "CHANNELS" and stack and nodes[stack[-1]].channels is None and not nodes[stack[-1]].is_end:
            start = sum(len(node.channels or ()) for node in nodes)
            nodes[stack[-1]].channels = {name: start + i for i, name in enumerate(_channel_names(rest, file, place))}
        else:
            raise MotionFormatError(file, place, repr(word[:40]), "JOINT, End Site, one OFFSET, one CHANNELS or }")
    if stack or not nodes:
        raise MotionFormatError(file, "end of HIERARCHY", f"{len(stack)} open braces, {len(nodes)} joints", "a closed ROOT")
    names = [n.name for n in nodes if not n.is_end]
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise MotionFormatError(file, "HIERARCHY", f"two joints named {twice!r}", "different names")
    return nodes


def _open(word: str, rest: Iterator[str], nodes: list[Node], stack: list[int], file: Path, place: str) -> None:
    """Append the node that begins here and step into it."""
    name = []
    while (part := next(rest)) != "{":
        name.append(part)
        if len(" ".join(name)) > LONGEST_WORD:
            raise MotionFormatError(file, place, " ".join(name)[:40], f"a name of at most {LONGEST_WORD} characters, then {{")
    parent = stack[-1] if stack else -1
    is_end = word == "End"
    if len(name) == 0 or (is_end and (name != ["Site"] or nodes[parent].is_end)) or (stack and nodes[parent].is_end):
        raise MotionFormatError(file, place, f"{word} {' '.join(name)[:40]}", "ROOT name, JOINT name or End Site, then {")
    label = f"{nodes[parent].name}/End" if is_end else " ".join(name)
    stack.append(len(nodes))
    nodes.append(Node(label, parent, channels={} if is_end else None, is_end=is_end))
    if len(nodes) > MOST_JOINTS or len(stack) > DEEPEST:
        found = f"{len(nodes)} joints, {len(stack)} deep"
        raise MotionFormatError(file, "HIERARCHY", found, f"at most {MOST_JOINTS}, {DEEPEST} deep")


def _channel_names(rest: Iterator[str], file: Path, place: str) -> list[str]:
    count = next(rest)
    if not re.fullmatch("[0-6]", count):
        raise MotionFormatError(file, f"{place}, CHANNELS", repr(count[:40]), "a number from 0 to 6")
    names = [next(rest).lower() for _ in range(int(count))]
    if not set(names) <= {*MOVES, *ANGLES} or len(set(names)) < len(names):
        raise MotionFormatError(file, f"{place}, CHANNELS", " ".join(names)[:120], "different ones of Xposition ... Zrotation")
    return names


def _motion(text: str, start: int, nodes: list[Node], file: Path) -> tuple[Float[np.ndarray, "T channels"], float]:
    """The number table and the frame rate."""
    head = re.compile(r"\s*Frames:\s*(\S+)\s+Frame[ \t]+Time:\s*(\S+)[^\n]*").match(text, start)
    if head is None:
        raise MotionFormatError(file, "MOTION", repr(text[start : start + 80].strip()[:40]), "Frames: and Frame Time:")
    count, step = head.groups()
    width = sum(len(n.channels or ()) for n in nodes)
    most = allowed(MOST_POINTS, file)
    if not re.fullmatch(r"\d{1,12}", count) or not 0 < int(count) * len(nodes) <= most:
        expected = f"a positive number of frames, at most {most // len(nodes)} for {len(nodes)} joints in a file of this size"
        raise MotionFormatError(file, "Frames", repr(count[:40]), expected)
    table = number_table(text, width, file, "MOTION", start=head.end())
    if len(table) != int(count):
        raise MotionFormatError(file, "MOTION", f"{len(table)} rows", f"{count}, as Frames: says")
    return table, _frames_per_second(step, file)


def _frames_per_second(word: str, file: Path) -> float:
    """The rate that a Frame Time stands for; a whole number if the digits written allow it (.0083333 is 120 Hz).

    Own choice: where so few digits allow several whole rates, it is the one that 1 / step is, else the nearest common one
    (0.03 is 30 Hz, 0.04 is 25).
    """
    step = number(word, file, "Frame Time")
    if not 1 / FASTEST <= step <= 1 / SLOWEST:
        found = f"{word[:40]}, which looks like milliseconds" if step > 1 else word[:40]
        raise MotionFormatError(file, "Frame Time", found, f"seconds, {1 / FASTEST:g} to {1 / SLOWEST:g}")
    written = re.fullmatch(r"\+?\d*\.?(\d*)(?:[eE]([+-]?\d{1,3}))?", word)
    off = 0.0 if written is None else 10.0 ** (int(written[2] or 0) - len(written[1]))
    whole = round(1 / step)
    is_vague = abs(1 / whole - step) > 1e-9 and abs(1 / (whole + 1) - step) < off
    fitting = [rate for rate in COMMON_RATES if abs(1 / rate - step) < off]
    if is_vague and fitting:
        return float(min(fitting, key=lambda rate: abs(1 / rate - step)))
    return float(whole) if abs(1 / whole - step) < off else 1 / step


def _positions(nodes: list[Node], table: Float[np.ndarray, "T channels"], picked: list[int]) -> Float[np.ndarray, "T joints 3"]:
    """Where the picked nodes stand, the file's unit."""
    everything = Skeleton("file", tuple(n.name for n in nodes), tuple(n.parent for n in nodes))

    def positions(part: slice) -> Float[np.ndarray, "n joints 3"]:
        """Joints in a part of the frames, in the unit of the file."""
        offsets = frame_offsets(nodes, table[part])
        rotations = np.broadcast_to(np.eye(3), (len(offsets), len(nodes), 3, 3)).copy()
        for joint, angles in enumerate(node.columns(ANGLES) for node in nodes):
            if angles:
                rotations[:, joint] = euler_matrices(axes_of(angles), np.deg2rad(table[part, [*angles.values()]]))
        return forward_kinematics(rotations, offsets, offsets[:, 0], everything)[:, picked]

    return in_blocks(positions, len(table), len(nodes))
