"""Joints of other skeletons that stand for Human3.6M's 17 and for HumanML3D's 22."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from mwlib.body.skeleton import BANDAI21, CMU, HUMANML22, LAFAN1, Skeleton

# In H36M17's order. Left stays left.
_LAFAN1 = (
    "Hips RightUpLeg RightLeg RightFoot LeftUpLeg LeftLeg LeftFoot Spine1 Spine2 Neck Head "
    "LeftArm LeftForeArm LeftHand RightArm RightForeArm RightHand"
)
_BANDAI21 = (
    "Hips UpperLeg_R LowerLeg_R Foot_R UpperLeg_L LowerLeg_L Foot_L Spine Chest Neck Head "
    "UpperArm_L LowerArm_L Hand_L UpperArm_R LowerArm_R Hand_R"
)
_HUMANML22 = (
    "pelvis right_hip right_knee right_ankle left_hip left_knee left_ankle spine2 spine3 neck head "
    "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist"
)
_CMU = (
    "root right_hipjoint right_femur right_tibia left_hipjoint left_femur left_tibia upperback thorax upperneck head "
    "left_clavicle left_humerus left_radius right_clavicle right_humerus right_radius"
)
KNOWN = {CMU: _CMU, LAFAN1: _LAFAN1, BANDAI21: _BANDAI21, HUMANML22: _HUMANML22}


class Scheme(NamedTuple):
    """CMU's tree under other names: "joint parent" words in any order, and the 17 joints in H36M17's order."""

    above: dict[str, str]
    joints: list[str]


def _scheme(tree: str, joints: str) -> Scheme:
    words = tree.split()
    return Scheme(dict(zip(words[::2], words[1::2], strict=True)), joints.split())


def _short(name: str) -> str:
    """A joint of CMU as ASF files call it."""
    return name.replace("left_", "l").replace("right_", "r")


# First the names of ASF files, whose points are the bones' far ends. Then those of the cgspeed BVH files and of the Daz-friendly
# ones, whose points are where bones begin: none is at the top of the head, so "neck" and "head" begin there, as for LAFAN1.
# Fingers, toes and eyes may be missing.
SCHEMES = (
    _scheme(" ".join(f"{_short(CMU.joints[child])} {_short(CMU.joints[parent])}" for parent, child in CMU.bones), _short(_CMU)),
    _scheme(
        "LHipJoint Hips LeftUpLeg LHipJoint LeftLeg LeftUpLeg LeftFoot LeftLeg RHipJoint Hips RightUpLeg RHipJoint "
        "RightLeg RightUpLeg RightFoot RightLeg LowerBack Hips Spine LowerBack Spine1 Spine Neck Spine1 Neck1 Neck Head Neck1 "
        "LeftShoulder Spine1 LeftArm LeftShoulder LeftForeArm LeftArm LeftHand LeftForeArm "
        "RightShoulder Spine1 RightArm RightShoulder RightForeArm RightArm RightHand RightForeArm",
        "Hips RightUpLeg RightLeg RightFoot LeftUpLeg LeftLeg LeftFoot Spine Spine1 Neck1 Head "
        "LeftArm LeftForeArm LeftHand RightArm RightForeArm RightHand",
    ),
    _scheme(
        "abdomen hip chest abdomen neck chest head neck lButtock hip lThigh lButtock lShin lThigh lFoot lShin "
        "rButtock hip rThigh rButtock rShin rThigh rFoot rShin lCollar chest lShldr lCollar lForeArm lShldr lHand lForeArm "
        "rCollar chest rShldr rCollar rForeArm rShldr rHand rForeArm",
        "hip rThigh rShin rFoot lThigh lShin lFoot abdomen chest neck head lShldr lForeArm lHand rShldr rForeArm rHand",
    ),
)


def to_h36m17(skeleton: Skeleton) -> list[int] | None:
    """The joints that stand for H36M17's, in its order; None if no way is known.

    Known skeletons go by themselves, CMU's tree under the names of any of its three publications by tree and names.

    >>> asf = Skeleton("mine", tuple(map(_short, CMU.joints)), CMU.parents)
    >>> to_h36m17(asf) == to_h36m17(CMU), to_h36m17(Skeleton("stick", ("a", "b"), (-1, 0)))
    (True, None)
    """
    if skeleton in KNOWN:
        return [skeleton.joints.index(name) for name in KNOWN[skeleton].split()]
    above = {
        child: skeleton.joints[parent] for child, parent in zip(skeleton.joints, skeleton.parents, strict=True) if parent >= 0
    }
    for scheme in SCHEMES:
        if scheme.above.items() <= above.items():
            return [skeleton.joints.index(name) for name in scheme.joints]
    return None


# In HUMANML22's order; two joints and a share stand for the point on the line between them, at that share of the way.
KNOWN22 = {
    CMU: "root left_hipjoint right_hipjoint lowerback left_femur right_femur upperback left_tibia right_tibia "
    "upperback:thorax:0.5 left_foot right_foot lowerneck thorax:left_clavicle:0.4 thorax:right_clavicle:0.4 upperneck "
    "left_clavicle right_clavicle left_humerus right_humerus left_radius right_radius",
    LAFAN1: "Hips LeftUpLeg RightUpLeg Spine LeftLeg RightLeg Spine1 LeftFoot RightFoot Spine2 LeftToe RightToe Neck "
    "LeftShoulder RightShoulder Head LeftArm RightArm LeftForeArm RightForeArm LeftHand RightHand",
    BANDAI21: "Hips UpperLeg_L UpperLeg_R Spine LowerLeg_L LowerLeg_R Spine:Chest:0.7 Foot_L Foot_R Chest Toes_L Toes_R Neck "
    "Shoulder_L Shoulder_R Head UpperArm_L UpperArm_R LowerArm_L LowerArm_R Hand_L Hand_R",
}


def to_humanml22(skeleton: Skeleton) -> Float[np.ndarray, "22 joints"] | None:
    """The share that each joint has in each of HUMANML22's, in its order; None if no way is known. Rows add up to 1.

    Own choice: CMU's thorax ends where neck and clavicles begin, above the joint spine3 of HumanML3D, and has no joints like
    the collars; those lie between thorax and shoulder.

    >>> to_humanml22(CMU).sum(axis=1).tolist() == [1.0] * 22, to_humanml22(HUMANML22) is None
    (True, True)
    """
    if skeleton not in KNOWN22:
        return None
    shares = np.zeros((len(HUMANML22), len(skeleton)))
    for row, part in zip(shares, KNOWN22[skeleton].split(), strict=True):
        first, second, share = part.split(":") if ":" in part else (part, part, 0)
        row[skeleton.joints.index(first)] = 1 - float(share)
        row[skeleton.joints.index(second)] += float(share)
    return shares
