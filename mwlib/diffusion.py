"""The forward process and the three things a network may be asked to predict."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def _signal_noise(alpha_bar_t: Tensor | float, like: Tensor) -> tuple[Tensor, Tensor]:
    """sqrt(alpha_bar_t) and sqrt(1 - alpha_bar_t), trailing axes added so that they multiply `like`."""
    a = torch.as_tensor(alpha_bar_t, dtype=torch.float64, device=like.device)
    a = a.reshape(a.shape + (1,) * (like.ndim - a.ndim))
    return a.sqrt().to(like.dtype), (1 - a).sqrt().to(like.dtype)


def noised(y: Float[Tensor, "... K D"], eps: Float[Tensor, "... K D"], alpha_bar_t: Tensor | float) -> Float[Tensor, "... K D"]:
    """y_t = sqrt(alpha_bar_t) y + sqrt(1 - alpha_bar_t) eps: t forward steps at once (Sec. 3.2.2; Ho et al. 2020, Eq. 4)."""
    signal, noise = _signal_noise(alpha_bar_t, y)
    return signal * y + noise * eps


def target(prediction: str, y: Tensor, eps: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """What the network should say: "eps" (Eq. 5), "x0" (the clean latent) or "v" (Salimans and Ho, 2022).

    Raises:
        ValueError: another name.
    """
    if prediction == "eps":
        return eps
    if prediction == "x0":
        return y
    if prediction == "v":
        signal, noise = _signal_noise(alpha_bar_t, y)
        return signal * eps - noise * y
    raise ValueError(f"prediction is {prediction!r}; expected 'eps', 'x0' or 'v'")


def to_eps(prediction: str, output: Tensor, y_t: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """The noise that a network output of the given kind stands for."""
    if prediction == "eps":
        return output
    signal, noise = _signal_noise(alpha_bar_t, y_t)
    if prediction == "x0":
        return (y_t - signal * output) / noise
    if prediction == "v":
        return signal * output + noise * y_t
    raise ValueError(f"prediction is {prediction!r}; expected 'eps', 'x0' or 'v'")


def clean_estimate(y_t: Tensor, eps: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """y0_hat = (y_t - sqrt(1 - alpha_bar_t) eps) / sqrt(alpha_bar_t)."""
    signal, noise = _signal_noise(alpha_bar_t, y_t)
    return (y_t - noise * eps) / signal


def eps_of(y_t: Tensor, y0_hat: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """The noise that leads from y0_hat to y_t: the inverse of `clean_estimate`."""
    return to_eps("x0", y0_hat, y_t, alpha_bar_t)
