"""Control of a prediction by masks over joints and frames: joint-level control, motion switching, filled gaps."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.diffusion import Mask, OnEstimate, masked, pasted
from mwlib.prediction.predictor import Predictor
from mwlib.settings import choice

_STREAM = 1912  # own stream of noise beside the sampler's


def joint_mask(skeleton: Skeleton, parts: Sequence[str], frames: int) -> Bool[Tensor, "T C"]:
    """M of joint-level control: the channels of some body parts or joints, in every frame.

    Source: MotionWavelet Sec. 4.6.1. Own reading: C there is a set of joints and M is over channels: a joint stands for three.

    Raises:
        ValueError: the skeleton has no such part or joint; the message lists its parts.
    """
    mask = torch.zeros(frames, 3 * (len(skeleton) - 1), dtype=torch.bool)
    for part in parts:
        mask[:, skeleton.channels(part)] = True
    return mask


def frame_mask(frames: int, channels: int, first: int, last: int | None = None) -> Bool[Tensor, "T C"]:
    """M over frames first to last - 1 (None: to the end), every channel.

    Source: MotionWavelet Sec. 4.6.2: motion switching prescribes the target's last frames. A gap to be filled is the
    complement.

    Raises:
        ValueError: the range is empty or leaves the motion.
    """
    last = frames if last is None else last
    if not 0 <= first < last <= frames:
        raise ValueError(f"frames {first} to {last}; expected a range within 0 to {frames}")
    mask = torch.zeros(frames, channels, dtype=torch.bool)
    mask[first:last] = True
    return mask


def feathered(mask: Bool[Tensor, "T C"], frames: int) -> Float[Tensor, "T C"]:
    """M that rises and falls as half a cosine within so many frames before and after each prescribed stretch.

    Own choice: the paper's M is 0 or 1. There the target must be given, too; it counts as far as M says.
    """
    soft = mask.float()
    for k in range(1, frames + 1):
        height = 0.5 + 0.5 * math.cos(math.pi * k / (frames + 1))
        soft[:-k] = soft[:-k].maximum(height * mask[k:])
        soft[k:] = soft[k:].maximum(height * mask[:-k])
    return soft


@torch.inference_mode()
def controlled(
    predictor: Predictor,
    x_target: Float[Tensor, "N T C"],
    mask: Mask,
    samples: int | None = None,
    seed: int | None = None,
    *,
    x_history: Float[Tensor, "N H C"] | None = None,
    active: float = 0.9,
    space: str = "y_t",
) -> Float[Tensor, "N S T C"]:
    """Sampled whole motions whose masked part follows a target.

    Source: MotionWavelet Sec. 4.6; Appendix A: the mask acts in the first 90 of 100 steps. With `active` = 1 it acts in the
    last one too, with the clean target: then the constraint is missed by no more than the transform loses, which is nothing
    for the paper's and some millimetres for one that leaves out details.

    Bones are as long as they come, whatever the settings say: a prescribed joint stays where it is prescribed.

    Args:
        predictor: a trained model.
        x_target: where the mask is not 0, what is to happen, metres; elsewhere its values do not matter.
        mask: over frames and channels, hard (0 or 1) or feathered.
        samples: S; None = the predictor's settings.
        seed: of the noise; None = the predictor's settings. A window's result depends on it and the window's number.
        x_history: observed frames; None = the first H frames of x_target.
        active: share of the steps, counted from the first, in which the mask acts.
        space: "y_t", Eq. 12 and 13; or "y0_hat" (own choice): the target replaces the masked part of every clean estimate, and
            no second noise comes in. Two noises meet at the mask's border: in coefficients of unit deviation that makes time
            details many times larger than any the network was trained on.

    Raises:
        ValueError: the shapes of target and mask do not fit, the mask leaves 0 to 1, the target is not finite under it, `active`
            is not a share, or the model turns motions by their heading and the mask treats the coordinates of a joint apart.
    """
    _check(x_target, mask, active, space)
    representation, indices, joints = predictor.representation, predictor.indices(), mask.unflatten(-1, (-1, 3))
    if representation.facing and (joints != joints[..., :1]).any():
        raise ValueError("the mask treats coordinates of a joint apart; expected whole joints, as the model turns motions")
    samples, seed = predictor.asked(samples, seed)
    count = round(active * len(indices))
    reached = [-1.0, *predictor.alpha_bar[indices[1:]].tolist(), 1.0]  # alpha_bar after so many steps
    own = int(np.random.SeedSequence((seed, _STREAM)).generate_state(1)[0])

    def imposed(part: slice, history: Tensor) -> dict[str, Any]:
        """Hooks of the sampler for a part of the windows."""
        target = representation.modelled(x_target[part].to(history), history)
        if space == "y0_hat":
            return {"on_y0_hat": _first(pasted(predictor.transform, target, mask), count)}
        noise = predictor.noise(own, range(len(x_target))[part], samples)
        return {"after_step": masked(predictor.transform, target, mask, noise, reached[count])}

    past = x_target[:, : representation.history] if x_history is None else x_history
    parts = predictor.sampled(past, samples, seed, imposed=imposed)
    return torch.cat([representation.decode(y, history).cpu() for y, history in parts])


def _check(x_target: Tensor, mask: Mask, active: float, space: str) -> None:
    if mask.shape != x_target.shape[1:]:
        raise ValueError(f"mask has shape {tuple(mask.shape)}; expected {tuple(x_target.shape[1:])}, frames and channels")
    if not 0 <= mask.min() <= mask.max() <= 1:
        raise ValueError(f"mask has values from {float(mask.min()):g} to {float(mask.max()):g}; expected 0 to 1")
    if not x_target[:, mask > 0].isfinite().all():
        raise ValueError("x_target is not finite where the mask holds; expected metres")
    choice("space", space, ("y_t", "y0_hat"))
    if not 0 <= active <= 1:
        raise ValueError(f"active is {active}; expected 0 to 1")


def _first(function: OnEstimate, steps: int) -> OnEstimate:
    """The function in the first so many calls, one a step."""
    left = iter([True] * steps)
    return lambda y: function(y) if next(left, False) else y


def constraint_error(p: Float[Tensor, "N S T C"], x_target: Float[Tensor, "N T C"], mask: Mask) -> Float[Tensor, "N S"]:
    """Mean distance of the prescribed coordinates (M = 1) from the target, metres per coordinate (root mean square)."""
    return (p - x_target[:, None])[..., mask == 1].square().mean(dim=-1).sqrt()


def seam(x: Float[Tensor, "... T C"], frame: int, fps: float, ramp: int = 0) -> dict[str, Float[Tensor, "..."]]:
    """How hard a motion is at a border between frames, averaged over joints; set beside the same of real motion.

    Args:
        x: motions, metres.
        frame: first frame after the border, at most T - 2.
        fps: frames per second.
        ramp: for feathered masks; the largest value counts of the borders before frames `frame - ramp` to `frame`.

    Returns:
        "jump" (m), distance from the frame before; "velocity" (m/s), change of velocity across the border; "jerk" (m/s³),
        third difference across it.

    Raises:
        ValueError: too near an end.
    """
    if ramp < 0 or not 2 + ramp <= frame <= x.shape[-2] - 2:
        raise ValueError(f"frame is {frame} and ramp {ramp}; expected a frame from {2 + max(ramp, 0)} to {x.shape[-2] - 2}")
    joints = x[..., frame - ramp - 2 : frame + 2, :].unflatten(-1, (-1, 3))
    steps = joints.diff(dim=-3)
    found = {
        "jump": steps[..., 1:-1, :, :],
        "velocity": (steps[..., 2:, :, :] - steps[..., :-2, :, :]) * fps,
        "jerk": joints.diff(n=3, dim=-3) * fps**3,
    }
    return {name: value.norm(dim=-1).mean(dim=-1).amax(dim=-1) for name, value in found.items()}
