"""Coefficients shifted and scaled to unit deviation, behind the same interface."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from .linear import Constant, Transform


def fit_scale(tf: Transform, x: Float[Tensor, "N T C"], kind: str) -> tuple[Tensor, Tensor]:
    """Mean and deviation of the coefficients of training windows.

    Own choice: the paper diffuses raw coefficients, in which the details lie far below the noise.

    Args:
        tf: the transform.
        x: training windows, metres.
        kind: "none" (0 and 1), "band" (no shift, one deviation per sub-band) or "coefficient" (both per
            coefficient; deviations below a thousandth of the largest are raised to it).

    Returns:
        (mean, deviation), each of shape `tf.shape`, float32.
    """
    if kind == "none":
        return torch.zeros(tf.shape), torch.ones(tf.shape)
    y = torch.cat([tf(part) for part in x.split(4096)])
    if kind == "band":
        deviations = {name: torch.full(band.shape[-2:], float(band.std())) for name, band in tf.split(y).items()}
        return torch.zeros(tf.shape), tf.join(deviations)
    deviation, mean = torch.std_mean(y, dim=0)
    return mean, deviation.clamp_min(1e-3 * float(deviation.max()))


class ScaledTransform(Transform):
    """(tf(x) - mean) / deviation, with the inverse, projection and sub-bands to match.

    Args:
        base: the transform underneath.
        mean, deviation: as `fit_scale` returns them; in metres, shape `base.shape`.
    """

    def __init__(self, base: Transform, mean: Tensor, deviation: Tensor) -> None:
        self.base, self.mean, self.deviation, self.shape = base, mean.numpy(), deviation.numpy(), base.shape
        self._mean, self._deviation = Constant(self.mean), Constant(self.deviation)

    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... K columns"]:
        """Unit-deviation coefficients of a motion."""
        return self._scale(self.base(x))

    def inverse(self, y: Float[Tensor, "... K columns"]) -> Float[Tensor, "... T C"]:
        """Motion, metres."""
        return self.base.inverse(self._unscale(y))

    def project(self, y: Float[Tensor, "... K columns"]) -> Float[Tensor, "... K columns"]:
        """The base's projection, seen in scaled coefficients."""
        return self._scale(self.base.project(self._unscale(y)))

    def split(self, y: Float[Tensor, "... K columns"]) -> dict[str, Tensor]:
        """Sub-bands of the scaled coefficients."""
        return self.base.split(y)

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... K columns"]:
        """Inverse of `split`."""
        return self.base.join(bands)

    def _scale(self, y: Tensor) -> Tensor:
        return (y - self._mean.like(y)) / self._deviation.like(y)

    def _unscale(self, y: Tensor) -> Tensor:
        return torch.addcmul(self._mean.like(y), y, self._deviation.like(y))
