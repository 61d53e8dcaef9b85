"""How long one unit of a file is, told from the body in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import Skeleton
from mwlib.data.errors import MotionFormatError

UNITS = {"m": 1.0, "cmu": 0.0254 / 0.45, "inch": 0.0254, "cm": 0.01, "mm": 0.001}  # metres
LONGEST_UNIT = 1000.0
TYPICAL_REACH = 2.4  # metres, from a toe to the fingers of the other side along the bones, of an adult of 1.7 m
SLACK = 1.6  # neighbouring units are a factor of 2.2 or more apart


def metres_per_unit(unit: float | str) -> float:
    """A unit's length in metres.

    Raises:
        ValueError: an unknown name, or not a positive number of sensible size.
    """
    if unit in UNITS:
        return UNITS[unit]
    if isinstance(unit, str) or not 0 < unit <= LONGEST_UNIT:
        raise ValueError(f"unit is {unit!r}; expected metres per unit up to {LONGEST_UNIT:g}, or one of {', '.join(UNITS)}")
    return float(unit)


def reach(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton) -> float:
    """Longest way along the bones from one joint to another, in the unit of `positions`.

    Bone lengths are medians over at most 100 frames.
    """
    frames = np.linspace(0, len(positions) - 1, min(len(positions), 100)).astype(int)
    lengths = np.median(bone_lengths(positions[frames], skeleton), axis=0)
    deepest, longest = np.zeros(len(skeleton)), 0.0
    for (parent, child), length in reversed(list(zip(skeleton.bones, lengths, strict=True))):
        way = deepest[child] + length
        longest = max(longest, deepest[parent] + way)
        deepest[parent] = max(deepest[parent], way)
    return float(longest)


def infer_unit(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, file: Path) -> float:
    """Metres per unit, so that the body has the size of a human.

    Own choice: the body is measured along its bones, toe to opposite fingers, about 1.4 times the height; unlike the
    height itself, that does not depend on the pose.

    Raises:
        MotionFormatError: no known unit makes a human of it.
    """
    found = reach(positions, skeleton)
    for metres in UNITS.values():
        if TYPICAL_REACH / SLACK < found * metres < TYPICAL_REACH * SLACK:
            return metres
    expected = f"1.5 to 3.8 m in one of the units {', '.join(UNITS)}; if the file is right, say unit="
    raise MotionFormatError(file, "body size", f"{found:.4g} units along the bones from end to end", expected)
