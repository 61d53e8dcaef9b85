"""How long one unit of a file is, told from the body in it; and whether a stated unit makes a human of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.stated import SIZE, SKELETON, Stated

UNITS = {"m": 1.0, "cmu": 0.0254 / 0.45, "inch": 0.0254, "cm": 0.01, "mm": 0.001}  # metres
METRIC = ("m", "cm", "mm")
USUAL = {"CMU": "cmu", "LAFAN1": "cm", "BANDAI21": "cm"}  # the unit of the files that these skeletons come from
LONGEST_UNIT = 1000.0
HEIGHT_BY_REACH = 1.7 / 2.4  # of an adult: standing height by the way from a toe to the fingers of the other side
SMALLEST, TALLEST = 0.5, 2.5  # metres, of a human
ADULT = 1.2, 2.3  # metres; heights of known skeletons come out as 1.3 to 1.8
SWING = 0.5  # a bone whose length varies by more of itself is none: it ties the body to the world's origin
HOW = "unit= (of load_motions, as a setting or an option; or a column unit in clips.csv, or unit in skeleton.json)"


def metres_per_unit(unit: float | str) -> float:
    """A unit's length in metres.

    Args:
        unit: a name, or metres per unit, as a number or in text.

    Raises:
        ValueError: an unknown name, or not a positive number of sensible size.
    """
    if unit in UNITS:
        return UNITS[unit]
    try:
        metres = float(unit)
    except (TypeError, ValueError):
        metres = 0.0
    if not 0 < metres <= LONGEST_UNIT:
        raise ValueError(f"unit is {unit!r}; expected metres per unit up to {LONGEST_UNIT:g}, or one of {', '.join(UNITS)}")
    return metres


def height(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton) -> float:
    """Standing height of the body whatever its pose, in the unit of `positions`.

    Own choice: the body is measured along its bones, from the toe to the fingers of the other side, and an adult's
    proportions do the rest; that is right to a quarter for skeletons with and without fingers, toes and the top of the head.
    Bone lengths are medians over at most 100 frames.
    """
    if len(skeleton) < 2:
        return 0.0
    frames = np.linspace(0, len(positions) - 1, min(len(positions), 100)).astype(int)
    every = bone_lengths(positions[frames], skeleton)
    lengths = np.median(every, axis=0)
    low, high = np.percentile(every, (10, 90), axis=0)
    lengths = np.where(high - low > SWING * lengths, 0.0, lengths)
    deepest, longest = np.zeros(len(skeleton)), 0.0
    for (parent, child), length in reversed(list(zip(skeleton.bones, lengths, strict=True))):
        way = deepest[child] + length
        longest = max(longest, deepest[parent] + way)
        deepest[parent] = max(deepest[parent], way)
    return HEIGHT_BY_REACH * float(longest)


def infer_unit(
    positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, file: Path, usual: str | None = None
) -> Stated[float]:
    """Metres per unit, so that the body has the size of a human.

    The usual unit of the skeleton's or the format's files is taken if it makes an adult. Else exactly one unit must make a human
    of 0.5 to 2.5 m, and a metric one: inches and CMU's units are told from nothing but a known skeleton.

    Raises:
        MotionFormatError: no unit does, or several do; the message says how to state it.
    """
    found = height(positions, skeleton)
    usual = usual or USUAL.get(skeleton.name)
    if usual and ADULT[0] < found * UNITS[usual] < ADULT[1]:
        return Stated(UNITS[usual], SKELETON)
    fitting = _fitting(found)
    if len(fitting) == 1 and fitting[0] in METRIC:
        return Stated(UNITS[fitting[0]], SIZE)
    sizes = f"{found / HEIGHT_BY_REACH:.4g} units along the bones from end to end{_readings(found, fitting)}"
    raise MotionFormatError(file, "body size", sizes, f"a human of {SMALLEST} to {TALLEST} m in one unit only; say {HOW}")


def check_size(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, unit: Stated[float], file: Path) -> None:
    """Refuse a body of no human's size, unless the user stated the unit.

    Args:
        positions: metres.

    Raises:
        MotionFormatError: it is too small or too large; the message names the likely unit.
    """
    tall = height(positions, skeleton)
    if unit.is_users or SMALLEST <= tall <= TALLEST:
        return
    readings = _readings(tall / unit.value, _fitting(tall / unit.value))
    sizes = f"a body of {tall:.3g} m in the unit of {unit.source}, {unit.value:.4g} m{readings}"
    raise MotionFormatError(file, "body size", sizes, f"a human of {SMALLEST} to {TALLEST} m; if the body is right, say {HOW}")


def _fitting(found: float) -> list[str]:
    """Units in which a height is a human's."""
    return [name for name, metres in UNITS.items() if SMALLEST <= found * metres <= TALLEST]


def _readings(found: float, names: list[str]) -> str:
    return f": a person of {' or '.join(f'{found * UNITS[n]:.2f} m if the unit is {n}' for n in names)}" if names else ""
