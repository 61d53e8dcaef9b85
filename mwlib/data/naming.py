"""Skeletons that are in none of our lists: a name of their own, left and right paired by name."""

from __future__ import annotations

import hashlib

from ..skeleton import Skeleton


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
