"""Skeletons: joint names, parents, mirror pairs, body parts, and the joints that stand for others'."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os.path import commonprefix
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from mwlib.settings import of_kind, several, whole


@dataclass(frozen=True)
class Skeleton:
    """A kinematic tree. Joint 0 is the root, parents come before children.

    Args:
        name: one word, unique among the known skeletons.
        joints: joint names, length J+1 (the root included).
        parents: index of each joint's parent, -1 for the root.
        left, right: joint indices of the two sides, paired position by position.
        parts: body part -> joint indices (root included in the numbering, never a member).
        h36m17: the joints that stand for Human3.6M's 17, in their order; () if none do.
        humanml22: the same for HumanML3D's 22; "a:b:0.4" stands for the point at that share of the way from a to b.

    Raises:
        ValueError: an argument is of another kind, lengths differ, a parent does not precede its child, two joints have one name,
            sides do not pair up or share a joint, or a part has a joint twice.
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    left: tuple[int, ...] = ()
    right: tuple[int, ...] = ()
    parts: Mapping[str, tuple[int, ...]] = field(default_factory=dict, hash=False)
    h36m17: tuple[str, ...] = field(default=(), compare=False, repr=False)
    humanml22: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        of_kind("name", self.name, str, "a text")
        for name in ("joints", "h36m17", "humanml22"):
            words = several(name, getattr(self, name), "names")
            object.__setattr__(self, name, tuple(of_kind(f"{name}[{n}]", word, str, "a text") for n, word in enumerate(words)))
        for name in ("parents", "left", "right"):
            object.__setattr__(self, name, self._numbers(name, getattr(self, name), -(name == "parents")))
        parts = of_kind("parts", self.parts, Mapping).items()
        parts = {of_kind("a part", part, str, "a text"): self._numbers(f"parts[{part!r}]", joints) for part, joints in parts}
        object.__setattr__(self, "parts", parts)
        if len(self.joints) != len(self.parents):
            raise ValueError(f"{self.name}: {len(self.joints)} joint names but {len(self.parents)} parents")
        for joint, parent in enumerate(self.parents):
            if not (parent == -1 if joint == 0 else 0 <= parent < joint):
                raise ValueError(
                    f"{self.name}: parent of joint {joint} is {parent}; expected -1 for joint 0, else 0 to {joint - 1}"
                )
        if len(self.left) != len(self.right):
            raise ValueError(f"{self.name}: {len(self.left)} left joints but {len(self.right)} right joints")
        for what, one in (("joint", self.joints), ("joint of a side", (*self.left, *self.right)), *self.parts.items()):
            if twice := [each for n, each in enumerate(one) if each in one[:n]]:
                raise ValueError(f"{self.name}: {what} {twice[0]!r} twice; expected each once")

    def _numbers(self, name: str, values: object, least: int = 0) -> tuple[int, ...]:
        """Numbers of joints, as plain ones."""
        most, rows = len(self.joints) - 1, several(name, values, "numbers of joints")
        return tuple(whole(f"{self.name}: {name}[{n}]", value, least, most) for n, value in enumerate(rows))

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """(parent, child) pairs, in joint order."""
        return tuple((parent, joint) for joint, parent in enumerate(self.parents) if parent >= 0)

    @property
    def mirror(self) -> np.ndarray:
        """Permutation (J+1,) that exchanges left and right joints."""
        order = np.arange(len(self))
        order[list(self.left)], order[list(self.right)] = self.right, self.left
        return order

    def channels(self, part: str) -> np.ndarray:
        """Channels of a body part in the root-dropped layout: joint-major, xyz fastest.

        Args:
            part: its name; or that of a joint, which a skeleton without parts has, too.

        Raises:
            ValueError: the skeleton has no such part and no such joint, or it is the root; the message lists its parts.
        """
        if part not in (*self.parts, *self.joints[1:]):
            raise ValueError(f"{self.name} has no part {part!r}; it has {sorted(self.parts)}, and joints but for the root")
        joints = np.asarray(self.parts[part] if part in self.parts else [self.joints.index(part)]) - 1
        return (3 * joints[:, None] + np.arange(3)).ravel()


SIDES = {"left": "right", "Left": "Right", "_L": "_R"}


