"""BVH: CMU (cgspeed and Daz conversions), LaFAN1, Bandai-Namco and any other skeleton are read; rigs, or fitted ones, written."""

import io
import re
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import chain, count, islice, repeat, takewhile
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.fitting import FitError, distance, fit_rig
from mwlib.body.kinematics import forward_kinematics
from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, Rig, axes_of
from mwlib.body.rotation import euler_angles, euler_quaternions
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.collections import SKELETONS
from mwlib.data.collections.bandai_namco import BANDAI21
from mwlib.data.formats.asf_amc import CMU_BONES, OF_CMU, depth_first, far_ends, named_bones
from mwlib.data.formats.frames import Turn, blocks, matrices, quaternions, starts_in_tpose
from mwlib.data.meaning import FASTEST, FILE, FORMAT, SLOWEST, Hints, Reading, Stated, infer_unit, metres_per_unit
from mwlib.data.mirroring import own_skeleton

from mwlib.data.untrusted import (  # isort: skip
    LARGEST, LONGEST_WORD, MOST_JOINTS, MOST_POINTS, MotionFormatError, allowed, number, number_table, read_text,
)  # fmt: skip
from mwlib.files import write_atomic
from mwlib.settings import of_kind

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
    is_end: bool
    missing: list[str]  # what has yet to be said of it
    offset: list[float] = field(default_factory=list)
    channels: dict[str, int] = field(default_factory=dict)

    def columns(self, kind: Container[str]) -> dict[str, int]:
        """Those of the channels of one kind, in the file's order."""
        return {name: column for name, column in self.channels.items() if name in kind}


def bvh_skeleton(nodes: list[Node], tree: Skeleton) -> tuple[Skeleton, list[int]]:
    """The skeleton of a file, and which node each of its joints is.

    Args:
        nodes: of the file.
        tree: all of them, End Sites among them.
    """
    joints = [i for i, n in enumerate(nodes) if not n.is_end]
    own = own_skeleton(tuple(tree.joints[i] for i in joints), tuple(joints.index(tree.parents[i]) if i else -1 for i in joints))
    bones = named_bones(own)
    if own.parents == CGSPEED_PARENTS and set(CGSPEED_POINTS) <= set(tree.joints):
        return CMU, [tree.joints.index(name) for name in CGSPEED_POINTS]
    if bones == named_bones(OF_CMU):
        ends = far_ends(tree)
        return CMU, [ends[tree.joints.index(bone)] for bone in CMU_BONES]
    for known in SKELETONS.values():
        above_root = {("joint_Root", "Hips")} if known is BANDAI21 else set()
        if bones - above_root == named_bones(known):
            return known, [tree.joints.index(name) for name in known.joints]
    return own, joints


def frame_offsets(nodes: list[Node], table: Float[np.ndarray, "T channels"]) -> Float[np.ndarray, "T nodes 3"]:
    """Offsets in every frame, the file's unit: position channels replace those of the hierarchy."""
    offsets = np.tile(np.array([n.offset for n in nodes]), (len(table), 1, 1))
    for joint, node in enumerate(nodes):
        for name, column in node.columns(MOVES).items():
            offsets[:, joint, MOVES.index(name)] = table[:, column]
    return offsets


