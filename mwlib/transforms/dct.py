"""HumanMAC's representation: the first rows of an orthonormal DCT-II over time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.fft import dct
from torch import Tensor

from mwlib.transforms.linear import Constant, LinearTransform


class DCTTransform(LinearTransform):
    """Low-pass cosine coefficients of every channel.

    Source: HumanMAC (Chen et al., 2023): orthonormal DCT-II over the T frames, first L rows kept.

    Args:
        frames, channels: T and C of the motions.
        rows: L, number of kept coefficients, at most T; None keeps all (then the inverse is exact).

    Raises:
        ValueError: rows is not between 1 and frames.

    >>> tf = DCTTransform(frames=40, channels=48, rows=8)
    >>> still = torch.ones(40, 48)
    >>> y = tf(still)
    >>> y.shape, torch.allclose(tf.inverse(y), still, atol=1e-5)
    (torch.Size([8, 48]), True)
    """

    def __init__(self, frames: int, channels: int, rows: int | None = None) -> None:
        rows = frames if rows is None else rows
        if not 1 <= rows <= frames:
            raise ValueError(f"rows is {rows}; expected 1 to {frames} (frames)")
        self.frames, self.channels, self.shape = frames, channels, (rows, channels)
        self.analysis_time = np.asarray(dct(np.eye(frames), norm="ortho", axis=0))[:rows]
        self.synthesis_time = self.analysis_time.T
        self._forward, self._backward = Constant(self.analysis_time), Constant(self.synthesis_time)

    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... rows columns"]:
        """First L DCT-II coefficients over time."""
        return self._forward.like(x) @ x

    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """The smooth motion with these coefficients; all higher ones zero."""
        return self._backward.like(y) @ y

    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """The identity: the rows are orthonormal, so all coefficients are a motion's."""
        return y

    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """One band."""
        return {"dct": y}

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Inverse of `split`."""
        return bands["dct"]
