"""The interface of frequency views, separable linear maps by constant matrices, and the padding of histories."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


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

    @abstractmethod
    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... rows columns"]:
        """Analysis: motion (metres) to coefficients (metres)."""

    @abstractmethod
    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """Synthesis: coefficients to motion."""

    @abstractmethod
    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """Analysis of the synthesis; of a linear map: the nearest thing to y, along a fixed direction, that some motion has."""

    @abstractmethod
    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """Named views of the sub-bands of y."""

    @abstractmethod
    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Put sub-bands together again: ``join(split(y)) == y``."""

    def tensors(self) -> dict[str, Tensor]:
        """What was learnt from data, by name; nothing for a map given by constants."""
        return {}


class LinearTransform(Transform):
    """y = A x Bᵀ up to a fixed arrangement of the columns; its inverse likewise; every matrix is a `Constant`."""


class OrthonormalRows(LinearTransform):
    """Coefficients of every channel along time by a matrix of orthonormal rows; the inverse is its transpose.

    Args:
        rows: the matrix, float64.
        channels: C of the motions.
        name: of its one band.
    """

    def __init__(self, rows: Float[np.ndarray, "rows T"], channels: int, name: str) -> None:
        self.frames, self.channels, self.shape, self.name = rows.shape[1], channels, (len(rows), channels), name
        self.analysis_time, self.synthesis_time = rows, rows.T
        self._forward, self._backward = Constant(self.analysis_time), Constant(self.synthesis_time)

    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... rows columns"]:
        """The coefficients."""
        return self._forward.like(x) @ x

    def inverse(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... T C"]:
        """The motion with these coefficients and no others."""
        return self._backward.like(y) @ y

    def project(self, y: Float[Tensor, "... rows columns"]) -> Float[Tensor, "... rows columns"]:
        """The identity: the rows are orthonormal, so all coefficients are a motion's."""
        return y

    def split(self, y: Float[Tensor, "... rows columns"]) -> dict[str, Tensor]:
        """One band."""
        return {self.name: y}

    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... rows columns"]:
        """Inverse of `split`."""
        return bands[self.name]