DEEPEST = 200
END = "the end of the hierarchy"  # in place of words behind its last one
COMMON_RATES = [int(rate) for rate in "24 25 30 48 50 60 72 75 90 100 120 144 150 180 200 240".split()]  # hertz


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
        found = "no MOTION section" if text.strip("\0 \r\n") else "an empty file"
        raise MotionFormatError(file, "end of HIERARCHY", found, "a line MOTION")
    words = (word[0] for word in re.compile(r"\S+").finditer(text, 0, split.start()))  # one by one: the first wrong one ends it
    nodes = _hierarchy(chain(words, repeat(END)), file)
    tree = own_skeleton(tuple(n.name for n in nodes), tuple(n.parent for n in nodes))
    skeleton, picked = bvh_skeleton(nodes, tree)
    if len(skeleton) < 2:
        raise MotionFormatError(file, "HIERARCHY", "one joint", "at least two")
    table, fps = _motion(text, split.end(), nodes, file)
    del text  # the clip needs its memory
    turns = [Turn(axes_of(n.channels), np.deg2rad(table[:, [*n.columns(ANGLES).values()]])) for n in nodes]
    path = frame_offsets(nodes[:1], table)[:, 0]
    positions = np.concatenate([
        forward_kinematics(matrices(turns, part), frame_offsets(nodes, table[part]), path[part], tree).take(picked, axis=1)
        for part in blocks(len(table), len(nodes))
    ])  # fmt: skip
    unit = hints.unit or infer_unit(positions, skeleton, file)
    up, rate = hints.up or Stated("y", FORMAT), hints.fps or Stated(fps, FILE)
    positions *= unit.value
    first = int(hints.first_frame is None and starts_in_tpose(turns[0].angles, positions, up.value))
    rig = Rig(
        tree,
        np.array([n.offset for n in nodes]) * unit.value,
        quaternions(turns, slice(first, None)),
        path[first:] * unit.value,
        tuple(picked),
        tuple(None if n.is_end else tuple(n.channels) for n in nodes),
        frame_offsets(nodes, table[first:]) * unit.value if any(n.columns(MOVES) for n in nodes[1:]) else None,
        unit.value,
    )
    return hints.reading(file, positions[first:], skeleton, unit, up, rate, Stated(first, FILE), rig)


def _hierarchy(words: Iterator[str], file: Path) -> list[Node]:
    """The nodes in file order: parents before children."""
    nodes: list[Node] = []
    columns = count()

    def add(kind: str, parent: int, depth: int) -> None:
        """The joint or End Site that begins here, and all that hangs from it."""
        name = " ".join(takewhile(lambda part: part != "{", islice(words, LONGEST_WORD)))
        above, is_end = (nodes[parent].name if nodes else "HIERARCHY"), kind == "End"
        if (kind == "ROOT") == bool(nodes) or not 0 < len(name) <= LONGEST_WORD or (is_end and name != "Site"):
            expected = f"ROOT, JOINT inside it, and a name of at most {LONGEST_WORD} characters, or End Site, then {{"
            raise MotionFormatError(file, above, f"{kind[:40]} {name[:40]}", expected)
        own = len(nodes)
        nodes.append(Node(f"{above}/End" if is_end else name, parent, is_end, ["OFFSET", "CHANNELS"][: 2 - is_end]))
        if own >= MOST_JOINTS or depth > DEEPEST:
            found = f"{own + 1} joints, {depth} deep"
            raise MotionFormatError(file, "HIERARCHY", found, f"at most {MOST_JOINTS}, {DEEPEST} deep")
        node, place = nodes[own], f"joint {nodes[own].name}"
        while (word := next(words)) != "}":
            if word in ("JOINT", "End") and not is_end:
                add(word, own, depth + 1)
            elif word not in node.missing:
                found = f"{depth} open braces at its end" if word == END else repr(word[:40])
                raise MotionFormatError(file, place, found, "JOINT, End Site, one OFFSET, one CHANNELS or }")
            elif word == "OFFSET":
                node.offset = [number(next(words), file, f"{place}, OFFSET") for _ in range(3)]
            else:
                node.channels = {name: next(columns) for name in _channel_names(words, file, place)}
            node.missing = [what for what in node.missing if what != word]
        if node.missing:
            raise MotionFormatError(file, place, f"no {' and no '.join(node.missing)}", "both")

    if (first := next(words)) != "HIERARCHY":
        raise MotionFormatError(file, "start", repr(first[:40]), "HIERARCHY")
    add(next(words), -1, 1)
    if (rest := next(words)) != END:
        raise MotionFormatError(file, "HIERARCHY", repr(rest[:40]), "one ROOT, everything else inside it")
    names = [n.name for n in nodes if not n.is_end]
    if twice := [name for i, name in enumerate(names) if name in names[:i]]:
        raise MotionFormatError(file, "HIERARCHY", f"two joints named {twice[0]!r}", "different names")
    return nodes


def _channel_names(words: Iterator[str], file: Path, place: str) -> list[str]:
    word = next(words)
    if not re.fullmatch("[0-6]", word):
        raise MotionFormatError(file, f"{place}, CHANNELS", repr(word[:40]), "a number from 0 to 6")
    names = [next(words).lower() for _ in range(int(word))]
    if not set(names) <= {*MOVES, *ANGLES} or len(set(names)) < len(names):
        raise MotionFormatError(file, f"{place}, CHANNELS", " ".join(names)[:120], "different ones of Xposition ... Zrotation")
    return names


