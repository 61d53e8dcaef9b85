"""Features as motions of a body in the world."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.data.formats.humanml import FeatureLayout, joints_of


def motion_of(features: Float[Tensor, "T D"], layout: FeatureLayout, name: str = "") -> Motion:
    """Raw features as joint positions: metres, y up, starting above the origin, facing +z. No rotations: see `fit_rig`.

    Args:
        features: raw, not normalised.
        layout: what a row means.
        name: of the motion.
    """
    positions = joints_of(features.double(), layout).numpy() * layout.metres_per_unit
    return Motion(positions, layout.fps, layout.skeleton, name=name, up="y")
