"""Reverse processes as flat generators in paper notation. They know nothing of wavelets or guidance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from jaxtyping import Float
from torch import Tensor

from mwlib.diffusion.process import eps_of, noised, y0_hat_of

Denoise = Callable[[Tensor, int], Tensor]  # y_t, t -> eps
OnEstimate = Callable[[Tensor], Tensor]  # y0_hat -> y0_hat
AfterStep = Callable[[Tensor, float], Tensor]  # y, its alpha_bar -> y


class Step(NamedTuple):
    """One reverse step: the index it left, the coefficients it reached, the clean estimate and noise it used."""

    t: int
    y: Tensor
    y0_hat: Tensor
    eps: Tensor


def _levels(alpha_bar: Tensor, indices: Sequence[int]) -> list[tuple[int, float, float]]:
    """Index, its alpha_bar, and the alpha_bar that its step goes to; the last step leaves no noise, alpha_bar 1 (own choice)."""
    here = [float(alpha_bar[t]) for t in indices]
    return list(zip(indices, here, [*here[1:], 1.0], strict=True))


def _estimate(denoise: Denoise, y: Tensor, t: int, a: float, on_y0_hat: OnEstimate | None) -> tuple[Tensor, Tensor]:
    """Clean estimate and noise at index t; where a hook changes the estimate, the noise is what leads from it to y."""
    eps = denoise(y, t)
    y0_hat = y0_hat_of(y, eps, a)
    if on_y0_hat is not None:
        y0_hat = on_y0_hat(y0_hat)
        eps = eps_of(y, y0_hat, a)
    return y0_hat, eps


def ddim(
    denoise: Denoise,
    y: Float[Tensor, "..."],
    alpha_bar: Float[Tensor, " M"],
    indices: Sequence[int],
    *,
    eta: float = 0.0,
    repeats: int = 1,
    noise: Callable[[], Tensor] | None = None,
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
            y0_hat, eps = _estimate(denoise, y, t, a, on_y0_hat)
            y = (a_prev**0.5 * y0_hat).add_(max(1 - a_prev - sigma**2, 0.0) ** 0.5 * eps)
            if noise is not None and sigma > 0:
                y = y + sigma * noise()
            if after_step is not None:
                y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)


def dpm_solver(
    denoise: Denoise,
    y: Float[Tensor, "..."],
    alpha_bar: Float[Tensor, " M"],
    indices: Sequence[int],
    *,
    on_y0_hat: OnEstimate | None = None,
    after_step: AfterStep | None = None,
) -> Iterator[Step]:
    """DPM-Solver++(2M): deterministic DDIM whose clean estimate is extrapolated, for few steps.

    Each step continues the line through its own clean estimate and the previous one to the middle of the step, measured in
    lambda = log(sqrt(alpha_bar) / sqrt(1 - alpha_bar)), and then does DDIM's update with it. The first step has no
    previous estimate and the last no finite length; both are plain DDIM.

    Source: Lu et al. 2022, DPM-Solver++, Algorithm 2. Not in MotionWavelet.

    Args:
        denoise, y, alpha_bar, indices, on_y0_hat, after_step: as in `ddim`.

    Yields:
        `Step` with the clean estimate as the network gave it (after `on_y0_hat`), not the extrapolated one.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> *_, last = dpm_solver(lambda y, t: eps_of(y, clean, a[t]), torch.randn(4, 3), a, ddim_indices(100, 5))
    >>> torch.allclose(last.y, clean, atol=1e-5)
    True
    """
    h_last, last = 0.0, None  # length of the last step in lambda, and the clean estimate that it started from
    for t, a, a_prev in _levels(alpha_bar, indices):
        y0_hat, eps = _estimate(denoise, y, t, a, on_y0_hat)
        h = math.inf if a_prev == 1 else _half_log_snr(a_prev) - _half_log_snr(a)
        denoised_d, noise = y0_hat, eps
        if last is not None and a_prev < 1:
            denoised_d = y0_hat + h / (2 * h_last) * (y0_hat - last)
            noise = eps_of(y, denoised_d, a)
        h_last, last = h, y0_hat
        y = a_prev**0.5 * denoised_d + (1 - a_prev) ** 0.5 * noise
        if after_step is not None:
            y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)


def _half_log_snr(alpha_bar: float) -> float:
    return 0.5 * math.log(alpha_bar / (1 - alpha_bar))


def posterior_mean(
    denoise: Denoise,
    y: Float[Tensor, "..."],
    alpha_bar: Float[Tensor, " M"],
    indices: Sequence[int],
    *,
    noise: Callable[[], Tensor] | None = None,
    on_y0_hat: OnEstimate | None = None,
    after_step: AfterStep | None = None,
) -> Iterator[Step]:
    """Eq. 6 taken literally, over any subset: y_prev = (y_t - (1-alpha)/sqrt(1-alpha_bar_t) eps) / sqrt(alpha).

    Source: MotionWavelet Eq. 6 and the last line of Algorithm 1, the DDPM mean. Its one-step ratio alpha_t is read
    as alpha_bar_t / alpha_bar_prev, without which skipping indices is wrong. Own choice: `noise` adds DDPM's
    posterior noise, which the paper leaves out.

    Args:
        denoise, y, alpha_bar, indices, on_y0_hat, after_step: as in `ddim`.
        noise: draws a tensor like y; None for the mean alone.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices
    >>> a, clean = alpha_bar("cosine", 100), torch.full((4, 3), 0.5)
    >>> *_, last = posterior_mean(lambda y, t: eps_of(y, clean, a[t]), torch.randn(4, 3), a, ddim_indices(100, 5))
    >>> torch.allclose(last.y, clean, atol=1e-5)
    True
    """
    for t, a, a_prev in _levels(alpha_bar, indices):
        alpha = a / a_prev
        y0_hat, eps = _estimate(denoise, y, t, a, on_y0_hat)
        y = (y - (1 - alpha) / (1 - a) ** 0.5 * eps) / alpha**0.5
        if noise is not None and a_prev < 1:
            y = y + ((1 - a_prev) / (1 - a) * (1 - alpha)) ** 0.5 * noise()
        if after_step is not None:
            y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)
