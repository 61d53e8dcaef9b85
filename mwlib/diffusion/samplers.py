"""Reverse processes as flat generators in paper notation, and the noise that they draw.

They know nothing of wavelets or guidance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.diffusion.process import eps_of, noised, y0_hat_of
from mwlib.settings import whole


class WindowNoise:
    """Gaussian noise with one stream per window, so that chunking windows cannot change any number.

    Own choice: drawn on the CPU whatever the device, so that a seed means the same everywhere; or, if told so, where it is
    wanted, which is faster and gives other numbers on each kind of device.

    Args:
        seed: of the whole draw.
        windows: identity of each window in this chunk.
        shape: of one window: (S, rows, columns).
        device: where the noise is wanted.
        source: where it is drawn.

    >>> three, last = WindowNoise(0, [0, 1, 2], (4, 5)), WindowNoise(0, [2], (4, 5))
    >>> torch.equal(three()[2:], last())
    True
    """

    def __init__(
        self,
        seed: int,
        windows: Sequence[int],
        shape: tuple[int, ...],
        device: torch.device | str = "cpu",
        source: torch.device | str = "cpu",
    ) -> None:
        seeds = (int(np.random.SeedSequence((seed, int(w))).generate_state(1)[0]) for w in windows)
        self.generators = [torch.Generator(source).manual_seed(s) for s in seeds]
        self.shape, self.device, self.source = shape, device, source

    def __call__(self) -> Float[Tensor, "N *item"]:
        """The next draw."""
        draws = torch.empty(len(self.generators), *self.shape, device=self.source)
        for row, generator in zip(draws, self.generators, strict=True):
            row.normal_(generator=generator)
        return draws.to(self.device)


Denoise = Callable[[Tensor, int], Tensor]  # y_t, t -> eps
OnEstimate = Callable[[Tensor], Tensor]  # y0_hat -> y0_hat
AfterStep = Callable[[Tensor, float], Tensor]  # y, its alpha_bar -> y
Schedule = Float[Tensor, " M"]  # alpha_bar of each index
Draw = Callable[[], Tensor]  # the next noise
Values = Float[Tensor, "..."]


class Step(NamedTuple):
    """One reverse step: the index it left, the coefficients it reached, the clean estimate and noise it used."""

    t: int
    y: Tensor
    y0_hat: Tensor
    eps: Tensor


def _levels(alpha_bar: Tensor, indices: Sequence[int], levels: Sequence[float] | None = None) -> list[tuple[int, float, float]]:
    """Index, alpha_bar there (or the given level), and that which the step goes to; after the last step it is 1 (own choice)."""
    here = [float(alpha_bar[t]) for t in indices] if levels is None else [*levels]
    return list(zip(indices, here, [*here[1:], 1.0], strict=True))


def _estimate(
    denoise: Denoise, y: Tensor, t: int, a: float, alpha_bar: Schedule, on_y0_hat: OnEstimate | None
) -> tuple[Tensor, Tensor]:
    """Clean estimate and noise at index t; the noise is what leads from the estimate to y.

    Args:
        a: alpha_bar of y.
        alpha_bar: at index t the network's noise is read as a clean estimate.
        on_y0_hat: changes the estimate.
    """
    eps, told = denoise(y, t), float(alpha_bar[t])
    y0_hat = y0_hat_of(y, eps, told)
    if on_y0_hat is not None:
        y0_hat = on_y0_hat(y0_hat)
    if on_y0_hat is not None or told != a:
        eps = eps_of(y, y0_hat, a)
    return y0_hat, eps


def ddim(
    denoise: Denoise,
    y: Values,
    alpha_bar: Schedule,
    indices: Sequence[int],
    *,
    eta: float = 0.0,
    repeats: int = 1,
    noise: Draw | None = None,
    on_y0_hat: OnEstimate | None = None,
    after_step: AfterStep | None = None,
) -> Iterator[Step]:
    """DDIM over any falling subset of indices; the last item holds the sample.

    Source: Song et al. 2021, Eq. 12; MotionWavelet Sec. 3.2.2 names it. eta = 0 is deterministic, eta = 1 over all
    indices is DDPM with the posterior variance.

    Args:
        denoise: (y_t, t) -> eps.
        y: start, noise at `indices[0]`.
        alpha_bar: schedule, float64.
        indices: falling diffusion indices, see `schedule.ddim_indices`.
        eta: share of the posterior deviation that is drawn anew.
        repeats: r, how often each step is taken. Between two times the result, `after_step` included, is noised from where it
            came to back to where it left, so that what `after_step` imposes and the rest can come to terms. Source: RePaint
            (Lugmayr et al., 2022), Algorithm 1, with jumps of one step; own choice: the last step is repeated, too. One item
            is yielded for all times.
        noise: draws a tensor like y; needed when eta > 0 or repeats > 1.
        on_y0_hat: applied to every clean estimate (e.g. a bound); eps is then re-derived from its result.
        after_step: (coefficients, their alpha_bar) -> coefficients, applied after every step (manifold shaping, masks).

    Raises:
        ValueError: eta > 0 or repeats > 1 without a noise source, or fewer repeats than one.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> knows = lambda y, t: eps_of(y, clean, a[t])  # a denoiser that has seen the answer
    >>> *_, last = ddim(knows, torch.randn(4, 3), a, ddim_indices(100, 5))
    >>> last.t, torch.allclose(last.y, clean, atol=1e-5)
    (1, True)
    """
    if eta > 0 and noise is None:
        raise ValueError(f"eta is {eta}; expected a noise source with it")
    if repeats < 1 or (repeats > 1 and noise is None):
        raise ValueError(f"repeats is {repeats}; expected at least 1, and a noise source with more")
    for t, a, a_prev in _levels(alpha_bar, indices):
        sigma = eta * ((1 - a_prev) / (1 - a) * (1 - a / a_prev)) ** 0.5
        for time in range(repeats):
            if noise is not None and time > 0:
                y = noised(y, noise(), a / a_prev)
            y0_hat, eps = _estimate(denoise, y, t, a, alpha_bar, on_y0_hat)
            y = (a_prev**0.5 * y0_hat).add_(max(1 - a_prev - sigma**2, 0.0) ** 0.5 * eps)
            if noise is not None and sigma > 0:
                y = y + sigma * noise()
            if after_step is not None:
                y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)


def dpm_solver(
    denoise: Denoise,
    y: Values,
    alpha_bar: Schedule,
    indices: Sequence[int],
    *,
    levels: Sequence[float] | None = None,
    noise: Draw | None = None,
    on_y0_hat: OnEstimate | None = None,
    after_step: AfterStep | None = None,
) -> Iterator[Step]:
    """DPM-Solver++(2M), for few steps: DDIM, or with noise its stochastic form, whose clean estimate is extrapolated.

    Each step continues the line through its own clean estimate and the previous one to the middle of the step, measured in
    lambda = log(sqrt(alpha_bar) / sqrt(1 - alpha_bar)): D. Without noise it does DDIM's update with D. With noise, h being the
    step's length in lambda, a its alpha_bar and s = sqrt(1 - a),

        y_prev = s_prev / s e^-h y + sqrt(a_prev) (1 - e^-2h) D + s_prev sqrt(1 - e^-2h) z.

    The first step has no previous estimate; the last has no finite length and ends at its clean estimate.

    Source: Lu et al. 2022, DPM-Solver++, Algorithm 2 and its appendix on the SDE. Not in MotionWavelet.

    Args:
        denoise, y, alpha_bar, indices, on_y0_hat, after_step: as in `ddim`; with `levels`, indices may repeat.
        levels: alpha_bar of the state at each step; None = those of the indices. The noise is read as a clean estimate at the
            index told: right for networks that say y0 or v and were turned to eps by `to_eps` there (diffusers' prediction_type
            "sample").
        noise: draws a tensor like y, once a step but for the last; None for the solver without noise.

    Yields:
        `Step` with the clean estimate as the network gave it (after `on_y0_hat`), not the extrapolated one, and the noise that
        leads from it to the state.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> *_, last = dpm_solver(lambda y, t: eps_of(y, clean, a[t]), torch.randn(4, 3), a, ddim_indices(100, 5))
    >>> torch.allclose(last.y, clean, atol=1e-5)
    True
    """
    h_last, last = 0.0, None  # length of the last step in lambda, and the clean estimate that it started from
    for t, a, a_prev in _levels(alpha_bar, indices, levels):
        y0_hat, eps = _estimate(denoise, y, t, a, alpha_bar, on_y0_hat)
        if a_prev == 1:
            y = y0_hat
        else:
            h = _half_log_snr(a_prev) - _half_log_snr(a)
            denoised = y0_hat if last is None else y0_hat + h / (2 * h_last) * (y0_hat - last)
            if noise is None:
                straight = eps if last is None else eps_of(y, denoised, a)
                y = a_prev**0.5 * denoised + (1 - a_prev) ** 0.5 * straight
            else:
                drawn, s_prev = -math.expm1(-2 * h), (1 - a_prev) ** 0.5  # share of the variance
                y = s_prev / (1 - a) ** 0.5 * math.exp(-h) * y + a_prev**0.5 * drawn * denoised + s_prev * drawn**0.5 * noise()
            h_last, last = h, y0_hat
        if after_step is not None:
            y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)


def _half_log_snr(alpha_bar: float) -> float:
    return 0.5 * math.log(alpha_bar / (1 - alpha_bar))


def posterior_mean(
    denoise: Denoise,
    y: Values,
    alpha_bar: Schedule,
    indices: Sequence[int],
    *,
    noise: Draw | None = None,
    **hooks: Any,
) -> Iterator[Step]:
    """Eq. 6 taken literally, over any subset: y_prev = (y_t - (1-alpha)/sqrt(1-alpha_bar_t) eps) / sqrt(alpha).

    Source: MotionWavelet Eq. 6 and the last line of Algorithm 1, the DDPM mean. Its one-step ratio alpha_t is read
    as alpha_bar_t / alpha_bar_prev, without which skipping indices is wrong. With eps for the clean estimate it is the mean
    of DDIM with eta = 1, and computed so. Own choice: `noise` adds DDPM's posterior noise, which the paper leaves out.

    Args:
        denoise, y, alpha_bar, indices: as in `ddim`.
        noise: draws a tensor like y; None for the mean alone.
        hooks: `on_y0_hat` and `after_step`, as in `ddim`.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> *_, last = posterior_mean(lambda y, t: eps_of(y, clean, a[t]), torch.randn(4, 3), a, ddim_indices(100, 5))
    >>> torch.allclose(last.y, clean, atol=1e-5)
    True
    """
    draw = noise or partial(torch.zeros_like, y)
    return ddim(denoise, y, alpha_bar, indices, eta=1.0, noise=draw, **hooks)


RHO = 7.0  # Karras et al. 2022, Sec. 3


def karras_levels(alpha_bar: Schedule, steps: int) -> list[tuple[int, float]]:
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
    whole("steps", steps, 1)
    a = alpha_bar.double().cpu().numpy()
    of_index = np.sqrt((1 - a) / a)
    sigma = np.linspace(of_index[-1] ** (1 / RHO), of_index[0] ** (1 / RHO), steps) ** RHO
    index = np.interp(np.log(sigma), np.log(of_index), np.arange(len(a))).round()
    return [(int(t), float(level)) for t, level in zip(index, 1 / (1 + sigma**2), strict=True)]


def sde_dpm_solver(
    denoise: Denoise,
    y: Values,
    alpha_bar: Schedule,
    steps: int,
    *,
    noise: Draw | None,
    **hooks: Any,
) -> Iterator[Step]:
    """`dpm_solver` on Karras' levels: "sde-dpmsolver++" of diffusers with use_karras_sigmas and a final sigma of zero.

    Source: StableMoFusion samples so, with 10 steps.

    Args:
        denoise, y, alpha_bar, noise: as in `dpm_solver`.
        steps: any number, see `karras_levels`.
        hooks: `on_y0_hat` and `after_step`, as in `dpm_solver`.

    >>> from mwlib.diffusion import alpha_bar
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> knows = lambda y, t: eps_of(y, clean, a[t])  # a denoiser that has seen the answer
    >>> *_, last = sde_dpm_solver(knows, torch.randn(4, 3), a, 5, noise=lambda: torch.randn(4, 3))
    >>> torch.allclose(last.y, clean, atol=1e-5)
    True
    """
    indices, levels = zip(*karras_levels(alpha_bar, steps), strict=True)
    return dpm_solver(denoise, y, alpha_bar, indices, levels=levels, noise=noise, **hooks)
