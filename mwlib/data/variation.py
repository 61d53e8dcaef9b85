"""Other motions that the same people could have made: what training draws beside what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.kinematics import heading, scale_bones, turn_heading
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton

SLOWEST = 0.1  # share of its speed that a slowed window keeps at least
ARMS = ("left_arm", "right_arm")


@dataclass(frozen=True)
class Variation:
    """How drawn windows differ from the recorded ones. Own choice, all of it: new people are built otherwise, move at other
    speeds, stand still in other poses and do other things with their arms. By default nothing differs.

    Args:
        speeds: the clips are also drawn played at two speeds up to 1 + `speeds` and at their inverses.
        bones: deviation of one random factor for all bones of a window, and of one for each pair of bones, left and right.
        backwards: share of the windows that are played backwards.
        slowed: share of the windows that are played at a random speed, a tenth to the whole of their own.
        arms: share of the windows that get the arms of another one of the batch, turned to where the body faces.
        pivot: frame around which a window is slowed, and of whose pose the arms are turned: the last observed one.
    """

    speeds: float = 0.0
    bones: float = 0.0
    backwards: float = 0.0
    slowed: float = 0.0
    arms: float = 0.0
    pivot: int = 0

    def clips(self, motions: Sequence[Motion]) -> list[Motion]:
        """The clips, and the same faster and slower."""
        if not self.speeds:
            return list(motions)
        faster = 1 + self.speeds / 2, 1 + self.speeds
        return [at_speed(m, f) for f in (1, *faster, *(1 / f for f in faster)) for m in motions]

    def __call__(
        self, x: Float[Tensor, "B T C"], skeleton: Skeleton, up: str, generator: torch.Generator
    ) -> Float[Tensor, "B T C"]:
        """The windows, each changed or not."""
        if self.bones:
            x = other_bones(x, self.bones, skeleton, generator)
        if self.backwards:
            x = torch.where(_coins(x, self.backwards, generator), x.flip(1), x)
        if self.slowed:
            speed = SLOWEST + (1 - SLOWEST) * torch.rand((len(x), 1), generator=generator).to(x.device)
            x = torch.where(_coins(x, self.slowed, generator), slowed(x, speed, self.pivot), x)
        if self.arms:
            donors = x[torch.randperm(len(x), generator=generator).to(x.device)]
            x = torch.where(_coins(x, self.arms, generator), other_arms(x, donors, skeleton, up, self.pivot), x)
        return x


def at_speed(motion: Motion, factor: float) -> Motion:
    """The clip played so many times as fast, at its own frame rate."""
    return replace(motion.resample(motion.fps / factor), fps=motion.fps)


def other_bones(
    x: Float[Tensor, "B T C"], deviation: float, skeleton: Skeleton, generator: torch.Generator
) -> Float[Tensor, "B T C"]:
    """The same motions of other bodies: left and right alike, the root where it is."""
    pair = torch.from_numpy(skeleton.mirror).minimum(torch.arange(len(skeleton)))
    each = torch.randn((len(x), 1, len(skeleton)), generator=generator)[..., pair[1:]]
    factor = (1 + deviation * each) * (1 + deviation * torch.randn((len(x), 1, 1), generator=generator))
    return scale_bones(x, factor.clamp_min(0.1).to(x.device), skeleton)


def slowed(x: Float[Tensor, "B T C"], speed: Float[Tensor, "B 1"], pivot: int) -> Float[Tensor, "B T C"]:
    """Windows played at a share of their speed, between frames on straight lines; the pose of the pivot stays where it is.

    >>> slowed(torch.arange(5.0)[None, :, None], torch.tensor([[0.5]]), pivot=2).flatten()
    tensor([1.0000, 1.5000, 2.0000, 2.5000, 3.0000])
    """
    frames = x.shape[1]
    place = pivot + (torch.arange(frames, device=x.device) - pivot) * speed
    before = place.floor().long().clamp(0, frames - 2)
    share = (place - before)[..., None]
    first, second = (x.gather(1, index[..., None].expand(-1, -1, x.shape[-1])) for index in (before, before + 1))
    return first + share * (second - first)


def other_arms(
    x: Float[Tensor, "B T C"], donors: Float[Tensor, "B T C"], skeleton: Skeleton, up: str, pivot: int
) -> Float[Tensor, "B T C"]:
    """Windows with the arms of others, hung where their own are, turned by how the bodies face at the pivot.

    Raises:
        ValueError: the skeleton does not say which joints are arms.
    """
    if missing := [name for name in ARMS if name not in skeleton.parts]:
        raise ValueError(
            f"{skeleton.name} has no parts {' and '.join(missing)}; expected them, to exchange arms: say other_arms=0"
        )
    turn = heading(x[:, pivot], skeleton, up) - heading(donors[:, pivot], skeleton, up)
    donors, out = turn_heading(donors, turn, up).unflatten(-1, (-1, 3)), x.unflatten(-1, (-1, 3)).clone()
    for arm in (list(skeleton.parts[name]) for name in ARMS):
        trunk, joints = skeleton.parents[arm[0]] - 1, [joint - 1 for joint in arm]
        apart = out[:, :, [trunk]] - donors[:, :, [trunk]] if trunk >= 0 else 0.0  # the root is at the origin of both
        out[:, :, joints] = donors[:, :, joints] + apart
    return out.flatten(-2)


def _coins(x: Float[Tensor, "B T C"], share: float, generator: torch.Generator) -> Tensor:
    """True for about this share of the windows."""
    return (torch.rand((len(x), 1, 1), generator=generator) < share).to(x.device)
