"""States of a body: places of joints, or the root's place and rotations; and the frame that a window is seen from.

A state is a row of vectors of three numbers. The first is the root's place, metres. A body that is carried elsewhere changes
only this one; a body that turns about the up-axis turns the first `turned` of them.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.kinematics import bones_of, fk, heading, places, scale_bones, turn_heading
from mwlib.body.motion import Motion
from mwlib.body.rig import ROTATION_DTYPE, Rig
from mwlib.body.rotation import continuous, from_six, six
from mwlib.body.skeleton import Skeleton
from mwlib.data.windows import Bodies

Track = Float[Tensor, "T C"]  # states of one motion, frame by frame
Tracks = Float[Tensor, "N T C"]  # of windows
Samples = Float[Tensor, "N S T C"]  # several motions for each window
States = Float[Tensor, "*lead T C"]
State = Float[Tensor, "*lead C"]
OtherStates = Float[Tensor, "*#lead T C"]  # whose leading axes broadcast
Offsets = Float[Tensor, "*#lead rig 3"]  # of the rig, metres, which make a body of a state
Joints = Float[Tensor, "*lead T J 3"]  # places, metres

UP = "z"
STIFF = 1e-3  # half a turn in radians up to which a joint counts as not turning


class Placement(NamedTuple):
    """The place of windows in the world: the heading of a frame, radians, and its root's place on the floor, metres."""

    angle: Float[Tensor, "*lead"]
    origin: Float[Tensor, "*lead 2"]

    def of_samples(self) -> Placement:
        """The same for all samples of each window."""
        return Placement(*(part[:, None] for part in self))


class Space(ABC):
    """States of one kind of body, z up.

    Args:
        bodies: skeleton, frame rate and up-axis of the motions.
        channels: numbers in a state, C.
        turned: how many of its vectors turn with the body.
        rigid: whether no state changes the length of a bone: no joint that turns lies amid one.
    """

    bodies: Bodies
    channels: int
    turned: int
    rigid: bool

    @abstractmethod
    def encode(self, motion: Motion, dtype: torch.dtype = torch.float32) -> Track:
        """States of a motion, in the world."""

    def offsets(self, motion: Motion) -> Offsets:
        """Offsets of the rig, metres, which make a body of a state, (rig, 3); a state of places needs none, (0, 3)."""
        return torch.zeros(0, 3)

    @abstractmethod
    def positions(self, x: States, offsets: Offsets) -> Joints:
        """Places of all joints of the skeleton, the root among them, metres."""

    def rotations(self, x: States, offsets: Offsets) -> Tensor | None:
        """Turns of the joints against the world, (..., T, joints, 4); None if the state has none."""
        return None

    @abstractmethod
    def decode(self, x: Track, like: Motion) -> Motion:
        """States as a motion. Rate, names and, for rotations, the rig and its bones are those of `like`."""

    def to_json(self) -> str:
        """As text that a model file carries."""
        return json.dumps({"bodies": self.bodies.to_json()})

    def valid(self, x: State) -> State:
        """The nearest numbers that are a state."""
        return x

    def with_bones(self, x: States, given: OtherStates) -> States:
        """States whose bones are as long as in other states; those of rotations have no lengths of their own."""
        return x

    def placement(self, x: States, offsets: Offsets, frame: int = 0) -> Placement:
        """The place of a window, by one of its frames. Source: own choice, as one of the two given poses suffices for it."""
        joints = self.positions(x[..., frame : frame + 1, :], offsets)[..., 0, :, :]
        relative = (joints[..., 1:, :] - joints[..., :1, :]).flatten(-2)
        return Placement(heading(relative, self.bodies.skeleton, UP), x[..., frame, :2])

    def seen_from(self, x: States, placement: Placement) -> States:
        """Windows in the world as seen from their placements: that frame's root above the origin, its left along x."""
        moved = x.clone()
        moved[..., :2] -= placement.origin[..., None, :]
        return self._turn(moved, -placement.angle)

    def placed(self, x: States, placement: Placement) -> States:
        """Inverse of `seen_from`."""
        moved = self._turn(x, placement.angle)
        moved[..., :2] += placement.origin[..., None, :]
        return moved

    def _turn(self, x: Tensor, angle: Tensor) -> Tensor:
        turned = turn_heading(x[..., : 3 * self.turned], angle.to(x), UP)
        return torch.cat([turned, x[..., 3 * self.turned :]], dim=-1)