def _motion(text: str, start: int, nodes: list[Node], file: Path) -> tuple[Float[np.ndarray, "T channels"], float]:
    """The number table and the frame rate."""
    head = re.compile(r"\s*Frames:\s*(\S+)\s+Frame[ \t]+Time:\s*(\S+)[^\n]*").match(text, start)
    if head is None:
        raise MotionFormatError(file, "MOTION", repr(text[start : start + 80].strip()[:40]), "Frames: and Frame Time:")
    rows, step = head.groups()
    width, most = sum(len(n.channels) for n in nodes), allowed(MOST_POINTS, file) // len(nodes)
    if not re.fullmatch(r"\d{1,12}", rows) or not 0 < int(rows) <= most:
        expected = f"a positive number of frames, at most {most} for {len(nodes)} joints in a file of this size"
        raise MotionFormatError(file, "Frames", repr(rows[:40]), expected)
    table = number_table(text, width, file, "MOTION", start=head.end())
    if len(table) != int(rows):
        raise MotionFormatError(file, "MOTION", f"{len(table)} rows", f"{rows}, as Frames: says")
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
    off = 10.0 ** int(Decimal(word).as_tuple().exponent)  # of the last digit
    whole = round(1 / step)
    is_vague = abs(1 / whole - step) > 1e-9 and abs(1 / (whole + 1) - step) < off
    common = [rate for rate in COMMON_RATES if is_vague and abs(1 / rate - step) < off]
    rate = min(common or [whole], key=lambda rate: abs(1 / rate - step))
    return float(rate) if abs(1 / rate - step) < off else 1 / step


ALIKE = 1e-6  # metres and radians: far above the rounding of float32, far below what is seen
DIGITS = 7  # after the point: 1e-9 m, and 2e-9 radians


def write_bvh(motion: Motion, file: str | Path, *, unit: float | str = "cm", up: str = "y") -> FitError:
    """Write a motion as a BVH file: same rate, joint names and channels as it was read with.

    A motion with a rig is written as its rig is, End Sites included. One with positions only, like a model's prediction, gets
    rotations by `fit_rig`: bones have their median lengths, so that its joints may be moved; see what is returned. A joint
    whose channels cannot say what it does (a mirrored or turned motion, sometimes) gets all of a kind. Whole or not at all: an
    old file stays until the new one is complete.

    Args:
        file: a name that ends in .bvh; missing folders are made.
        unit: metres per unit of the file, or "cm", "m", "mm", "inch", "cmu". BVH has no place to state it. Own choice:
            centimetres, as LaFAN1 and Bandai-Namco have them; `load_motions` tells cm, m and mm from the size of a human,
            any other unit has to be said to it again. `motion.rig.metres` is the unit of the file that it was read from.
        up: the axis that points up in the file. Whoever reads one with "z" has to be told.

    Returns:
        Mean and largest distance, metres, of the joints in the file from `motion.positions`.

    Raises:
        ValueError: an argument is of another kind, positions are not finite or absurdly large, a joint's name or the rate cannot
            stand in a BVH file, the name of the file ends otherwise, or an unknown unit. Nothing is written then.

    >>> import tempfile
    >>> from mwlib.data.load import load_motions
    >>> from mwlib.synthetic.motions import synthetic_motions
    >>> file = Path(tempfile.mkdtemp()) / "walk.bvh"
    >>> walk = synthetic_motions(subjects=1, seconds=1.0)[0]
    >>> write_bvh(walk, file).max < 1e-5
    True
    >>> [again] = load_motions(file)
    >>> again.fps, again.up, again.skeleton.name, np.allclose(again.with_up("z").positions, walk.positions, atol=1e-5)
    (50.0, 'y', 'H36M17', True)
    """
    metres = metres_per_unit(unit)
    file, motion, rig = asked_for(motion, file, ".bvh", up)
    if not SLOWEST <= motion.fps <= FASTEST:
        raise ValueError(f"fps is {motion.fps:g}; expected {SLOWEST:g} to {FASTEST:g}")
    for name, names in zip(rig.skeleton.joints, rig.channels, strict=True):
        if names is not None and (not name or " ".join(name.split()) != name or {"{", "}"} & {*name.split()}):
            raise ValueError(f"a joint is named {name!r}; expected words with single spaces between, no brace alone")
    channels = {joint: _enough(rig, joint) for joint in depth_first(rig.skeleton)}
    channels[0] = channels[0] or MOVES + ANGLES
    table = np.stack(
        [column for joint, names in channels.items() for column in _columns(rig, joint, names or (), metres)], axis=1
    )
    if not np.all(np.abs(table) <= LARGEST):  # False for nan
        raise ValueError(f"a number of the motion is {np.abs(table).max():g} in the file; expected finite ones up to {LARGEST:g}")
    tree = "\n".join(["HIERARCHY", *_joint(rig, 0, channels, metres)])
    # The digits of a whole rate's Frame Time are such that it is read as the whole rate.
    step = f"{1 / motion.fps:.10f}" if motion.fps == round(motion.fps) else np.format_float_positional(1 / motion.fps)
    numbers = io.StringIO()
    np.savetxt(numbers, np.round(table, DIGITS) + 0.0, fmt=f"%.{DIGITS}f")
    write_atomic(file, f"{tree}\nMOTION\nFrames: {len(table)}\nFrame Time: {step}\n{numbers.getvalue()}")
    return distance(rig, motion)


