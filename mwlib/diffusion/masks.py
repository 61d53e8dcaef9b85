"""Masks that impose part of a motion on every step of a sampler."""

from __future__ import annotations

from collections.abc import Callable

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.diffusion.process import noised
from mwlib.diffusion.samplers import AfterStep
from mwlib.transforms import Transform

Mask = Bool[Tensor, "T C"] | Float[Tensor, "T C"]  # True or 1 where a target holds, in between a mixture


def masked(
    tf: Transform, x_target: Float[Tensor, "... T C"], mask: Mask, noise: Callable[[], Tensor], until: float = 1.0
) -> AfterStep:
    """Eq. 12 and 13 as the `after_step` of a sampler: the masked part of the motion is the noisy target's.

    y_c = sqrt(a) DWT(x_target) + sqrt(1-a) z (Eq. 12), x_c = iDWT(y_c), x' = M x_c + (1-M) iDWT(y) (Eq. 13), and DWT(x')
    goes on. The paper's Eq. 12 mixes alpha_bar of t and of t-1; here both are that of the index reached. With a = 1 the
    masked part is the target itself, to rounding.

    Args:
        tf: transform of motions; an axis for the samples may be missing in x_target.
        x_target: the motion to impose, in the frame of reference of tf's coefficients (see `Representation.origin`).
        mask: M.
        noise: draws a tensor like y, anew at every step.
        until: largest alpha_bar at which it acts; 1 = to the last step.
    """
    y0 = tf(x_target)
    m = mask.to(y0)

    def impose(y: Float[Tensor, "... rows columns"], alpha_bar_prev: float) -> Float[Tensor, "... rows columns"]:
        if alpha_bar_prev > until:
            return y
        clean = y0.unsqueeze(-3) if y0.ndim < y.ndim else y0
        x_c = tf.inverse(noised(clean, noise(), alpha_bar_prev))
        return tf(m * x_c + (1 - m) * tf.inverse(y))

    return impose


def history_completion(
    tf: Transform, x_padded: Float[Tensor, "... T C"], history: int, noise: Callable[[], Tensor]
) -> Callable[[Tensor, float], Tensor]:
    """HumanMAC's mask completion, as the `after_step` of a sampler: observed frames are put back after every step.

    y0 = tf(x_padded) is noised to the step's alpha_bar; in the time domain its first H frames replace those of y. With
    alpha_bar = 1 they are the history itself if tf loses nothing, and what tf keeps of it otherwise (DCT with L < T rows).

    Args:
        tf: any linear transform of motions.
        x_padded: history stretched to T frames (`pad_history`), metres. An axis for the samples may be missing.
        history: H, observed frames.
        noise: draws a tensor like y, anew at every step.

    Source: HumanMAC (Chen et al., 2023), "DCT-Completion".
    """
    mask = (torch.arange(x_padded.shape[-2]) < history)[:, None].expand(x_padded.shape[-2:])
    return masked(tf, x_padded, mask, noise)
