"""Losses on clean estimates of motions: diversity, smoothness, bone length, bone angle, contacts.

Source: FreqDiffusionBridge, Sec. 3.3, of the first four. Its formulae are lost from the text that we have; what is ambiguous is
a named option. That of contacts is MDM's (Tevet et al. 2023).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.metrics import foot_contacts

Smoothness = Literal["step", "velocity", "acceleration"]
Diversity = Literal["distance", "exponential"]
Poses = Float[Tensor, "*lead F C"]
Places = Float[Tensor, "*lead F joints 3"]  # metres
PerMotion = Float[Tensor, "*lead"]
STANDING = 0.2  # m/s up to which a low foot of the truth stands; MDM: a centimetre a frame at 20 Hz


def diversity_loss(samples: Float[Tensor, "*lead M F C"], kind: Diversity, scale: float = 1.0) -> PerMotion:
    """Likeness of the M samples of a clip.

    Args:
        samples: at least two.
        kind: "distance": minus the mean distance of two, flattened, as the paper has it, without a lower bound; "exponential":
            mean of exp(-distance² / scale), as DLow (Yuan and Kitani 2020) has it, from 0 to 1.
        scale: of "exponential".

    Raises:
        ValueError: fewer than two samples.

    >>> samples = torch.tensor([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]])[:, None]
    >>> [round(float(diversity_loss(samples, kind, 25.0)), 6) for kind in ("distance", "exponential")]
    [-6.666667, 0.251358]
    """
    count = samples.shape[-3]
    if count < 2:
        raise ValueError(f"{count} sample; expected at least two to compare")
    first, second = torch.triu_indices(count, count, 1, device=samples.device)
    apart = (samples[..., first, :, :] - samples[..., second, :, :]).flatten(-2)
    if kind == "distance":
        return -apart.norm(dim=-1).mean(-1)
    return torch.exp(-apart.square().sum(-1) / scale).mean(-1)


def smoothness_loss(x: Poses, truth: Poses, kind: Smoothness) -> PerMotion:
    """Change of a motion from frame to frame: mean over frames of its squared length.

    Args:
        x: any numbers over time.
        truth: the true ones, of "velocity".
        kind: "step", the paper's words: every step counts, so that standing still is best; "velocity": a step's difference from
            the truth's; "acceleration": second differences.

    >>> x = torch.tensor([0.0, 1.0, 1.0, 3.0])[:, None]
    >>> [round(float(smoothness_loss(x, x, kind)), 6) for kind in ("step", "velocity", "acceleration")]
    [1.666667, 0.0, 2.5]
    """
    change = x.diff(dim=-2)
    if kind == "velocity":
        change = change - truth.diff(dim=-2)
    elif kind == "acceleration":
        change = change.diff(dim=-2)
    return change.square().sum(-1).mean(-1)


def bone_length_loss(positions: Places, lengths: Float[Tensor, "*#lead bones"], skeleton: Skeleton) -> PerMotion:
    """Mean over frames and bones of the squared difference from the given length, metres².

    Args:
        positions: metres.
        lengths: in the order of `skeleton.bones`, metres.
        skeleton: whose joints these are.

    >>> arm = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))
    >>> bent = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.1, 0.0]]])
    >>> round(float(bone_length_loss(bent, torch.ones(2), arm)), 6)
    0.005
    """
    return (bone_lengths(positions, skeleton) - lengths[..., None, :]).square().mean((-2, -1))


def bone_lengths(positions: Float[Tensor, "*lead joints 3"], skeleton: Skeleton) -> Float[Tensor, "*lead bones"]:
    """`body.kinematics.bone_lengths` in torch: gradients pass."""
    parent, child = torch.tensor(skeleton.bones, device=positions.device).T
    return (positions[..., child, :] - positions[..., parent, :]).norm(dim=-1)


def bone_angles(positions: Float[Tensor, "*lead joints 3"], skeleton: Skeleton) -> Float[Tensor, "*lead angles"]:
    """Angle between the bone to a joint and each bone from it, radians: 0 where they go straight on, pi where they fold back.

    By the arc tangent of sine and cosine, whose gradient is finite at both ends.
    """
    above, joint, below = _meetings(skeleton, positions.device)
    rows = positions.movedim((-2, -1), (0, 1))  # a joint in one piece of memory: two thirds of the time
    u = rows.index_select(0, joint) - rows.index_select(0, above)
    v = rows.index_select(0, below) - rows.index_select(0, joint)
    cross = torch.linalg.cross(u, v, dim=1).square().sum(1)
    return torch.atan2((cross + 1e-12).sqrt(), (u * v).sum(1)).movedim(0, -1).contiguous()


def bone_angle_loss(positions: Places, limits: Float[Tensor, " angles"], skeleton: Skeleton) -> PerMotion:
    """Mean over frames and angles of the squared excess over the limit, radians².

    Args:
        positions: metres.
        limits: largest angle where two bones meet, in the order of `bone_angles`, radians.
        skeleton: whose joints these are.

    >>> arm = Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1))
    >>> bent = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.1, 0.0]]])
    >>> round(float(bone_angle_loss(bent, torch.tensor([80.0]).deg2rad(), arm)), 6)
    0.030462
    """
    return (bone_angles(positions, skeleton) - limits).clamp_min(0).square().mean((-2, -1))


def contact_loss(positions: Places, truth: Float[Tensor, "*#lead F joints 3"], feet: Sequence[int], fps: float) -> PerMotion:
    """Speed of feet where the truth's stand: mean over steps and feet of its square, 0 elsewhere, m²/s².

    Source: MDM (Tevet et al. 2023), Eq. 4, in metres per second. Own choice: the truth's foot stands if it is slow, as there,
    and also low, as in `foot_skate`; the floor is at the truth's lowest foot.

    Args:
        positions: metres, z up.
        truth: the same windows.
        feet: joints that touch the floor.
        fps: frames per second.

    >>> stands = torch.zeros(3, 1, 3)
    >>> slides = torch.tensor([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.2, 0.0]])[:, None]
    >>> round(float(contact_loss(slides, stands, [0], fps=10.0)), 6)
    2.5
    """
    stand = foot_contacts(truth, feet, fps, floor=floor_of(truth, feet), fastest=STANDING)
    velocity = positions[..., list(feet), :].diff(dim=-3) * fps
    return (velocity.square().sum(-1) * stand).mean((-2, -1))


def floor_of(positions: Places, feet: Sequence[int]) -> PerMotion:
    """Height of the lowest of some joints over a window, z up, metres."""
    return positions[..., list(feet), 2].amin((-2, -1))


def feet(skeleton: Skeleton) -> list[int]:
    """The joints that touch the floor, by their names: toes, else feet, else ankles; none where nothing is called so."""
    for word in ("toe", "foot", "ankle"):
        if found := [i for i, name in enumerate(skeleton.joints) if word in name.lower()]:
            return found
    return []


@lru_cache(maxsize=64)
@torch.inference_mode(False)  # what is kept must serve training, too
def _meetings(skeleton: Skeleton, device: torch.device) -> Int[Tensor, "3 angles"]:
    """Triples parent, joint, child, one for every pair of bones that meet end to end."""
    parents = skeleton.parents
    rows = [(parents[joint], joint, child) for child, joint in enumerate(parents) if joint > 0]
    return torch.tensor(rows, device=device).reshape(-1, 3).T
