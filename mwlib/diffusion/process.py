"""The forward process and the three things a network may be asked to predict."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def _signal_noise(alpha_bar_t: Tensor | float, like: Tensor) -> tuple[Tensor, Tensor]:
    """sqrt(alpha_bar_t) and sqrt(1 - alpha_bar_t), trailing axes added so that they multiply `like`."""
    a = torch.as_tensor(alpha_bar_t, dtype=torch.float64)
    a = a.reshape(a.shape + (1,) * (like.ndim - a.ndim))
    return _like(a.sqrt(), like), _like((1 - a).sqrt(), like)


def _like(a: Tensor, like: Tensor) -> Tensor:
    """In like's precision first, then on its device: not every device has float64."""
    return a.to(like.dtype).to(like.device)


def noised(
    y: Float[Tensor, "... rows columns"], eps: Float[Tensor, "... rows columns"], alpha_bar_t: Tensor | float
) -> Float[Tensor, "... rows columns"]:
    """y_t = sqrt(alpha_bar_t) y + sqrt(1 - alpha_bar_t) eps: t forward steps at once (Sec. 3.2.2; Ho et al. 2020, Eq. 4).

    >>> y, eps = torch.ones(2, 3), torch.zeros(2, 3)
    >>> noised(y, eps, 0.25)
    tensor([[0.5000, 0.5000, 0.5000],
            [0.5000, 0.5000, 0.5000]])
    """
    signal, noise = _signal_noise(alpha_bar_t, y)
    return signal * y + noise * eps


def network_target(prediction: str, y: Tensor, eps: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """What the network should say: "eps" (Eq. 5), "y0" (the clean coefficients) or "v" (Salimans and Ho, 2022).

    Raises:
        ValueError: another name.

    >>> y, eps = torch.tensor([1.0]), torch.tensor([2.0])
    >>> [float(network_target(kind, y, eps, 0.36)) for kind in ("eps", "y0")]
    [2.0, 1.0]
    >>> round(float(network_target("v", y, eps, 0.36)), 3)  # 0.6 eps - 0.8 y
    0.4
    """
    if prediction == "eps":
        return eps
    if prediction == "y0":
        return y
    if prediction == "v":
        signal, noise = _signal_noise(alpha_bar_t, y)
        return signal * eps - noise * y
    raise ValueError(f"prediction is {prediction!r}; expected 'eps', 'y0' or 'v'")


def to_eps(prediction: str, output: Tensor, y_t: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """The noise that a network output of the given kind stands for.

    >>> y, eps = torch.ones(2, 3), torch.randn(2, 3)
    >>> output = network_target("v", y, eps, 0.36)
    >>> torch.allclose(to_eps("v", output, noised(y, eps, 0.36), 0.36), eps, atol=1e-6)
    True
    """
    if prediction == "eps":
        return output
    signal, noise = _signal_noise(alpha_bar_t, y_t)
    if prediction == "y0":
        return (y_t - signal * output) / noise
    if prediction == "v":
        return signal * output + noise * y_t
    raise ValueError(f"prediction is {prediction!r}; expected 'eps', 'y0' or 'v'")


def y0_hat_of(y_t: Tensor, eps: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """y0_hat = (y_t - sqrt(1 - alpha_bar_t) eps) / sqrt(alpha_bar_t).

    >>> y, eps = torch.ones(2, 3), torch.randn(2, 3)
    >>> torch.allclose(y0_hat_of(noised(y, eps, 0.36), eps, 0.36), y, atol=1e-6)
    True
    """
    signal, noise = _signal_noise(alpha_bar_t, y_t)
    return (y_t - noise * eps) / signal


def eps_of(y_t: Tensor, y0_hat: Tensor, alpha_bar_t: Tensor | float) -> Tensor:
    """The noise that leads from y0_hat to y_t: the inverse of `y0_hat_of`.

    >>> y, eps = torch.ones(2, 3), torch.randn(2, 3)
    >>> torch.allclose(eps_of(noised(y, eps, 0.36), y, 0.36), eps, atol=1e-6)
    True
    """
    return to_eps("y0", y0_hat, y_t, alpha_bar_t)
