"""A wavelet transform along time alone, arranged in tokens that hold all scales of one stretch of time."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.transforms.dwt import wavelet_matrices
from mwlib.transforms.linear import Constant, LinearTransform


class TimeWaveletTransform(LinearTransform):
    """DWT of every channel along time, periodised; one row of coefficients for each stretch of 2^level frames.

    Own choice: MotionWavelet also transforms along the list of channels, where neighbours have nothing to do with each other,
    and has a row for each two frames. Here row r holds the approximation and the details of all kept levels whose place is in
    frames 2^level r to 2^level (r + 1): 1 + 1 + 2 + 4 ... coefficients of each channel. A transformer over rows then has few
    tokens, and none of them has to look at another to know how fast its own stretch moves.

    Args:
        frames, channels: T and C of the motions.
        wavelet: any discrete PyWavelets wavelet.
        level: number of decomposition levels, at least 1.
        omit: how many of the finest levels of details are left out. The inverse is then smooth instead of exact.

    Raises:
        ValueError: unknown wavelet, a level below 1, or one that leaves no frame; omit does not leave a level of details.

    >>> tf = TimeWaveletTransform(frames=40, channels=48, wavelet="bior6.8", level=3)
    >>> x = torch.randn(5, 40, 48)
    >>> tf(x).shape, {name: tuple(band.shape) for name, band in tf.split(tf(x)).items()}["d1"]
    (torch.Size([5, 5, 384]), (5, 5, 192))
    >>> torch.allclose(tf.inverse(tf(x)), x, atol=1e-5)
    True
    """

    def __init__(self, frames: int, channels: int, wavelet: str = "bior6.8", level: int = 3, omit: int = 0) -> None:
        if level < 1:
            raise ValueError(f"level is {level}; expected at least 1")
        if not 0 <= omit < level:
            raise ValueError(f"omit is {omit}; expected 0 to {level - 1}, below the level ({level})")
        if frames < 2**level:
            raise ValueError(f"level is {level} of {frames} frames; expected at most {frames.bit_length() - 1}")
        analysis, synthesis, sizes = wavelet_matrices(frames, wavelet, "periodization", level)
        rows = sizes[0]
        self.frames, self.channels, self.names = frames, channels, [f"a{level}", *(f"d{n}" for n in range(level, omit, -1))]
        self.counts = [1, *(2**k for k in range(level - omit))]  # coefficients of a channel in one row, by sub-band
        ends = np.cumsum(sizes)
        there, back = [], []
        for count, first, last in zip(self.counts, ends - sizes, ends, strict=False):
            lacking = rows * count - (last - first)  # an odd level has one row less than two of the next
            there.append(np.pad(analysis[first:last], ((0, lacking), (0, 0))).reshape(rows, count, frames))
            back.append(np.pad(synthesis[:, first:last], ((0, 0), (0, lacking))).reshape(frames, rows, count))
        a, s = np.concatenate(there, axis=1).reshape(-1, frames), np.concatenate(back, axis=2).reshape(frames, -1)
        self.analysis_time, self.synthesis_time = a, s
        self.shape = (rows, sum(self.counts) * channels)
        self._analysis, self._synthesis, self._projection = Constant(a), Constant(s), Constant(a @ s)

    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... rows columns"]:
        """Coefficients of the kept levels."""
        return self._rows(self._analysis.like(x) @ x)

    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """The motion with these coefficients, those left out being zero."""
        return self._synthesis.like(y) @ self._flat(y)

    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """Analysis of the synthesis: the identity but for the few coefficients beyond the last frame."""
        return self._rows(self._projection.like(y) @ self._flat(y))

    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """Sub-bands by letter and level: a3, d3, d2, d1."""
        widths = [count * self.channels for count in self.counts]
        return dict(zip(self.names, y.split(widths, dim=-1), strict=True))

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Inverse of `split`."""
        return torch.cat([bands[name] for name in self.names], dim=-1)

    def _rows(self, coefficients: Float[Tensor, "... all C"]) -> Float[Tensor, "... rows columns"]:
        return coefficients.unflatten(-2, (self.shape[0], -1)).flatten(-2)

    def _flat(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... all C"]:
        return y.unflatten(-1, (-1, self.channels)).flatten(-3, -2)
