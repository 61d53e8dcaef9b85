"""Arrays of one's own with joint positions and the skeleton file beside them, and the texts of the CMU prediction benchmark.

Source of the skeleton of those texts: Li et al., Convolutional Sequence to Sequence Model for Human Dynamics, CVPR 2018;
published code, `forward_kinematics_cmu.py`, MIT licence.
"""

import json
from collections import Counter
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from mwlib.body.skeleton import Skeleton
from mwlib.data.collections import SKELETONS, known_skeleton
from mwlib.data.formats.humanml import HUMANML3D, KIT

from mwlib.data.meaning import (  # isort: skip
    BESIDE, DEFAULT, ENTRY, FORMAT, LEVELS_UP, UNKNOWN, Hints, Reading, Stated, hints_of, infer_unit,
)  # fmt: skip
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.skeleton import CMU
from mwlib.data.collections.cmu import BENCHMARK_COLUMNS
from mwlib.data.formats.frames import in_blocks, starts_in_tpose
from mwlib.data.meaning import FILE, UNITS
from mwlib.data.mirroring import paired

from mwlib.data.untrusted import (  # isort: skip
    MOST_JOINTS, SMALL_TEXT, MotionFormatError, check_names, label, number_table, numbers, read_text, single,
)  # fmt: skip

SKELETON_FILE = "skeleton.json"
KEYS = tuple("name joints parents left right parts fps unit up note notes".split())  # of it
JOINTS_FOLDER = "new_joints"  # of HumanML3D (22 joints) and KIT-ML (21)


def read_positions(arrays: dict[str, Shaped[np.ndarray, "*shape"]], file: Path, hints: Hints) -> Reading:
    """Make a motion of the entries of an .npz file.

    `positions` (T, J, 3) is needed; `fps`, `unit`, `up`, `subject`, `action` and `skeleton` (the name of a known skeleton)
    may be there; what is not comes from skeleton.json beside the file or above it, which must not contradict them where it is
    about this skeleton. `Hints` says who is believed first; an axis up that nobody states is z.

    Raises:
        MotionFormatError: shapes, values or the skeleton do not fit, nobody states the skeleton or the frame rate, or the file
            and skeleton.json state two of something while neither the caller nor clips.csv decides.
    """
    beside = _layout_beside(file, arrays["positions"].shape)
    said = {name: single(array, file, name) for name, array in arrays.items() if name != "positions"}
    inside = hints_of(said, file, ENTRY)
    skeleton = inside.skeleton or beside.skeleton or hints.skeleton
    if skeleton == (beside.skeleton or skeleton):
        _check_agreement(inside, beside, file, hints)
    who, what = (label(str(said.get(name, "")), file, name) for name in ("subject", "action"))
    known = hints.over(inside).over(beside).over(Hints(subject=who, action=what))
    if skeleton is None or known.fps is None:
        missing, ways = (
            ("skeleton", "skeleton=") if skeleton is None else ("frame rate", "a column fps in clips.csv, or file_fps=")
        )
        raise MotionFormatError(file, missing, "none", f"a {SKELETON_FILE} beside the file that says it, or {ways}")
    positions = arrays["positions"]
    fits = positions.shape[1:] == (len(skeleton), 3) and len(positions) > 0
    expected = f"numbers of shape (T, {len(skeleton)}, 3) with T > 0 for {skeleton.name}"
    positions = numbers(positions, fits, file, "positions", expected)
    unit = known.unit or infer_unit(positions, skeleton, file)
    return known.reading(file, positions * unit.value, skeleton, unit, known.up or Stated("z", DEFAULT), known.fps)


def _check_agreement(inside: Hints, beside: Hints, file: Path, hints: Hints) -> None:
    """Refuse a file that says something else than the skeleton.json beside it, unless somebody else says what is right."""
    for name, argument in (("fps", "file_fps"), ("unit", "unit"), ("up", "up")):
        one, other = (getattr(layout, name) for layout in (inside, beside))
        if one and other and one.value != other.value and getattr(hints, name) is None:
            expected = f"one value; or a column {name} in clips.csv, or {argument}="
            raise MotionFormatError(file, name, f"{one.value} in {one.source}, {other.value} in {other.source}", expected)


