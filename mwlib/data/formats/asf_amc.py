"""ASF and AMC: Acclaim skeletons and motions, as CMU publishes its recordings."""

import re
from collections import defaultdict
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.rotation import euler_matrices
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.formats.frames import Turn, blocks, matrices, quaternions
from mwlib.data.meaning import FILE, FORMAT, Hints, Reading, Stated, infer_unit, stated
from mwlib.data.mirroring import own_skeleton

from mwlib.data.untrusted import (  # isort: skip
    BLOCK, MOST_JOINTS, MOST_POINTS, SMALL_TEXT, MotionFormatError, allowed, bare_name, bare_suffix, label, number, number_table,
    read_text, without_twins,
)  # fmt: skip

INCH = 0.0254
ROOT_ORDER = ("tx", "ty", "tz", "rx", "ry", "rz")
ROOT = {"order": [*ROOT_ORDER], "position": ["0"] * 3, "orientation": ["0"] * 3, "axis": ["XYZ"]}  # where a file says nothing
TURNS = ("rz", "ry", "rx")  # the first outermost
CMU_BONES = tuple(name.replace("left_", "l").replace("right_", "r") for name in CMU.joints)
OF_CMU = replace(CMU, joints=CMU_BONES)


Lines = list[list[str]]  # each in its words


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
    units = {words[0]: words[1] for words in sections["units"] if len(words) == 2}
    angle = units.get("angle", "deg").lower()
    if not re.fullmatch("deg(rees)?|rad(ians)?", angle):
        raise MotionFormatError(file, ":units angle", repr(angle[:40]), "deg or rad")
    degrees = angle.startswith("deg")
    length = number(units["length"], file, ":units length") if "length" in units else None
    if length is not None and not 1e-3 <= length <= 1e3:
        raise MotionFormatError(file, ":units length", f"{length:g}", "0.001 to 1000 (CMU: 0.45)")
    root = ROOT | {words[0]: words[1:] for words in sections["root"]}
    order = tuple(word.lower() for word in root["order"])
    if sorted(order) != sorted(ROOT_ORDER):
        raise MotionFormatError(file, ":root order", " ".join(order)[:60], "TX TY TZ RX RY RZ in some order")
    position = _numbers(root["position"], 3, file, ":root position")
    axis = _axis(root["orientation"] + root["axis"], degrees, file, ":root")
    bones = {"root": Bone(np.zeros(3), axis, order, parent="root")}
    _add_bones(bones, sections["bonedata"], degrees, file)
    return Body(_hung(bones, sections["hierarchy"], file), position, INCH / length if length else None)


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


def _sections(text: str, file: Path) -> dict[str, Lines]:
    """Lines of words under each :keyword; none under one that is missing."""
    sections: dict[str, Lines] = defaultdict(list)
    lines: Lines = []
    for words in map(str.split, text.splitlines()):
        if not words or words[0].startswith(("#", "(")):  # a line of limits begins with "("
            continue
        if words[0].startswith(":"):
            name = words[0][1:].lower()
            if name in sections:
                raise MotionFormatError(file, words[0][:40], "this section twice", "each once")
            lines = sections[name]
        else:
            lines.append(words)
    return sections


def _add_bones(bones: dict[str, Bone], lines: Lines, degrees: bool, file: Path) -> None:
    """:bonedata, blocks from begin to end; keys that do not shape the motion (id, limits, ...) are passed over."""
    rest, expected = iter(lines), "blocks from begin to end, in which each key stands once"
    for words in rest:
        if words != ["begin"]:
            raise MotionFormatError(file, ":bonedata", " ".join(words)[:40], expected)
        block: dict[str, list[str]] = defaultdict(list)
        for key, *values in iter(partial(next, rest, ["begin"]), ["end"]):  # at the end of the file stands another begin
            if key in ("begin", "end", *block):
                raise MotionFormatError(file, ":bonedata", f"{key[:40]} inside a bone, or twice", expected)
            block[key] = values
        name, bone = _bone(block, degrees, file)
        if name in bones or len(bones) > MOST_JOINTS:
            raise MotionFormatError(file, f"bone {name}", "it twice, or too many", f"up to {MOST_JOINTS} different names")
        bones[name] = bone
    if len(bones) < 2:
        raise MotionFormatError(file, ":bonedata", "0 whole bones", expected)


def _bone(block: dict[str, list[str]], degrees: bool, file: Path) -> tuple[str, Bone]:
    name = label(" ".join(block["name"]), file, "bone name")
    place = f"bone {name[:40]}"
    if not name:
        raise MotionFormatError(file, place, "no name", "name, direction, length and axis")
    direction, (length,) = (_numbers(block[key], n, file, f"{place}, {key}") for key, n in (("direction", 3), ("length", 1)))
    if abs((norm := np.linalg.norm(direction)) - 1) > 0.01:
        raise MotionFormatError(file, f"{place}, direction", f"length {norm:.4g}", "a unit vector")
    if length < 0:
        raise MotionFormatError(file, f"{place}, length", f"{length:g}", "0 or more")
    axis = _axis(block["axis"], degrees, file, f"{place}, axis")
    dof = tuple(word.lower() for word in block["dof"])
    if not set(dof) <= set(TURNS) or len(set(dof)) < len(dof):
        raise MotionFormatError(file, f"{place}, dof", " ".join(dof)[:40], "different ones of rx, ry, rz")
    return name, Bone(direction * length, axis, dof)


