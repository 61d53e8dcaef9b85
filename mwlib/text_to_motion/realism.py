"""What scores of embeddings do not tell: whether a body does what the sentence says, and whether it moves like one."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor

from mwlib.body.kinematics import bones_of
from mwlib.data.captions import CaptionedClip
from mwlib.data.formats.humanml import FeatureLayout, joints_of
from mwlib.metrics import foot_skate, jerk, path_length, speed
from mwlib.text_to_motion.attributes import measured_attributes

CLAIMS = ("action", "then", "path", "speed", "hand", "foot", "turn", "count")  # of what a caption of synthetic people may say


def movement(features: Float[Tensor, "T D"], layout: FeatureLayout) -> dict[str, float]:
    """Speed and jerk of the joints, way of the root, sliding of the toes, and how much bones change their lengths.

    Args:
        features: raw.
        layout: what a row means.

    Returns:
        "joint_speed" (m/s), "way" (m), "jerk" (m/s³), "skate" (m/s, NaN where no toe is on the floor; the floor is the lowest
        toe), "bone_jitter" (m, mean step of a bone's length from frame to frame).
    """
    joints = joints_of(features.float(), layout) * layout.metres_per_unit
    flat = joints.flatten(-2)[None, None]
    toes = layout.contact_joints[1::2]
    floor = float(joints[:, toes, 1].amin())
    return {
        "joint_speed": float(speed(flat, layout.fps)),
        "way": float(path_length(joints[:, 0, [0, 2]])),
        "jerk": float(jerk(flat, layout.fps)),
        "bone_jitter": float(
            bones_of((joints[:, 1:] - joints[:, :1]).flatten(-2), layout.skeleton).norm(dim=-1).diff(dim=0).abs().mean()
        ),
        "skate": float(foot_skate(joints.flatten(-2), toes, layout.fps, up="y", floor=floor)),
    }


def claims_met(features: Float[Tensor, "T D"], clip: CaptionedClip, layout: FeatureLayout) -> dict[str, float]:
    """Which attributes of a clip's person a motion shows: 1 or 0 for each that its captions claim; none without attributes."""
    wanted = {name: clip.attributes[name] for name in CLAIMS if name in clip.attributes}
    if not wanted:
        return {}
    joints = joints_of(features.double(), layout).numpy() * layout.metres_per_unit
    found = measured_attributes(joints, layout.fps)
    return {name: float(found.get(name) == value) for name, value in wanted.items()}
