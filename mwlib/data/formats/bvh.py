"""BVH: CMU (cgspeed and Daz conversions), LaFAN1, Bandai-Namco, and any other skeleton."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES
from mwlib.body.rotation import euler_matrices
from mwlib.body.skeleton import Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.formats.bvh_rig import Node, bvh_rig, bvh_skeleton
from mwlib.data.formats.tpose import starts_in_tpose
from mwlib.data.hints import Hints
from mwlib.data.reading import number, number_table, read_text
from mwlib.data.stated import FILE, FORMAT, Reading, Stated
from mwlib.data.units import infer_unit

MOST_JOINTS = 1000
DEEPEST = 200
MOST_POINTS = 20_000_000  # frames times joints: about 2 GB while reading


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
    nodes = _hierarchy(text[: split.start()].split(), file)
    table, fps = _motion(text[split.end() :], nodes, file)
    everything = Skeleton("file", tuple(n.name for n in nodes), tuple(n.parent for n in nodes))
    channels = _channels(nodes, table)
    positions = forward_kinematics(channels.rotations, channels.offsets, channels.offsets[:, 0], everything)
    skeleton, picked = bvh_skeleton(nodes)
    positions = positions[:, picked]
    unit = hints.unit or infer_unit(positions, skeleton, file)
    up, rate = hints.up or Stated("y", FORMAT), hints.fps or Stated(fps, FILE)
    positions *= unit.value
    first = int(starts_in_tpose(channels.turn, positions, up.value))
    rig = bvh_rig(nodes, table[first:], channels.offsets[first:], picked, unit.value)
    motion = Motion(positions[first:].astype(np.float32), rate.value, skeleton, up=up.value, rig=rig)
    return Reading(hints.label(motion, file), unit, up, rate)


def _hierarchy(words: list[str], file: Path) -> list[Node]:
    """The nodes in file order: parents before children."""
    if words[:1] != ["HIERARCHY"]:
        raise MotionFormatError(file, "start", repr(" ".join(words[:1])[:40]), "HIERARCHY")
    nodes: list[Node] = []
    stack: list[int] = []
    rest = iter(words[1:])
    for word in rest:
        place = f"joint {nodes[stack[-1]].name}" if stack else "HIERARCHY"
        if word in ("ROOT", "JOINT", "End"):
            if (word == "ROOT") == bool(stack) or (nodes and not stack):
                raise MotionFormatError(file, place, word, "one ROOT, everything else inside it")
            _open(word, rest, nodes, stack, file, place)
        elif word == "}" and stack:
            _check_node(nodes[stack.pop()], file)
        elif word == "OFFSET" and stack and nodes[stack[-1]].offset is None:
            nodes[stack[-1]].offset = [number(_next(rest, file, place), file, f"{place}, OFFSET") for _ in range(3)]
        elif word == "CHANNELS" and stack and nodes[stack[-1]].channels is None and not nodes[stack[-1]].is_end:
            nodes[stack[-1]].channels = _channel_names(rest, file, place)
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
    while (part := _next(rest, file, place)) != "{":
        name.append(part)
    parent = stack[-1] if stack else -1
    is_end = word == "End"
    if len(name) == 0 or (is_end and (name != ["Site"] or nodes[parent].is_end)) or (stack and nodes[parent].is_end):
        raise MotionFormatError(file, place, f"{word} {' '.join(name)[:40]}", "ROOT name, JOINT name or End Site, then {")
    label = f"{nodes[parent].name}/End" if is_end else " ".join(name)
    stack.append(len(nodes))
    nodes.append(Node(label, parent, channels=[] if is_end else None, is_end=is_end))
    if len(nodes) > MOST_JOINTS or len(stack) > DEEPEST:
        found = f"{len(nodes)} joints, {len(stack)} deep"
        raise MotionFormatError(file, "HIERARCHY", found, f"at most {MOST_JOINTS}, {DEEPEST} deep")


def _next(rest: Iterator[str], file: Path, place: str) -> str:
    word = next(rest, None)
    if word is None:
        raise MotionFormatError(file, place, "the end of the hierarchy", "more of this joint")
    return word


def _channel_names(rest: Iterator[str], file: Path, place: str) -> list[str]:
    count = _next(rest, file, place)
    if not re.fullmatch("[0-6]", count):
        raise MotionFormatError(file, f"{place}, CHANNELS", repr(count[:40]), "a number from 0 to 6")
    names = [_next(rest, file, place).lower() for _ in range(int(count))]
    if not set(names) <= {*MOVES, *ANGLES} or len(set(names)) < len(names):
        raise MotionFormatError(file, f"{place}, CHANNELS", " ".join(names)[:120], "different ones of Xposition ... Zrotation")
    return names


def _check_node(node: Node, file: Path) -> None:
    missing = [word for word, value in (("OFFSET", node.offset), ("CHANNELS", node.channels)) if value is None]
    if missing:
        raise MotionFormatError(file, f"joint {node.name}", f"no {' and no '.join(missing)}", "both")


def _motion(text: str, nodes: list[Node], file: Path) -> tuple[Float[np.ndarray, "T channels"], float]:
    """The number table and the frame rate."""
    head = re.match(r"\s*Frames:\s*(\S+)\s+Frame[ \t]+Time:\s*(\S+)[^\n]*", text)
    if head is None:
        raise MotionFormatError(file, "MOTION", repr(text.strip()[:40]), "Frames: and Frame Time:")
    count, step = head.groups()
    width = sum(len(n.channels or ()) for n in nodes)
    if not re.fullmatch(r"\d{1,12}", count) or not 0 < int(count) * len(nodes) <= MOST_POINTS:
        expected = f"a positive number of frames, at most {MOST_POINTS // len(nodes)} for {len(nodes)} joints"
        raise MotionFormatError(file, "Frames", repr(count[:40]), expected)
    table = number_table(text[head.end() :], width, file, "MOTION")
    if len(table) != int(count):
        raise MotionFormatError(file, "MOTION", f"{len(table)} rows", f"{count}, as Frames: says")
    return table, _frames_per_second(step, file)


def _frames_per_second(word: str, file: Path) -> float:
    """The rate that a Frame Time stands for; a whole number if the digits written allow it (.0083333 is 120 Hz)."""
    step = number(word, file, "Frame Time")
    if not 1e-4 <= step <= 10:
        raise MotionFormatError(file, "Frame Time", word[:40], "seconds, 0.0001 to 10")
    whole = max(round(1 / step), 1)
    decimals = re.fullmatch(r"\d*\.?(\d*)", word)
    is_whole = decimals is not None and abs(1 / whole - step) < 10.0 ** -len(decimals[1])
    return float(whole) if is_whole else 1 / step


class Channels(NamedTuple):
    """What the channels say: local rotations (T, joints, 3, 3), offsets (T, joints, 3), and the root's angles (T, angles)."""

    rotations: Float[np.ndarray, "T joints 3 3"]
    offsets: Float[np.ndarray, "T joints 3"]
    turn: Float[np.ndarray, "T angles"]


def _channels(nodes: list[Node], table: Float[np.ndarray, "T channels"]) -> Channels:
    """Position channels replace the offset."""
    rotations = np.broadcast_to(np.eye(3), (len(table), len(nodes), 3, 3)).copy()
    offsets = np.tile(np.array([n.offset for n in nodes]), (len(table), 1, 1))
    turn, start = table[:, :0], 0
    for joint, node in enumerate(nodes):
        names = node.channels or []
        columns = table[:, start : start + len(names)]
        start += len(names)
        angles = [i for i, name in enumerate(names) if name.endswith("rotation")]
        for i, name in enumerate(names):
            if name.endswith("position"):
                offsets[:, joint, "xyz".index(name[0])] = columns[:, i]
        if angles:
            rotations[:, joint] = euler_matrices("".join(names[i][0] for i in angles), np.deg2rad(columns[:, angles]))
        if joint == 0:
            turn = columns[:, angles]
    return Channels(rotations, offsets, turn)
