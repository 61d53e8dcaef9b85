"""Arrays of one's own with joint positions and the skeleton file beside them, and the texts of the CMU prediction benchmark.

Source of the skeleton of those texts: Li et al., Convolutional Sequence to Sequence Model for Human Dynamics, CVPR 2018;
published code, `forward_kinematics_cmu.py`, MIT licence.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from scipy.spatial.transform import Rotation

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.collections import SKELETONS, known_skeleton
from mwlib.data.collections.cmu import BENCHMARK_COLUMNS
from mwlib.data.formats.frames import blocks, starts_in_tpose
from mwlib.data.formats.humanml import HUMANML3D, JOINTS, KIT
from mwlib.data.mirroring import paired
from mwlib.settings import of_kind, several, whole, wholes

from mwlib.data.meaning import (  # isort: skip
    BESIDE, DEFAULT, ENTRY, FILE, FORMAT, LEVELS_UP, UNITS, UNKNOWN, Hints, Reading, Stated, hints_of, infer_unit,
)  # fmt: skip
from mwlib.data.untrusted import (  # isort: skip
    MOST_JOINTS, SMALL_TEXT, MotionFormatError, check_names, label, number_table, numbers, read_text, single,
)  # fmt: skip

SKELETON_FILE = "skeleton.json"
KEYS = tuple("name joints parents left right parts fps unit up note notes".split())  # of it


def read_positions(arrays: dict[str, Shaped[np.ndarray, "*shape"]], file: Path, hints: Hints) -> Reading:
    """Make a motion of the entries of an .npz file.

    `positions` (T, J, 3) is needed; `fps`, `unit`, `up`, `subject`, `action` and `skeleton` (the name of a known skeleton)
    may be there; what is not comes from skeleton.json beside the file or above it, which must not contradict them where it is
    about this skeleton. `Hints` says who is believed first; an axis up that nobody states is z.

    Raises:
        MotionFormatError: shapes, values or the skeleton do not fit, nobody states the skeleton or the frame rate, or the file
            and skeleton.json state two of something while neither the caller nor clips.csv decides.
    """
    positions = arrays["positions"]
    beside = _layout_beside(file, positions.shape)
    said = {name: single(array, file, name) for name, array in arrays.items() if name != "positions"}
    inside = hints_of(said, file, ENTRY)
    skeleton = inside.skeleton or beside.skeleton or hints.skeleton
    checked = (("fps", "file_fps"), ("unit", "unit"), ("up", "up"))
    for name, argument in checked if skeleton == (beside.skeleton or skeleton) else ():  # else it is about another skeleton
        one, other = getattr(inside, name), getattr(beside, name)
        if one and other and one.value != other.value and getattr(hints, name) is None:
            expected = f"one value; or a column {name} in clips.csv, or {argument}="
            raise MotionFormatError(file, name, f"{one.value} in {one.source}, {other.value} in {other.source}", expected)
    who, what = (label(str(said.get(name, "")), file, name) for name in ("subject", "action"))
    known = hints.over(inside).over(beside).over(Hints(subject=who, action=what))
    if skeleton is None or known.fps is None:
        expected = f"a {SKELETON_FILE} beside the file that says it, or skeleton= and a column fps in clips.csv, or file_fps="
        raise MotionFormatError(file, "frame rate" if skeleton else "skeleton", "none", expected)
    fits = positions.shape[1:] == (len(skeleton), 3) and len(positions) > 0
    expected = f"numbers of shape (T, {len(skeleton)}, 3) with T > 0 for {skeleton.name}"
    positions = numbers(positions, fits, file, "positions", expected)
    unit = known.unit or infer_unit(positions, skeleton, file)
    return known.reading(file, positions * unit.value, skeleton, unit, known.up or Stated("z", DEFAULT), known.fps)


def _layout_beside(file: Path, shape: tuple[int, ...]) -> Hints:
    """What the nearest skeleton.json says, in the file's folder or above; else that of the data set with such a folder."""
    path = file.resolve()
    for folder in path.parents[:LEVELS_UP]:
        if (folder / SKELETON_FILE).is_file():
            return read_skeleton_file(folder / SKELETON_FILE)
    known = KIT if shape[1:] == (len(KIT.skeleton), 3) else HUMANML3D
    if path.parent.name == JOINTS:
        return Hints(
            Stated(known.metres_per_unit, FORMAT), Stated("y", FORMAT), Stated(known.fps, FORMAT), skeleton=known.skeleton
        )
    return UNKNOWN


