"""Discrete wavelet transforms of a motion, as constant matrices: along time and joints, or along time alone."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pywt
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.settings import choice, shown, whole
from mwlib.transforms.linear import Constant, LinearTransform


def _level_matrices(length: int, wavelet: pywt.Wavelet, mode: str) -> tuple[np.ndarray, np.ndarray]:
    """One level in one dimension: analysis (2K, length) with rows [approx; detail], synthesis (length, 2K).

    Analysis pads the signal with PyWavelets' own extension and takes a[k] = sum_j h[j] x[2k+1-j] (Eq. 3);
    synthesis adds up the dual filters at even shifts (Eq. 1).
    """
    taps = wavelet.dec_len
    periodised = mode == "periodization"
    even = length + length % 2
    rows = even // 2 if periodised else (length + taps - 1) // 2
    shift = taps // 2 if periodised else 1
    extended = pywt.pad(np.eye(length), [(taps, taps + 1), (1, 1)], mode)[
        :, 1 : length + 1
    ]  # "smooth" fails on an axis not padded
    source = 2 * np.arange(rows)[:, None] + shift - np.arange(taps) + taps
    analysis = [np.einsum("j,kjn->kn", filters, extended[source]) for filters in (wavelet.dec_lo, wavelet.dec_hi)]

    target = 2 * np.arange(rows)[:, None] + np.arange(taps) - (taps // 2 - 1 if periodised else taps - 2)
    column = np.broadcast_to(np.arange(rows)[:, None], target.shape)
    synthesis = []
    for filters in (wavelet.rec_lo, wavelet.rec_hi):
        weight = np.broadcast_to(filters, target.shape)
        part = np.zeros((length, rows))
        place = target % even if periodised else target
        keep = (place >= 0) & (place < length)
        np.add.at(part, (place[keep], column[keep]), weight[keep])
        synthesis.append(part)
    return np.concatenate(analysis), np.concatenate(synthesis, axis=1)


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
    filters = pywt.Wavelet(wavelet)
    analysis, synthesis = _level_matrices(length, filters, mode)
    sizes = (len(analysis) // 2,) * 2
    for _ in range(level - 1):
        approx = sizes[0]
        deeper, back = _level_matrices(approx, filters, mode)
        analysis = np.concatenate([deeper @ analysis[:approx], analysis[approx:]])
        synthesis = np.concatenate([synthesis[:, :approx] @ back, synthesis[:, approx:]], axis=1)
        sizes = (len(deeper) // 2, len(deeper) // 2, *sizes[1:])
    return analysis, synthesis, sizes


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
        self.analysis_time, self.synthesis_time, self.rows = wavelet_matrices(frames, wavelet, mode, level)
        self.analysis_space, self.synthesis_space, self.columns = wavelet_matrices(channels, wavelet, mode, level)
        self.shape = (self.rows[0], 4 * self.columns[0]) if level == 1 else (sum(self.rows), sum(self.columns))
        a, s, b, r = self.analysis_time, self.synthesis_time, self.analysis_space, self.synthesis_space
        self._analysis = Constant(a), Constant(b.T)
        self._synthesis = Constant(s), Constant(r.T)
        self._projection = Constant(a @ s), Constant((b @ r).T)

    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... rows columns"]:
        """y = DWT(x)."""
        self._expect(x, (self.frames, self.channels))
        left, right = (m.like(x) for m in self._analysis)
        return self._side_by_side((left @ x) @ right)

    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """x = iDWT(y), cropped to T x C."""
        self._expect(y, self.shape)
        left, right = (m.like(y) for m in self._synthesis)
        return left @ (self._blocks(y) @ right)

    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """DWT(iDWT(y)), Eq. 8: onto the range of the DWT."""
        self._expect(y, self.shape)
        left, right = (m.like(y) for m in self._projection)
        return self._side_by_side((left @ self._blocks(y)) @ right)

    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """Sub-bands by name, time letter first: aa, da, ad, dd; with the level after each letter if level > 1."""
        if self.level == 1:
            return dict(zip(("aa", "da", "ad", "dd"), y.split(self.columns[0], dim=-1), strict=True))
        bands = {}
        for row, across in zip(self._letters(), y.split(self.rows, dim=-2), strict=True):
            for column, band in zip(self._letters(), across.split(self.columns, dim=-1), strict=True):
                bands[row + column] = band
        return bands

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Inverse of `split`."""
        if self.level == 1:
            return torch.cat([bands[name] for name in ("aa", "da", "ad", "dd")], dim=-1)
        rows = [torch.cat([bands[row + column] for column in self._letters()], dim=-1) for row in self._letters()]
        return torch.cat(rows, dim=-2)

    def _letters(self) -> list[str]:
        return [f"a{self.level}", *(f"d{n}" for n in range(self.level, 0, -1))]

    def _side_by_side(self, grid: Tensor) -> Tensor:
        """(2K, 2D) blocks [[aa, ad], [da, dd]] -> (K, 4D) columns aa, da, ad, dd."""
        if self.level > 1:
            return grid
        return grid.unflatten(-1, (2, -1)).unflatten(-3, (2, -1)).movedim(-4, -2).flatten(-3)

    def _blocks(self, y: Tensor) -> Tensor:
        """Inverse of `_side_by_side`."""
        if self.level > 1:
            return y
        return y.unflatten(-1, (2, 2, -1)).movedim(-2, -4).flatten(-4, -3).flatten(-2)


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
        for name, count in (("frames", frames), ("channels", channels), ("level", level)):
            whole(name, count, 1)
        if not 0 <= whole("omit", omit) < level:
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
        self._expect(x, (self.frames, self.channels))
        return self._rows(self._analysis.like(x) @ x)

    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """The motion with these coefficients, those left out being zero."""
        self._expect(y, self.shape)
        return self._synthesis.like(y) @ self.along_time(y)

    def time_rows(self) -> Float[np.ndarray, "all T"]:
        """Low-pass and high-pass rows of the kept levels."""
        return self.analysis_time

    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """Analysis of the synthesis: the identity but for the few coefficients beyond the last frame."""
        return self._rows(self._projection.like(y) @ self.along_time(y))

    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """Sub-bands by letter and level: a3, d3, d2, d1."""
        widths = [count * self.channels for count in self.counts]
        return dict(zip(self.names, y.split(widths, dim=-1), strict=True))

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Inverse of `split`."""
        return torch.cat([bands[name] for name in self.names], dim=-1)

    def _rows(self, coefficients: Float[Tensor, "... all C"]) -> Float[Tensor, "... rows columns"]:
        return coefficients.unflatten(-2, (self.shape[0], -1)).flatten(-2)

    def along_time(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... all C"]:
        """The coefficients of each channel, row after row."""
        return y.unflatten(-1, (-1, self.channels)).flatten(-3, -2)
