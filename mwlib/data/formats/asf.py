"""ASF: the Acclaim skeleton that belongs to AMC motions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mwlib.body.rotation import euler_matrices
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.reading import MOST_JOINTS, SMALL_TEXT, label, lines_of, number, read_text

INCH = 0.0254
ROOT_ORDER = ("tx", "ty", "tz", "rx", "ry", "rz")
TURNS = ("rx", "ry", "rz")
CMU_BONES = tuple(name.replace("left_", "l").replace("right_", "r") for name in CMU.joints)


@dataclass
class Bone:
    """A bone: from its parent's far end along `offset` (file units) in its own turned frame, whose axes are `axis` (3, 3)."""

    offset: np.ndarray
    axis: np.ndarray
    dof: tuple[str, ...]
    parent: str = ""


@dataclass
class Body:
    """What an ASF file says: bones in file order without the root, the root's pose at rest, and metres per unit if stated."""

    bones: dict[str, Bone]
    position: np.ndarray
    root_axis: np.ndarray
    root_order: tuple[str, ...]
    metres: float | None


def read_asf(file: Path) -> Body:
    """Read one ASF file.

    Raises:
        MotionFormatError: it is malformed, or uses an axis order or a degree of freedom that nobody has checked here.
    """
    sections = _sections(read_text(file, SMALL_TEXT), file)
    units = {words[0]: words[1] for words in sections.get("units", []) if len(words) == 2}
    degrees = _is_degrees(units.get("angle", "deg"), file)
    length = number(units["length"], file, ":units length") if "length" in units else None
    if length is not None and not 1e-3 <= length <= 1e3:
        raise MotionFormatError(file, ":units length", f"{length:g}", "0.001 to 1000 (CMU: 0.45)")
    bones = _bones(sections.get("bonedata", []), degrees, file)
    _hang(bones, sections.get("hierarchy", []), file)
    root = {words[0]: words[1:] for words in sections.get("root", [])}
    order = tuple(word.lower() for word in root.get("order", ROOT_ORDER))
    if sorted(order) != sorted(ROOT_ORDER):
        raise MotionFormatError(file, ":root order", " ".join(order)[:60], "TX TY TZ RX RY RZ in some order")
    position = _three(root.get("position", ["0", "0", "0"]), file, ":root position")
    axis = _axis(root.get("orientation", ["0", "0", "0"]) + root.get("axis", ["XYZ"]), degrees, file, ":root")
    return Body(bones, position, axis, order, INCH / length if length else None)


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


def _hang(bones: dict[str, Bone], lines: list[list[str]], file: Path) -> None:
    """Set every bone's parent from :hierarchy."""
    for parent, *children in lines:
        if parent in ("begin", "end") and not children:
            continue
        for child in children:
            if (parent != "root" and parent not in bones) or child not in bones or bones[child].parent:
                expected = "bones of :bonedata, each with one parent"
                raise MotionFormatError(file, ":hierarchy", f"{child[:40]} under {parent[:40]}", expected)
            bones[child].parent = parent
    for name, bone in bones.items():
        seen, above = {name}, bone.parent
        while above not in ("root", "") and above not in seen:
            seen.add(above)
            above = bones[above].parent
        if above != "root":
            raise MotionFormatError(file, ":hierarchy", f"{name} does not hang from the root", "one tree")


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


def _is_degrees(word: str, file: Path) -> bool:
    if word.lower() not in ("deg", "degrees", "rad", "radians"):
        raise MotionFormatError(file, ":units angle", repr(word[:40]), "deg or rad")
    return word.lower().startswith("deg")
