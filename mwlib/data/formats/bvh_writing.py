"""Writing BVH files: the rotations that a motion has, or ones fitted to its positions."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.fitting import FitError, distance, fit_rig
from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, Rig, axes_of
from mwlib.body.rotation import euler_angles, euler_quaternions
from mwlib.data.formats.asf_amc import depth_first
from mwlib.data.meaning import FASTEST, SLOWEST, metres_per_unit
from mwlib.data.untrusted import LARGEST
from mwlib.files import write_atomic
from mwlib.settings import of_kind

ALIKE = 1e-6  # metres and radians: far above the rounding of float32, far below what is seen
DIGITS = 7  # after the point: 1e-9 m, and 2e-9 radians


def write_bvh(motion: Motion, file: str | Path, *, unit: float | str = "cm", up: str = "y") -> FitError:
    """Write a motion as a BVH file: same rate, joint names and channels as it was read with.

    A motion with a rig is written as its rig is, End Sites included. One with positions only, like a model's prediction, gets
    rotations by `fit_rig`: bones have their median lengths, so that its joints may be moved; see what is returned. A joint
    whose channels cannot say what it does (a mirrored or turned motion, sometimes) gets all of a kind. Whole or not at all: an
    old file stays until the new one is complete.

    Args:
        file: a name that ends in .bvh; missing folders are made.
        unit: metres per unit of the file, or "cm", "m", "mm", "inch", "cmu". BVH has no place to state it. Own choice:
            centimetres, as LaFAN1 and Bandai-Namco have them; `load_motions` tells cm, m and mm from the size of a human,
            any other unit has to be said to it again. `motion.rig.metres` is the unit of the file that it was read from.
        up: the axis that points up in the file. Whoever reads one with "z" has to be told.

    Returns:
        Mean and largest distance, metres, of the joints in the file from `motion.positions`.

    Raises:
        ValueError: an argument is of another kind, positions are not finite or absurdly large, a joint's name or the rate cannot
            stand in a BVH file, the name of the file ends otherwise, or an unknown unit. Nothing is written then.

    >>> import tempfile
    >>> from mwlib.data.load import load_motions
    >>> from mwlib.synthetic.motions import synthetic_motions
    >>> file = Path(tempfile.mkdtemp()) / "walk.bvh"
    >>> walk = synthetic_motions(subjects=1, seconds=1.0)[0]
    >>> write_bvh(walk, file).max < 1e-5
    True
    >>> [again] = load_motions(file)
    >>> again.fps, again.up, again.skeleton.name, np.allclose(again.with_up("z").positions, walk.positions, atol=1e-5)
    (50.0, 'y', 'H36M17', True)
    """
    file, metres = asked_for(motion, file, ".bvh"), metres_per_unit(unit)
    if not SLOWEST <= motion.fps <= FASTEST:
        raise ValueError(f"fps is {motion.fps:g}; expected {SLOWEST:g} to {FASTEST:g}")
    motion = motion.with_up(up)
    rig = motion.rig or fit_rig(motion).rig
    _check_names(rig)
    order = depth_first(rig.skeleton)
    channels = {joint: _enough(rig, joint) for joint in order}
    channels[0] = channels[0] or MOVES + ANGLES
    table = np.concatenate([_columns(rig, joint, names or (), metres) for joint, names in channels.items()], axis=1)
    if not np.all(np.abs(table) <= LARGEST):  # False for nan
        raise ValueError(f"a number of the motion is {np.abs(table).max():g} in the file; expected finite ones up to {LARGEST:g}")
    write_atomic(file, _hierarchy(rig, channels, metres) + _motion_section(table, motion.fps))
    return distance(rig, motion)


def asked_for(motion: object, file: object, ending: str) -> Path:
    """Where a motion is to be written.

    Raises:
        ValueError: it is no motion, or the file's name ends otherwise.
    """
    of_kind("motion", motion, Motion)
    file = Path(of_kind("file", file, (str, Path), "a path"))
    if file.suffix.lower() != ending:
        raise ValueError(f"file is {file.name!r}; expected a name that ends in {ending}")
    return file


def _check_names(rig: Rig) -> None:
    for name, channels in zip(rig.skeleton.joints, rig.channels, strict=True):
        if channels is not None and (not name or " ".join(name.split()) != name or {"{", "}"} & {*name.split()}):
            raise ValueError(f"a joint is named {name!r}; expected words with single spaces between, no brace alone")


def _places(rig: Rig, joint: int) -> Float[np.ndarray, "T 3"]:
    """What position channels would say, metres."""
    if joint == 0:
        return rig.root
    return rig.moves[:, joint] if rig.moves is not None else np.tile(rig.offsets[joint], (len(rig.root), 1))


def _enough(rig: Rig, joint: int) -> tuple[str, ...] | None:
    """A joint's channels, and all of a kind where its own cannot say what it does."""
    names = rig.channels[joint]
    if names is None:
        return None
    lacking = [name not in names for name in MOVES]
    if np.abs(_places(rig, joint) - rig.offsets[joint])[:, lacking].max(initial=0) > ALIKE:
        names = MOVES + tuple(name for name in names if name not in MOVES)
    axes, quaternions = axes_of(names), rig.rotations[:, joint].astype(np.float64)
    if len(axes) < 3:
        said = euler_quaternions(axes, euler_angles(axes, quaternions))
        astray = np.minimum(*(np.linalg.norm(said - sign * quaternions, axis=-1) for sign in (1, -1)))
        if 2 * astray.max() > ALIKE:
            names = tuple(name for name in names if name not in ANGLES) + ANGLES
    return names