def _hung(bones: dict[str, Bone], lines: Lines, file: Path) -> dict[str, Bone]:
    """The bones with their parents from :hierarchy, in file order as far as parents allow."""
    for parent, *children in lines:
        for child in children:
            if not {parent, child} <= {*bones} or bones[child].parent:
                expected = "bones of :bonedata, each with one parent"
                raise MotionFormatError(file, ":hierarchy", f"{child[:40]} under {parent[:40]}", expected)
            bones[child].parent = parent
    hung: dict[str, Bone] = {}
    while waiting := {name: bone for name, bone in bones.items() if name not in hung}:
        ready = {name: bone for name, bone in waiting.items() if bone.parent in ("root", *hung)}
        if not ready:
            raise MotionFormatError(file, ":hierarchy", f"{[*waiting][0]} does not hang from the root", "one tree")
        hung |= ready
    return hung


def _numbers(words: list[str], count: int, file: Path, place: str) -> np.ndarray:
    if len(words) != count:
        raise MotionFormatError(file, place, f"{len(words)} words", f"{count} numbers")
    return np.array([number(word, file, place) for word in words])


def _axis(words: list[str], degrees: bool, file: Path, place: str) -> np.ndarray:
    """Three angles and their order as a matrix (3, 3)."""
    angles = _numbers(words[:3], 3, file, place)
    if [word.upper() for word in words[3:]] != ["XYZ"]:
        raise MotionFormatError(file, place, f"order {' '.join(words[3:])[:40]!r}", "XYZ, as in every file of CMU")
    return euler_matrices("zyx", (np.deg2rad(angles) if degrees else angles)[None, ::-1])[0]


def depth_first(tree: Skeleton) -> list[int]:
    """Joints as nested text lists them: each followed by all that hang from it."""
    order, waiting = [], [0]
    while waiting:  # no recursion: a file may hang hundreds of joints one under the other
        order.append(waiting.pop())
        waiting += [child for parent, child in reversed(tree.bones) if parent == order[-1]]
    return order


def _with_ends(tree: Skeleton) -> Skeleton:
    """The skeleton in the order of a BVH file, an End Site under each bone without children."""
    last = [joint for joint in range(len(tree)) if joint not in tree.parents]
    names, parents = [*tree.joints, *(f"{tree.joints[joint]}/End" for joint in last)], [*tree.parents, *last]
    order = depth_first(Skeleton("", tuple(names), tuple(parents)))
    return own_skeleton(tuple(names[joint] for joint in order), (-1, *(order.index(parents[joint]) for joint in order[1:])))


CMU_FPS = 120.0  # neither file says
Frame = list[tuple[str, str]]  # of each word of a frame, whose it is and what it says


def read_amc(file: Path, hints: Hints) -> Reading:
    """Read one AMC file and the ASF beside it: far ends of the bones in metres, and the rotations behind them.

    The transform of a bone is G = G_parent C Rz Ry Rx C^-1, with C from its `axis`; it ends at its parent's end plus
    G direction length. So C R C^-1 is its local rotation in a rig whose joints stand where bones begin, and the parent's own
    vector that joint's offset. One unit is 1/length inches, `length` from the ASF's :units (CMU: 0.45). Up is y unless `hints`
    say otherwise.

    Raises:
        MotionFormatError: either file is malformed, or they do not fit each other.
    """
    asf = find_asf(file)
    body = read_asf(asf)
    path, turns = _tracks(read_text(file), body, file)
    names = tuple(body.bones)
    skeleton = tree = own_skeleton(names, (-1, *[names.index(bone.parent) for bone in [*body.bones.values()][1:]]))
    if named_bones(tree) == named_bones(OF_CMU):
        skeleton, names = CMU, CMU_BONES
    picked, offsets = [tree.joints.index(name) for name in names], np.array([bone.offset for bone in body.bones.values()])
    positions = np.concatenate([
        forward_kinematics(rotations, (rotations @ offsets[:, :, None])[..., 0], path[part], tree).take(picked, axis=1)
        for part in blocks(len(path), len(tree))
        for rotations in [matrices([*turns.values()], part)]  # a bone's own turn moves its far end
    ])  # fmt: skip
    unit = hints.unit or stated(body.metres, FILE) or infer_unit(positions, skeleton, asf, usual="cmu")
    up, fps = hints.up or Stated("y", FORMAT), hints.fps or Stated(CMU_FPS, FORMAT)
    positions *= unit.value
    whole, still = _with_ends(tree), Turn("", path[:, :0])  # its joints stand where bones begin
    ends, starts = far_ends(whole), [body.bones[whole.joints[parent]].offset for parent in whole.parents[1:]]
    rig = Rig(
        whole,
        np.array([body.position, *starts]) * unit.value,
        quaternions([turns.get(name, still) for name in whole.joints]),
        path * unit.value,
        tuple(ends[whole.joints.index(bone)] for bone in names),
        (MOVES + ANGLES, *[None if name.endswith("/End") else ANGLES for name in whole.joints[1:]]),
    )
    return hints.reading(file, positions, skeleton, unit, up, fps, rig=rig)


