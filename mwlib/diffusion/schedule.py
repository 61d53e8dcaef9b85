"""Noise schedules and step subsets: arrays only."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def _cosine(u: Tensor) -> Tensor:
    return torch.cos((u + 0.008) / 1.008 * torch.pi / 2) ** 2


def _sqrt(u: Tensor) -> Tensor:
    return 1 - torch.sqrt(u + 1e-4)


def _sigmoid(u: Tensor) -> Tensor:
    start, end, tau = -3.0, 3.0, 0.7
    low, high = torch.sigmoid(torch.tensor([start / tau, end / tau], dtype=u.dtype))
    return (high - torch.sigmoid((u * (end - start) + start) / tau)) / (high - low)


# Continuous alpha_bar at u in [0, 1]; "linear" is given by its betas instead.
CURVES = {"cosine": _cosine, "sigmoid": _sigmoid, "sqrt": _sqrt}
SCHEDULES = ("linear", *CURVES)


def alpha_bar(kind: str, steps: int) -> Float[Tensor, " steps"]:
    """Share of signal power that is left after each of the noising steps, float64, falling.

    Source: Ho et al. 2020 (linear), Nichol and Dhariwal 2021 (cosine), Jabri et al. 2022 (sigmoid), Li et al. 2022
    (sqrt), with HumanMAC's constants: beta_i = clip(1 - alpha_bar(i/M) / alpha_bar((i-1)/M), 0, 0.999) and
    alpha_bar_t the running product of 1 - beta.

    Args:
        kind: "linear", "cosine", "sigmoid" or "sqrt".
        steps: M, number of noising steps.

    Raises:
        ValueError: unknown kind or fewer than one step.

    >>> [round(float(a), 3) for a in alpha_bar("cosine", 1000)[[0, 499, 899]]]
    [1.0, 0.494, 0.024]
    """
    if steps < 1:
        raise ValueError(f"steps is {steps}; expected at least 1")
    if kind == "linear":
        beta = torch.linspace(1e-4, 0.02, steps, dtype=torch.float64) * (1000 / steps)
    elif kind in CURVES:
        curve = CURVES[kind](torch.arange(steps + 1, dtype=torch.float64) / steps)
        beta = 1 - curve[1:] / curve[:-1]
    else:
        raise ValueError(f"kind is {kind!r}; expected one of {', '.join(SCHEDULES)}")
    return torch.cumprod(1 - beta.clamp(0, 0.999), dim=0)


def ddim_indices(steps: int, subset: int, spacing: str = "leading") -> list[int]:
    """The retained diffusion indices, falling.

    Args:
        steps: M, the schedule's length.
        subset: number of denoising steps.
        spacing: "leading" as HumanMAC (M=1000, 100 steps: 991, 981, ..., 1) or "trailing" (own choice for few
            steps: starts at M-1, where the state really is noise).

    Raises:
        ValueError: unknown spacing, or subset not between 1 and steps.

    >>> ddim_indices(1000, 4), ddim_indices(1000, 4, "trailing")
    ([751, 501, 251, 1], [999, 749, 499, 249])
    """
    if not 1 <= subset <= steps:
        raise ValueError(f"subset is {subset}; expected 1 to {steps}")
    if spacing == "leading":
        offset = 1 if subset < steps else 0
        return [i * (steps // subset) + offset for i in reversed(range(subset))]
    if spacing == "trailing":
        return [round((i + 1) * steps / subset) - 1 for i in reversed(range(subset))]
    raise ValueError(f"spacing is {spacing!r}; expected 'leading' or 'trailing'")
