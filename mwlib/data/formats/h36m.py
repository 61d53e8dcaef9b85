"""Human3.6M and HumanEva-I as VideoPose3D stores them, and writing that layout.

Source: VideoPose3D, `positions_3d`: subject -> action -> (frames, joints, 3), metres, z up; joint reduction and dropped
sequences as in DLow and HumanMAC.
"""

import io
import re
from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO

import numpy as np

from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17
from mwlib.data.collections.h36m import HUMANEVA15
from mwlib.data.formats.pickles import unpickle
from mwlib.data.meaning import FORMAT, Hints, Reading, Stated
from mwlib.data.untrusted import MotionFormatError, array_header, bounded, label
from mwlib.files import write_atomic

KNOWN = {17: (H36M17, 50.0), 15: (HUMANEVA15, 60.0)}  # joints -> skeleton and frames per second
KEPT = tuple(map(int, "0 1 2 3 6 7 8 12 13 14 15 17 18 19 25 26 27".split()))
# For each of the 32 joints which of the 17 stands there: itself, or the next one above that is kept.
STANDS = [*map(int, "0 1 2 3 3 3 4 5 6 6 6 0 7 8 9 10 7 11 12 13 13 13 13 13 7 14 15 16 16 16 16 16".split())]
CORRUPT = {
    ("S11", "Directions"), ("Train/S3", "Walking 1 chunk0"), ("Train/S3", "Walking 1 chunk2"), ("Validate/S3", "Walking 1 chunk4")
}  # fmt: skip


def read_positions_3d(stream: BinaryIO, file: Path, hints: Hints) -> list[Reading]:
    """Motions out of the `positions_3d` entry of an npz file, in the file's order.

    32 joints are reduced to Human3.6M's 17, 17 are taken as they are, 15 are HumanEva-I's. Sequences known to be corrupt
    are dropped: S11 Directions, and three HumanEva chunks with a wrong head. `action` is the name without its take
    ("Walking 1" -> "Walking"), `name` is "S9 Walking 1".

    Raises:
        MotionFormatError: the entry holds anything but dictionaries of finite arrays of these joints; code in it never runs.
    """
    place = "positions_3d"
    shape, _, dtype = array_header(stream, file, place)
    if shape != () or dtype.kind != "O":
        raise MotionFormatError(file, place, f"{dtype} of shape {shape}", "one pickled dictionary (dtype object, shape ())")
    subjects = unpickle(stream.read(), file, place)
    if not isinstance(subjects, dict) or not all(isinstance(actions, dict) for actions in subjects.values()):
        raise MotionFormatError(file, place, "no two levels of dictionaries", "subject -> action -> array")
    readings = [
        _reading(array, subject, action, file, hints)
        for subject, actions in subjects.items()
        for action, array in actions.items()
        if (subject, action) not in CORRUPT
    ]
    if len({r.motion.skeleton.name for r in readings}) != 1:
        raise MotionFormatError(file, place, f"{len(readings)} sequences", "at least one, all with the same joints")
    return readings


def _reading(array: np.ndarray, subject: str, action: str, file: Path, hints: Hints) -> Reading:
    for word in (subject, action):
        label(word, file, "positions_3d")
    place = f"positions_3d, {subject[:40]} {action[:60]}"
    fits = array.ndim == 3 and array.shape[1] in (32, *KNOWN) and array.shape[2] == 3 and len(array) > 0
    if not fits or array.dtype.kind != "f":
        raise MotionFormatError(file, place, f"shape {array.shape}, {array.dtype}", "floats (frames, 32 or 17 or 15, 3)")
    positions = bounded(array, file, place).astype(np.float32)
    if positions.shape[1] == 32:
        positions = positions[:, KEPT]
    skeleton, rate = KNOWN[positions.shape[1]]
    unit, up, fps = hints.unit or Stated(1.0, FORMAT), hints.up or Stated("z", FORMAT), hints.fps or Stated(rate, FORMAT)
    positions *= np.float32(unit.value)
    kind = re.sub(r"( \d+)?( chunk\d+)?$", "", action)
    return Reading(Motion(positions, fps.value, skeleton, subject, kind, f"{subject} {action}", up.value), unit, up, fps)


def write_h36m(path: str | Path, motions: Sequence[Motion]) -> None:
    """Write motions as VideoPose3D's data_3d_h36m.npz is laid out: 32 joints, metres, z up, 50 fps, float32.

    The 15 joints that readers leave out get their parent's position. Takes of one action by one subject are numbered
    "Walking", "Walking 1", "Walking 2", ... in the order given.

    Raises:
        ValueError: a motion cannot be carried over to H36M17, or would be named like a sequence that readers drop.
    """
    tree: dict[str, dict[str, np.ndarray]] = {}
    for motion in motions:
        motion = motion.retarget(H36M17).with_up("z").resample(50.0)
        actions = tree.setdefault(motion.subject, {})
        numbered = chain([motion.action], (f"{motion.action} {take}" for take in count(1)))
        name = next(name for name in numbered if name not in actions)
        if (motion.subject, name) in CORRUPT:
            raise ValueError(f"{motion.subject} {name} is a sequence that readers drop; expected another name")
        actions[name] = motion.positions[:, STANDS]
    stream = io.BytesIO()
    np.savez_compressed(stream, positions_3d=np.array(tree, dtype=object))
    write_atomic(Path(path), stream.getvalue())
