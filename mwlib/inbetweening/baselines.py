"""Baselines of in-betweening that no training needs: paces along straight lines, and a Gaussian process."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from mwlib.body.rotation import from_six, six, slerp
from mwlib.inbetweening.space import RotationSpace, Space, Tracks

# How far along the way from the first to the last frame a body is, for u in [0, 1].
PACES: dict[str, Callable[[Tensor], Tensor]] = {
    "zero_velocity": lambda u: (u >= 1).to(u),  # the first frame until the last
    "interpolation": lambda u: u,
    "hermite": lambda u: u**2 * (3 - 2 * u),  # cubic, at rest at both ends
    "minimum_jerk": lambda u: u**3 * (10 - 15 * u + 6 * u**2),  # Flash and Hogan 1985: without acceleration, too
}


def between(space: Space, x: Tracks, pace: str, blend: Callable[[Tensor, Tensor, Tensor], Tensor] = slerp) -> Tracks:
    """Straight lines of places and slerp of rotations from the first to the last frame, at a pace.

    Source: LaFAN1's baselines (Harvey et al. 2020) for "zero_velocity" and "interpolation".

    Args:
        space: what a state means.
        x: windows; only the first and the last frame are looked at.
        pace: one of `PACES`.
        blend: of two rotations, as `slerp`.
    """
    share = PACES[pace](torch.linspace(0, 1, x.shape[-2], dtype=x.dtype, device=x.device))
    start, end = x[..., :1, :], x[..., -1:, :]
    line = start + share[:, None] * (end - start)
    if not isinstance(space, RotationSpace):
        return line
    first, last = (from_six(pose[..., 3:].unflatten(-1, (-1, 6))) for pose in (start, end))
    turns = blend(first, last, share[:, None].expand(*line.shape[:-1], first.shape[-2]))
    return torch.cat([line[..., :3], six(turns).flatten(-2)], dim=-1)


class GaussianBetween:
    """The mean of a Gaussian process given two frames, every channel by itself and all with one correlation over time.

    The correlation of frames i and j is estimated from training windows, whatever their place: rho(|i - j|). What lies between
    is mean + k K⁻¹ (given - mean), the kriging predictor (Rasmussen and Williams 2006, Eq. 2.23). Own choice: K⁺ in place of K⁻¹,
    as K is singular where nobody moves.

    Args:
        x: training windows as seen from their first frames.
    """

    def __init__(self, x: Tracks) -> None:
        frames = x.shape[1]
        self.mean = x.mean((0, 1))
        centred = (x - self.mean) / x.flatten(0, 1).std(0).clamp_min(1e-4)
        gram = torch.einsum("ntc,nsc->ts", centred, centred).double()
        gram = gram / gram.diagonal().mean().clamp_min(1e-12)
        lag = (torch.arange(frames)[:, None] - torch.arange(frames)).abs()
        rho = torch.zeros(frames, dtype=torch.float64).scatter_add_(0, lag.flatten(), gram.flatten())
        self.rho = rho / torch.bincount(lag.flatten())
        near, far = self.rho[lag[:, [0, -1]]], self.rho[lag[[0, -1]][:, [0, -1]]]
        self.weights = (near @ torch.linalg.pinv(far, rtol=1e-6, hermitian=True)).float()  # (T, 2)

    def __call__(self, x: Tracks) -> Tracks:
        """Windows with everything but the first and last frame filled in."""
        return self.mean + self.weights @ (x[..., [0, -1], :] - self.mean)