def asked_for(motion: object, file: object, ending: str, up: str) -> tuple[Path, Motion, Rig]:
    """Where a motion is to be written, the motion with another axis up, and its rig or one fitted to it.

    Raises:
        ValueError: it is no motion, or the file's name ends otherwise.
    """
    motion = of_kind("motion", motion, Motion)
    file = Path(of_kind("file", file, (str, Path), "a path")).expanduser()
    if file.suffix.lower() != ending:
        raise ValueError(f"file is {file.name!r}; expected a name that ends in {ending}")
    motion = motion.with_up(up)
    return file, motion, motion.rig or fit_rig(motion).rig


def _places(rig: Rig, joint: int) -> Float[np.ndarray, "T 3"]:
    """What position channels would say, metres."""
    return np.broadcast_to(rig.spans[:, joint], rig.root.shape) if joint else rig.root


def _enough(rig: Rig, joint: int) -> tuple[str, ...] | None:
    """A joint's channels, and all of a kind where its own cannot say what it does."""
    names = rig.channels[joint]
    if names is None:
        return None
    lacking = [name not in names for name in MOVES]
    if np.abs(_places(rig, joint) - rig.offsets[joint])[:, lacking].max(initial=0) > ALIKE:
        names = MOVES + tuple(name for name in names if name not in MOVES)
    axes, quaternions = axes_of(names), rig.rotations[:, joint].astype(np.float64)
    if len(axes) < 3:
        said = euler_quaternions(axes, euler_angles(axes, quaternions))
        astray = np.minimum(*(np.linalg.norm(said - sign * quaternions, axis=-1) for sign in (1, -1)))
        if 2 * astray.max() > ALIKE:
            names = tuple(name for name in names if name not in ANGLES) + ANGLES
    return names


def _columns(rig: Rig, joint: int, names: tuple[str, ...], metres: float) -> list[Float[np.ndarray, " T"]]:
    """The joint's part of the table: the file's unit, and degrees."""
    places = _places(rig, joint) / metres
    degrees = iter(np.rad2deg(euler_angles(axes_of(names), rig.rotations[:, joint].astype(np.float64))).T)
    return [next(degrees) if name in ANGLES else places[:, MOVES.index(name)] for name in names]


def _joint(rig: Rig, joint: int, channels: dict[int, tuple[str, ...] | None], metres: float) -> list[str]:
    """Lines of the tree from a joint on; where nothing hangs from it, it gets an End Site, which other readers want."""
    names, offset = channels[joint], np.round(rig.offsets[joint] / metres, DIGITS) + 0.0
    lines = [f"OFFSET {' '.join(f'{value:.{DIGITS}f}' for value in offset)}"]
    if names is not None:
        lines.append(f"CHANNELS {len(names)} {' '.join(name.capitalize() for name in names)}".rstrip())
        children = [child for parent, child in rig.skeleton.bones if parent == joint]
        for child in children:
            lines += _joint(rig, child, channels, metres)
        if not children:
            lines += ["End Site", "{", "\tOFFSET 0 0 0", "}"]
    head = "End Site" if names is None else f"{'JOINT' if joint else 'ROOT'} {rig.skeleton.joints[joint]}"
    return [head, "{", *(f"\t{line}" for line in lines), "}"]
