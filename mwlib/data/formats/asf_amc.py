"""ASF and AMC: Acclaim skeletons and motions, as CMU publishes its recordings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.rotation import euler_matrices, euler_quaternions
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.formats.frames import in_blocks, rotation_track
from mwlib.data.meaning import FILE, FORMAT, Hints, Reading, Stated, infer_unit, stated
from mwlib.data.mirroring import own_skeleton, rig_skeleton

from mwlib.data.untrusted import (  # isort: skip
    BLOCK, LARGEST, MOST_JOINTS, MOST_POINTS, MOST_VALUES, SMALL_TEXT, MotionFormatError, allowed, bare_name, bare_suffix,
    blocks_of, label, lines_of, number, read_text, without_twins,
)  # fmt: skip

INCH = 0.0254
ROOT_ORDER = ("tx", "ty", "tz", "rx", "ry", "rz")
TURNS = ("rx", "ry", "rz")
CMU_BONES = tuple(name.replace("left_", "l").replace("right_", "r") for name in CMU.joints)
OF_CMU = replace(CMU, joints=CMU_BONES)


@dataclass
class Bone:
    """A bone: from its parent's far end along `offset` (file units) in its own turned frame, whose axes are `axis` (3, 3)."""

    offset: np.ndarray
    axis: np.ndarray
    dof: tuple[str, ...]
    parent: str = ""


@dataclass
class Body:
    """What an ASF file says: the root and its bones, parents first, the root's place at rest, and metres per unit if stated."""

    bones: dict[str, Bone]
    position: np.ndarray
    metres: float | None


def read_asf(file: Path) -> Body:
    """Read one ASF file.

    Raises:
        MotionFormatError: it is malformed, or uses an axis order or a degree of freedom that nobody has checked here.
    """
    sections = _sections(read_text(file, SMALL_TEXT), file)
    units = {words[0]: words[1] for words in sections.get("units", []) if len(words) == 2}
    angle = units.get("angle", "deg").lower()
    if angle not in ("deg", "degrees", "rad", "radians"):
        raise MotionFormatError(file, ":units angle", repr(angle[:40]), "deg or rad")
    degrees = angle.startswith("deg")
    length = number(units["length"], file, ":units length") if "length" in units else None
    if length is not None and not 1e-3 <= length <= 1e3:
        raise MotionFormatError(file, ":units length", f"{length:g}", "0.001 to 1000 (CMU: 0.45)")
    bones = _bones(sections.get("bonedata", []), degrees, file)
    root = {words[0]: words[1:] for words in sections.get("root", [])}
    order = tuple(word.lower() for word in root.get("order", ROOT_ORDER))
    if sorted(order) != sorted(ROOT_ORDER):
        raise MotionFormatError(file, ":root order", " ".join(order)[:60], "TX TY TZ RX RY RZ in some order")
    position = _three(root.get("position", ["0", "0", "0"]), file, ":root position")
    axis = _axis(root.get("orientation", ["0", "0", "0"]) + root.get("axis", ["XYZ"]), degrees, file, ":root")
    bones = {"root": Bone(np.zeros(3), axis, order)} | _hung(bones, sections.get("hierarchy", []), file)
    return Body(bones, position, INCH / length if length else None)


def far_ends(tree: Skeleton) -> list[int]:
    """Where each bone of an ASF skeleton ends, when its joints are where bones begin: at a child or End Site; the root at itself.

    Several children begin at one place; one that is neither left nor right is taken, so that mirrored bones end at mirrored
    joints.
    """
    ends, mirror = list(range(len(tree))), tree.mirror
    for parent, child in reversed(tree.bones):
        if parent > 0 and (ends[parent] == parent or mirror[child] == child or mirror[ends[parent]] != ends[parent]):
            ends[parent] = child
    return ends