def named_tree(name: str, rows: str, parts: dict[str, str] | None = None, h36m17: str = "", humanml22: str = "") -> Skeleton:
    """A skeleton of "joint parent" words; left and right pairs follow from the names. Further arguments as words, too."""
    words = rows.split()
    joints, parents = tuple(words[::2]), tuple(int(p) for p in words[1::2])
    others = [re.sub("^left|^Left|_L$", lambda found: SIDES[found[0]], joint) for joint in joints]
    left, right = zip(*[(i, joints.index(other)) for i, other in enumerate(others) if other != joints[i]], strict=True)
    members = {part: tuple(joints.index(j) for j in names.split()) for part, names in (parts or {}).items()}
    return Skeleton(name, joints, parents, left, right, members, tuple(h36m17.split()), tuple(humanml22.split()))


# Human3.6M after VideoPose3D's joint reduction; parts as HumanMAC's control demo uses them.
H36M17 = named_tree(
    "H36M17",
    "hip -1 right_hip 0 right_knee 1 right_foot 2 left_hip 0 left_knee 4 left_foot 5 spine 0 thorax 7 neck 8 head 9 "
    "left_shoulder 8 left_elbow 11 left_wrist 12 right_shoulder 8 right_elbow 14 right_wrist 15",
    {
        "right_leg": "right_hip right_knee right_foot",
        "left_leg": "left_hip left_knee left_foot",
        "spine": "spine thorax neck head",
        "left_arm": "left_shoulder left_elbow left_wrist",
        "right_arm": "right_shoulder right_elbow right_wrist",
    },
    h36m17="hip right_hip right_knee right_foot left_hip left_knee left_foot spine thorax neck head "
    "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist",
)
# CMU: the 31 points of the ASF skeletons; a point is the far end of the bone of that name.
CMU = named_tree(
    "CMU",
    "root -1 left_hipjoint 0 left_femur 1 left_tibia 2 left_foot 3 left_toes 4 "
    "right_hipjoint 0 right_femur 6 right_tibia 7 right_foot 8 right_toes 9 "
    "lowerback 0 upperback 11 thorax 12 lowerneck 13 upperneck 14 head 15 "
    "left_clavicle 13 left_humerus 17 left_radius 18 left_wrist 19 left_hand 20 left_fingers 21 left_thumb 20 "
    "right_clavicle 13 right_humerus 24 right_radius 25 right_wrist 26 right_hand 27 right_fingers 28 right_thumb 27",
    h36m17="root right_hipjoint right_femur right_tibia left_hipjoint left_femur left_tibia upperback thorax upperneck head "
    "left_clavicle left_humerus left_radius right_clavicle right_humerus right_radius",
    humanml22="root left_hipjoint right_hipjoint lowerback left_femur right_femur upperback left_tibia right_tibia "
    "upperback:thorax:0.5 left_foot right_foot lowerneck thorax:left_clavicle:0.4 thorax:right_clavicle:0.4 upperneck "
    "left_clavicle right_clavicle left_humerus right_humerus left_radius right_radius",
)
HUMANML22 = named_tree(
    "HUMANML22",
    "pelvis -1 left_hip 0 right_hip 0 spine1 0 left_knee 1 right_knee 2 spine2 3 left_ankle 4 right_ankle 5 spine3 6 "
    "left_foot 7 right_foot 8 neck 9 left_collar 9 right_collar 9 head 12 left_shoulder 13 right_shoulder 14 "
    "left_elbow 16 right_elbow 17 left_wrist 18 right_wrist 19",
    h36m17="pelvis right_hip right_knee right_ankle left_hip left_knee left_ankle spine2 spine3 neck head "
    "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist",
)


class Scheme(NamedTuple):
    """CMU's tree under other names: "joint parent" words in any order, and the 17 joints in H36M17's order."""

    above: dict[str, str]
    joints: list[str]


def _scheme(tree: str, joints: str) -> Scheme:
    words = tree.split()
    return Scheme(dict(zip(words[::2], words[1::2], strict=True)), joints.split())


def _above(names: Sequence[str], skeleton: Skeleton) -> dict[str, str]:
    """The parent of each joint of a skeleton whose joints have these names."""
    return {names[child]: names[parent] for parent, child in skeleton.bones}


def _short(name: str) -> str:
    """A joint of CMU as ASF files call it."""
    return name.replace("left_", "l").replace("right_", "r")


# First the names of ASF files, whose points are the bones' far ends. Then those of the cgspeed BVH files and of the Daz-friendly
# ones, whose points are where bones begin: none is at the top of the head, so "neck" and "head" begin there, as for LAFAN1.
# Fingers, toes and eyes may be missing.
SCHEMES = (
    Scheme(_above([*map(_short, CMU.joints)], CMU), [*map(_short, CMU.h36m17)]),
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
SMPL = Scheme(_above(HUMANML22.joints, HUMANML22), [*HUMANML22.h36m17])


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
    above = _above(_bare(skeleton), skeleton)
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
