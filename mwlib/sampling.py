"""Reverse processes as flat generators in paper notation. They know nothing of wavelets or guidance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from .diffusion import clean_estimate, eps_of

Denoise = Callable[[Tensor, int], Tensor]
Shape = Callable[[Tensor], Tensor]
AfterStep = Callable[[Tensor, float], Tensor]


class Step(NamedTuple):
    """One reverse step: the index it left, the latent it reached, the clean estimate and noise it used."""

    t: int
    y: Tensor
    y0_hat: Tensor
    eps: Tensor


def _previous(alpha_bar: Tensor, indices: Sequence[int], final: float) -> list[float]:
    return [float(alpha_bar[t]) for t in indices[1:]] + [final]


def ddim(
    denoise: Denoise,
    y: Float[Tensor, "..."],
    alpha_bar: Float[Tensor, " M"],
    indices: Sequence[int],
    *,
    eta: float = 0.0,
    noise: Callable[[], Tensor] | None = None,
    clean: Shape | None = None,
    after_step: AfterStep | None = None,
    final: float = 1.0,
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
        noise: draws a tensor like y; needed when eta > 0.
        clean: applied to every clean estimate (e.g. a bound); eps is then re-derived from its result.
        after_step: (latent, its alpha_bar) -> latent, applied after every step (manifold shaping, masks).
        final: alpha_bar to which the last step goes: 1 (own choice: nothing left of the noise) or alpha_bar[0] (HumanMAC).

    Raises:
        ValueError: eta > 0 without a noise source.
    """
    if eta > 0 and noise is None:
        raise ValueError(f"eta is {eta}; expected a noise source with it")
    for t, a_prev in zip(indices, _previous(alpha_bar, indices, final), strict=True):
        a = float(alpha_bar[t])
        eps = denoise(y, t)
        y0_hat = clean_estimate(y, eps, a)
        if clean is not None:
            y0_hat = clean(y0_hat)
            eps = eps_of(y, y0_hat, a)
        sigma = eta * ((1 - a_prev) / (1 - a) * (1 - a / a_prev)) ** 0.5
        y = a_prev**0.5 * y0_hat + max(1 - a_prev - sigma**2, 0.0) ** 0.5 * eps
        if sigma > 0:
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
    clean: Shape | None = None,
    after_step: AfterStep | None = None,
    final: float = 1.0,
) -> Iterator[Step]:
    """DPM-Solver++(2M): deterministic DDIM whose clean estimate is extrapolated, for few steps.

    Each step continues the line through its own clean estimate and the previous one to the middle of the step, measured in
    lambda = log(sqrt(alpha_bar) / sqrt(1 - alpha_bar)), and then does DDIM's update with it. The first step has no
    previous estimate and the last no finite length; both are plain DDIM.

    Source: Lu et al. 2022, DPM-Solver++, Algorithm 2. Not in MotionWavelet.

    Args:
        denoise, y, alpha_bar, indices, clean, after_step, final: as in `ddim`.

    Yields:
        `Step` with the clean estimate as the network gave it (after `clean`), not the extrapolated one.
    """
    previous: tuple[Tensor, float] | None = None  # clean estimate, length of the step that followed it
    for t, a_prev in zip(indices, _previous(alpha_bar, indices, final), strict=True):
        a = float(alpha_bar[t])
        eps = denoise(y, t)
        y0_hat = clean_estimate(y, eps, a)
        if clean is not None:
            y0_hat = clean(y0_hat)
            eps = eps_of(y, y0_hat, a)
        last = t == indices[-1]
        length = math.inf if last else _half_log_snr(a_prev) - _half_log_snr(a)
        along, noise = y0_hat, eps
        if previous is not None and not last:
            along = y0_hat + length / (2 * previous[1]) * (y0_hat - previous[0])
            noise = eps_of(y, along, a)
        previous = y0_hat, length
        y = a_prev**0.5 * along + (1 - a_prev) ** 0.5 * noise
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
    clean: Shape | None = None,
    after_step: AfterStep | None = None,
    final: float = 1.0,
) -> Iterator[Step]:
    """Eq. 6 taken literally, over any subset: y_prev = (y_t - (1-alpha)/sqrt(1-alpha_bar_t) eps) / sqrt(alpha).

    Source: MotionWavelet Eq. 6 and the last line of Algorithm 1, the DDPM mean. Its one-step ratio alpha_t is read
    as alpha_bar_t / alpha_bar_prev, without which skipping indices is wrong. Own choice: `noise` adds DDPM's
    posterior noise, which the paper leaves out.

    Args:
        denoise, y, alpha_bar, indices, clean, after_step, final: as in `ddim`.
        noise: draws a tensor like y; None for the mean alone.
    """
    for t, a_prev in zip(indices, _previous(alpha_bar, indices, final), strict=True):
        a = float(alpha_bar[t])
        alpha = a / a_prev
        eps = denoise(y, t)
        y0_hat = clean_estimate(y, eps, a)
        if clean is not None:
            y0_hat = clean(y0_hat)
            eps = eps_of(y, y0_hat, a)
        y = (y - (1 - alpha) / (1 - a) ** 0.5 * eps) / alpha**0.5
        if noise is not None and a_prev < 1:
            y = y + ((1 - a_prev) / (1 - a) * (1 - alpha)) ** 0.5 * noise()
        if after_step is not None:
            y = after_step(y, a_prev)
        yield Step(t, y, y0_hat, eps)


class WindowNoise:
    """Gaussian noise with one stream per window, so that chunking windows cannot change any number.

    Own choice: drawn on the CPU whatever the device, so that a seed means the same everywhere.

    Args:
        seed: of the whole draw.
        windows: identity of each window in this chunk.
        shape: (S, K, D) of one window.
        device: where the noise is wanted.
    """

    def __init__(self, seed: int, windows: Sequence[int], shape: tuple[int, ...], device: torch.device | str = "cpu") -> None:
        seeds = (int(np.random.SeedSequence((seed, int(w))).generate_state(1)[0]) for w in windows)
        self.generators = [torch.Generator().manual_seed(s) for s in seeds]
        self.shape, self.device = shape, device

    def __call__(self) -> Float[Tensor, "N S K D"]:
        """The next draw."""
        draws = torch.empty(len(self.generators), *self.shape)
        for row, generator in zip(draws, self.generators, strict=True):
            row.normal_(generator=generator)
        return draws.to(self.device)
