"""Interface of frequency views, maps by constant matrices, such as cosines and sines along time, scaling, padded histories."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import torch
from jaxtyping import Float
from scipy.fft import dct, dst
from torch import Tensor

from mwlib.settings import choice, of_kind, whole

Motions = Float[Tensor, "... T C"]  # metres
Coefficients = Float[Tensor, "... rows columns"]
TimeRows = Float[np.ndarray, "all T"]


def pad_history(x_history: Float[Tensor, "... H C"], frames: int) -> Float[Tensor, "... T C"]:
    """Hold the last observed pose over the unknown future, so that a transform over T frames can be applied.

    Source: HumanMAC's default, and the reading of MotionWavelet's y_pad (Algorithm 1).

    Args:
        x_history: observed frames, metres.
        frames: T, the wanted length.

    Raises:
        ValueError: a history longer than `frames`.

    >>> pad_history(torch.tensor([[1.0], [2.0]]), 4).flatten()
    tensor([1., 2., 2., 2.])
    """
    observed = x_history.shape[-2]
    if observed > frames:
        raise ValueError(f"the history has {observed} frames; expected at most {frames}")
    index = torch.arange(frames, device=x_history.device).clamp(max=observed - 1)
    return x_history.index_select(-2, index)


class Constant:
    """A float64 array that is cast once per precision and device, so that the input decides where and how precisely."""

    def __init__(self, array: np.ndarray) -> None:
        self.array = np.ascontiguousarray(array)
        self._cast: dict[tuple[torch.dtype, torch.device], Tensor] = {}

    def like(self, x: Tensor) -> Tensor:
        """The array in x's precision, where x is."""
        key = (x.dtype, x.device)
        if key not in self._cast:
            with torch.inference_mode(False):  # else later gradients could not use it
                self._cast[key] = torch.as_tensor(self.array).to(x.dtype).to(x.device)  # not every device has float64
        return self._cast[key]


class Transform(ABC):
    """A frequency view of motions of T frames and C channels. Leading axes are free; gradients flow."""

    shape: tuple[int, int]
    frames: int
    channels: int
    bands: dict[str, int]  # columns of each sub-band, in their order

    def _expect(self, array: Tensor, expected: tuple[int, int]) -> None:
        """Refuse what is no motion, or no coefficients, of this transform.

        Raises:
            ValueError: the last two axes are not these.
        """
        if tuple(of_kind("the argument", array, Tensor, "a tensor").shape[-2:]) != expected:
            raise ValueError(f"last two axes are {tuple(array.shape[-2:])}; expected {expected}")

    @abstractmethod
    def __call__(self, x: Motions) -> Coefficients:
        """Analysis: motion (metres) to coefficients (metres)."""

    @abstractmethod
    def inverse(self, y: Coefficients) -> Motions:
        """Synthesis: coefficients to motion."""

    def project(self, y: Coefficients) -> Coefficients:
        """Analysis of the synthesis; of a linear map: the nearest thing to y, along a fixed direction, that some motion has."""
        return self(self.inverse(y))

    def split(self, y: Coefficients) -> dict[str, Tensor]:
        """Named views of the sub-bands of y."""
        return dict(zip(self.bands, y.split([*self.bands.values()], dim=-1), strict=True))

    def join(self, bands: dict[str, Tensor]) -> Coefficients:
        """Put sub-bands together again: ``join(split(y)) == y``."""
        return torch.cat([bands[name] for name in self.bands], dim=-1)

    def tensors(self) -> dict[str, Tensor]:
        """What was learnt from data, by name; nothing for a map given by constants."""
        return {}

    def time_rows(self) -> TimeRows | None:
        """The matrix by which every channel is analysed along time, where the transform does no more; else None."""
        return None

    def along_time(self, y: Coefficients) -> Float[Tensor, "... all C"]:
        """What y says of each channel: ``time_rows() @ x`` of a motion x with these coefficients; without rows, x itself."""
        return self.inverse(y)


class LinearTransform(Transform):
    """y = A x Bᵀ up to a fixed arrangement of the columns; its inverse likewise; every matrix is a `Constant`."""


