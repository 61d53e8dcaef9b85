"""Features of HumanML3D (263 numbers a frame) and KIT-ML (251): what stands where, and the joints that they describe.

Sources: Guo et al. 2022, "Generating diverse and natural 3D human motions from text", and the code published with HumanML3D.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.skeleton import HUMANML22, KIT21, Skeleton

Array = TypeVar("Array", np.ndarray, Tensor)
AXIS = {"0": (0, 0, 0), "+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1)}


@dataclass(frozen=True)
class FeatureLayout:
    """What the numbers of a frame mean: y is up, a frame's heading is seen along +z, left is +x.

    Args:
        name: of the data set.
        skeleton: J joints, the root among them.
        fps: frames per second.
        metres_per_unit: length of one unit of the features.
        contact_joints: left ankle and toe, right ankle and toe.
        face_joints: right hip, left hip, right shoulder, left shoulder; they tell where the body faces.
        contact_threshold: units squared; a joint that moves less from a frame to the next has contact.
        chains: rows of joints along which rotations follow each other; the first joint of a row is not turned by it.
        rest: for each joint the axis along which the published code lets its bone rest, from the joint before.
        bone_lengths: of the one body that the data set's people were given, units, joint by joint, the root's being 0; None:
            not known.
        shortest: a clip has at least so many frames.
    """

    name: str
    skeleton: Skeleton
    fps: float
    metres_per_unit: float
    contact_joints: tuple[int, int, int, int]
    face_joints: tuple[int, int, int, int]
    contact_threshold: float
    chains: tuple[tuple[int, ...], ...]
    rest: tuple[str, ...]
    bone_lengths: tuple[float, ...] | None
    shortest: int

    @property
    def width(self) -> int:
        """Features of a frame, 12 J - 1."""
        return 12 * len(self.skeleton) - 1

    @property
    def blocks(self) -> dict[str, slice]:
        """Where each kind of feature stands.

        "yaw_rate" is HALF the turn to the next frame (rad); "root_velocity" the step x, z to the next frame in the heading of
        that frame; "height" the root's; "positions" of the other joints, seen from the root's place on the floor in the frame's
        heading; "rotations" of the bones to them, six numbers each; "velocities" of all joints to the next frame, in this
        frame's heading; "contacts" 0 or 1, in the order of `contact_joints`.

        >>> HUMANML3D.blocks["velocities"], KIT.blocks["contacts"]
        (slice(193, 259, None), slice(247, 251, None))
        """
        others = len(self.skeleton) - 1
        sizes = {"yaw_rate": 1, "root_velocity": 2, "height": 1, "positions": 3 * others, "rotations": 6 * others}
        sizes |= {"velocities": 3 * others + 3, "contacts": 4}
        ends = np.cumsum([*sizes.values()]).tolist()
        return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    def rests(self, heading: str) -> Float[np.ndarray, "J 3"]:
        """Unit vectors along which bones rest, as `rest` has them; with heading "correct" left is +x for all.

        Own choice: KIT's published ones have left and right exchanged, so that hips are half a turn from rest, where the
        shortest rotation has no axis.
        """
        axes = np.array([AXIS[word] for word in self.rest], float)
        if heading == "correct":
            for joints, sign in ((self.skeleton.left, 1), (self.skeleton.right, -1)):
                axes[list(joints), 0] = sign * np.abs(axes[list(joints), 0])
        return axes


HUMANML3D = FeatureLayout(
    name="HumanML3D",
    skeleton=HUMANML22,
    fps=20.0,
    metres_per_unit=1.0,
    contact_joints=(7, 10, 8, 11),
    face_joints=(2, 1, 17, 16),
    contact_threshold=0.002,
    chains=((0, 2, 5, 8, 11), (0, 1, 4, 7, 10), (0, 3, 6, 9, 12, 15), (9, 14, 17, 19, 21), (9, 13, 16, 18, 20)),
    rest=tuple("0 +x -x +y -y -y +y -y -y +y +z +z +y +x -x +z -y -y -y -y -y -y".split()),
    # Measured from the example motion 012314 that was published with the code; every clip has them.
    bone_lengths=(
        0.0, 0.1031, 0.1099, 0.1316, 0.3936, 0.3902, 0.1432, 0.4324, 0.4256, 0.0574, 0.1434,
        0.1494, 0.2194, 0.1375, 0.1434, 0.1030, 0.1316, 0.1230, 0.2568, 0.2631, 0.2660, 0.2699,
    ),
    shortest=40,
)  # fmt: skip

# One unit is about a thousandth of the body's height, which is taken as 1.75 m (own choice; hips are then 0.98 m high).
KIT = FeatureLayout(
    name="KIT-ML",
    skeleton=KIT21,
    fps=12.5,
    metres_per_unit=0.00175,
    contact_joints=(19, 20, 14, 15),
    face_joints=(11, 16, 5, 8),
    contact_threshold=0.05,
    chains=((0, 11, 12, 13, 14, 15), (0, 16, 17, 18, 19, 20), (0, 1, 2, 3, 4), (3, 5, 6, 7), (3, 8, 9, 10)),
    rest=tuple("0 +y +y +y +y +x -y -y -x -y -y +x -y -y +z +z -x -y -y +z +z".split()),
    bone_lengths=None,
    shortest=24,
)

LAYOUTS = {layout.width: layout for layout in (HUMANML3D, KIT)}


def joints_of(features: Array, layout: FeatureLayout) -> Array:
    """Joint positions (..., T, J, 3) that features (..., T, D) describe, y up, in the layout's units.

    The root starts at x = z = 0 and faces +z; its path is the sum of its steps. Only yaw rate, root velocity, height and
    positions are used, as in the published decoder; rotations, velocities and contacts change nothing. Gradients pass.

    Args:
        features: raw, not normalised; NumPy in, NumPy out; torch in, torch out.
        layout: of the features.

    Raises:
        ValueError: another width.

    A quarter turn to the right in the first frame, and steps of 1 ahead:

    >>> x = torch.zeros(3, 263)
    >>> x[0, 0], x[:, 2], x[:, 3] = torch.pi / 4, 1.0, 1.0
    >>> (joints_of(x, HUMANML3D)[:, 0].round(decimals=3) + 0.0).tolist()
    [[0.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    """
    if features.shape[-1] != layout.width:
        raise ValueError(f"features have width {features.shape[-1]}; expected {layout.width} for {layout.name}")
    if isinstance(features, np.ndarray):
        return _joints(torch.from_numpy(np.array(features)), layout).numpy()
    return _joints(features, layout)


def _joints(features: Float[Tensor, "*lead T D"], layout: FeatureLayout) -> Float[Tensor, "*lead T J 3"]:
    back = -turned(features[..., 0])
    first = torch.zeros_like(features[..., :1, 1:3])
    steps = torch.cat([first, features[..., :-1, layout.blocks["root_velocity"]]], dim=-2)
    path = torch.stack(_about_up(steps[..., 0], steps[..., 1], back), dim=-1).cumsum(dim=-2)
    local = features[..., layout.blocks["positions"]].unflatten(-1, (-1, 3))
    x, z = _about_up(local[..., 0], local[..., 2], back[..., None])
    others = torch.stack([x + path[..., :1], local[..., 1], z + path[..., 1:]], dim=-1)
    root = torch.stack([path[..., 0], features[..., 3], path[..., 1]], dim=-1)
    return torch.cat([root[..., None, :], others], dim=-2)


def turned(yaw_rate: Float[Tensor, "*lead T"]) -> Float[Tensor, "*lead T"]:
    """The angle about y that makes the body of each frame face +z, radians; `yaw_rate` holds half its steps."""
    return 2 * torch.cat([torch.zeros_like(yaw_rate[..., :1]), yaw_rate[..., :-1].cumsum(dim=-1)], dim=-1)


def _about_up(x: Tensor, z: Tensor, angle: Tensor) -> tuple[Tensor, Tensor]:
    """x and z turned about y, from z towards x."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    return cos * x + sin * z, cos * z - sin * x
