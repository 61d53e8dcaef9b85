"""Coefficients shifted and scaled to unit deviation, behind the same interface."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.transforms.linear import Constant, Transform


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

    Raises:
        ValueError: the windows are all alike (or there is one), so that no deviation can be told.

    >>> x = torch.randn(200, 20, 6) * 0.3
    >>> mean, deviation = fit_scale(mw.DCTTransform(20, 6), x, "coefficient")
    >>> mean.shape, bool((deviation - 0.3).abs().max() < 0.1)
    (torch.Size([20, 6]), True)
    """
    if kind == "none":
        return torch.zeros(tf.shape), torch.ones(tf.shape)
    y = torch.cat([tf(part) for part in x.split(4096)])
    if len(y) == 0 or not (y != y[0]).any():
        raise ValueError(f"{len(y)} windows, all alike; expected windows that differ, to tell the scale of their coefficients")
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

    >>> x = torch.randn(200, 20, 6) * 0.3
    >>> base = mw.DCTTransform(20, 6)
    >>> tf = ScaledTransform(base, *fit_scale(base, x, "band"))
    >>> round(float(tf(x).std()), 3), torch.allclose(tf.inverse(tf(x)), x, atol=1e-5)
    (1.0, True)
    """

    def __init__(self, base: Transform, mean: Tensor, deviation: Tensor) -> None:
        self.base, self.mean, self.deviation, self.shape = base, mean.numpy(), deviation.numpy(), base.shape
        self._mean, self._deviation = Constant(self.mean), Constant(self.deviation)

    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... rows columns"]:
        """Unit-deviation coefficients of a motion."""
        return self._scale(self.base(x))

    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """Motion, metres."""
        return self.base.inverse(self._unscale(y))

    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """The base's projection, seen in scaled coefficients."""
        projected = self.base.project(self._unscale(y))  # of a tensor that nobody else has
        return projected.sub_(self._mean.like(y)).div_(self._deviation.like(y))

    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """Sub-bands of the scaled coefficients."""
        return self.base.split(y)

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Inverse of `split`."""
        return self.base.join(bands)

    def _scale(self, y: Tensor) -> Tensor:
        return (y - self._mean.like(y)).div_(self._deviation.like(y))

    def _unscale(self, y: Tensor) -> Tensor:
        return torch.addcmul(self._mean.like(y), y, self._deviation.like(y))