@dataclass(eq=False)
class PositionSpace(Space):
    """Places: the root's, and every other joint's from the root; all of them turn with the body."""

    bodies: Bodies

    def __post_init__(self) -> None:
        self.turned, self.rigid = len(self.bodies.skeleton), False
        self.channels = 3 * self.turned

    def encode(self, motion: Motion, dtype: torch.dtype = torch.float32) -> Track:
        """See `Space`."""
        return torch.from_numpy(np.concatenate([motion.positions[:, 0], motion.root_relative()], axis=1)).to(dtype)

    def positions(self, x: States, offsets: Offsets) -> Joints:
        """See `Space`."""
        root, others = x[..., None, :3], x[..., 3:].unflatten(-1, (-1, 3))
        return torch.cat([root, root + others], dim=-2)

    def decode(self, x: Track, like: Motion) -> Motion:
        """See `Space`."""
        return replace(like, positions=self.positions(x, self.offsets(like)).numpy().astype(like.positions.dtype), rig=None)

    def with_bones(self, x: States, given: OtherStates) -> States:
        """See `Space`."""
        here, there = (bones_of(states[..., 3:], self.bodies.skeleton).norm(dim=-1) for states in (x, given))
        return torch.cat([x[..., :3], scale_bones(x[..., 3:], there / here.clamp_min(1e-6), self.bodies.skeleton)], dim=-1)


