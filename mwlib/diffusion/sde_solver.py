"""DPM-Solver++(2M) on Karras' noise levels, with and without noise: few steps, as StableMoFusion samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Literal

import numpy as np
from jaxtyping import Float
from torch import Tensor

from mwlib.diffusion.process import eps_of, y0_hat_of
from mwlib.diffusion.samplers import AfterStep, Denoise, OnEstimate, Step

RHO = 7.0  # Karras et al. 2022, Sec. 3


def karras_levels(alpha_bar: Float[Tensor, " M"], steps: int) -> list[tuple[int, float]]:
    """For each step the diffusion index that the network is told, and the alpha_bar of the state.

    Levels sigma = sqrt((1 - alpha_bar) / alpha_bar) go from the schedule's largest to its smallest, evenly in sigma^(1/7). They
    lie between those of whole indices; the index is interpolated in log sigma and rounded to a whole one (halves to even ones),
    so that neighbours can have the same. Only the network sees the index: the state has the level itself.

    Source: Karras et al. 2022, Eq. 5; the rounding is that of diffusers, which however leaves indices of its own cosine schedule
    as fractions; here all networks take whole ones.

    Args:
        alpha_bar: schedule, float64, falling.
        steps: of the sampler; any number.

    Raises:
        ValueError: fewer steps than one.

    >>> from mwlib.diffusion import alpha_bar
    >>> [t for t, _ in karras_levels(alpha_bar("linear", 1000), 5)]
    [999, 843, 593, 142, 0]
    """
    if steps < 1:
        raise ValueError(f"steps is {steps}; expected at least 1")
    a = alpha_bar.double().cpu().numpy()
    of_index = np.sqrt((1 - a) / a)
    sigma = np.linspace(of_index[-1] ** (1 / RHO), of_index[0] ** (1 / RHO), steps) ** RHO
    index = np.interp(np.log(sigma), np.log(of_index), np.arange(len(a))).round()
    return [(int(t), float(level)) for t, level in zip(index, 1 / (1 + sigma**2), strict=True)]


def sde_dpm_solver(
    denoise: Denoise,
    y: Float[Tensor, "..."],
    alpha_bar: Float[Tensor, " M"],
    steps: int,
    *,
    noise: Callable[[], Tensor] | None,
    read_at: Literal["index", "level"] = "index",
    on_y0_hat: OnEstimate | None = None,
    after_step: AfterStep | None = None,
) -> Iterator[Step]:
    """SDE-DPM-Solver++(2M): each step goes on with the line through two clean estimates and draws part of its noise anew.

    With lambda = log(sqrt(a) / sqrt(1 - a)), h a step's length in it, s = sqrt(1 - a) and D the clean estimate extrapolated to
    the middle of the step:

        y_prev = s_prev / s e^-h y + sqrt(a_prev) (1 - e^-2h) D + s_prev sqrt(1 - e^-2h) z.

    Without noise e^-h is left out of the first factor and 2h is h: `dpm_solver` on other levels. The first step has no previous
    estimate, and the last has no finite length and ends at its clean estimate.

    Source: Lu et al. 2022, DPM-Solver++, Algorithm 2 and its appendix on the SDE, as diffusers has it ("sde-dpmsolver++",
    use_karras_sigmas, final sigma zero); StableMoFusion samples so, with 10 steps.

    Args:
        denoise: (y_t, t) -> eps.
        y: start, noise.
        alpha_bar: schedule, float64.
        steps: any number, see `karras_levels`.
        noise: draws a tensor like y, once a step but for the last; None for the solver without noise.
        read_at: the level at which eps is read as a clean estimate. "index": that of the index told, right for networks that say
            y0 or v and were turned to eps by `to_eps` there (diffusers' prediction_type "sample"). "level": that of the state, as
            diffusers does for networks that say eps.
        on_y0_hat, after_step: as in `ddim`.

    Yields:
        `Step` with the index told, the clean estimate as the network gave it (after `on_y0_hat`), and the noise that leads from
        it to the state.

    >>> from mwlib.diffusion import alpha_bar
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> knows = lambda y, t: eps_of(y, clean, a[t])  # a denoiser that has seen the answer
    >>> *_, last = sde_dpm_solver(knows, torch.randn(4, 3), a, 5, noise=lambda: torch.randn(4, 3))
    >>> torch.allclose(last.y, clean, atol=1e-5)
    True
    """
    if read_at not in ("index", "level"):
        raise ValueError(f"read_at is {read_at!r}; expected 'index' or 'level'")
    levels = karras_levels(alpha_bar, steps)
    h_last, last = 0.0, None  # length of the last step in lambda, and the clean estimate that it started from
    for number, (t, a) in enumerate(levels):
        y0_hat = y0_hat_of(y, denoise(y, t), float(alpha_bar[t]) if read_at == "index" else a)
        if on_y0_hat is not None:
            y0_hat = on_y0_hat(y0_hat)
        eps, a_prev = eps_of(y, y0_hat, a), 1.0
        if number + 1 == len(levels):
            y = y0_hat
        else:
            a_prev = levels[number + 1][1]
            h = 0.5 * math.log(a_prev * (1 - a) / (a * (1 - a_prev)))
            denoised_d = y0_hat if last is None else y0_hat + h / (2 * h_last) * (y0_hat - last)
            y = _stepped(y, denoised_d, (1 - a) ** 0.5, a_prev, h, noise)
            h_last, last = h, y0_hat
        if after_step is not None:
            y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)


def _stepped(y: Tensor, denoised: Tensor, s: float, a_prev: float, h: float, noise: Callable[[], Tensor] | None) -> Tensor:
    """One step of length h from noise of deviation s to alpha_bar a_prev."""
    s_prev = (1 - a_prev) ** 0.5
    if noise is None:
        return s_prev / s * y - a_prev**0.5 * math.expm1(-h) * denoised
    drawn = -math.expm1(-2 * h)  # share of the variance
    return s_prev / s * math.exp(-h) * y + a_prev**0.5 * drawn * denoised + s_prev * drawn**0.5 * noise()
