"""Guidance that any diffusion model can use."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.diffusion.masks import Mask, beside_samples, known, weights
from mwlib.diffusion.process import y0_hat_of
from mwlib.diffusion.samplers import Denoise
from mwlib.transforms import Transform


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
    if form == "eq7":
        return ((1 + w) * conditional).sub_(w * unconditional)
    if form == "alg1":
        return unconditional + w * (conditional - unconditional)
    raise ValueError(f"form is {form!r}; expected 'eq7' or 'alg1'")


def reconstruction_guided(
    denoise: Denoise,
    tf: Transform,
    x_target: Float[Tensor, "... T C"],
    mask: Mask,
    alpha_bar: Float[Tensor, " M"],
    weight: float,
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
        m, x_known = weights(mask, x_target).clone(), known(x_target, mask).clone()

    def guided(y: Float[Tensor, "... rows columns"], t: int) -> Float[Tensor, "... rows columns"]:
        a = float(alpha_bar[t])
        with torch.inference_mode(False), torch.enable_grad():
            y_t = y.clone().requires_grad_()
            eps = denoise(y_t, t)
            error = m * (tf.inverse(y0_hat_of(y_t, eps, a)) - beside_samples(x_known, y_t))
            (gradient,) = torch.autograd.grad(error.square().sum(), y_t)
        return eps.detach() + weight * a / (2 * (1 - a) ** 0.5) * gradient

    return guided
