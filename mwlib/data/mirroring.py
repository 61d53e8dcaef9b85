"""Left and right: joints paired by their names, and bodies that can be mirrored."""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections import SKELETONS
from mwlib.hashing import sha256

# What says "left" in a name: the word, or one letter where a word begins (lThigh, J_Bip_L_Arm, thigh.L, ik_hand_l).
LEFT = re.compile(r"left|Left|LEFT|(?<![A-Za-z])[lL]|(?<=[a-z0-9])L(?![a-z])")
RIGHT = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R"}
LUMBAR = re.compile(r"[lL]\d+(/End)?")  # vertebrae, not left joints


def paired(joints: tuple[str, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Left and right joints, position by position, told from their names.

    A joint is left if its name says so and the same name with "right" or "r" in that place is a joint, too: so "lowerback" and
    "lip" are neither. Mixamo, Biped, VRM, Rigify, Unreal, CMU, Daz, SMPL and HumanML3D name their joints so that this works.
    End Sites, each called "<its joint>/End", pair up as their joints do, and come last.
    """
    pairs: dict[str, str] = {}
    for name in sorted(joints, key=lambda name: name.endswith("/End")):
        other = next((n for n in _counterparts(name) if n in joints and n not in pairs.values()), None)
        if other is not None and name not in pairs.values():
            pairs[name] = other
    left, right = (tuple(joints.index(name) for name in side) for side in (pairs.keys(), pairs.values()))
    return left, right


def own_skeleton(joints: tuple[str, ...], parents: tuple[int, ...]) -> Skeleton:
    """A skeleton made from a file; equal ones get equal names, different ones different names; left and right are `paired`."""
    return Skeleton(f"{joints[0]}{len(joints)}_{sha256([repr((joints, parents))])[:4]}", joints, parents, *paired(joints))


def _counterparts(name: str) -> Iterator[str]:
    """What the right-hand counterpart of a left joint may be called: a word or letter exchanged in one place or in all."""
    if not LUMBAR.fullmatch(name):
        for at in LEFT.finditer(name):
            yield name[: at.start()] + RIGHT[at[0]] + name[at.end() :]
            yield name.replace(at[0], RIGHT[at[0]])


MOST_CLIPS, MOST_FRAMES = 20, 50
SIDEWAYS = 0.5  # share of an unpaired bone that points to a side, median over frames: hips 0.8, necks 0.35 at most in any clip
SHORT = 0.01  # metres; the direction of a shorter bone says nothing


def unmirrored(motions: Sequence[Motion]) -> str:
    """Why clips of one skeleton cannot be mirrored, as a sentence; "" if they can.

    Mirroring exchanges left and right joints. A joint off the middle without a partner, like a hand whose name nobody paired
    or a sword in it, would stay on its side while the body around it changes over.

    Own choice: such a joint hangs below a paired one, or its bone points sideways, measured by the pair nearest to the root,
    median over frames of at most 20 clips.
    """
    skeleton = motions[0].skeleton
    if skeleton in SKELETONS.values():
        return ""
    if not skeleton.left:
        return f"no joint of {skeleton.name} has a left or right partner"
    paired = {*skeleton.left, *skeleton.right}
    step = max(1, len(motions) // MOST_CLIPS)
    places = np.concatenate([m.positions[:: max(1, len(m) // MOST_FRAMES)] for m in motions[::step]])
    left, right = min(zip(skeleton.left, skeleton.right, strict=True), key=lambda pair: len(way_to(pair[0], skeleton)))
    across = places[:, left] - places[:, right]
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    alone: list[int] = []
    for parent, joint in skeleton.bones:
        bone = places[:, joint] - places[:, parent]
        length = np.linalg.norm(bone, axis=-1)
        sideways = abs(np.median(np.sum(bone * across, axis=-1) / np.maximum(length, 1e-9)))
        is_off = parent in paired or parent in alone or (sideways > SIDEWAYS and np.median(length) > SHORT)
        alone += [joint] if joint not in paired and is_off else []
    names = ", ".join(skeleton.joints[joint] for joint in alone[:6]) + " ..." * (len(alone) > 6)
    return f"{names} of {skeleton.name} {'is' if len(alone) == 1 else 'are'} off the middle without a partner" if alone else ""


def way_to(joint: int, skeleton: Skeleton) -> list[int]:
    """The joints from the root to this one."""
    return [0] if joint == 0 else [*way_to(skeleton.parents[joint], skeleton), joint]
