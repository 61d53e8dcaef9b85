"""Skeletons that are in none of our lists: a name of their own, left and right paired by name."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from mwlib.body.skeleton import Skeleton


def own_skeleton(joints: tuple[str, ...], parents: tuple[int, ...]) -> Skeleton:
    """A skeleton made from a file; equal ones get equal names, different ones different names.

    Left and right are paired by name: left/right anywhere, l/r before a word, _l/_r or .l/.r after it, in any case.
    """
    digest = hashlib.sha256(repr((joints, parents)).encode()).hexdigest()[:4]
    pairs: dict[str, str] = {}
    for name in joints:
        other = next((n for n in _counterparts(name) if n in joints and n not in pairs.values()), None)
        if other is not None and name not in pairs.values():
            pairs[name] = other
    left, right = (tuple(joints.index(name) for name in side) for side in (pairs.keys(), pairs.values()))
    return Skeleton(f"{joints[0]}{len(joints)}_{digest}", joints, parents, left, right)


def _counterparts(name: str) -> list[str]:
    """What the right-hand counterpart of a left joint may be called."""
    names = [name.replace(a, b, 1) for a, b in (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT")) if a in name]
    for a, b in ("lr", "LR"):
        names += [b + name[1:]] if name.startswith(a) else []
        names += [name[:-1] + b] if name.endswith((f"_{a}", f".{a}")) else []
    return names


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