class AlongTime(LinearTransform):
    """Coefficients of every channel along time, those of one stretch of time side by side in a row, one band after the other.

    Args:
        analysis: the matrix that gives them, row after row, float64.
        synthesis: the one that leads back.
        channels: C of the motions.
        counts: coefficients of a channel in one row, by band.
    """

    def __init__(self, analysis: TimeRows, synthesis: Float[np.ndarray, "T all"], channels: int, counts: dict[str, int]) -> None:
        self.frames, self.channels = analysis.shape[1], whole("channels", channels, 1)
        self.bands = {name: count * channels for name, count in counts.items()}
        self.shape = (len(analysis) // sum(counts.values()), sum(self.bands.values()))
        self.analysis_time, self.synthesis_time = analysis, synthesis
        self._analysis, self._synthesis, self._projection = map(Constant, (analysis, synthesis, analysis @ synthesis))

    def __call__(self, x: Motions) -> Coefficients:
        """The coefficients."""
        self._expect(x, (self.frames, self.channels))
        return self._rows(self._analysis.like(x) @ x)

    def inverse(self, y: Coefficients) -> Motions:
        """The motion with these coefficients, all others being zero."""
        self._expect(y, self.shape)
        return self._synthesis.like(y) @ self.along_time(y)

    def project(self, y: Coefficients) -> Coefficients:
        """Analysis of the synthesis: the identity but for what no motion has."""
        return self._rows(self._projection.like(y) @ self.along_time(y))

    def time_rows(self) -> TimeRows:
        """The matrix of the analysis."""
        return self.analysis_time

    def along_time(self, y: Coefficients) -> Float[Tensor, "... all C"]:
        """The coefficients of each channel, row after row."""
        return y.unflatten(-1, (-1, self.channels)).flatten(-3, -2)

    def _rows(self, coefficients: Float[Tensor, "... all C"]) -> Coefficients:
        return coefficients.unflatten(-2, (self.shape[0], -1)).flatten(-2)


class OrthonormalRows(AlongTime):
    """Coefficients of every channel along time by a matrix of orthonormal rows; the inverse is its transpose.

    Args:
        rows: the matrix, float64.
        channels: C of the motions.
        name: of its one band.
    """

    def __init__(self, rows: TimeRows, channels: int, name: str) -> None:
        super().__init__(rows, rows.T, channels, {name: 1})

    def project(self, y: Coefficients) -> Coefficients:
        """The identity: the rows are orthonormal, so all coefficients are a motion's."""
        return y


class DCTTransform(OrthonormalRows):
    """Low-pass cosine coefficients of every channel.

    Source: HumanMAC (Chen et al., 2023): orthonormal DCT-II over the T frames, first L rows kept.

    Args:
        frames, channels: T and C of the motions.
        rows: L, number of kept coefficients, at most T; None keeps all (then the inverse is exact).

    Raises:
        ValueError: a count is not whole or too small, or rows exceeds frames.

    >>> tf = DCTTransform(frames=40, channels=48, rows=8)
    >>> still = torch.ones(40, 48)
    >>> y = tf(still)
    >>> y.shape, torch.allclose(tf.inverse(y), still, atol=1e-5)
    (torch.Size([8, 48]), True)
    """

    def __init__(self, frames: int, channels: int, rows: int | None = None) -> None:
        rows = whole("rows", whole("frames", frames, 1) if rows is None else rows, 1, frames)
        super().__init__(np.asarray(dct(np.eye(frames), norm="ortho", axis=0))[:rows], channels, "dct")


class DSTTransform(OrthonormalRows):
    """Low-pass sine coefficients of every channel, of the frames between the first and the last.

    Source: own choice: the orthonormal DST-I over the T - 2 inner frames. Its sines, sin(pi k n / (T - 1)), are zero at both
    ends. They are the eigenvectors of the Brownian bridge, so that its coefficients are independent.

    Args:
        frames, channels: T and C of the motions.
        rows: number of kept coefficients, at most T - 2; None keeps all.

    Raises:
        ValueError: a count is not whole or too small, or rows exceeds frames - 2.

    >>> tf = DSTTransform(frames=6, channels=1)
    >>> bridge = torch.tensor([0.0, 1.0, 3.0, 2.0, 1.0, 0.0])[:, None]
    >>> tf(bridge).shape, torch.allclose(tf.inverse(tf(bridge)), bridge, atol=1e-6)
    (torch.Size([4, 1]), True)
    """

    def __init__(self, frames: int, channels: int, rows: int | None = None) -> None:
        inner = whole("frames", frames, 3) - 2
        rows = whole("rows", inner if rows is None else rows, 1, inner)
        sines = np.asarray(dst(np.eye(inner), type=1, norm="ortho", axis=0))[:rows]
        super().__init__(np.pad(sines, ((0, 0), (1, 1))), channels, "dst")


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
    choice("kind", kind, ("none", "band", "coefficient"))
    if kind == "none":
        return torch.zeros(tf.shape), torch.ones(tf.shape)
    y = torch.cat([tf(part) for part in x.split(4096)])
    if len(y) == 0 or not (y != y[0]).any():
        raise ValueError(f"{len(y)} windows, all alike; expected windows that differ, to tell the scale of their coefficients")
    if kind == "band":
        deviations = {name: torch.full(band.shape[-2:], float(band.std())) for name, band in tf.split(y).items()}
        mean, deviation = torch.zeros(tf.shape), tf.join(deviations)
    else:
        deviation, mean = (part.float().cpu() for part in torch.std_mean(y, dim=0))
    return mean, deviation.clamp_min(1e-3 * float(deviation.max()))


class ScaledTransform(Transform):
    """(tf(x) - mean) / deviation, with the inverse, projection and sub-bands to match.

    Args:
        base: the transform underneath.
        mean, deviation: as `fit_scale` returns them; in metres, shape `base.shape`.

    Raises:
        ValueError: base is no transform, or a scale is no tensor of its shape.

    >>> x = torch.randn(200, 20, 6) * 0.3
    >>> base = mw.DCTTransform(20, 6)
    >>> tf = ScaledTransform(base, *fit_scale(base, x, "band"))
    >>> round(float(tf(x).std()), 3), torch.allclose(tf.inverse(tf(x)), x, atol=1e-5)
    (1.0, True)
    """

    def __init__(self, base: Transform, mean: Tensor, deviation: Tensor) -> None:
        self.base, self.shape = of_kind("base", base, Transform), base.shape
        self.frames, self.channels, self.bands = base.frames, base.channels, base.bands
        for name, scale in (("mean", mean), ("deviation", deviation)):
            if of_kind(name, scale, Tensor, "a tensor").shape != self.shape:
                raise ValueError(f"{name} has shape {tuple(scale.shape)}; expected {self.shape}")
        self.mean, self.deviation = mean.numpy(), deviation.numpy()
        self._mean, self._deviation = Constant(self.mean), Constant(self.deviation)
        self.time_rows, self.split, self.join = base.time_rows, base.split, base.join  # as scaling leaves the order alone

    def __call__(self, x: Motions) -> Coefficients:
        """Unit-deviation coefficients of a motion."""
        return self._scale(self.base(x))

    def inverse(self, y: Coefficients) -> Motions:
        """Motion, metres."""
        return self.base.inverse(self._unscale(y))

    def along_time(self, y: Coefficients) -> Float[Tensor, "... all C"]:
        """The base's, metres."""
        return self.base.along_time(self._unscale(y))

    def project(self, y: Coefficients) -> Coefficients:
        """The base's projection, seen in scaled coefficients."""
        return self._scale(self.base.project(self._unscale(y)))

    def _scale(self, y: Tensor) -> Tensor:
        """In place, as nobody else has y."""
        return y.sub_(self._mean.like(y)).div_(self._deviation.like(y))

    def _unscale(self, y: Tensor) -> Tensor:
        return torch.addcmul(self._mean.like(y), y, self._deviation.like(y))
