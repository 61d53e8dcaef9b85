"""Discrete wavelet transforms of a motion, as constant matrices: along time and joints, or along time alone."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
import pywt
import torch
from torch import Tensor

from mwlib.settings import choice, shown, whole
from mwlib.transforms.linear import AlongTime, Coefficients, Constant, LinearTransform, Motions


@lru_cache(maxsize=64)
def wavelet_matrices(length: int, wavelet: str, mode: str, level: int) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
    """Multi-level analysis and synthesis matrices of one axis.

    Returns:
        analysis (R, length) and synthesis (length, R), float64, rows ordered as PyWavelets' ``wavedec``:
        [a_n, d_n, ..., d_1]; and the row count of each sub-band in that order.

    Raises:
        ValueError: unknown wavelet or mode, or a level below 1.
    """
    if wavelet not in pywt.wavelist(kind="discrete"):
        raise ValueError(f"wavelet is {shown(wavelet)}; expected a discrete PyWavelets wavelet, e.g. 'bior2.8'")
    choice("mode", mode, pywt.Modes.modes)
    whole("level", level, 1)
    filters, analysis, sizes = pywt.Wavelet(wavelet), np.eye(length), (length,)
    for _ in range(level):
        approx = sizes[0]
        edge = "symmetric" if approx == 1 and "reflect" in mode else mode  # one row has no other to be mirrored about it
        bands = pywt.dwt(analysis[:approx], filters, edge, axis=0)
        analysis = np.concatenate([*bands, analysis[approx:]])
        sizes = (*map(len, bands), *sizes[1:])
    units = np.split(np.eye(len(analysis)), np.cumsum(sizes)[:-1])
    return analysis, pywt.waverec(units, filters, mode, axis=0)[:length], sizes


class WaveletTransform(LinearTransform):
    """DWT of a motion along time and along the flattened joint axis.

    Source: MotionWavelet, Eq. 4 and Definition 1 (level 1). One level gives the four sub-bands side by side,
    y = cat(aa, da, ad, dd) with the time letter first, shape (K, 4D), K = floor((T+l-1)/2), D = floor((C+l-1)/2)
    for filters of l taps. Own choice for level > 1, where the sub-bands no longer have equal height: the fully
    separable transform, y = A x Bᵀ with rows and columns [a_n, d_n, ..., d_1] (PyWavelets' ``fswavedecn``).

    Args:
        frames, channels: T and C of the motions.
        wavelet: any discrete PyWavelets wavelet.
        mode: any PyWavelets signal extension; the paper's appendix: "zero".
        level: number of decomposition levels, at least 1.

    Raises:
        ValueError: unknown wavelet or mode, or level < 1.

    Notes:
        ``inverse(tf(x)) == x`` for every wavelet with perfect reconstruction, i.e. all but dmey (a truncated
        filter, error about 1e-3). ``project`` is idempotent of rank T*C, orthogonal only for orthogonal
        wavelets with zero extension.

    >>> tf = WaveletTransform(frames=40, channels=48, wavelet="bior2.8")
    >>> x = torch.randn(5, 40, 48)
    >>> y = tf(x)
    >>> y.shape, list(tf.split(y))
    (torch.Size([5, 28, 128]), ['aa', 'da', 'ad', 'dd'])
    >>> torch.allclose(tf.inverse(y), x, atol=1e-5)
    True
    """

    def __init__(self, frames: int, channels: int, wavelet: str = "bior2.8", mode: str = "zero", level: int = 1) -> None:
        self.frames, self.channels = whole("frames", frames, 1), whole("channels", channels, 1)
        self.wavelet, self.mode, self.level = wavelet, mode, level
        self.analysis_time, self.synthesis_time, self.rows = a, s, rows = wavelet_matrices(frames, wavelet, mode, level)
        self.analysis_space, self.synthesis_space, self.columns = b, r, columns = wavelet_matrices(channels, wavelet, mode, level)
        self.shape = (rows[0], 4 * columns[0]) if level == 1 else (sum(rows), sum(columns))
        self._letters = ["a", "d"] if level == 1 else [f"a{level}", *(f"d{n}" for n in range(level, 0, -1))]
        self.bands = dict.fromkeys(("aa", "da", "ad", "dd"), columns[0])  # of one level
        self._analysis = Constant(a), Constant(b.T)
        self._synthesis = Constant(s), Constant(r.T)
        self._projection = Constant(a @ s), Constant((b @ r).T)

    def __call__(self, x: Motions) -> Coefficients:
        """y = DWT(x)."""
        self._expect(x, (self.frames, self.channels))
        left, right = (m.like(x) for m in self._analysis)
        return self.join(self._bands((left @ x) @ right))

    def inverse(self, y: Coefficients) -> Motions:
        """x = iDWT(y), cropped to T x C."""
        self._expect(y, self.shape)
        left, right = (m.like(y) for m in self._synthesis)
        return left @ (self._grid(self.split(y)) @ right)

    def project(self, y: Coefficients) -> Coefficients:
        """DWT(iDWT(y)), Eq. 8: onto the range of the DWT."""
        self._expect(y, self.shape)
        left, right = (m.like(y) for m in self._projection)
        return self.join(self._bands((left @ self._grid(self.split(y))) @ right))

    def split(self, y: Coefficients) -> dict[str, Tensor]:
        """Sub-bands by name, time letter first: aa, da, ad, dd; with the level after each letter if level > 1."""
        return super().split(y) if self.level == 1 else self._bands(y)

    def join(self, bands: dict[str, Tensor]) -> Coefficients:
        """Inverse of `split`."""
        return super().join(bands) if self.level == 1 else self._grid(bands)

    def _bands(self, grid: Tensor) -> dict[str, Tensor]:
        """Sub-bands of A x Bᵀ, those of one letter of time in a row."""
        bands = (band for across in grid.split(self.rows, dim=-2) for band in across.split(self.columns, dim=-1))
        return dict(zip(map("".join, product(self._letters, repeat=2)), bands, strict=True))

    def _grid(self, bands: dict[str, Tensor]) -> Tensor:
        """Inverse of `_bands`."""
        return torch.cat([torch.cat([bands[row + column] for column in self._letters], dim=-1) for row in self._letters], dim=-2)


class TimeWaveletTransform(AlongTime):
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
        whole("frames", frames, 1)
        whole("level", level, 1)
        if not 0 <= whole("omit", omit) < level:
            raise ValueError(f"omit is {omit}; expected 0 to {level - 1}, below the level ({level})")
        if frames < 2**level:
            raise ValueError(f"level is {level} of {frames} frames; expected at most {frames.bit_length() - 1}")
        analysis, synthesis, sizes = wavelet_matrices(frames, wavelet, "periodization", level)
        counts = {f"a{level}": 1, **{f"d{n}": 2 ** (level - n) for n in range(level, omit, -1)}}

        def by_rows(matrix: np.ndarray) -> np.ndarray:
            """Coefficients in the order of rows; an odd level has one less than two rows of the next."""
            bands = zip(counts.values(), np.split(matrix, np.cumsum(sizes)), strict=False)
            padded = [np.pad(band, ((0, sizes[0] * count - len(band)), (0, 0))) for count, band in bands]
            return np.hstack([band.reshape(sizes[0], -1, frames) for band in padded]).reshape(-1, frames)

        super().__init__(by_rows(analysis), by_rows(synthesis.T).T, channels, counts)
