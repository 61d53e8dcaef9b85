"""Skeletons that are in none of our lists: a name of their own, left and right paired by name."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace

from mwlib.body.skeleton import Skeleton

# What says "left" in a name: the word, or one letter where a word begins (lThigh, J_Bip_L_Arm, thigh.L, ik_hand_l).
WORDS = {"left": "right", "Left": "Right", "LEFT": "RIGHT"}
LETTER = re.compile(r"(?<![A-Za-z])[lL]|(?<=[a-z0-9])L(?![a-z])")


def paired(joints: tuple[str, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Left and right joints, position by position, told from their names.

    A joint is left if its name says so and the same name with "right" or "r" in that place is a joint, too: so "lowerback" and
    "lip" are neither. Mixamo, Biped, VRM, Rigify, Unreal, CMU, Daz, SMPL and HumanML3D name their joints so that this works.
    """
    pairs: dict[str, str] = {}
    for name in joints:
        other = next((n for n in _counterparts(name) if n in joints and n not in pairs.values()), None)
        if other is not None and name not in pairs.values():
            pairs[name] = other
    left, right = (tuple(joints.index(name) for name in side) for side in (pairs.keys(), pairs.values()))
    return left, right


def own_skeleton(joints: tuple[str, ...], parents: tuple[int, ...]) -> Skeleton:
    """A skeleton made from a file; equal ones get equal names, different ones different names; left and right are `paired`."""
    digest = hashlib.sha256(repr((joints, parents)).encode()).hexdigest()[:4]
    return Skeleton(f"{joints[0]}{len(joints)}_{digest}", joints, parents, *paired(joints))


def _counterparts(name: str) -> Iterator[str]:
    """What the right-hand counterpart of a left joint may be called."""
    for left, right in WORDS.items():
        if left in name:
            yield name.replace(left, right)
    for found in LETTER.finditer(name):
        if not re.fullmatch(r"[lL]\d+", name):  # lumbar vertebrae
            yield name[: found.start()] + ("r" if found[0] == "l" else "R") + name[found.end() :]


def rig_skeleton(joints: tuple[str, ...], parents: tuple[int, ...]) -> Skeleton:
    """`own_skeleton` with End Sites among the joints, each called "<its joint>/End"; they pair up as their joints do."""
    own = own_skeleton(joints, parents)
    ends: dict[int, list[int]] = {}
    for joint, parent in enumerate(parents):
        if joints[joint].endswith("/End"):
            ends.setdefault(parent, []).append(joint)
    pairs = {left: right for left, right in zip(own.left, own.right, strict=True) if not joints[left].endswith("/End")}
    for left, right in list(pairs.items()):
        pairs |= dict(zip(ends.get(left, []), ends.get(right, []), strict=False))
    return replace(own, left=tuple(pairs), right=tuple(pairs.values()))