def read_skeleton_file(file: Path) -> Hints:
    """Read a skeleton.json.

    An object with "name", and for a skeleton that mwlib does not know "joints" (names, the root first), "parents" (joint
    indices, -1 for the root) and optionally "left", "right" (joint indices, paired; left out, they are told from the names) and
    "parts" (name -> joint indices);
    optionally "fps", "unit" (metres, or a name such as "cm") and "up" ("y" or "z").

    Raises:
        MotionFormatError: not JSON, an unknown key, a field of the wrong kind, or a skeleton that is no tree.
    """
    text = read_text(file, SMALL_TEXT)
    try:
        tree = json.loads(text, object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise MotionFormatError(file, "text", str(error)[:80], "JSON with each key once") from error
    tree = tree if isinstance(tree, dict) else {}
    check_names(tree, KEYS, "key", file, "top")
    name = label(tree.get("name") or "", file, "name")
    if not name.strip():
        raise MotionFormatError(file, "top", "no name", "an object with a name")
    return hints_of(
        tree | {"skeleton": _skeleton(tree, file) if "joints" in tree or name not in SKELETONS else name}, file, BESIDE
    )


def _once(pairs: list[tuple[str, object]]) -> dict:
    """An object, each of whose keys stands once."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError(f"a key twice among {', '.join(key for key, _ in pairs)}")
    return found


def _skeleton(tree: dict[str, Any], file: Path) -> Skeleton:
    names = tree.get("joints")
    if not isinstance(names, list) or not 2 <= len(names) <= MOST_JOINTS:
        raise MotionFormatError(file, "joints", repr(names)[:60], f"a list of two or more names up to {MOST_JOINTS}")
    for name in names:
        if label(name, file, "joints").strip() != name or not name:
            raise MotionFormatError(file, "joints", repr(name), "names without blanks around them")
    try:
        parents = tuple(whole("parents", parent, -1) for parent in several("parents", tree.get("parents"), "joint indices"))
        left, right = (tuple(wholes(side, tree.get(side, ()))) for side in ("left", "right"))
        if {"left", "right"}.isdisjoint(tree):
            left, right = paired(tuple(names))
        parts = {part: tuple(wholes(part, row)) for part, row in of_kind("parts", tree.get("parts", {}), dict).items()}
        found = known_skeleton(Skeleton(tree["name"], tuple(names), parents, left, right, parts))
    except ValueError as error:
        raise MotionFormatError(file, "skeleton", str(error), "a tree of joints, pairs of them and parts") from error
    told = dict(zip(*paired(found.joints), strict=True))
    for one, other in zip(found.left, found.right, strict=True):
        if told.get(one) != other and {one, other} & {*told, *told.values()}:
            said = f"{found.joints[one]!r} on the left and {found.joints[other]!r} on the right"
            raise MotionFormatError(file, "left, right", said, "pairs as the joints' names say, in the same order")
    return found


FPS = 120.0  # every row; the usual protocol keeps every second one
# Parent and offset (CMU units) of the 38 points: the 31 cgspeed joints and seven End Sites.
POINTS = """
    -1 0 0 0,               0 0 0 0,                1 1.65674 -1.80282 0.62477, 2 2.5972 -7.13576 0,
    3 2.49236 -6.8477 0,    4 0.19704 -0.54136 2.14581, 5 0 0 1.11249,          0 0 0 0,
    7 -1.6107 -1.80282 0.62476, 8 -2.59502 -7.12977 0, 9 -2.4678 -6.78024 0,    10 -0.23024 -0.63258 2.13368,
    11 0 0 1.11569,         0 0 0 0,                13 0.01961 2.0545 -0.14112, 14 0.01021 2.06436 -0.05921,
    15 0 0 0,               16 0.00713 1.56711 0.14968, 17 0.03429 1.56041 -0.10006, 18 0.01305 1.6256 -0.05265,
    15 0 0 0,               20 3.54205 0.90436 -0.17364, 21 4.86513 0 0,        22 3.35554 0 0,
    23 0 0 0,               24 0.66117 0 0,         25 0.53306 0 0,             23 0 0 0,
    27 0.5412 0 0.5412,     15 0 0 0,               29 -3.49802 0.75994 -0.32616, 30 -5.02649 0 0,
    31 -3.36431 0 0,        32 0 0 0,               33 -0.73041 0 0,            34 -0.58887 0 0,
    32 0 0 0,               36 -0.59786 0 0.59786
"""
TREE = np.array([point.split() for point in POINTS.split(",")], dtype=float)
SKELETON = Skeleton("CMU benchmark", tuple(f"point{i}" for i in range(38)), tuple(TREE[:, 0].astype(int).tolist()))
# The point that stands at each joint of CMU; thorax and wrists have no length, as in the cgspeed BVH files.
PICKED = [int(n) for n in "0 2 3 4 5 6 8 9 10 11 12 14 15 16 17 18 19 21 22 23 24 25 26 28 30 31 32 33 34 35 37".split()]


def read_benchmark(file: Path, hints: Hints) -> Reading:
    """Read one text file: every row but an added T-pose, in metres, y up, on CMU's 31 points.

    The file's rotation vectors are for row vectors, so they are negated. The action is the folder's name. In some published
    clips the whole body flips while it turns (`check-data` lists them); the usual protocol drops the root's rotation.

    Raises:
        MotionFormatError: not lines of 117 finite numbers.
    """
    table = number_table(read_text(file), BENCHMARK_COLUMNS, file, "table", delimiter=",")
    positions = np.concatenate([
        forward_kinematics(rotations, TREE[:, 1:], table[part, :3], SKELETON).take(PICKED, axis=1)
        for part in blocks(len(table), len(SKELETON))
        for rotations in [Rotation.from_rotvec(-table[part, 3:].reshape(-1, 3)).as_matrix().reshape(-1, len(SKELETON), 3, 3)]
    ])  # fmt: skip
    unit = hints.unit or Stated(UNITS["cmu"], FORMAT)
    up, fps = hints.up or Stated("y", FORMAT), hints.fps or Stated(FPS, FORMAT)
    positions *= unit.value
    first = int(hints.first_frame is None and starts_in_tpose(table[:, 3:6], positions, up.value))
    known = hints.over(Hints(action=file.parent.name))
    return known.reading(file, positions[first:], CMU, unit, up, fps, Stated(first, FILE))
