"""Metrics of transitions between keyframes: the LaFAN1 benchmark's L2P, L2Q and NPSS, seams, feet, bones and paths.

A pose is the vector of all its numbers, as elsewhere in this room: positions are (..., F, C) with C = 3J, metres, world
coordinates, root included. Leading axes are free and those of truth and prediction broadcast: for samples (N, S, F, C) give the
truth as `g[:, None]`. The benchmark's three errors take the frames of the transition only, without keyframes; the others take
whole motions, keyframes included, and each is to be read beside the same number of the truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.body.kinematics import bones_of, horizontal
from mwlib.body.rotation import continuous
from mwlib.body.skeleton import Skeleton
from mwlib.metrics.prediction import PerWindow, Samples, Truths, sample_ade
from mwlib.settings import Positive

Moving = Float[Tensor, "*lead T C"]
PerMotion = Float[Tensor, "*lead"]
Frames = Float[Tensor, "*#lead F C"]  # of predictions or of truths, whose leading axes broadcast
Turns = Float[Tensor, "*#lead F J 4"]


def l2p(p: Frames, g: Frames, mean: Float[Tensor, " C"], deviation: Float[Tensor, " C"]) -> PerMotion:
    """Global position error of each sequence: mean over frames of ‖z(p_t) - z(g_t)‖, z(x) = (x - mean) / deviation.

    The norm is that of all C numbers of a pose at once, not a mean over joints. No unit: that of the positions cancels.

    Args:
        p: predicted positions.
        g: true ones.
        mean, deviation: of each coordinate over the training set, in the unit of the positions. The mean cancels, too; it is
            an argument because the definition has it, and so that nobody passes the deviations of another set of statistics.

    Source: Harvey et al., Robust Motion In-betweening, 2020, as their code for LaFAN1 computes it.

    Raises:
        ValueError: shapes do not fit, a value is not finite, or a deviation is not positive.

    >>> p, g = torch.tensor([[[0.0, 3.0]]]), torch.tensor([[[0.0, 1.0]]])
    >>> l2p(p, g, mean=torch.tensor([0.0, 1.0]), deviation=torch.tensor([1.0, 4.0]))
    tensor([0.5000])
    """
    check_pair(p, g, axes=2)
    if not mean.shape == deviation.shape == p.shape[-1:]:
        raise ValueError(
            f"mean {tuple(mean.shape)} and deviation {tuple(deviation.shape)}; "
            f"expected ({p.shape[-1]},), one number for each coordinate of a pose"
        )
    if not (deviation > 0).all():
        raise ValueError(f"the smallest deviation is {float(deviation.min()):g}; expected positive ones")
    mean, deviation = mean.to(p), deviation.to(p)
    return ((p - mean) / deviation - (g - mean) / deviation).norm(dim=-1).mean(-1)


def l2q(p: Turns, g: Turns) -> PerMotion:
    """Global rotation error of each sequence: mean over frames of the norm of all 4J differences of quaternions.

    A quaternion and its negative are one turn, but far-apart numbers. The benchmark's code leaves signs as they are, which
    suits what was recorded and interpolated; what a network predicts has any sign: give `continued(p, start)` and
    `continued(g, start)`, as the Δ-interpolator's evaluation does.

    Args:
        p: predicted global (not local) unit quaternions (w, x, y, z).
        g: true ones.

    Source: Harvey et al., 2020, as their code for LaFAN1 computes it.

    Raises:
        ValueError: shapes do not fit or a value is not finite.

    >>> still = torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(1, 3, 1, 4)
    >>> l2q(-still, still), l2q(continued(-still, still[:, 0]), still)
    (tensor([2.]), tensor([0.]))
    """
    check_pair(p, g, axes=3)
    if p.shape[-1] != 4:
        raise ValueError(f"p has shape {tuple(p.shape)}; expected (..., F, J, 4), quaternions")
    return (p - g).flatten(-2).norm(dim=-1).mean(-1)


def continued(q: Turns, start: Float[Tensor, "*#lead J 4"]) -> Float[Tensor, "*lead F J 4"]:
    """The same turns with signs such that no quaternion lies opposite to the one before, the first not to `start`.

    Source: the evaluation of the Δ-interpolator (Oreshkin et al., 2022): the frame before is put in front, signs are made
    continuous, the frame is dropped.

    Raises:
        ValueError: the shapes do not fit each other.
    """
    if start.ndim != q.ndim - 1 or start.shape[-2:] != q.shape[-2:]:
        expected = f"one frame, (..., {', '.join(map(str, q.shape[-2:]))}) with {q.ndim - 1} axes, for {tuple(q.shape)}"
        raise ValueError(f"start has shape {tuple(start.shape)}; expected {expected}")
    against = (q[..., 0, :, :] * start.to(q)).sum(-1, keepdim=True) < 0
    return continuous(q) * torch.where(against, -1.0, 1.0).to(q)[..., None, :, :]


class NPSS:
    """Normalised power spectrum similarity, over all sequences and channels that were fed.

    NPSS = Σ P E / Σ P over sequences and channels together, P the total power of a true channel and E the sum over frequency
    bins of |difference of the cumulated shares of power|. A mean of the values of batches is another number. E is a sum, so it
    grows with the number of frames.

    At 0/0: a predicted channel without any power has the shares 0, so E is the sum of the truth's cumulated shares; a true
    one has the weight P = 0 and does not count. `value` is NaN if nothing that was fed had power.

    Power is, as in the benchmark, the squared real part of the Fourier coefficients, all F bins; it depends on the phase.
    |coefficient|² is what is usually called power.

    Source: Gopalakrishnan et al., A Neural Temporal Model for Human Motion Prediction, 2019, as the code of Harvey et al.,
    2020, computes it for LaFAN1. At 0/0: own choice, as in the Two-stage Transformers (Qin et al., 2022); the benchmark's code
    has no guard.

    >>> npss = NPSS()
    >>> npss.update(torch.tensor([1.0, 1.0, 1.0, 2.0])[None, :, None], torch.tensor([1.0, 2.0, 3.0, 4.0])[None, :, None])
    >>> round(npss.value(), 6)
    0.137363
    """

    def __init__(self) -> None:
        self._weighted, self._weight = 0.0, 0.0

    def update(self, p: Frames, g: Frames) -> None:
        """Add sequences: predictions, and their truths. Quaternions are flattened, `q.flatten(-2)`, their signs continuous.

        Raises:
            ValueError: shapes do not fit or a value is not finite.
        """
        check_pair(p, g, axes=2)
        (predicted, _), (true, total) = self._cumulated(p), self._cumulated(g)
        distance = (predicted - true).abs().sum(-2)
        self._weighted += float((distance * total).sum())
        self._weight += float(total.expand_as(distance).sum())

    def value(self) -> float:
        """NPSS of everything fed so far; NaN before anything with power was."""
        return self._weighted / self._weight if self._weight else float("nan")

    def _cumulated(self, x: Float[Tensor, "*lead F C"]) -> tuple[Float[Tensor, "*lead F C"], Float[Tensor, "*lead C"]]:
        """Cumulated shares of power over frequency, and the total."""
        power = torch.fft.fft(x.double(), dim=-2).real ** 2
        total = power.sum(-2)
        return power.cumsum(-2) / torch.where(total > 0, total, 1.0)[..., None, :], total


def npss(p: Frames, g: Frames) -> float:
    """`NPSS` of one batch that holds all sequences.

    Raises:
        ValueError: shapes do not fit or a value is not finite.

    >>> swing = torch.sin(torch.arange(30.0))[None, :, None]
    >>> npss(-swing, swing)
    0.0
    """
    found = NPSS()
    found.update(p, g)
    return found.value()


def check_pair(p: Tensor, g: Tensor, axes: int) -> None:
    """Refuse predictions and truths that do not fit each other, and what is not finite.

    Args:
        axes: how many of the last axes must be equal; those before them broadcast.

    Raises:
        ValueError: the message has the shapes.
    """
    fits = p.ndim == g.ndim >= axes and p.shape[-axes:] == g.shape[-axes:] and 0 not in p.shape[-axes:]
    if not fits or any(a != b and 1 not in (a, b) for a, b in zip(p.shape, g.shape, strict=True)):
        hint = "equal but for leading axes of 1; for samples p (N, S, F, ...) give the truth as g[:, None]"
        raise ValueError(f"p has shape {tuple(p.shape)} and g {tuple(g.shape)}; expected them {hint}")
    _check_finite("p", p)
    _check_finite("g", g)


CONTACT_HEIGHT = 0.05  # metres above the floor below which a foot is said to stand


def seam_ratio(x: Moving) -> PerMotion:
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
    step = x.diff(dim=-2).norm(dim=-1)
    return (step[..., 0] + step[..., -1]) / 2 / step[..., 1:-1].mean(-1)


def keyframe_error(p: Float[Tensor, "*#lead T C"], g: Float[Tensor, "*#lead T C"], keyframes: Sequence[int]) -> PerMotion:
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
    if not keyframes or not {*keyframes} <= {*range(-frames, frames)}:
        raise ValueError(f"keyframes are {list(keyframes)}; expected at least one, each from {-frames} to {frames - 1}")
    return (_joints(p) - _joints(g))[..., list(keyframes), :, :].norm(dim=-1).amax((-2, -1))


def path_length(path: Float[Tensor, "*lead T axes"]) -> PerMotion:
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
    fps: Positive,
    *,
    up: str = "z",
    floor: float | Float[Tensor, "*#lead"] = 0.0,
    fastest: float = math.inf,
) -> Bool[Tensor, "*lead steps feet"]:
    """Which feet stand from one frame to the next: those lower than 5 cm in both frames, and not faster than `fastest`.

    Source: height as in `foot_skate`; speed as in the foot contact loss of MDM (Tevet et al. 2023), which looks at it alone.

    Args:
        joints: metres.
        feet: joints that touch the floor.
        fps: frames per second.
        up: the axis that points up, "y" or "z".
        floor: metres along that axis, one for all or each its own.
        fastest: m/s, in any direction. A foot that swings past the floor is low, and does not stand.

    >>> toe = torch.tensor([[0.0, 0.0, 0.01], [0.0, 0.0, 0.02], [0.5, 0.0, 0.03], [0.5, 0.0, 0.2]])[:, None]
    >>> foot_contacts(toe, [0], fps=10.0).flatten().tolist(), foot_contacts(toe, [0], fps=10.0, fastest=0.2).flatten().tolist()
    ([True, True, False], [True, False, False])
    """
    *_, vertical = horizontal(up)
    places = joints[..., list(feet), :]
    is_low = places[..., vertical] - torch.as_tensor(floor).to(joints)[..., None, None] < CONTACT_HEIGHT
    is_slow = places.diff(dim=-3).norm(dim=-1) * fps <= fastest
    return is_low[..., 1:, :] & is_low[..., :-1, :] & is_slow


def foot_skate(x: Moving, feet: Sequence[int], fps: Positive, *, up: str = "z", floor: float = 0.0) -> PerMotion:
    """How fast feet slide while they stand, m/s: mean horizontal speed of those in contact, NaN if none ever is.

    A foot is in contact as `foot_contacts` has it, however fast it is. A speed in m/s does not depend on the frame rate.
    Source: contact as in the foot-skating ratio of GMD (Karunratanakul et al., Guided Motion Diffusion, 2023: toes below 5 cm
    in both frames); own choice: the mean speed instead of the share of frames in which it exceeds 0.5 m/s, because
    a share hides how fast, and no threshold on speed, because a foot that slides is fast.

    Args:
        feet: joints that touch the floor: toes rather than ankles, which are higher than 5 cm when standing.
        fps: frames per second.
        up: the axis that points up, "y" or "z".
        floor: metres along that axis.

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
    stands = foot_contacts(joints, feet, fps, up=up, floor=floor)
    speed = joints[..., list(feet), :][..., [a, b]].diff(dim=-3).norm(dim=-1) * fps
    return (speed * stands).sum((-2, -1)) / stands.sum((-2, -1))


