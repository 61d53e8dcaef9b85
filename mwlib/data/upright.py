"""Along which axis the body of a clip stands."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import AXES
from mwlib.body.skeleton import Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.stated import Stated

UPPER = [re.compile(words, re.I) for words in ("head|neck|skull|nose", "chest|thorax|torso|spine|clavicle|collar|shoulder")]
LOWER = [re.compile(words, re.I) for words in ("foot|feet|toe|ankle|heel|tibia|shin|calf", "knee|leg|thigh|femur")]
MOST_FRAMES = 200
UPRIGHT = 0.5  # share of the way from feet to head along an axis, median over frames; people who stand or bend have 0.69 and more
OTHERWISE = 0.75  # along another axis; people who lie and roll have 0.42 at most
STEADY = 0.8  # how far the lowest joint wanders along it, by the body's length: over steps and boxes 0.6, in crawling far
HOW = "(of load_motions, as a setting or an option; or a column up in clips.csv, or up in skeleton.json)"
LONGER = 2.0  # without names of joints: how much longer than along both others the body is


class Standing(NamedTuple):
    """What a clip says about its up-axis.

    Args:
        axis: the one that the body is stretched along, feet to head, as "y" or "-z"; of its extent, if no joint is known.
        share: how much of the way from feet to head is along the axis that is said to be up, 0 to 1; of the extent.
        is_clear: whether it stands along another axis for sure.
    """

    axis: str
    share: float
    is_clear: bool


def standing(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, up: str) -> Standing:
    """Along which axis the body stands.

    Own choice: the mean of head and neck above the mean of the feet, median over at most 200 frames. A short clip of
    somebody who lies still along an axis can look like another axis up; one who crawls or rolls does not.
    """
    frames = np.linspace(0, len(positions) - 1, min(len(positions), MOST_FRAMES)).astype(int)
    places, here = positions[frames], AXES[up]
    ends = _joints(skeleton, UPPER), _joints(skeleton, LOWER)
    if all(ends):
        way = np.subtract(*(places[:, joints].mean(axis=1) for joints in ends))
        length = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
        lean = np.median(way / length[:, None], axis=0)
        axis = int(np.argmax(np.abs(lean)))
        low, high = np.percentile((places * np.sign(lean)).min(axis=1)[:, axis], (10, 90))
        is_clear = (axis != here or lean[axis] < 0) and abs(lean[axis]) > OTHERWISE and lean[here] < UPRIGHT
        is_clear = bool(is_clear and high - low < STEADY * length.max())
        return Standing("-" * bool(lean[axis] < 0) + "xyz"[axis], float(lean[here]), is_clear)
    extent = np.median(np.ptp(places, axis=1), axis=0)
    axis = int(np.argmax(extent))
    others = np.delete(extent, axis)
    is_clear = bool(axis != here and extent[axis] > LONGER * others.max())
    return Standing("xyz"[axis], float(extent[here] / max(extent[axis], 1e-9)), is_clear)


def check_up(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, up: Stated[str], file: Path) -> None:
    """Refuse a body that clearly stands along another axis, unless the user stated which one is up.

    Raises:
        MotionFormatError: it does; the message names both axes, and how to state the right one.
    """
    found = standing(positions, skeleton, up.value)
    if up.is_users or not found.is_clear:
        return
    fits = found.axis in AXES
    say = f"say up={found.axis}" if fits else "turn the positions so that y or z points up, and say which by up="
    expected = f"{up.value} up, as {up.source} has it; {say} {HOW}; if somebody lies there, up={up.value}"
    raise MotionFormatError(file, "up-axis", f"a body that stands along {found.axis}", expected)


def _joints(skeleton: Skeleton, kinds: list[re.Pattern[str]]) -> list[int]:
    """Joints named by the first of the patterns that names any."""
    every = ([joint for joint, name in enumerate(skeleton.joints) if kind.search(name)] for kind in kinds)
    return next((joints for joints in every if joints), [])
