"""Keyframe schemes on a Gaussian process, whose best denoiser and whose motions between keyframes are known in closed form.

What a scheme gives here is its own doing: no network, no training, no data has a part in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from math import pi

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.diffusion import Denoise, KeyframeConfig, alpha_bar, ddim_indices, keyframe_mask, keyframed
from mwlib.transforms import DCTTransform, Transform

Covariance = Float[Tensor, "T T"]
Curve = Float[Tensor, " T"]
Curves = Float[Tensor, "S T"]
STEPS = 1000  # of the forward process
DIVERGED = 10  # a spread that many times the true one is no sample of anything


def squared_exponential(frames: int, length: float = 6.0, jitter: float = 1e-4) -> Covariance:
    """Covariance exp(-(i-j)²/(2 length²)) + jitter (i = j) of a smooth random coordinate, float64.

    Args:
        frames: T.
        length: over how many frames it forgets where it was.
        jitter: variance of each frame alone; without it the matrix is singular to rounding.
    """
    i = torch.arange(frames, dtype=torch.float64)
    return torch.exp(-((i[:, None] - i).square()) / (2 * length**2)) + jitter * torch.eye(frames, dtype=torch.float64)


class GaussianBridge:
    """One coordinate of mean 0 and known covariance over T frames, of which some are given.

    Args:
        covariance: of the process, float64, see `squared_exponential`.
        keyframes: frame -> its value; negative frames count from the end.

    >>> bridge = GaussianBridge(squared_exponential(32), {0: -1.0, -1: 1.5})
    >>> mean, covariance = bridge.law()
    >>> mean[[0, 31]].tolist(), bool(covariance.diagonal()[1:-1].min() > 0)
    ([-1.0, 1.5], True)
    """

    def __init__(self, covariance: Covariance, keyframes: Mapping[int, float]) -> None:
        self.covariance, self.frames = covariance, len(covariance)
        self.mask = keyframe_mask(self.frames, list(keyframes))
        self.target = torch.zeros(self.frames, dtype=torch.float64)
        self.target[list(keyframes)] = torch.tensor(list(keyframes.values()), dtype=torch.float64)

    def law(self) -> tuple[Curve, Covariance]:
        """Mean and covariance of all frames, given the keyframes: the true in-between law. Keyframes have variance 0.

        Mean Σ_uk Σ_kk⁻¹ x_k and covariance Σ_uu - Σ_uk Σ_kk⁻¹ Σ_ku, with k the keyframes and u the others.
        """
        free, given = ~self.mask, self.mask
        gain = torch.linalg.solve(self.covariance[given][:, given], self.covariance[given][:, free]).mT
        mean, covariance = self.target.clone(), torch.zeros_like(self.covariance)
        mean[free] = gain @ self.target[given]
        covariance[free[:, None] & free] = (self.covariance[free][:, free] - gain @ self.covariance[given][:, free]).ravel()
        return mean, covariance

    def draw(self, samples: int, generator: torch.Generator) -> Curves:
        """Samples of the true in-between law."""
        mean, covariance = self.law()
        free, x = ~self.mask, self.target.expand(samples, -1).clone()
        root = torch.linalg.cholesky(covariance[free][:, free])
        x[:, free] = mean[free] + torch.randn(samples, len(root), generator=generator, dtype=torch.float64) @ root.mT
        return x


def optimal_denoiser(covariance: Covariance, tf: Transform, schedule: Float[Tensor, " M"]) -> Denoise:
    """The denoiser that no network can better: the posterior mean of y_0 given y_t, a linear map, and the noise it stands for.

    y0_hat = sqrt(a) Σ_y (a Σ_y + (1-a) I)⁻¹ y_t with Σ_y = D Σ Dᵀ, so eps = sqrt(1-a) (a Σ_y + (1-a) I)⁻¹ y_t.

    Args:
        covariance: Σ of the process over time.
        tf: D, a linear transform over time alone, such as `DCTTransform`; every column of y_t is a process of its own.
        schedule: alpha_bar.
    """
    d = torch.as_tensor(tf.time_rows(), dtype=covariance.dtype)
    variances, axes = torch.linalg.eigh(d @ covariance @ d.mT)

    @cache
    def gain(t: int) -> Tensor:
        """The matrix of the best linear denoiser at t."""
        a = float(schedule[t])
        return (axes * ((1 - a) ** 0.5 / (a * variances + 1 - a))) @ axes.mT

    return lambda y_t, t: gain(t) @ y_t


@dataclass(frozen=True)
class Scheme:
    """A way to sample between keyframes: a row of the table."""

    how: KeyframeConfig = KeyframeConfig()
    steps: int = 100  # of DDIM
    rows: int | None = None  # L, cosine coefficients; None = as many as frames

    @property
    def evaluations(self) -> int:
        """Of the network, for a sample; with a gradient each is also differentiated."""
        return self.steps * self.how.repeats


SCHEMES = {
    "unconditional": Scheme(KeyframeConfig("none")),
    "replacement (paper)": Scheme(),
    "replacement, 1000 steps": Scheme(steps=1000),
    "replacement, η = 1": Scheme(KeyframeConfig(eta=1)),
    "replacement, DDPM": Scheme(KeyframeConfig(eta=1), 1000),
    "replacement, fixed noise": Scheme(KeyframeConfig(keyframe_noise="fixed")),
    "paste": Scheme(KeyframeConfig("paste")),
    "RePaint, r = 5": Scheme(KeyframeConfig(repeats=5)),
    "RePaint, r = 10": Scheme(KeyframeConfig(repeats=10)),
    "RePaint, r = 20": Scheme(KeyframeConfig(repeats=20)),
    "RePaint, r = 10, η = 1": Scheme(KeyframeConfig(eta=1, repeats=10)),
    "RePaint, r = 10, 25 steps": Scheme(KeyframeConfig(repeats=10), 25),
    "gradient, w = 1": Scheme(KeyframeConfig("none", reconstruction_weight=1)),
    "gradient, w = 5": Scheme(KeyframeConfig("none", reconstruction_weight=5)),
    "gradient, w = 20": Scheme(KeyframeConfig("none", reconstruction_weight=20)),
    "gradient, w = 200": Scheme(KeyframeConfig("none", reconstruction_weight=200)),
    "gradient, w = 20, η = 1": Scheme(KeyframeConfig("none", eta=1, reconstruction_weight=20)),
    "paste and gradient, w = 20": Scheme(KeyframeConfig("paste", reconstruction_weight=20)),
    "replacement, L = 20": Scheme(rows=20),
    "replacement, L = 10": Scheme(rows=10),
    "replacement, L = 6": Scheme(rows=6),
}


def sample(bridge: GaussianBridge, scheme: Scheme, samples: int, generator: torch.Generator | None) -> Curves:
    """Samples of a scheme with the optimal denoiser, cosine schedule.

    All maps act over time, so that every sample is a channel: one product of matrices serves all.

    Args:
        bridge: the process and its keyframes.
        scheme: a value of `SCHEMES`, or another.
        samples: S.
        generator: of all noise; None = no noise at all. As each scheme here is linear in its noise, of mean 0, that is the
            exact mean of its samples.
    """
    tf, schedule = DCTTransform(bridge.frames, samples, scheme.rows), alpha_bar("cosine", STEPS)

    def noise() -> Tensor:
        """A draw of unit deviation; zeros without a generator."""
        if generator is None:
            return torch.zeros(tf.shape, dtype=torch.float64)
        return torch.randn(tf.shape, generator=generator).double()  # drawing doubles takes five times as long

    denoise = optimal_denoiser(bridge.covariance, tf, schedule)
    target = bridge.target[:, None].expand(-1, samples)
    return keyframed(denoise, tf, target, bridge.mask, schedule, ddim_indices(STEPS, scheme.steps), noise, scheme.how).mT


def _seam(steps: Float[Tensor, " borders"], mask: Bool[Tensor, " T"]) -> float:
    """Mean step between a keyframe and a free frame, over the mean step between free frames."""
    border, inside = mask[1:] != mask[:-1], ~(mask[1:] | mask[:-1])
    return float(steps[border].mean() / steps[inside].mean())


def measure(bridge: GaussianBridge, x: Curves) -> dict[str, float]:
    """Samples against the true in-between law.

    Returns:
        "mean_error", mean |mean of the samples - true mean| over the free frames; "spread", mean ratio of the deviations;
        "seam", mean step across the borders of keyframes over the mean step elsewhere (for the truth see `exact`);
        "keyframe_error", mean distance from the keyframes.
    """
    mean, covariance = bridge.law()
    free = ~bridge.mask
    spread = x.std(0)[free] / covariance.diagonal()[free].sqrt()
    return {
        "mean_error": float((x.mean(0) - mean)[free].abs().mean()),
        "spread": float(spread.mean()),
        "seam": _seam(x.diff(dim=1).abs().mean(0), bridge.mask),
        "keyframe_error": float((x - bridge.target)[:, bridge.mask].abs().mean()),
    }


def exact(bridge: GaussianBridge) -> dict[str, float]:
    """The measures of endless samples of the true law: a step is Gaussian, the mean of its size a folded normal's."""
    mean, covariance = bridge.law()
    step = mean.diff()
    variance = covariance.diff(dim=0).diff(dim=1).diagonal().clamp_min(0)
    ratio = step / (2 * variance).sqrt()
    size = (2 * variance / pi).sqrt() * torch.exp(-ratio.square()) + step * torch.erf(ratio)
    return {"mean_error": 0.0, "spread": 1.0, "seam": _seam(size, bridge.mask), "keyframe_error": 0.0}


def table(
    bridge: GaussianBridge, samples: int = 1000, seed: int = 0, names: Iterable[str] = tuple(SCHEMES)
) -> list[dict[str, str | int | float | bool]]:
    """The truth and every scheme, a row each: what `measure` gives; "mean_error_limit", that of endless samples; "diverged".

    Args:
        bridge: the process and its keyframes.
        samples: of each scheme.
        seed: of the noise, the same for all.
        names: of `SCHEMES`.
    """
    rows: list[dict[str, str | int | float | bool]] = [
        {"scheme": "true law", "evaluations": 0, **exact(bridge), "mean_error_limit": 0.0, "diverged": False}
    ]
    for name in names:
        scheme = SCHEMES[name]
        found = measure(bridge, sample(bridge, scheme, samples, torch.Generator().manual_seed(seed)))
        limit = measure(bridge, sample(bridge, scheme, 2, None))["mean_error"]
        also = {"mean_error_limit": limit, "diverged": not found["spread"] < DIVERGED}
        rows.append({"scheme": name, "evaluations": scheme.evaluations, **found, **also})
    return rows