def bone_length_error(x: Moving, lengths: Float[Tensor, "*#lead bones"], skeleton: Skeleton) -> PerMotion:
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
        raise ValueError(
            f"x has {x.shape[-1]} numbers per frame and lengths {lengths.shape[-1]}; "
            f"expected {3 * len(skeleton)} and {len(skeleton) - 1} for {skeleton.name}"
        )
    joints = _joints(x)
    bones = bones_of((joints[..., 1:, :] - joints[..., :1, :]).flatten(-2), skeleton)
    return (bones.norm(dim=-1) - lengths.to(x)[..., None, :]).abs().mean((-2, -1))


def nearer_share(p: Samples, g: Truths, reference: Truths) -> PerWindow:
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


def _joints(x: Moving) -> Float[Tensor, "*lead T J 3"]:
    if x.shape[-1] % 3:
        raise ValueError(f"{x.shape[-1]} numbers per frame; expected a multiple of 3")
    return x.unflatten(-1, (-1, 3))


def _check(x: Tensor, frames: int) -> None:
    if x.ndim < 2 or x.shape[-2] < frames:
        raise ValueError(f"shape is {tuple(x.shape)}; expected (..., frames, numbers) with at least {frames} frames")
    _check_finite("x", x)


def _check_finite(name: str, x: Tensor) -> None:
    if not x.isfinite().all():
        raise ValueError(f"{name} is not finite at {(~x.isfinite()).nonzero()[0].tolist()}; expected finite numbers")
