"""Masks that impose part of a motion on every step of a sampler."""

from __future__ import annotations

from collections.abc import Callable

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.diffusion.process import noised
from mwlib.diffusion.samplers import AfterStep, OnEstimate
from mwlib.transforms import Transform

# True or 1 where a target holds, in between a mixture; over frames alone it is of every channel.
Mask = Bool[Tensor, "T C"] | Float[Tensor, "T C"] | Bool[Tensor, " T"] | Float[Tensor, " T"]


def weights(mask: Mask, like: Tensor) -> Float[Tensor, "T C"] | Float[Tensor, "T 1"]:
    """M as numbers that multiply motions like `like`."""
    m = mask.to(like)
    return m[:, None] if m.ndim == 1 else m


def known(x_target: Float[Tensor, "... T C"], mask: Mask) -> Float[Tensor, "... T C"]:
    """The target where the mask is not 0, and 0 elsewhere, where it may be unknown (NaN)."""
    return x_target.masked_fill(weights(mask, x_target) == 0, 0)


def beside_samples(x: Float[Tensor, "... rows columns"], y: Float[Tensor, "... k l"]) -> Float[Tensor, "... rows columns"]:
    """x with an axis for the samples that y has, where x has none."""
    return x.unsqueeze(-3) if x.ndim < y.ndim else x


def masked(
    tf: Transform, x_target: Float[Tensor, "... T C"], mask: Mask, noise: Callable[[], Tensor], until: float = 1.0
) -> AfterStep:
    """Eq. 12 and 13 as the `after_step` of a sampler: the masked part of the motion is the noisy target's.

    y_c = sqrt(a) DWT(x_target) + sqrt(1-a) z (Eq. 12), x_c = iDWT(y_c), x' = M x_c + (1-M) iDWT(y) (Eq. 13), and DWT(x')
    goes on. The paper's Eq. 12 mixes alpha_bar of t and of t-1; here both are that of the index reached. With a = 1 the
    masked part is the target itself, to rounding.

    Own choice where tf loses something (DCT with L < T rows): the noise is what tf can hold, but the target enters x_c whole,
    so that nothing depends on what x_target says outside of the mask. What tf cannot hold is lost in DWT(x').

    Args:
        tf: transform of motions; an axis for the samples may be missing in x_target.
        x_target: the motion to impose, in the frame of reference of tf's coefficients (see `Representation.origin`); where M
            is 0 its values do not matter.
        mask: M.
        noise: draws a tensor like y, anew at every step.
        until: largest alpha_bar at which it acts; 1 = to the last step.
    """
    m, x_known = weights(mask, x_target), known(x_target, mask)
    y0 = tf(x_known)
    lost = x_known - tf.inverse(y0)

    def impose(y: Float[Tensor, "... rows columns"], alpha_bar_prev: float) -> Float[Tensor, "... rows columns"]:
        if alpha_bar_prev > until:
            return y
        x_c = tf.inverse(noised(beside_samples(y0, y), noise(), alpha_bar_prev)) + alpha_bar_prev**0.5 * beside_samples(lost, y)
        return tf(m * x_c + (1 - m) * tf.inverse(y))

    return impose


def pasted(tf: Transform, x_target: Float[Tensor, "... T C"], mask: Mask) -> OnEstimate:
    """The clean target in place of the masked part of every clean estimate, as the `on_y0_hat` of a sampler.

    y0_hat <- tf(M x_target + (1-M) tf_inverse(y0_hat)); the sampler derives the noise anew from it. No second noise comes in.

    Args:
        tf, x_target, mask: as in `masked`.

    Source: MDM (Tevet et al., 2023), motion editing; CondMDI (Cohan et al., 2024), imputation.
    """
    m, x_known = weights(mask, x_target), known(x_target, mask)

    def paste(y0_hat: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        return tf(m * beside_samples(x_known, y0_hat) + (1 - m) * tf.inverse(y0_hat))

    return paste


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
    mask = torch.arange(x_padded.shape[-2]) < history
    return masked(tf, tf.inverse(tf(x_padded)), mask, noise)
