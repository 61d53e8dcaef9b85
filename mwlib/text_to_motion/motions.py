"""Features as motions of a body in the world."""

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.kinematics import bones_of, scale_bones
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data.formats.humanml import FeatureLayout, joints_of, turned

# Chosen on people neither trained nor tested on: the first two by jerk and sliding, the others by what their motions show.
STEP_WEIGHT, CONTACT_WEIGHT, HEIGHT_WEIGHT, ARM_WEIGHT = 3.0, 30.0, 1.0, 0.1


def motion_of(features: Float[Tensor, "T D"], layout: FeatureLayout, name: str = "", fused: bool = False) -> Motion:
    """Raw features as joint positions: metres, y up, starting above the origin, facing +z. No rotations: see `fit_rig`.

    Args:
        features: raw, not normalised.
        layout: what a row means.
        name: of the motion.
        fused: use `fused_joints` instead of `joints_of`, and `steady_bones`: calmer, where a network wrote the features.
    """
    x = features.double()
    places = steady_bones(fused_joints(x, layout), layout.skeleton) if fused else joints_of(x, layout)
    return Motion(places.numpy() * layout.metres_per_unit, layout.fps, layout.skeleton, name=name, up="y")


def steady_bones(places: Float[Tensor, "T J 3"], skeleton: Skeleton) -> Float[Tensor, "T J 3"]:
    """The same with each bone as long, in all frames, as in the median one, and pointing where it did; the root stays.

    Own choice: a network writes places, of which no rule keeps bones their length. A recorded motion stays as it is.
    """
    root = places[:, :1]
    x = (places[:, 1:] - root).flatten(-2)
    lengths = bones_of(x, skeleton).norm(dim=-1)
    steady = scale_bones(x, lengths.quantile(0.5, dim=0) / lengths.clamp_min(1e-6), skeleton)
    return torch.cat([root, root + steady.unflatten(-1, (-1, 3))], dim=1)


def fused_joints(
    features: Float[Tensor, "T D"],
    layout: FeatureLayout,
    step_weight: float = STEP_WEIGHT,
    contact_weight: float = CONTACT_WEIGHT,
    height_weight: float = HEIGHT_WEIGHT,
    arm_weight: float = ARM_WEIGHT,
) -> Float[Tensor, "T J 3"]:
    """Joint positions that agree with everything that features say of them: places, steps and contacts.

    A row says a joint's place, and in `velocities` its step to the next frame. For a recorded motion the two agree. For one that
    a network wrote they do not: its places tremble more than its steps. With p the places as `joints_of` reads them and u the
    steps in the world, each joint's way x solves the least squares

        sum_t |x_t - p_t|^2 + sum_t w_t |x_{t+1} - x_t - u_t|^2,

    along the floor and in height, each for itself. Along the floor w is `step_weight`, but `contact_weight` for a foot that is
    said to stand, whose u then is 0. In height w is `height_weight`, which is smaller: each row says heights over the floor, and
    with more trust in steps the feet of walkers leave it. Elbows and wrists have `arm_weight` in all directions: predicted steps
    are too short where limbs go back and forth, and waves would lose a third of their swing. Own choice: the published decoder
    reads the places alone. Without contacts a recorded motion stays as it is.

    Args:
        features: raw, not normalised.
        layout: what a row means.
        step_weight, contact_weight, height_weight, arm_weight: at least 0; all 0 gives `joints_of`.

    Raises:
        ValueError: another width, or a negative weight.
    """
    if min(step_weight, contact_weight, height_weight, arm_weight) < 0:
        raise ValueError(f"{step_weight=}, {contact_weight=}, {height_weight=}, {arm_weight=}; expected at least 0")
    feet, arms = list(layout.contact_joints), list(layout.arm_joints)
    places, steps = joints_of(features, layout), _steps(features, layout)
    weights, heights = torch.full_like(steps[..., 0], step_weight), torch.full_like(steps[..., 0], height_weight)
    weights[:, arms] = heights[:, arms] = arm_weight
    standing = features[:-1, layout.blocks["contacts"]] > 0.5
    weights[:, feet] = torch.where(standing, contact_weight, weights[:, feet])
    along = steps[..., [0, 2]]
    along[:, feet] *= ~standing[..., None]
    x, z = _agreeing(places[..., [0, 2]], along, weights).unbind(-1)
    height = _agreeing(places[..., 1:2], steps[..., 1:2], heights)[..., 0]
    return torch.stack([x, height, z], dim=-1)


def _agreeing(
    places: Float[Tensor, "T J c"], steps: Float[Tensor, "T-1 J c"], weights: Float[Tensor, "T-1 J"]
) -> Float[Tensor, "T J c"]:
    """The least squares of `fused_joints` for some coordinates."""
    identity = torch.eye(len(places), dtype=places.dtype)
    difference = identity.diff(dim=0)
    weighted = difference.T * weights.T[:, None]  # (J, T, T-1)
    normal = identity + weighted @ difference
    return torch.linalg.solve(normal, places.transpose(0, 1) + weighted @ steps.transpose(0, 1)).transpose(0, 1)


def _steps(features: Float[Tensor, "T D"], layout: FeatureLayout) -> Float[Tensor, "T-1 J 3"]:
    """The block of velocities, turned from the body's heading into the world."""
    x, y, z = features[:-1, layout.blocks["velocities"]].unflatten(-1, (-1, 3)).unbind(-1)
    heading = turned(features[:, 0])[:-1, None]
    cos, sin = heading.cos(), heading.sin()
    return torch.stack([cos * x - sin * z, y, sin * x + cos * z], dim=-1)