@dataclass(eq=False)
class RotationSpace(Space):
    """The root's place, and six numbers for the rotation of each joint that turns (Zhou et al. 2019).

    Args:
        bodies: of the motions.
        tree: joints of the rig, End Sites among them.
        turning: which of them have a rotation.
        points: which of them stands at each joint of the skeleton.
    """

    bodies: Bodies
    tree: Skeleton
    turning: tuple[int, ...]
    points: tuple[int, ...]

    @classmethod
    def of(cls, motion: Motion) -> RotationSpace:
        """The space that a motion with a rig is in; see `rooted_rig` for what else it must have."""
        rig = rooted_rig(motion)
        turning = tuple(j for j, names in enumerate(rig.channels) if any("rotation" in name for name in names or ()))
        return cls(Bodies.of([motion]), rig.skeleton, turning, rig.points)

    def __post_init__(self) -> None:
        self.channels = 3 + 6 * len(self.turning)
        self.turned = 3  # the root's place and the two vectors of its rotation; the others are against their parents
        ends = ((self.points[parent], self.points[joint]) for parent, joint in self.bodies.skeleton.bones)
        self.rigid = not any(joint in self.turning for start, end in ends for joint in self._between(start, end))

    def _between(self, start: int, end: int) -> list[int]:
        """Joints of the rig on the way up from `end` to `start`, or to the root where it leads past."""
        way = []
        while (end := self.tree.parents[end]) not in (start, -1):
            way.append(end)
        return way

    def encode(self, motion: Motion, dtype: torch.dtype = torch.float32) -> Track:
        """See `Space`.

        Raises:
            ValueError: the motion has no rig, or another tree of joints, or it turns one that has no rotation here.
        """
        rig = rooted_rig(motion)
        if rig.skeleton.parents != self.tree.parents or rig.points != self.points:
            raise ValueError(
                f"{motion.name or 'a motion'} has a rig of {len(rig.skeleton)} joints, {rig.skeleton.name}; expected the "
                f"{len(self.tree)} of {self.tree.name}, as the others have"
            )
        stiff = [j for j in range(len(self.tree)) if j not in self.turning]
        if lost := [j for j in stiff if np.abs(rig.rotations[:, j, 1:]).max() > STIFF]:
            raise ValueError(
                f"{motion.name or 'a motion'} turns {self.tree.joints[lost[0]]}, which has no rotation channels in the first "
                "clip; expected the same channels in all clips"
            )
        turns = torch.from_numpy(rig.rotations[:, self.turning]).to(dtype)
        return torch.cat([torch.from_numpy(rig.root).to(dtype), six(turns).flatten(-2)], dim=-1)

    def offsets(self, motion: Motion) -> Offsets:
        """See `Space`."""
        return torch.from_numpy(rooted_rig(motion).offsets.astype(np.float32))

    def to_json(self) -> str:
        """See `Space`."""
        rows = {"bodies": self.bodies.to_json(), "tree": asdict(self.tree), "turning": self.turning, "points": self.points}
        return json.dumps(rows)

    def local(self, x: State) -> Float[Tensor, "*lead rig 4"]:
        """Rotations of all joints of the rig against their parents; those that do not turn have none."""
        return from_six(self._numbers(x))

    def _numbers(self, x: State) -> Float[Tensor, "*lead rig 6"]:
        found = x.new_tensor([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]).repeat(*x.shape[:-1], len(self.tree), 1)
        found[..., list(self.turning), :] = x[..., 3:].unflatten(-1, (-1, 6))
        return found

    def positions(self, x: States, offsets: Offsets) -> Joints:
        """See `Space`: forward kinematics."""
        found = places(self._numbers(x), offsets.to(x)[..., None, :, :], x[..., :3], self.tree)
        return found.movedim(-2, 0).index_select(0, torch.tensor(self.points, device=x.device)).movedim(0, -2)

    def rotations(self, x: States, offsets: Offsets) -> Float[Tensor, "*lead T joints 4"]:
        """See `Space`."""
        turns = self.local(x)
        offsets = offsets.to(x)[..., None, :, :].expand(*turns.shape[:-1], 3)
        return fk(turns, offsets, x[..., :3], self.tree)[1][..., list(self.turning), :]

    def decode(self, x: Track, like: Motion) -> Motion:
        """See `Space`."""
        template = rooted_rig(like)
        turns = continuous(self.local(x.double())).numpy().astype(ROTATION_DTYPE)
        rig = Rig(template.skeleton, template.offsets, turns, x[:, :3].double().numpy(), template.points, template.channels)
        return replace(like, positions=rig.positions().astype(like.positions.dtype), rig=rig)

    def valid(self, x: State) -> State:
        """See `Space`."""
        return torch.cat([x[..., :3], six(from_six(x[..., 3:].unflatten(-1, (-1, 6)))).flatten(-2)], dim=-1)


def space_from_json(text: str) -> Space:
    """Inverse of `Space.to_json`."""
    tree = json.loads(text)
    bodies = Bodies.from_json(tree["bodies"])
    if "tree" not in tree:
        return PositionSpace(bodies)
    rig = tree["tree"]
    joints, parents, left, right = (tuple(rig[name]) for name in ("joints", "parents", "left", "right"))
    skeleton = Skeleton(rig["name"], joints, parents, left, right)
    return RotationSpace(bodies, skeleton, tuple(tree["turning"]), tuple(tree["points"]))


def rooted_rig(motion: Motion) -> Rig:
    """The rig of a motion, with the motion's root as its root and bones of fixed length.

    Raises:
        ValueError: it has no rig, or its bones change their lengths.
    """
    if motion.rig is None:
        raise ValueError(
            f"{motion.name or 'a motion'} has positions only; expected rotations, as BVH and AMC files have, or state=positions"
        )
    return motion.rig.rooted()