def _sections(text: str, file: Path) -> dict[str, list[list[str]]]:
    """Lines of words under each :keyword."""
    sections: dict[str, list[list[str]]] = {}
    lines: list[list[str]] = []
    for line in lines_of(text):
        words = line[0].split()
        if not words or words[0].startswith(("#", "(")):  # a line of limits begins with "("
            continue
        if words[0].startswith(":"):
            name = words[0][1:].lower()
            if name in sections:
                raise MotionFormatError(file, words[0][:40], "this section twice", "each once")
            lines = sections.setdefault(name, [])
        else:
            lines.append(words)
    return sections


def _bones(lines: list[list[str]], degrees: bool, file: Path) -> dict[str, Bone]:
    """:bonedata, blocks from begin to end; keys that do not shape the motion (id, limits, ...) are passed over."""
    bones: dict[str, Bone] = {}
    block: dict[str, list[str]] | None = None
    for words in lines:
        if words == ["begin"] and block is None:
            block = {}
        elif words == ["end"] and block is not None:
            name, bone = _bone(block, degrees, file)
            if name in bones or name == "root" or len(bones) >= MOST_JOINTS:
                raise MotionFormatError(file, f"bone {name}", "it twice, or too many", f"up to {MOST_JOINTS} different names")
            bones[name] = bone
            block = None
        elif block is not None and words[0] not in ("begin", "end"):
            if words[0] in block:
                raise MotionFormatError(file, ":bonedata", f"{words[0][:40]} twice in one bone", "each key once")
            block[words[0]] = words[1:]
        else:
            raise MotionFormatError(file, ":bonedata", " ".join(words)[:40], "blocks from begin to end")
    if block is not None or not bones:
        raise MotionFormatError(file, ":bonedata", f"{len(bones)} whole bones", "blocks from begin to end")
    return bones


def _bone(block: dict[str, list[str]], degrees: bool, file: Path) -> tuple[str, Bone]:
    name = label(" ".join(block.get("name", [])), file, "bone name")
    place = f"bone {name[:40]}"
    missing = [key for key in ("name", "direction", "length", "axis") if not block.get(key)]
    if missing:
        raise MotionFormatError(file, place, f"no {missing[0]}", "name, direction, length and axis")
    direction = _three(block["direction"], file, f"{place}, direction")
    if abs(np.linalg.norm(direction) - 1) > 0.01:
        raise MotionFormatError(file, f"{place}, direction", f"length {np.linalg.norm(direction):.4g}", "a unit vector")
    length = number(block["length"][0], file, f"{place}, length")
    if length < 0:
        raise MotionFormatError(file, f"{place}, length", f"{length:g}", "0 or more")
    axis = _axis(block["axis"], degrees, file, f"{place}, axis")
    dof = tuple(word.lower() for word in block.get("dof", []))
    if not set(dof) <= set(TURNS) or len(set(dof)) < len(dof):
        raise MotionFormatError(file, f"{place}, dof", " ".join(dof)[:40], "different ones of rx, ry, rz")
    return name, Bone(direction * length, axis, dof)


def _hung(bones: dict[str, Bone], lines: list[list[str]], file: Path) -> dict[str, Bone]:
    """The bones with their parents from :hierarchy, in file order as far as parents allow."""
    for parent, *children in lines:
        if parent in ("begin", "end") and not children:
            continue
        for child in children:
            if (parent != "root" and parent not in bones) or child not in bones or bones[child].parent:
                expected = "bones of :bonedata, each with one parent"
                raise MotionFormatError(file, ":hierarchy", f"{child[:40]} under {parent[:40]}", expected)
            bones[child].parent = parent
    hung: dict[str, Bone] = {}
    while waiting := {name: bone for name, bone in bones.items() if name not in hung}:
        ready = {name: bone for name, bone in waiting.items() if bone.parent == "root" or bone.parent in hung}
        if not ready:
            raise MotionFormatError(file, ":hierarchy", f"{[*waiting][0]} does not hang from the root", "one tree")
        hung |= ready
    return hung


def _three(words: list[str], file: Path, place: str) -> np.ndarray:
    if len(words) != 3:
        raise MotionFormatError(file, place, f"{len(words)} words", "three numbers")
    return np.array([number(word, file, place) for word in words])


