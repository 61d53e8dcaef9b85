"""Does the high band follow the low one? Two waves whose phases are bound to each other, or are not (Theorem 3.2 of Free-T2M).

The theorem says that a high frequency is restored from the low ones. Its proof replaces what the high band knows of itself by
what the low band knows of it (Eq. 42 to 43), without a reason. For Gaussian data the truth is the reverse: bands are
independent, and a high band has nothing but itself. For data whose phases are bound the low band does help. So it is a matter of
the data, and this is the smallest experiment that has both cases.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from jaxtyping import Complex, Float
from torch import Tensor

AMPLITUDE = 0.3  # of the high band; the low one has 1


class Bands(NamedTuple):
    """Complex amplitudes of the two waves, clean high one first: what is wanted, and what is seen of both through noise."""

    high: Tensor
    noisy_high: Tensor
    noisy_low: Tensor


def two_bands(samples: int, sigma: float, bound: bool, generator: torch.Generator) -> Bands:
    """Random motions cos(ωn + φ) + 0.3 cos(2ωn + ψ) as amplitudes e^{iφ} and 0.3 e^{iψ}, and the same with noise of power sigma².

    Args:
        samples: how many; φ is drawn evenly from the circle.
        sigma: deviation of the complex noise on each amplitude.
        bound: ψ = 2φ, as a harmonic of one movement has it; otherwise ψ is drawn on its own.
        generator: of all draws.
    """
    phi, own = 2 * math.pi * torch.rand(2, samples, generator=generator, dtype=torch.float64)
    noise = sigma * torch.randn(2, samples, generator=generator, dtype=torch.complex128)
    low, high = torch.exp(1j * phi), AMPLITUDE * torch.exp(1j * (2 * phi if bound else own))
    return Bands(high, high + noise[0], low + noise[1])


def squared_phase(z: Complex[Tensor, " N"]) -> Complex[Tensor, " N"]:
    """(z/|z|)²: the low wave's phase, doubled; the direction in which a bound harmonic points."""
    return (z / z.abs()).square()


def regression_error(inputs: Complex[Tensor, "N F"], target: Complex[Tensor, " N"]) -> float:
    """Relative error of the best linear prediction: fitted on the first half of the samples, measured on the second.

    Raises:
        ValueError: too few samples for the inputs.
    """
    half = len(target) // 2
    if half <= inputs.shape[1]:
        raise ValueError(f"{len(target)} samples; expected more than twice the {inputs.shape[1]} inputs")
    weights = torch.linalg.lstsq(inputs[:half], target[:half, None]).solution[:, 0]
    missed = target[half:] - inputs[half:] @ weights
    return float(missed.abs().square().sum() / target[half:].abs().square().sum())


def relative_errors(sigma: Float[Tensor, " S"], bound: bool) -> tuple[Float[Tensor, " S"], Float[Tensor, " S"]]:
    """What `regression_error` tends to: from the noisy high band alone, and with the squared phase of the noisy low one.

    Alone it is Wiener's 1 / (1 + A²/σ²). The noisy phase points m = E cos 2(φ̂ - φ) = 1 - σ² (1 - exp(-1/σ²)) of the way, so given
    it, A² (1 - m²) of the high band's power is left to say, and 1/error = A² (1/(A² (1-m²)) + 1/σ²). A phase of its own: m = 0.

    Source: own derivation; the linear prediction, so a lower bound of what the low band tells.

    >>> alone, both = relative_errors(torch.tensor([0.2, 0.4, 0.8]), bound=True)
    >>> [round(e, 3) for e in alone.tolist()], [round(e, 3) for e in both.tolist()]
    ([0.308, 0.64, 0.877], [0.067, 0.252, 0.683])
    """
    known = AMPLITUDE**2 / sigma.square()
    points = 1 - sigma.square() * (1 - torch.exp(-1 / sigma.square())) if bound else torch.zeros_like(sigma)
    return 1 / (1 + known), 1 / (1 / (1 - points.square()) + known)