def _columns(rig: Rig, joint: int, names: tuple[str, ...], metres: float) -> Float[np.ndarray, "T channels"]:
    """The joint's part of the table: the file's unit, and degrees."""
    axes = axes_of(names)
    degrees = np.rad2deg(euler_angles(axes, rig.rotations[:, joint].astype(np.float64)))
    places = _places(rig, joint) / metres
    said = {f"{axis}rotation": degrees[:, i] for i, axis in enumerate(axes)}
    said |= {f"{axis}position": places[:, i] for i, axis in enumerate("xyz")}
    return np.stack([said[name] for name in names], axis=1) if names else places[:, :0]


def _hierarchy(rig: Rig, channels: dict[int, tuple[str, ...] | None], metres: float) -> str:
    """The tree as text, in the order of `channels`; where nothing hangs from a joint, an End Site, which other readers want."""
    lines, inside = ["HIERARCHY"], []
    offsets = np.round(rig.offsets / metres, DIGITS) + 0.0
    has_children = set(rig.skeleton.parents)
    for joint, names in channels.items():
        while inside and inside[-1] != rig.skeleton.parents[joint]:
            inside.pop()
            lines.append("\t" * len(inside) + "}")
        tabs = "\t" * len(inside)
        head = "End Site" if names is None else f"{'JOINT' if inside else 'ROOT'} {rig.skeleton.joints[joint]}"
        offset = " ".join(f"{v:.{DIGITS}f}" for v in offsets[joint])
        lines += [f"{tabs}{head}", f"{tabs}{{", f"{tabs}\tOFFSET {offset}"]
        if names is not None:
            lines.append(f"{tabs}\tCHANNELS {len(names)} {' '.join(name.capitalize() for name in names)}".rstrip())
            if joint not in has_children:
                lines += [f"{tabs}\tEnd Site", f"{tabs}\t{{", f"{tabs}\t\tOFFSET 0 0 0", f"{tabs}\t}}"]
        inside.append(joint)
    lines += ["\t" * depth + "}" for depth in reversed(range(len(inside)))]
    return "\n".join(lines) + "\n"


def _motion_section(table: Float[np.ndarray, "T channels"], fps: float) -> str:
    """Rate and numbers. The digits of a whole rate's Frame Time are such that it is read as the whole rate."""
    step = f"{1 / fps:.10f}" if fps == round(fps) else np.format_float_positional(1 / fps, unique=True)
    numbers = io.StringIO()
    np.savetxt(numbers, np.round(table, DIGITS) + 0.0, fmt=f"%.{DIGITS}f")
    return f"MOTION\nFrames: {len(table)}\nFrame Time: {step}\n{numbers.getvalue()}"
