"""Joints of other skeletons that stand for Human3.6M's 17 and for HumanML3D's 22."""

from __future__ import annotations

from os.path import commonprefix
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from mwlib.body.skeleton import CMU, HUMANML22, Skeleton


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
    _scheme(
        " ".join(f"{_short(CMU.joints[child])} {_short(CMU.joints[parent])}" for parent, child in CMU.bones),
        _short(" ".join(CMU.h36m17)),
    ),
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

# LaFAN1's tree with more joints, like Mixamo's: fingers, the top of the head.
MIXAMO = _scheme(
    "LeftUpLeg Hips LeftLeg LeftUpLeg LeftFoot LeftLeg RightUpLeg Hips RightLeg RightUpLeg RightFoot RightLeg "
    "Spine Hips Spine1 Spine Spine2 Spine1 Neck Spine2 Head Neck LeftShoulder Spine2 LeftArm LeftShoulder LeftForeArm LeftArm "
    "LeftHand LeftForeArm RightShoulder Spine2 RightArm RightShoulder RightForeArm RightArm RightHand RightForeArm",
    "Hips RightUpLeg RightLeg RightFoot LeftUpLeg LeftLeg LeftFoot Spine1 Spine2 Neck Head "
    "LeftArm LeftForeArm LeftHand RightArm RightForeArm RightHand",
)

# SMPL's bodies as their rigs have them: with hands or fingers, jaw and eyes.
SMPL = _scheme(
    " ".join(f"{HUMANML22.joints[child]} {HUMANML22.joints[parent]}" for parent, child in HUMANML22.bones),
    " ".join(HUMANML22.h36m17),
)


def to_h36m17(skeleton: Skeleton) -> list[int] | None:
    """The joints that stand for H36M17's, in its order; None if no way is known.

    A skeleton may say it itself (`Skeleton.h36m17`); CMU's tree goes under the names of any of its three publications, and
    LaFAN1's with more joints under Mixamo's, HumanML3D's with more under SMPL's. What all names begin with, like "mixamorig:",
    does not count.

    >>> asf = Skeleton("mine", tuple(map(_short, CMU.joints)), CMU.parents)
    >>> to_h36m17(asf) == to_h36m17(CMU), to_h36m17(Skeleton("stick", ("a", "b"), (-1, 0)))
    (True, None)
    """
    if skeleton.h36m17 and {*skeleton.h36m17} <= {*skeleton.joints}:
        return [skeleton.joints.index(name) for name in skeleton.h36m17]
    names, scheme = _bare(skeleton), _scheme_of(skeleton, (*SCHEMES, MIXAMO, SMPL))
    return None if scheme is None else [names.index(name) for name in scheme.joints]


def is_cmu(skeleton: Skeleton) -> bool:
    """Whether this is CMU's tree, under the names of any of its publications; fingers, toes and eyes may be missing."""
    return skeleton == CMU or _scheme_of(skeleton, SCHEMES) is not None


def _scheme_of(skeleton: Skeleton, schemes: tuple[Scheme, ...]) -> Scheme | None:
    """The first scheme whose joints the skeleton has, under the same parents."""
    names = _bare(skeleton)
    above = {names[child]: names[parent] for parent, child in skeleton.bones}
    return next((scheme for scheme in schemes if scheme.above.items() <= above.items()), None)


def _bare(skeleton: Skeleton) -> list[str]:
    """Names of joints without what all begin with."""
    shared = len(commonprefix(skeleton.joints))
    return [name[shared:] for name in skeleton.joints]


def to_humanml22(skeleton: Skeleton) -> Float[np.ndarray, "22 joints"] | None:
    """The share that each joint has in each of HUMANML22's, in its order; None if no way is known. Rows add up to 1.

    Own choice: CMU's thorax ends where neck and clavicles begin, above the joint spine3 of HumanML3D, and has no joints like
    the collars; those lie between thorax and shoulder.

    >>> to_humanml22(CMU).sum(axis=1).tolist() == [1.0] * 22, to_humanml22(HUMANML22) is None
    (True, True)
    """
    if not skeleton.humanml22 or not {j for part in skeleton.humanml22 for j in part.split(":")[:2]} <= {*skeleton.joints}:
        return None
    shares = np.zeros((len(HUMANML22), len(skeleton)))
    for row, part in zip(shares, skeleton.humanml22, strict=True):
        first, second, share = part.split(":") if ":" in part else (part, part, 0)
        row[skeleton.joints.index(first)] = 1 - float(share)
        row[skeleton.joints.index(second)] += float(share)
    return shares
