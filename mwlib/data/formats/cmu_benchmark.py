"""The CMU prediction benchmark: text files of rotation vectors on one generic skeleton.

Source: Li et al., Convolutional Sequence to Sequence Model for Human Dynamics, CVPR 2018; skeleton constants from the
published code (`forward_kinematics_cmu.py`, MIT licence).
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.motion import Motion
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.collections.cmu import BENCHMARK_COLUMNS
from mwlib.data.formats.frames import in_blocks, starts_in_tpose
from mwlib.data.meaning import FILE, FORMAT, UNITS, Hints, Reading, Stated
from mwlib.data.untrusted import number_table, read_text

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
    motion = Motion(positions[first:].astype(np.float32), fps.value, CMU, action=file.parent.name, up=up.value)
    return Reading(hints.label(motion, file), unit, up, fps, Stated(first, FILE))


def _positions(table: Float[np.ndarray, "n 117"]) -> Float[np.ndarray, "n joints 3"]:
    """Where the points of CMU are, CMU units."""
    turns = Rotation.from_rotvec(-table[:, 3:].reshape(-1, 3)).as_matrix().reshape(len(table), 38, 3, 3)
    return forward_kinematics(turns, TREE[:, 1:], table[:, :3], SKELETON)[:, PICKED]