def _axis(words: list[str], degrees: bool, file: Path, place: str) -> np.ndarray:
    """Three angles and their order as a matrix (3, 3)."""
    angles = _three(words[:3], file, place)
    if [word.upper() for word in words[3:]] != ["XYZ"]:
        raise MotionFormatError(file, place, f"order {' '.join(words[3:])[:40]!r}", "XYZ, as in every file of CMU")
    return euler_matrices("zyx", (np.deg2rad(angles) if degrees else angles)[None, ::-1])[0]


Tracks = dict[str, dict[str, Float[np.ndarray, " T"]]]  # bone -> degree of freedom -> values, radians or file units


def root_path(tracks: Tracks, body: Body) -> Float[np.ndarray, "T 3"]:
    """Where the root is, file units."""
    return body.position + np.stack([tracks["root"][d] for d in ROOT_ORDER[:3]], axis=-1)


def asf_rig(tracks: Tracks, body: Body, tree: Skeleton, bones: Sequence[str], metres: float) -> Rig:
    """The rig whose joints stand where the bones begin; a bone's far end is its first child's joint, or its End Site.

    G = G_parent C Rz Ry Rx C^-1 makes C R C^-1 the local rotation, and the parent bone's own vector is the joint's offset,
    so the points are exactly the same.

    Args:
        tree: root and bones, joints named by bone.
        bones: the motion's joints, by bone.
        metres: per unit of the file.
    """
    names, parents = _with_ends(tree)
    skeleton = rig_skeleton(names, parents)
    offsets = np.array([body.position, *[body.bones[names[parent]].offset for parent in parents[1:]]])

    def rotations(part: slice) -> Float[np.ndarray, "n rig 4"]:
        """Quaternions of the bones in a part of the frames."""
        found = np.zeros((part.stop - part.start, len(names), 4))
        found[..., 0] = 1.0
        for joint, name in enumerate(names):
            if turns := _turns(tracks, name, part):
                found[:, joint] = euler_quaternions(*turns)
                found[:, joint, 1:] @= body.bones[name].axis.T  # C R C^-1: R about the turned axis
        return found

    ends = far_ends(skeleton)
    return Rig(
        skeleton,
        offsets * metres,
        rotation_track(rotations, len(tracks["root"]["tx"]), len(names)),
        root_path(tracks, body) * metres,
        tuple(ends[names.index(bone)] for bone in bones),
        tuple(None if name.endswith("/End") else (MOVES if joint == 0 else ()) + ANGLES for joint, name in enumerate(names)),
    )


def _turns(tracks: Tracks, name: str, part: slice) -> tuple[str, Float[np.ndarray, "n turns"]] | None:
    """Axes and angles of a bone's rotation Rz Ry Rx over some frames, as far as it can turn; None if it cannot."""
    turns = [dof for dof in reversed(TURNS) if dof in tracks.get(name, {})]
    return ("".join(dof[1] for dof in turns), np.stack([tracks[name][dof][part] for dof in turns], axis=-1)) if turns else None


def depth_first(tree: Skeleton) -> list[int]:
    """Joints as nested text lists them: each followed by all that hang from it."""
    order, waiting = [], [0]
    while waiting:
        order.append(waiting.pop())
        waiting += [child for parent, child in reversed(tree.bones) if parent == order[-1]]
    return order


