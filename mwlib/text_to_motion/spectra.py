"""The spectral theory of Free-T2M (appendix B), as functions of a spectrum and a noise schedule: exact, without sampling.

A spectrum is P_k = E c_k², the mean power of the orthonormal cosine coefficients of the data, k = 0 the mean over time. The paper
derives its statements for a process without drift and prints a process with one; here the process is that of Eq. 2, which models
use: c_t = sqrt(a) c_0 + sqrt(1-a) eps with a = alpha_bar_t. Where a statement of the paper needs a condition, or is wrong, the
function says so.

Theorem 3.2 says that a high frequency is restored from the low ones. Its proof replaces what the high band knows of itself by
what the low band knows of it (Eq. 42 to 43), without a reason. For Gaussian data the bands are independent, and a high band has
nothing but itself; for data whose phases are bound the low band does help. `two_bands` is the smallest experiment with both.
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple, get_args

import numpy as np
import torch
from jaxtyping import Complex, Float
from scipy.fft import dct
from torch import Tensor

from mwlib.settings import choice

Rule = Literal["ddpm", "ddim", "eq36"]
Spectrum = Float[Tensor, " K"]
Times = Float[Tensor, "*times"]
Spectra = Float[Tensor, "*times K"]


def power_of(x: Float[Tensor, "... T C"]) -> Float[Tensor, " T"]:
    """Mean power of each orthonormal cosine coefficient over all motions and channels, float64.

    Source: Eq. 25, with the expectation that Eq. 28 drops, and the orthonormal DCT of Eq. 7 in place of a Fourier transform whose
    scale the paper leaves open: with an unscaled one the noise would have T times the power that Eq. 24 gives it.

    Args:
        x: motions of T frames and C channels, in any unit; the power is in its square. Energy shares mean what they say only if
            the channels are in comparable units.

    >>> power_of(torch.full((4, 2), 3.0)).round(decimals=6).tolist()
    [36.0, 0.0, 0.0, 0.0]
    """
    c = np.asarray(dct(x.detach().cpu().double().numpy(), axis=-2, norm="ortho"))
    return torch.from_numpy(np.square(c).mean(axis=(*range(x.ndim - 2), -1)))


def energy_share(power: Spectrum) -> Spectrum:
    """Share of the energy in the first 1, 2, ..., K coefficients; entry K-1 belongs to K coefficients.

    >>> energy_share(torch.tensor([4.0, 3.0, 1.0])).tolist()
    [0.5, 0.875, 1.0]
    """
    return power.cumsum(0) / power.sum()


def power_law(coefficients: int, exponent: float = 2.0) -> Spectrum:
    """P_k ~ k^-exponent, of mean 1 (Eq. 29 has |w|^-a); 0 gives white data. Own choice: P_0, which the law leaves open, is P_1.

    >>> power_law(3, 1.0).tolist()
    [1.2, 1.2, 0.6]
    """
    k = torch.arange(coefficients, dtype=torch.float64).clamp_min(1)
    return k**-exponent / (k**-exponent).mean()


def gaussian_motions(power: Float[Tensor, " T"], samples: int, generator: torch.Generator) -> Float[Tensor, "samples T"]:
    """Coefficients of Gaussian data with this spectrum, independent of each other: sqrt(P_k) times normal numbers, float64."""
    return power.sqrt() * torch.randn(samples, len(power), generator=generator, dtype=torch.float64)


def forward_power(power: Spectrum, alpha_bar: Times) -> Spectra:
    """E c_t² = a P_k + 1 - a. Source: Eq. 18 for the process of Eq. 2; one draw of c_t² has a cross term, only its mean has none.

    >>> forward_power(torch.tensor([4.0, 1.0, 0.0]), torch.tensor(0.25)).tolist()
    [1.75, 1.0, 0.75]
    """
    a = alpha_bar[..., None]
    return a * power + 1 - a


def snr(power: Spectrum, alpha_bar: Times) -> Spectra:
    """a P_k / (1 - a). Source: Eq. 3 for the process of Eq. 2.

    It is a product of a function of k and one of t. So two frequencies keep their ratio: none falls "more rapidly" (Theorem 3.1),
    some start lower. And Eq. 4, a low frequency above every higher one, holds if P_k falls, and only then.
    """
    a = alpha_bar[..., None]
    return a * power / (1 - a)


def recovery_time(power: Float[Tensor, "*shape"], steps: int, gamma: float = 1.0) -> Float[Tensor, "*shape"]:
    """When the SNR is gamma under the cosine schedule, in steps: T (1.008 (2/π) arccos sqrt(a) - 0.008), a = gamma/(gamma + P_k).

    Source: Eq. 38 for the process of Eq. 2, solved: a is the alpha_bar at which the SNR is gamma. Time t has alpha_bar(t/T), so
    index i of `mwlib.diffusion.alpha_bar` is time i + 1. Reversed time runs from T down: a large t returns early. The order is
    low before high only where P_k falls.

    Raises:
        ValueError: gamma is not positive.

    >>> [round(t, 2) for t in recovery_time(power_law(128)[[1, 64]], 1000).tolist()]
    [908.52, 61.58]
    """
    if gamma <= 0:
        raise ValueError(f"gamma is {gamma}; expected more than 0")
    level = gamma / (gamma + power)
    return steps * (1.008 * 2 / math.pi * torch.arccos(level.sqrt()) - 0.008)


def wiener_gain(power: Spectrum, alpha_bar: Times) -> Spectra:
    """g with ĉ_0 = g c_t: sqrt(a) P_k / (a P_k + 1 - a). For Gaussian data no denoiser is better, and k alone tells about k.

    sqrt(a) g = SNR / (1 + SNR) is the share of P_k that the estimate has.
    """
    return alpha_bar.sqrt()[..., None] * power / forward_power(power, alpha_bar)


def unknown_share(power: Spectrum, alpha_bar: Times) -> Spectra:
    """Mean square error of the best estimate, as a share of P_k: (1-a) / (a P_k + 1 - a) = 1 / (1 + SNR)."""
    return (1 - alpha_bar)[..., None] / forward_power(power, alpha_bar)


class Reverse(NamedTuple):
    """Power of each coefficient after every reverse step, and that of the clean estimate that the step used; (S, K) each."""

    state: Tensor
    estimate: Tensor


def reverse_power(power: Spectrum, alpha_bar: Float[Tensor, " M"], indices: Sequence[int], rule: Rule = "ddpm") -> Reverse:
    """Power through a whole reverse process with the best denoiser of Gaussian data; `state[-1]` is that of the samples.

    Each step is linear, c' = r c_t + s z, so the variance v of c_t goes to r² v + s². It starts from 1, as samplers do. With g
    the `wiener_gain`, a' the alpha_bar that the step goes to (1 in the end) and α = a / a':

        ddpm   r = sqrt(a')(1-α)/(1-a) g + sqrt(α)(1-a')/(1-a),  s² = (1-a')/(1-a) (1-α), the "fixed small" variance
        ddim   r = sqrt(a') g + sqrt(1-a') (1 - sqrt(a) g) / sqrt(1-a),  s = 0
        eq36   r = sqrt(a') g,  s² = 1 - a': Eq. 36 and 40 of the paper, which call themselves DDPM

    Source: Ho et al. 2020, Eq. 7; Song et al. 2021, Eq. 12; Free-T2M, Eq. 36 with alpha read as alpha_bar. The last puts new
    noise of the full level on an estimate that lacks what is not known, at every step, and so keeps about half of P_k.

    Args:
        power: P_k of the data.
        alpha_bar: schedule, float64.
        indices: falling diffusion indices, at least one, see `mwlib.diffusion.ddim_indices`.
        rule: "ddpm", "ddim" or "eq36".

    Raises:
        ValueError: another rule.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices
    >>> v = reverse_power(power_law(128), alpha_bar("cosine", 50), ddim_indices(50, 50)).state[-1] / power_law(128)
    >>> [round(ratio, 2) for ratio in v[[1, 4, 16, 64, 120]].tolist()]
    [0.84, 0.92, 0.86, 0.65, 0.49]
    """
    choice("rule", rule, get_args(Rule))
    levels = alpha_bar[list(indices)]
    v, states, estimates = torch.ones_like(power), [], []
    for a, after in torch.cat([levels, levels.new_ones(1)]).unfold(0, 2, 1):
        gain = wiener_gain(power, a)
        keep, added = _step(gain, a, after, rule)
        estimates.append(gain**2 * v)
        v = keep**2 * v + added
        states.append(v)
    return Reverse(torch.stack(states), torch.stack(estimates))


def _step(gain: Tensor, a: Tensor, after: Tensor, rule: Rule) -> tuple[Tensor, Tensor]:
    """r and s² of a step from alpha_bar a to after."""
    if rule == "eq36":
        return after.sqrt() * gain, 1 - after
    if rule == "ddim":
        return after.sqrt() * gain + (1 - after).sqrt() * (1 - a.sqrt() * gain) / (1 - a).sqrt(), 0 * a
    ratio = a / after
    keep = (after.sqrt() * (1 - ratio) * gain + ratio.sqrt() * (1 - after)) / (1 - a)
    return keep, (1 - after) / (1 - a) * (1 - ratio)


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
