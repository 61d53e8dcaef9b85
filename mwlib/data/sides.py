"""Whether a body can be mirrored: every joint off its middle needs a partner on the other side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mwlib.body.motion import Motion
from mwlib.body.skeleton import SKELETONS

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
    left, right = min(zip(skeleton.left, skeleton.right, strict=True), key=lambda pair: _depth(pair[0], skeleton.parents))
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


def _depth(joint: int, parents: tuple[int, ...]) -> int:
    """Bones between a joint and the root."""
    return 0 if joint == 0 else 1 + _depth(parents[joint], parents)