def _with_ends(tree: Skeleton) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names and parents in the order of a BVH file, an End Site under each bone without children."""
    names, parents, places = [], [], {-1: -1}
    for joint in depth_first(tree):
        places[joint] = len(names)
        names.append(tree.joints[joint])
        parents.append(places[tree.parents[joint]])
        if joint not in tree.parents:
            names.append(f"{tree.joints[joint]}/End")
            parents.append(places[joint])
    return tuple(names), tuple(parents)


CMU_FPS = 120.0  # neither file says


def read_amc(file: Path, hints: Hints) -> Reading:
    """Read one AMC file and the ASF beside it: far ends of the bones in metres, and the rotations behind them.

    The transform of a bone is G = G_parent C Rz Ry Rx C^-1, with C from its `axis`; it ends at its parent's end plus
    G direction length. One unit is 1/length inches, `length` from the ASF's :units (CMU: 0.45). Up is y unless `hints` say
    otherwise.

    Raises:
        MotionFormatError: either file is malformed, or they do not fit each other.
    """
    asf = find_asf(file)
    body = read_asf(asf)
    tracks = _tracks(read_text(file), body, file)
    names = tuple(body.bones)
    skeleton = tree = own_skeleton(names, (-1, *[names.index(bone.parent) for bone in [*body.bones.values()][1:]]))
    if same_tree(tree, OF_CMU):
        skeleton, names = CMU, CMU_BONES
    positions = _positions(tracks, body, tree, [tree.joints.index(name) for name in names])
    unit = hints.unit or stated(body.metres, FILE) or infer_unit(positions, skeleton, asf, usual="cmu")
    up, fps = hints.up or Stated("y", FORMAT), hints.fps or Stated(CMU_FPS, FORMAT)
    positions *= unit.value
    rig = asf_rig(tracks, body, tree, names, unit.value)
    return hints.reading(file, positions, skeleton, unit, up, fps, rig=rig)


def find_asf(file: Path) -> Path:
    """The skeleton of an AMC file, in the same folder: named like its subject (05_12.amc, 05.asf), else the only one.

    Raises:
        MotionFormatError: there is none, or it is not clear which.
    """
    there = without_twins([f for f in file.parent.iterdir() if bare_suffix(f) == ".asf"])
    stem = Path(bare_name(file)).stem
    named = [f for f in there if Path(bare_name(f)).stem in (stem, stem.split("_")[0])]
    for candidates in (named, there):
        if len(candidates) == 1:
            return candidates[0]
    found = ", ".join(f.name for f in there) or "no .asf file"
    raise MotionFormatError(file, "skeleton", f"{found} in its folder", f"{stem.split('_')[0]}.asf, or a single .asf file")


def same_tree(one: Skeleton, other: Skeleton) -> bool:
    """Whether the same names hang from the same names, in whichever order they are listed."""
    trees = [{s.joints[j]: s.joints[p] if p >= 0 else None for j, p in enumerate(s.parents)} for s in (one, other)]
    return trees[0] == trees[1]


def _tracks(text: str, body: Body, file: Path) -> Tracks:
    """All channels over time, in radians and file units."""
    degrees, start = _header(text, file)
    words = _words_of_a_frame(text, start, body, file)
    table = _table(text, start, words, body, file)
    tracks: Tracks = {}
    for (name, dof), column in zip([word for word in words if word[1]][1:], table.T, strict=True):
        tracks.setdefault(name, {})[dof] = np.deg2rad(column) if degrees and dof in TURNS else column
    return tracks


def _header(text: str, file: Path) -> tuple[bool, int]:
    """Whether angles are in degrees, and where the first frame begins."""
    degrees = True
    for line in lines_of(text):
        if line.start() > BLOCK:
            raise MotionFormatError(file, "header", f"more than {BLOCK} characters", "a frame before that")
        word = line[0].strip().lower()
        if word and not word.startswith(("#", ":")):
            return degrees, line.start()
        degrees = degrees and word != ":radians"
    raise MotionFormatError(file, "end of file", "no frame", "at least one frame")


def _words_of_a_frame(text: str, start: int, body: Body, file: Path) -> list[tuple[str, str]]:
    """Bone and degree of freedom of every word of the first frame: its number, then of each bone its name and its numbers."""
    dofs = {name: bone.dof for name, bone in body.bones.items() if bone.dof}
    order: list[str] = []
    for line in islice(lines_of(text, start), 1, None):
        if line.start() - start > BLOCK:
            break
        words = line[0].split(maxsplit=len(ROOT_ORDER) + 1)
        if len(words) == 1:  # the next frame's number
            break
        if not words:
            continue
        name = words[0]
        if name in order or len(words) - 1 != len(dofs.get(name, ())):
            found = f"{name[:40]} with {len(words) - 1} numbers" + (" again" if name in order else "")
            expected = f"{len(dofs[name])} numbers, once" if name in dofs else "a bone of the ASF that can move"
            raise MotionFormatError(file, "frame 1", found, expected)
        order.append(name)
    if missing := sorted({*dofs} - {*order}):
        raise MotionFormatError(file, "frame 1", f"no {', '.join(missing)[:200]}", "every bone of the ASF that can move")
    return [("frame", "number"), *((name, dof) for name in order for dof in ("", *dofs[name]))]


def _table(text: str, start: int, frame: list[tuple[str, str]], body: Body, file: Path) -> Float[np.ndarray, "T channels"]:
    """The numbers of all frames, bone after bone as in the first one."""
    stride, bones = len(frame), len(body.bones) - 1
    most = min(allowed(MOST_POINTS, file) // bones, allowed(MOST_VALUES, file) // sum(dof != "" for _, dof in frame))
    tables: list[np.ndarray] = []
    frames, words = 0, []
    for block in blocks_of(text, start, " \t\r\n", file, "frames"):
        words += block.split()
        whole = len(words) // stride * stride
        tables += [_block(words[:whole], frame, tables, file)] if whole else []
        words = words[whole:]
        frames += whole // stride
        if frames > most:
            found = f"more than {most} frames"
            raise MotionFormatError(file, "frames", found, f"at most that for {bones} bones in a file of this size")
    if words:
        found = f"{frames * stride + len(words)} words, not a multiple of the {stride} of frame 1"
        raise MotionFormatError(file, "frames", found, "whole frames")
    return np.concatenate(tables)[:, 1:]


def _block(
    words: list[str], frame: list[tuple[str, str]], before: list[np.ndarray], file: Path
) -> Float[np.ndarray, "n columns"]:
    """Frame numbers, then the numbers of every bone, of some frames that follow those `before`."""
    for place, (name, dof) in enumerate(frame):
        if not dof and (others := {*words[place :: len(frame)]} - {name}):
            raise MotionFormatError(file, f"line of {name}", repr(min(others)[:40]), f"{name}, as in frame 1")
    columns = [place for place, (_, dof) in enumerate(frame) if dof]
    grid = np.array(words, dtype=object).reshape(-1, len(frame))[:, columns]
    try:
        table = grid.astype(np.float64)
    except (ValueError, OverflowError):
        table = np.full((1, 1), np.nan)
    if not np.all(np.abs(table) <= LARGEST):  # False for nan; now say where
        for place, column in zip(columns, grid.T, strict=True):
            for word in column:
                number(word, file, " ".join(frame[place]))
    numbers = np.concatenate([before[-1][-1:, 0], table[:, 0]]) if before else table[:, 0]
    if np.any(np.diff(numbers) != 1):
        at = int(np.argmax(np.diff(numbers) != 1))
        raise MotionFormatError(file, f"after frame {numbers[at]:g}", f"frame {numbers[at + 1]:g}", "the next one")
    return table


def _positions(tracks: Tracks, body: Body, skeleton: Skeleton, picked: list[int]) -> Float[np.ndarray, "T joints 3"]:
    """Where the picked bones end, file units."""
    place = root_path(tracks, body)

    def positions(part: slice) -> Float[np.ndarray, "n joints 3"]:
        """Joints in a part of the frames, metres."""
        rotations = np.broadcast_to(np.eye(3), (part.stop - part.start, len(skeleton), 3, 3)).copy()
        offsets = np.zeros((len(rotations), len(skeleton), 3))
        for joint, name in enumerate(skeleton.joints):
            axis = body.bones[name].axis
            if turns := _turns(tracks, name, part):
                rotations[:, joint] = axis @ euler_matrices(*turns) @ axis.T
            offsets[:, joint] = rotations[:, joint] @ body.bones[name].offset  # a bone's own turn moves its far end
        return forward_kinematics(rotations, offsets, place[part], skeleton)[:, picked]

    return in_blocks(positions, len(place), len(skeleton))
