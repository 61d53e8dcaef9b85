"""AMC: Acclaim motions, as CMU publishes its recordings."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mwlib.body.kinematics import forward_kinematics
from mwlib.body.motion import Motion
from mwlib.body.rotation import euler_matrices
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.data.errors import MotionFormatError
from mwlib.data.formats.asf import CMU_BONES, ROOT_ORDER, TURNS, Body, read_asf
from mwlib.data.formats.asf_rig import Tracks, asf_rig, root_path
from mwlib.data.formats.blocks import in_blocks
from mwlib.data.hints import Hints
from mwlib.data.naming import own_skeleton
from mwlib.data.opening import MOST_POINTS, MOST_VALUES, allowed, bare_name, bare_suffix, without_twins
from mwlib.data.reading import BLOCK, LARGEST, blocks_of, bounded, lines_of, read_text
from mwlib.data.stated import FILE, FORMAT, Reading, Stated, stated
from mwlib.data.units import infer_unit

CMU_FPS = 120.0  # neither file says


def read_amc(file: Path, hints: Hints) -> Reading:
    """Read one AMC file and the ASF beside it: far ends of the bones in metres, and the rotations behind them.

    The transform of a bone is G = G_parent C Rz Ry Rx C^-1, with C from its `axis`; it ends at its parent's end plus
    G direction length. One unit is 1/length inches, `length` from the ASF's :units (CMU: 0.45). Up is y unless `hints` say
    otherwise.

    Raises:
        MotionFormatError: either file is malformed, or they do not fit each other.
    """
    asf = find_asf(file)
    body = read_asf(asf)
    tracks = _tracks(read_text(file), body, file)
    names = _parents_first(body)
    parents = tuple(names.index(body.bones[name].parent) for name in names[1:])
    skeleton = tree = own_skeleton(tuple(names), (-1, *parents))
    if set(names) == set(CMU_BONES) and [body.bones[n].parent for n in CMU_BONES[1:]] == [CMU_BONES[p] for p in CMU.parents[1:]]:
        skeleton, names = CMU, list(CMU_BONES)
    positions = _positions(tracks, body, tree, [tree.joints.index(name) for name in names])
    unit = hints.unit or stated(body.metres, FILE) or infer_unit(positions, skeleton, asf, usual="cmu")
    up, fps = hints.up or Stated("y", FORMAT), hints.fps or Stated(CMU_FPS, FORMAT)
    positions *= unit.value
    rig = asf_rig(tracks, body, tree, names, unit.value)
    motion = Motion(positions.astype(np.float32), fps.value, skeleton, up=up.value, rig=rig)
    return Reading(hints.label(motion, file), unit, up, fps)


def find_asf(file: Path) -> Path:
    """The skeleton of an AMC file, in the same folder: named like its subject (05_12.amc, 05.asf), else the only one.

    Raises:
        MotionFormatError: there is none, or it is not clear which.
    """
    there = without_twins([f for f in file.parent.iterdir() if bare_suffix(f) == ".asf"])
    stem = Path(bare_name(file)).stem
    named = [f for f in there if Path(bare_name(f)).stem in (stem, stem.split("_")[0])]
    for candidates in (named, there):
        if len(candidates) == 1:
            return candidates[0]
    found = ", ".join(f.name for f in there) or "no .asf file"
    raise MotionFormatError(file, "skeleton", f"{found} in its folder", f"{stem.split('_')[0]}.asf, or a single .asf file")


def _parents_first(body: Body) -> list[str]:
    """Root and bones, in file order as far as parents allow."""
    names, there, waiting = ["root"], {"root"}, list(body.bones)
    while waiting:
        ready = [name for name in waiting if body.bones[name].parent in there]
        names += ready
        there |= set(ready)
        waiting = [name for name in waiting if name not in there]
    return names


def _tracks(text: str, body: Body, file: Path) -> Tracks:
    """All channels over time, in radians and file units."""
    degrees, start = _header(text, file)
    first = _first_frame(text, start, body, file)
    table = _table(text, start, first, body, file)
    tracks: Tracks = {}
    column = 0
    for name, dof in first.items():
        columns = {d: table[:, column + i] for i, d in enumerate(dof)}
        tracks[name] = {d: np.deg2rad(c) if degrees and d in TURNS else c for d, c in columns.items()}
        column += len(dof)
    return tracks


def _header(text: str, file: Path) -> tuple[bool, int]:
    """Whether angles are in degrees, and where the first frame begins."""
    degrees = True
    for line in lines_of(text):
        if line.start() > BLOCK:
            raise MotionFormatError(file, "header", f"more than {BLOCK} characters", "a frame before that")
        word = line[0].strip().lower()
        if word and not word.startswith(("#", ":")):
            return degrees, line.start()
        degrees = degrees and word != ":radians"
    raise MotionFormatError(file, "end of file", "no frame", "at least one frame")


def _first_frame(text: str, start: int, body: Body, file: Path) -> dict[str, tuple[str, ...]]:
    """Bone -> degrees of freedom, in the order of the first frame."""
    dofs = {"root": body.root_order} | {name: bone.dof for name, bone in body.bones.items() if bone.dof}
    order: dict[str, tuple[str, ...]] = {}
    for line in islice(lines_of(text, start), 1, None):
        if line.start() - start > BLOCK:
            break
        words = line[0].split(maxsplit=len(ROOT_ORDER) + 1)
        if len(words) == 1:  # the next frame's number
            break
        if not words:
            continue
        name = words[0]
        if name in order or len(words) - 1 != len(dofs.get(name, ())):
            found = f"{name[:40]} with {len(words) - 1} numbers" + (" again" if name in order else "")
            expected = f"{len(dofs[name])} numbers, once" if name in dofs else "a bone of the ASF that can move"
            raise MotionFormatError(file, "frame 1", found, expected)
        order[name] = dofs[name]
    missing = sorted(set(dofs) - set(order))
    if missing:
        raise MotionFormatError(file, "frame 1", f"no {', '.join(missing)[:200]}", "every bone of the ASF that can move")
    return order


def _table(text: str, start: int, first: dict[str, tuple[str, ...]], body: Body, file: Path) -> Float[np.ndarray, "T channels"]:
    """The numbers of all frames, bone after bone as in the first one."""
    stride = _stride(first)
    most = min(allowed(MOST_POINTS, file) // len(body.bones), allowed(MOST_VALUES, file) // (stride - len(first)))
    tables: list[np.ndarray] = []
    frames, words = 0, []
    for block in _text_blocks(text, start, file):
        words += block.split()
        whole = len(words) // stride * stride
        tables += [_block(words[:whole], first, tables, file)] if whole else []
        words = words[whole:]
        frames += whole // stride
        if frames > most:
            found = f"more than {most} frames"
            raise MotionFormatError(file, "frames", found, f"at most that for {len(body.bones)} bones in a file of this size")
    if words:
        found = f"{frames * stride + len(words)} words, not a multiple of the {stride} of frame 1"
        raise MotionFormatError(file, "frames", found, "whole frames")
    return np.concatenate(tables)[:, 1:]


def _text_blocks(text: str, start: int, file: Path) -> Iterator[str]:
    try:
        yield from blocks_of(text, start, " \t\r\n")
    except ValueError as error:
        raise MotionFormatError(file, "frames", str(error), "words") from error


def _block(
    words: list[str], first: dict[str, tuple[str, ...]], before: list[np.ndarray], file: Path
) -> Float[np.ndarray, "n columns"]:
    """Frame numbers, then the numbers of every bone, of some frames that follow those `before`."""
    places = {0: "frame numbers"}
    stride = 1
    for name, dof in first.items():
        others = set(words[stride :: _stride(first)]) - {name}
        if others:
            raise MotionFormatError(file, f"line of {name}", repr(sorted(others)[0][:40]), f"{name}, as in frame 1")
        places |= {stride + i: f"{name} {d}" for i, d in enumerate(dof, 1)}
        stride += 1 + len(dof)
    grid = np.array(words, dtype=object).reshape(-1, stride)
    try:
        table = grid[:, list(places)].astype(np.float64)
    except (ValueError, OverflowError):
        table = np.full((1, 1), np.nan)
    if not np.all(np.abs(table) <= LARGEST):  # False for nan; now say where
        table = np.stack([_column(grid[:, column].tolist(), file, place) for column, place in places.items()], axis=-1)
    numbers = np.concatenate([before[-1][-1:, 0], table[:, 0]]) if before else table[:, 0]
    if np.any(np.diff(numbers) != 1):
        at = int(np.argmax(np.diff(numbers) != 1))
        raise MotionFormatError(file, f"after frame {numbers[at]:g}", f"frame {numbers[at + 1]:g}", "the next one")
    return table


def _stride(first: dict[str, tuple[str, ...]]) -> int:
    """Words of a frame: its number, and of each bone its name and numbers."""
    return 1 + sum(1 + len(dof) for dof in first.values())


def _column(words: list[str], file: Path, place: str) -> Float[np.ndarray, " n"]:
    try:
        column = np.array(words, dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise MotionFormatError(file, place, str(error)[:80], "numbers") from error
    return bounded(column, file, place)


def _positions(tracks: Tracks, body: Body, skeleton: Skeleton, picked: list[int]) -> Float[np.ndarray, "T joints 3"]:
    """Where the picked bones end, file units."""
    place = root_path(tracks, body)

    def positions(part: slice) -> Float[np.ndarray, "n joints 3"]:
        rotations = np.broadcast_to(np.eye(3), (part.stop - part.start, len(skeleton), 3, 3)).copy()
        offsets = np.zeros((len(rotations), len(skeleton), 3))
        for joint, name in enumerate(skeleton.joints):
            bone = body.bones.get(name)
            axis = bone.axis if bone else body.root_axis
            turns = [dof for dof in reversed(TURNS) if dof in tracks.get(name, {})]  # z, y, x: Rz Ry Rx
            if turns:
                angles = np.stack([tracks[name][dof][part] for dof in turns], axis=-1)
                rotations[:, joint] = axis @ euler_matrices("".join(dof[1] for dof in turns), angles) @ axis.T
            if bone:
                offsets[:, joint] = rotations[:, joint] @ bone.offset  # a bone's own turn moves its far end
        return forward_kinematics(rotations, offsets, place[part], skeleton)[:, picked]

    return in_blocks(positions, len(place), len(skeleton))