def _layout_beside(file: Path, shape: tuple[int, ...]) -> Hints:
    """What the nearest skeleton.json says, in the file's folder or above; else that of the data set with such a folder."""
    path = file.resolve()
    for folder in path.parents[:LEVELS_UP]:
        if (folder / SKELETON_FILE).is_file():
            return read_skeleton_file(folder / SKELETON_FILE)
    known = KIT if shape[1:] == (len(KIT.skeleton), 3) else HUMANML3D
    if path.parent.name == JOINTS_FOLDER:
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
    try:
        tree = json.loads(read_text(file, SMALL_TEXT), object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        if isinstance(error, MotionFormatError):
            raise
        raise MotionFormatError(file, "text", str(error)[:80], "JSON with each key once") from error
    if isinstance(tree, dict):
        check_names(tree, KEYS, "key", file, "top")
    if not isinstance(tree, dict) or not isinstance(tree.get("name"), str) or not tree["name"].strip():
        raise MotionFormatError(file, "top", "no name", "an object with a name")
    label(tree["name"], file, "name")
    if "joints" in tree or tree["name"] not in SKELETONS:
        tree["skeleton"] = _skeleton(tree, file)
    else:
        tree["skeleton"] = tree["name"]
    return hints_of(tree, file, BESIDE)


def _once(pairs: list[tuple[str, object]]) -> dict:
    """An object, each of whose keys stands once."""
    if twice := [key for key, count in Counter(key for key, _ in pairs).items() if count > 1]:
        raise ValueError(f"key {twice[0]!r} twice")
    return dict(pairs)


def _skeleton(tree: dict, file: Path) -> Skeleton:
    names, parents = tree.get("joints"), tree.get("parents")
    if (
        not isinstance(names, list) or not 2 <= len(names) <= MOST_JOINTS or not all(isinstance(name, str) for name in names)
        or not isinstance(parents, list) or not all(type(p) is int for p in parents)
    ):  # fmt: skip
        found = f"joints {str(names)[:60]}, parents {str(parents)[:60]}"
        raise MotionFormatError(
            file, "joints, parents", found, f"a list of two or more names up to {MOST_JOINTS}, a list of indices"
        )
    for name in names:
        if label(name, file, "joints").strip() != name or not name:
            raise MotionFormatError(file, "joints", repr(name), "names without blanks around them")
    parts = tree.get("parts", {})
    if not isinstance(parts, dict):
        raise MotionFormatError(file, "parts", repr(parts)[:60], "an object")
    for row in (tree.get("left", []), tree.get("right", []), *parts.values()):
        if not isinstance(row, list) or not all(type(i) is int and 0 <= i < len(names) for i in row):
            raise MotionFormatError(file, "left, right, parts", repr(row)[:60], f"lists of joint indices, 0 to {len(names) - 1}")
    by_name = {"left", "right"}.isdisjoint(tree)
    left, right = paired(tuple(names)) if by_name else (tuple(tree.get(side, [])) for side in ("left", "right"))
    parts = {part: tuple(row) for part, row in parts.items()}
    try:
        found = known_skeleton(Skeleton(tree["name"], tuple(names), tuple(parents), left, right, parts))
    except ValueError as error:
        raise MotionFormatError(file, "skeleton", str(error), "a tree") from error
    _check_sides(found, file)
    return found


def _check_sides(skeleton: Skeleton, file: Path) -> None:
    """Refuse pairs of joints that their names contradict."""
    told = dict(zip(*paired(skeleton.joints), strict=True))
    for one, other in zip(skeleton.left, skeleton.right, strict=True):
        if told.get(one) != other and {one, other} & {*told, *told.values()}:
            found = f"{skeleton.joints[one]!r} on the left and {skeleton.joints[other]!r} on the right"
            raise MotionFormatError(file, "left, right", found, "pairs as the joints' names say, in the same order")


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
    positions = in_blocks(lambda part: _positions(table[part]), len(table), len(SKELETON))
    unit = hints.unit or Stated(UNITS["cmu"], FORMAT)
    up, fps = hints.up or Stated("y", FORMAT), hints.fps or Stated(FPS, FORMAT)
    positions *= unit.value
    first = int(hints.first_frame is None and starts_in_tpose(table[:, 3:6], positions, up.value))
    known = hints.over(Hints(action=file.parent.name))
    return known.reading(file, positions[first:], CMU, unit, up, fps, Stated(first, FILE))


def _positions(table: Float[np.ndarray, "n 117"]) -> Float[np.ndarray, "n joints 3"]:
    """Where the points of CMU are, CMU units."""
    turns = Rotation.from_rotvec(-table[:, 3:].reshape(-1, 3)).as_matrix().reshape(len(table), 38, 3, 3)
    return forward_kinematics(turns, TREE[:, 1:], table[:, :3], SKELETON)[:, PICKED]
