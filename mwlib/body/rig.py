"""Rigs: the rotations behind a motion, from which forward kinematics gives its positions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Shaped
from torch.nn.functional import normalize

from mwlib.body.kinematics import fk
from mwlib.body.rotation import continuous, multiply, rotate, slerp, tensor64
from mwlib.body.skeleton import Skeleton

ROTATION_DTYPE = np.float32  # half the memory of float64; off by less than 5e-7 m on every file at hand
MOVES = ("xposition", "yposition", "zposition")
ALIKE, STILL = 0.03, 1e-3  # metres: left and right are built alike, and a joint stays where it is, up to here
ANGLES = ("zrotation", "yrotation", "xrotation")  # in the order in which most BVH files have them


@dataclass(frozen=True, eq=False)
class Rig:
    """Local rotations of a tree of joints over time, as BVH stores them: a joint's rotation moves its children, not itself.

    Own choice: the tree is the file's, not the motion's. It may hold joints that the motion leaves out, and it holds the End
    Sites, without which the outer points of some skeletons would have no place; `points` says what stands where.

    Args:
        skeleton: names and parents of the rig's joints, End Sites among them.
        offsets: metres, from parent to joint in the parent's frame, at rest. The root's own is its place at rest, which
            kinematics does not use.
        rotations: unit quaternions (w, x, y, z), scalar first, of each joint against its parent; no sign jumps in time.
        root: the root's path, metres, world coordinates.
        points: which of the rig's joints stands at each joint of the motion's skeleton.
        channels: of each joint, in a BVH file's order, like "xposition" or "zrotation"; None for an End Site.
        moves: where a joint other than the root has a position of its own in every frame, it replaces `offsets` for all.
        metres: per unit of the file it came from.

    Raises:
        ValueError: the shapes do not fit each other, a quaternion is not of length 1, an End Site has children.
    """

    skeleton: Skeleton
    offsets: Float[np.ndarray, "rig 3"]
    rotations: Float[np.ndarray, "T rig 4"]
    root: Float[np.ndarray, "T 3"]
    points: tuple[int, ...]
    channels: tuple[tuple[str, ...] | None, ...]
    moves: Float[np.ndarray, "T rig 3"] | None = None
    metres: float = 0.01

    def __post_init__(self) -> None:
        frames, joints = len(self.root), len(self.skeleton)
        shapes = {"offsets": (joints, 3), "rotations": (frames, joints, 4), "root": (frames, 3), "moves": (frames, joints, 3)}
        for name, expected in shapes.items():
            values = getattr(self, name)
            if values is not None and values.shape != expected:
                raise ValueError(f"{name} of the rig have shape {values.shape}; expected {expected} for {self.skeleton.name}")
        if len(self.channels) != joints or not all(set(c or ()) <= {*MOVES, *ANGLES} for c in self.channels):
            raise ValueError(
                f"channels of the rig are {self.channels}; expected names like xposition for each of {joints} joints"
            )
        if not {*self.points} <= {*range(joints)}:
            raise ValueError(f"points of the rig are {self.points}; expected joints 0 to {joints - 1}")
        if any(self.channels[parent] is None for parent in self.skeleton.parents[1:]):
            raise ValueError("an End Site of the rig has children; expected none")
        length = np.sqrt(np.einsum("tjc,tjc->tj", self.rotations, self.rotations))
        if not np.all(np.abs(length - 1) < 1e-4):
            raise ValueError(f"a quaternion of the rig has length {length.flat[np.argmax(np.abs(length - 1))]:.4g}; expected 1")

    def world(self) -> tuple[Float[np.ndarray, "T rig 3"], Float[np.ndarray, "T rig 4"]]:
        """Positions of all its joints (metres) and their turns against the world, float64: forward kinematics."""
        turns = normalize(tensor64(self.rotations), dim=-1)
        places, turns = fk(turns, tensor64(self.spans), tensor64(self.root), self.skeleton)
        return places.numpy(), turns.numpy()

    @property
    def spans(self) -> Float[np.ndarray, "_T rig 3"]:
        """From parent to joint in each frame, metres; one for all where nothing moves but the root."""
        return self.offsets[None] if self.moves is None else self.moves

    def positions(self) -> Float[np.ndarray, "T joints 3"]:
        """Positions of the motion's joints, metres, float64."""
        return self.world()[0][:, self.points]

    def pick(self, frames: slice | Shaped[np.ndarray, " frames"]) -> Rig:
        """Some of the frames."""
        moves = None if self.moves is None else self.moves[frames]
        return replace(self, rotations=self.rotations[frames], root=self.root[frames], moves=moves)

    def between(self, low: Shaped[np.ndarray, " n"], high: Shaped[np.ndarray, " n"], share: Float[np.ndarray, " n"]) -> Rig:
        """Frames between frames `low` and `high`: rotations by slerp, positions linearly; share 0 is `low`."""
        turns = slerp(tensor64(self.rotations[low]), tensor64(self.rotations[high]), tensor64(share)[:, None])
        return replace(
            self,
            rotations=continuous(turns).numpy().astype(self.rotations.dtype),
            root=on_the_way(self.root, low, high, share),
            moves=None if self.moves is None else on_the_way(self.moves, low, high, share),
        )

    def turned(self, turn: Float[np.ndarray, " 4"]) -> Rig:
        """The whole body turned about the world's origin by one quaternion; every joint but the root keeps its frame."""
        by = tensor64(turn)
        rotations = self.rotations.copy()
        rotations[:, 0] = multiply(by, tensor64(self.rotations[:, 0])).numpy()
        offsets = self.offsets.copy()
        offsets[0] = rotate(by, tensor64(self.offsets[0])).numpy()
        return replace(self, rotations=rotations, root=rotate(by, tensor64(self.root)).numpy(), offsets=offsets)

    def mirrored(self, order: Shaped[np.ndarray, " joints"]) -> Rig:
        """The mirror image across the plane x = 0, left and right joints exchanged.

        Args:
            order: the permutation that exchanges left and right in the motion's skeleton.

        Raises:
            ValueError: left and right of the rig are not built alike, so that it has no mirror image on the same tree.
        """
        swap, parents = self.skeleton.mirror, np.array(self.skeleton.parents)
        points = np.array(self.points)
        if not np.array_equal(swap[parents[1:]], parents[swap[1:]]) or not np.array_equal(swap[points], points[order]):
            raise ValueError(f"left and right of {self.skeleton.name} are not built alike; expected pairs that hang from pairs")
        axis, world = self.across() or 0, np.array([-1.0, 1.0, 1.0])
        flip = 1 - 2 * np.eye(3)[axis]
        rotations = tensor64(self.rotations[:, swap]) * torch.tensor([1.0, *-flip])
        rotations[:, 0] = tensor64(self.rotations[:, 0]) * torch.tensor([1.0, *-world])
        if axis:  # from the world's mirror plane to that of the joints: half a turn about the third axis
            rotations[:, 0] = multiply(rotations[:, 0], torch.eye(4, dtype=torch.float64)[4 - axis])
        offsets = self.offsets[swap] * flip
        offsets[0] = self.offsets[0] * world
        return replace(
            self,
            offsets=offsets,
            rotations=continuous(rotations).numpy().astype(self.rotations.dtype),
            root=self.root * world,
            channels=tuple(self.channels[joint] for joint in swap),
            moves=None if self.moves is None else self.moves[:, swap] * flip,
        )

    def across(self) -> int | None:
        """The axis of the joints' own frames along which left and right are mirror images, within 3 cm; None: along none.

        What does not hang from the motion's root, like a joint on the floor, and the root's own way do not count.
        Of CMU's rigs and most others it is x. Of LaFAN1's, whose bones lie along x, it is z.
        """
        offsets, below = self.spans[0], self.hanging()[1:]
        image = offsets[self.skeleton.mirror]
        apart = [np.abs(image * (1 - 2 * unit) - offsets)[below].max(initial=0.0) for unit in np.eye(3)]
        return int(np.argmin(apart)) if min(apart) < ALIKE else None

    def rooted(self) -> Rig:
        """The same places by a rig whose root is the motion's, and whose bones keep their lengths.

        Own choice: Bandai-Namco's files hang the hips from a joint that stays on the floor, and give every joint a place of its
        own in each frame, which does not change but for the hips. What does not hang from the motion's root is left out.

        Raises:
            ValueError: another joint moves against its parent by more than a millimetre, or a point would be lost.
        """
        root, parents = self.points[0], self.skeleton.parents
        if root == 0 and self.moves is None:
            return self
        kept = self.hanging()
        at, below = {joint: i for i, joint in enumerate(kept)}, kept[1:]
        if lost := sorted({*self.points} - {*at}):
            raise ValueError(f"{self.skeleton.joints[lost[0]]} does not hang from {self.skeleton.joints[root]}; expected all to")
        if (way := np.ptp(self.spans[:, below], axis=0).max()) > STILL:
            raise ValueError(
                f"a joint of {self.skeleton.name} moves {way:.3g} m against its parent; expected bones of fixed length"
            )
        places, turns = self.world()
        rotations = self.rotations[:, kept].copy()
        rotations[:, 0] = turns[:, root]
        left, right = (tuple(at[j] for j in side if j in at) for side in (self.skeleton.left, self.skeleton.right))
        joints = tuple(self.skeleton.joints[j] for j in kept)
        tree = Skeleton(self.skeleton.name, joints, (-1, *[at[parents[j]] for j in below]), left, right)
        return Rig(
            tree, self.spans.mean(axis=0)[kept], continuous(tensor64(rotations)).numpy().astype(rotations.dtype), places[:, root],
            tuple(at[j] for j in self.points), (MOVES + ANGLES, *[self.channels[j] for j in below]),
        )  # fmt: skip

    def hanging(self) -> list[int]:
        """The motion's root, and the joints that hang from it."""
        found = [self.points[0]]
        for joint, parent in enumerate(self.skeleton.parents):
            if parent in found:
                found.append(joint)
        return found


def axes_of(channels: Iterable[str]) -> str:
    """The axes of a joint's rotation channels, one letter each, in their order."""
    return "".join(name[0] for name in channels if name in ANGLES)


def on_the_way(path: np.ndarray, low: np.ndarray, high: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Numbers between those of frames `low` and `high`, linearly; share 0 is `low`."""
    share = share.reshape(-1, *[1] * (path.ndim - 1))
    return path[low] * (1 - share) + path[high] * share
