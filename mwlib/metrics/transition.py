"""What the errors of a transition do not tell: its seams, its keyframes, its feet, its bones, and how far it goes.

Positions are (..., F, C) with C = 3J, metres, world coordinates, root included; keyframes are among the frames. Leading axes
are free. Each number is to be read beside the same number of the truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.body.kinematics import bones_of, horizontal
from mwlib.body.skeleton import Skeleton
from mwlib.metrics.inbetweening import check_pair
from mwlib.metrics.prediction import sample_ade

CONTACT_HEIGHT = 0.05  # metres above the floor below which a foot is said to stand


def seam_ratio(x: Float[Tensor, "*lead T C"]) -> Float[Tensor, "*lead"]:
    """How much a motion jumps beside its two keyframes: mean of its first and last step over its mean step between.

    A step is ‖x_t+1 - x_t‖ over all C values. About 1 for recorded motion, much more where keyframes were only pasted. Standing
    still between the keyframes gives infinity, standing still throughout NaN. Source: own choice.

    Args:
        x: whole motions, first and last frame are the keyframes.

    Raises:
        ValueError: fewer than four frames, or a value is not finite.

    >>> seam_ratio(torch.tensor([0.0, 3.0, 4.0, 5.0, 6.0])[:, None])
    tensor(2.)
    """
    _check(x, frames=4)
    step = torch.linalg.vector_norm(x.diff(dim=-2), dim=-1)
    return (step[..., 0] + step[..., -1]) / 2 / step[..., 1:-1].mean(-1)


def keyframe_error(
    p: Float[Tensor, "*#lead T C"], g: Float[Tensor, "*#lead T C"], keyframes: Sequence[int]
) -> Float[Tensor, "*lead"]:
    """How far a motion is from its keyframes, metres: the largest distance of a joint over the given frames.

    Source: own choice; 0 where keyframes are met exactly.

    Args:
        p: motions made between keyframes.
        g: motions that have the keyframes; other frames do not matter.
        keyframes: numbers of frames; -1 is the last.

    Raises:
        ValueError: no keyframes, one that is no frame, shapes that do not fit, C no multiple of 3, or a value is not finite.

    >>> p = torch.tensor([[0.0, 0.0, 0.0], [9.0, 9.0, 9.0], [3.0, 4.0, 0.0]])
    >>> keyframe_error(p, torch.zeros(3, 3), keyframes=(0, -1))
    tensor(5.)
    """
    check_pair(p, g, axes=2)
    frames = p.shape[-2]
    if not keyframes or not all(-frames <= k < frames for k in keyframes):
        raise ValueError(f"keyframes are {list(keyframes)}; expected at least one, each from {-frames} to {frames - 1}")
    picked = list(keyframes)
    return (_joints(p)[..., picked, :, :] - _joints(g)[..., picked, :, :]).norm(dim=-1).amax((-2, -1))


def path_length(path: Float[Tensor, "*lead T axes"]) -> Float[Tensor, "*lead"]:
    """Length of a path, metres: sum of the distances from frame to frame.

    Source: own choice. Of the root's two horizontal coordinates it is the way gone; of all three the bobbing counts, too.

    Raises:
        ValueError: fewer than two frames, or a value is not finite.

    >>> path_length(torch.tensor([[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]]))
    tensor(6.)
    """
    _check(path, frames=2)
    return path.diff(dim=-2).norm(dim=-1).sum(-1)


def foot_contacts(
    joints: Float[Tensor, "*lead T J 3"],
    feet: Sequence[int],
    fps: float,
    *,
    up: str = "z",
    floor: float | Float[Tensor, "*#lead"] = 0.0,
    height: float = CONTACT_HEIGHT,
    fastest: float = math.inf,
) -> Bool[Tensor, "*lead steps feet"]:
    """Which feet stand from one frame to the next: those lower than `height` in both frames, and not faster than `fastest`.

    Source: height as in `foot_skate`; speed as in the foot contact loss of MDM (Tevet et al. 2023), which looks at it alone.

    Args:
        joints: metres.
        feet: joints that touch the floor.
        fps: frames per second.
        up: the axis that points up, "y" or "z".
        floor: metres along that axis, one for all or each its own.
        height: metres above the floor.
        fastest: m/s, in any direction. A foot that swings past the floor is low, and does not stand.

    >>> toe = torch.tensor([[0.0, 0.0, 0.01], [0.0, 0.0, 0.02], [0.5, 0.0, 0.03], [0.5, 0.0, 0.2]])[:, None]
    >>> foot_contacts(toe, [0], fps=10.0).flatten().tolist(), foot_contacts(toe, [0], fps=10.0, fastest=0.2).flatten().tolist()
    ([True, True, False], [True, False, False])
    """
    *_, vertical = horizontal(up)
    places = joints[..., list(feet), :]
    is_low = places[..., vertical] - torch.as_tensor(floor).to(joints)[..., None, None] < height
    is_slow = places.diff(dim=-3).norm(dim=-1) * fps <= fastest
    return is_low[..., 1:, :] & is_low[..., :-1, :] & is_slow


def foot_skate(
    x: Float[Tensor, "*lead T C"],
    feet: Sequence[int],
    fps: float,
    *,
    up: str = "z",
    floor: float = 0.0,
    height: float = CONTACT_HEIGHT,
) -> Float[Tensor, "*lead"]:
    """How fast feet slide while they stand, m/s: mean horizontal speed of those in contact, NaN if none ever is.

    A foot is in contact as `foot_contacts` has it, however fast it is. A speed in m/s does not depend on the frame rate.
    Source: contact as in the foot-skating ratio of GMD (Karunratanakul et al., Guided Motion Diffusion, 2023: toes below 5 cm
    in both frames); own choice: the mean speed instead of the share of frames in which it exceeds 0.5 m/s, because
    a share hides how fast, and no threshold on speed, because a foot that slides is fast.

    Args:
        feet: joints that touch the floor: toes rather than ankles, which are higher than `height` when standing.
        fps: frames per second.
        up: the axis that points up, "y" or "z".
        floor: metres along that axis.
        height: metres above the floor.

    Raises:
        ValueError: no feet, a foot that is no joint, fewer than two frames, C no multiple of 3, or a value is not finite.

    >>> toe = torch.stack([0.02 * torch.arange(11.0), torch.zeros(11), torch.zeros(11)], dim=-1)
    >>> round(float(foot_skate(toe, feet=[0], fps=10.0)), 4)
    0.2
    """
    _check(x, frames=2)
    joints = _joints(x)
    if not feet or not all(0 <= foot < joints.shape[-2] for foot in feet):
        raise ValueError(f"feet are {list(feet)}; expected at least one of joints 0 to {joints.shape[-2] - 1}")
    a, b, _ = horizontal(up)
    stands = foot_contacts(joints, feet, fps, up=up, floor=floor, height=height)
    speed = joints[..., list(feet), :][..., [a, b]].diff(dim=-3).norm(dim=-1) * fps
    return (speed * stands).sum((-2, -1)) / stands.sum((-2, -1))


def bone_length_error(
    x: Float[Tensor, "*lead T C"], lengths: Float[Tensor, "*#lead bones"], skeleton: Skeleton
) -> Float[Tensor, "*lead"]:
    """How far bones are from their lengths, metres: mean over bones and frames of |length - given length|.

    Source: own choice; the unsquared form of the bone-length loss of FreqDiffusionBridge (2026). Zero for forward kinematics.

    Args:
        lengths: of the skeleton's bones, in their order, as `bone_lengths` gives for a keyframe; one set for all or per motion.
        skeleton: whose joints these are, root included.

    Raises:
        ValueError: C or `lengths` do not belong to the skeleton, or a value is not finite.

    >>> chain = mw.Skeleton("chain", ("root", "end"), (-1, 0))
    >>> bone_length_error(torch.tensor([[1.0, 0.0, 0.0, 1.0, 0.0, 2.5]]), torch.tensor([2.0]), chain)
    tensor(0.5000)
    """
    _check(x, frames=1)
    if x.shape[-1] != 3 * len(skeleton) or lengths.shape[-1] != len(skeleton) - 1:
        found = f"x has {x.shape[-1]} numbers per frame and lengths {lengths.shape[-1]}"
        raise ValueError(f"{found}; expected {3 * len(skeleton)} and {len(skeleton) - 1} for {skeleton.name}")
    joints = _joints(x)
    bones = bones_of((joints[..., 1:, :] - joints[..., :1, :]).flatten(-2), skeleton)
    return (bones.norm(dim=-1) - lengths.to(x)[..., None, :]).abs().mean((-2, -1))


def nearer_share(
    p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"], reference: Float[Tensor, "N F C"]
) -> Float[Tensor, " N"]:
    """Share of the samples that are nearer to the truth than another motion is, in the distance of `ade`; ties do not count.

    Source: own choice. The minimum of `ade` over samples falls with their number; this does not.

    Args:
        reference: for example the interpolation between the keyframes.

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> p = torch.tensor([0.5, 2.0, -1.0, 0.0]).reshape(1, 4, 1, 1)
    >>> nearer_share(p, torch.zeros(1, 1, 1), torch.ones(1, 1, 1))
    tensor([0.5000])
    """
    return (sample_ade(p, g) < sample_ade(reference[:, None], g)).to(p).mean(1)


def _joints(x: Float[Tensor, "*lead T C"]) -> Float[Tensor, "*lead T J 3"]:
    if x.shape[-1] % 3:
        raise ValueError(f"{x.shape[-1]} numbers per frame; expected a multiple of 3")
    return x.unflatten(-1, (-1, 3))


def _check(x: Tensor, frames: int) -> None:
    if x.ndim < 2 or x.shape[-2] < frames:
        raise ValueError(f"shape is {tuple(x.shape)}; expected (..., frames, numbers) with at least {frames} frames")
    if not x.isfinite().all():
        raise ValueError(f"not finite at {(~x.isfinite()).nonzero()[0].tolist()}; expected finite metres")
