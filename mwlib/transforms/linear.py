"""What every transform here is: a separable linear map given by constant matrices."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


class LinearTransform(ABC):
    """y = A x Bᵀ up to a fixed arrangement of the columns; its inverse likewise.

    Matrices are kept in float64 on the CPU and cast once per (dtype, device), so the input decides where and
    how precisely the product is taken. Leading axes are free; gradients flow.
    """

    shape: tuple[int, int]

    def __init__(self) -> None:
        self._cast: dict[tuple[str, torch.dtype, torch.device], Tensor] = {}

    def _matrix(self, name: str, like: Tensor) -> Tensor:
        key = (name, like.dtype, like.device)
        if key not in self._cast:
            self._cast[key] = torch.as_tensor(np.ascontiguousarray(getattr(self, name))).to(like.device, like.dtype)
        return self._cast[key]

    @abstractmethod
    def __call__(self, x: Float[Tensor, "... T C"]) -> Float[Tensor, "... K columns"]:
        """Analysis: motion (metres) to coefficients (metres)."""

    @abstractmethod
    def inverse(self, y: Float[Tensor, "... K columns"]) -> Float[Tensor, "... T C"]:
        """Synthesis: coefficients to motion."""

    @abstractmethod
    def project(self, y: Float[Tensor, "... K columns"]) -> Float[Tensor, "... K columns"]:
        """Analysis of the synthesis: the nearest thing to y, along a fixed direction, that some motion has."""

    @abstractmethod
    def split(self, y: Float[Tensor, "... K columns"]) -> dict[str, Tensor]:
        """Named views of the sub-bands of y."""

    @abstractmethod
    def join(self, bands: dict[str, Tensor]) -> Float[Tensor, "... K columns"]:
        """Put sub-bands together again: ``join(split(y)) == y``."""


def apply(left: Tensor, x: Tensor, right: Tensor) -> Tensor:
    """left @ x @ right for x (..., m, n), cheaper side first."""
    rows, m = left.shape
    n, columns = right.shape
    if rows * m * n + rows * n * columns <= m * n * columns + rows * m * columns:
        return (left @ x) @ right
    return left @ (x @ right)
