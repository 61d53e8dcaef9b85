"""Conditions on a sampler: classifier-free and reconstruction guidance, masks over frames and channels, keyframes."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.diffusion.config import KeyframeConfig
from mwlib.diffusion.process import noised, y0_hat_of
from mwlib.diffusion.samplers import AfterStep, Denoise, Draw, OnEstimate, Schedule, ddim
from mwlib.settings import choice
from mwlib.transforms import Transform
from mwlib.transforms.linear import Coefficients, Motions

# True or 1 where a target holds, in between a mixture; over frames alone it is of every channel.
Mask = Bool[Tensor, "T C"] | Float[Tensor, "T C"] | Bool[Tensor, " T"] | Float[Tensor, " T"]


def known(x_target: Motions, mask: Mask) -> tuple[Float[Tensor, "T C"] | Float[Tensor, "T 1"], Motions]:
    """M as numbers that multiply motions; and the target where M is not 0, and 0 elsewhere, where it may be unknown (NaN)."""
    m = mask.to(x_target)
    m = m[:, None] if m.ndim == 1 else m
    return m, x_target.masked_fill(m == 0, 0)


def beside_samples(x: Coefficients, y: Float[Tensor, "... k l"]) -> Coefficients:
    """x with an axis for the samples that y has, where x has none."""
    return x.unsqueeze(-3) if x.ndim < y.ndim else x


def masked(tf: Transform, x_target: Motions, mask: Mask, noise: Draw, until: float = 1.0) -> AfterStep:
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
    m, x_known = known(x_target, mask)
    y0 = tf(x_known)
    lost = x_known - tf.inverse(y0)

    def impose(y: Coefficients, alpha_bar_prev: float) -> Coefficients:
        """Coefficients whose masked part is the known motion, as noisy as the rest."""
        if alpha_bar_prev > until:
            return y
        x_c = tf.inverse(noised(beside_samples(y0, y), noise(), alpha_bar_prev)) + alpha_bar_prev**0.5 * beside_samples(lost, y)
        return tf(m * x_c + (1 - m) * tf.inverse(y))

    return impose


def pasted(tf: Transform, x_target: Motions, mask: Mask) -> OnEstimate:
    """The clean target in place of the masked part of every clean estimate, as the `on_y0_hat` of a sampler.

    y0_hat <- tf(M x_target + (1-M) tf_inverse(y0_hat)); the sampler derives the noise anew from it. No second noise comes in.

    Args:
        tf, x_target, mask: as in `masked`.

    Source: MDM (Tevet et al., 2023), motion editing; CondMDI (Cohan et al., 2024), imputation.
    """
    m, x_known = known(x_target, mask)

    def paste(y0_hat: Coefficients) -> Coefficients:
        """Clean estimates whose masked part is the known motion."""
        return tf(m * beside_samples(x_known, y0_hat) + (1 - m) * tf.inverse(y0_hat))

    return paste


def history_completion(tf: Transform, x_padded: Motions, history: int, noise: Draw) -> AfterStep:
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


def classifier_free(conditional: Tensor, unconditional: Tensor, w: float, form: str = "eq7") -> Tensor:
    """Mix two noise estimates.

    Source: MotionWavelet Eq. 7, (1+w) cond - w uncond ("eq7"), or the last but one line of Algorithm 1,
    uncond + w (cond - uncond) ("alg1"). They are the same with w_alg1 = 1 + w_eq7.

    Raises:
        ValueError: unknown form.

    >>> conditional, unconditional = torch.tensor(2.0), torch.tensor(1.0)
    >>> classifier_free(conditional, unconditional, 0.5), classifier_free(conditional, unconditional, 1.5, "alg1")
    (tensor(2.5000), tensor(2.5000))
    """
    choice("form", form, ("eq7", "alg1"))
    if form == "eq7":
        return ((1 + w) * conditional).sub_(w * unconditional)
    return unconditional + w * (conditional - unconditional)


def reconstruction_guided(
    denoise: Denoise, tf: Transform, x_target: Motions, mask: Mask, alpha_bar: Schedule, weight: float
) -> Denoise:
    """A denoiser whose clean estimate is drawn to the masked part of a target, by the gradient through the network.

    y0_hat <- y0_hat - w sqrt(alpha_bar_t)/2 grad_{y_t} ||M (tf_inverse(y0_hat) - x_target)||^2; for the noise that is
    eps <- eps + w alpha_bar_t / (2 sqrt(1 - alpha_bar_t)) grad.

    Works inside `torch.inference_mode` and `torch.no_grad`; then whatever `denoise` holds that gradients pass through must
    have been made outside of inference mode, as weights are. No graph outlives a call, and no weight gets a gradient.

    Args:
        denoise: (y_t, t) -> eps, differentiable.
        tf: linear transform of motions.
        x_target, mask: as in `masked`; the target in metres, so that w depends on the unit.
        alpha_bar: schedule.
        weight: w; with 0 `denoise` itself is returned. Too large a weight diverges.

    Source: Ho et al. 2022, Video Diffusion Models, Sec. 3.1; CondMDI (Cohan et al., 2024).
    """
    if weight == 0:
        return denoise
    with torch.inference_mode(False):  # else the gradient could not use them
        m, x_known = (part.clone() for part in known(x_target, mask))

    def guided(y: Coefficients, t: int) -> Coefficients:
        """The noise, and the gradient of the error against the known motion."""
        a = float(alpha_bar[t])
        with torch.inference_mode(False), torch.enable_grad():
            y_t = y.clone().requires_grad_()
            eps = denoise(y_t, t)
            error = m * (tf.inverse(y0_hat_of(y_t, eps, a)) - beside_samples(x_known, y_t))
            (gradient,) = torch.autograd.grad(error.square().sum(), y_t)
        return eps.detach() + weight * a / (2 * (1 - a) ** 0.5) * gradient

    return guided


def keyframe_mask(frames: int, keyframes: Sequence[int]) -> Bool[Tensor, " T"]:
    """M over frames, true at the keyframes; negative numbers count from the end.

    Raises:
        ValueError: no keyframe, or one that the motion does not have.

    >>> keyframe_mask(5, [0, -1])
    tensor([ True, False, False, False,  True])
    """
    if not keyframes or not all(-frames <= k < frames for k in keyframes):
        raise ValueError(f"keyframes are {list(keyframes)}; expected one or more of {-frames} to {frames - 1}")
    mask = torch.zeros(frames, dtype=torch.bool)
    mask[list(keyframes)] = True
    return mask


def with_keyframes(x: Motions, x_target: Motions, mask: Mask) -> Motions:
    """x with the clean target in its masked part, to the bit: the paper's last step, concat_time(s, x_mid, e).

    Args:
        x: sampled motions.
        x_target, mask: as in `masked`.
    """
    m, x_known = known(x_target, mask)
    return m * beside_samples(x_known, x) + (1 - m) * x


def keyframed(
    denoise: Denoise,
    tf: Transform,
    x_target: Motions,
    mask: Mask,
    alpha_bar: Schedule,
    indices: Sequence[int],
    noise: Draw,
    how: KeyframeConfig,
) -> Motions:
    """The motion that DDIM makes of noise and that meets keyframes, by the scheme of the settings.

    With "replacement" this is the loop of FreqDiffusionBridge: whatever the network is asked about holds the keyframes at the
    level of the other frames, the first time, too; they are put in over time, and transformed with the rest. Schemes that hold
    the keyframes give them back to the bit. Own choice: the paper does not say how its last step ends. With the scheme "none" the
    keyframes stay as the sampler left them, near the target.

    Args:
        denoise: (y_t, t) -> eps of an unconditional model.
        tf, x_target, mask: as in `masked`. Any number of keyframes may stand anywhere.
        alpha_bar, indices: as in `ddim`.
        noise: draws a tensor like y; its first draw is the start.
        how: the scheme.

    Source: FreqDiffusionBridge, Sec. 3.4 (own reconstruction of its loop); RePaint (Lugmayr et al., 2022);
        MDM (Tevet et al., 2023); Video Diffusion Models (Ho et al., 2022).

    >>> from mwlib.diffusion import alpha_bar, ddim_indices, eps_of
    >>> tf, a, clip = mw.DCTTransform(6, 3), alpha_bar("cosine", 100), torch.randn(6, 3)
    >>> knows = lambda y, t: eps_of(y, tf(clip), a[t])  # a denoiser that has seen the answer
    >>> mask, noise = keyframe_mask(6, [0, -1]), lambda: torch.randn(2, 6, 3)
    >>> x = keyframed(knows, tf, clip, mask, a, ddim_indices(100, 5), noise, KeyframeConfig())
    >>> torch.equal(x[1, mask], clip[mask]), torch.allclose(x, clip.expand(2, 6, 3), atol=1e-4)
    (True, True)
    """
    denoise = reconstruction_guided(denoise, tf, x_target, mask, alpha_bar, how.reconstruction_weight)
    y, impose, paste = noise(), None, None
    if how.scheme == "replacement":
        drawn = noise() if how.keyframe_noise == "fixed" else None
        impose = masked(tf, x_target, mask, noise if drawn is None else lambda: drawn)
        y = impose(y, float(alpha_bar[indices[0]]))
    elif how.scheme == "paste":
        paste = pasted(tf, x_target, mask)
    random = {"eta": how.eta, "repeats": how.repeats, "noise": noise}
    *_, last = ddim(denoise, y, alpha_bar, indices, on_y0_hat=paste, after_step=impose, **random)
    x = tf.inverse(last.y)
    return x if how.scheme == "none" else with_keyframes(x, x_target, mask)