def find_asf(file: Path) -> Path:
    """The skeleton of an AMC file, in the same folder: named like its subject (05_12.amc, 05.asf), else the only one.

    Raises:
        MotionFormatError: there is none, or it is not clear which.
    """
    there = without_twins([f for f in file.parent.iterdir() if bare_suffix(f) == ".asf"])
    stem = Path(bare_name(file)).stem
    subject = stem.split("_")[0]
    named = [f for f in there if Path(bare_name(f)).stem in (stem, subject)]
    for candidates in (named, there):
        if len(candidates) == 1:
            return candidates[0]
    found = ", ".join(f.name for f in there) or "no .asf file"
    raise MotionFormatError(file, "skeleton", f"{found} in its folder", f"{subject}.asf, or a single .asf file")


def named_bones(skeleton: Skeleton) -> set[tuple[str, str]]:
    """Which name hangs from which; the same for the same tree, in whichever order it is listed."""
    return {(skeleton.joints[parent], skeleton.joints[child]) for parent, child in skeleton.bones}


def _tracks(text: str, body: Body, file: Path) -> tuple[Float[np.ndarray, "T 3"], dict[str, Turn]]:
    """Where the root is, file units, and how every bone turns."""
    first = re.search(r"(?<![^\r\n])[ \t]*[^\s#:]", text)  # the first line that is neither a comment nor a keyword
    if first is None or first.start() > BLOCK:
        raise MotionFormatError(file, "header", "no frame", f"at least one, after at most {BLOCK} characters")
    degrees = ":radians" not in [line.strip() for line in text[: first.start()].lower().splitlines()]
    text = text[first.start() :]
    frame = _first_frame(text, body, file)
    table = _table(text, frame, body, file)
    column = {word: place for place, word in enumerate(frame)}
    turns: dict[str, Turn] = {}
    for name, bone in body.bones.items():
        dofs = [dof for dof in TURNS if dof in bone.dof]
        angles = table[:, [column[name, dof] for dof in dofs]]
        angles = np.deg2rad(angles) if degrees else angles
        turns[name] = Turn("".join(dof[1] for dof in dofs), angles, bone.axis if dofs else None)
    return body.position + table.take([column["root", dof] for dof in ROOT_ORDER[:3]], axis=1), turns


def _first_frame(text: str, body: Body, file: Path) -> Frame:
    """Bone and degree of freedom of every word of the first frame: its number, then of each bone its name and its numbers."""
    dofs = {name: bone.dof for name, bone in body.bones.items() if bone.dof}
    frame = [("frame", "number")]
    for line in islice(re.finditer(r"[^\r\n]+", text), 1, None):  # one by one, however long the text is
        words = line[0].split(maxsplit=7)  # a name and six numbers at most, or too many of them
        if len(words) == 1:  # the next frame's number
            break
        if not words:
            continue
        name, *numbers = words
        if (name, "") in frame or len(numbers) != len(dofs.get(name, ())):
            expected = f"{len(dofs[name])} numbers, once" if name in dofs else "a bone of the ASF that can move"
            raise MotionFormatError(file, "frame 1", f"{name[:40]} with {len(numbers)} numbers", expected)
        frame += [(name, dof) for dof in ("", *dofs[name])]
    if missing := sorted({*dofs} - {name for name, _ in frame}):
        raise MotionFormatError(file, "frame 1", f"no {', '.join(missing)[:200]}", "every bone of the ASF that can move")
    return frame


def _table(text: str, frame: Frame, body: Body, file: Path) -> Float[np.ndarray, "T words"]:
    """All frames, a row each, the names of bones as their places in `frame`."""
    places = {name: place for place, (name, dof) in enumerate(frame) if not dof}
    # The blanks before a name, of which one ends the line above, are looked at once: it takes no longer than the text is long.
    rows = re.sub(r"(?<!\s)\s+([^\s\d.+-]\S*)", lambda found: f" {places.get(found[1], found[1])}", text)
    table = number_table(rows, len(frame), file, "frames")
    bones = len(body.bones) - 1
    most = allowed(MOST_POINTS, file) // bones
    if len(table) > most:
        found = f"more than {most} frames"
        raise MotionFormatError(file, "frames", found, f"at most that for {bones} bones in a file of this size")
    names = [*places.values()]
    if len(others := np.flatnonzero(np.any(table[:, names] != names, axis=1))):
        raise MotionFormatError(file, f"frame {table[others[0], 0]:g}", "other bones", "those of frame 1 in their order")
    if len(jumps := np.flatnonzero(np.diff(table[:, 0]) != 1)):
        before, after = table[jumps[0] :, 0][:2]
        raise MotionFormatError(file, f"after frame {before:g}", f"frame {after:g}", "the next one")
    return table
