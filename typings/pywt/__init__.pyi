"""What mwlib uses of PyWavelets, which has no types of its own: most of it is compiled."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

class Wavelet:
    name: str
    dec_len: int
    dec_lo: list[float]
    dec_hi: list[float]
    rec_lo: list[float]
    rec_hi: list[float]
    filter_bank: tuple[list[float], list[float], list[float], list[float]]
    orthogonal: bool
    symmetry: str
    def __init__(self, name: str) -> None: ...
    def wavefun(self, level: int = 8) -> list[np.ndarray]: ...

class _Modes:
    modes: list[str]

Modes: _Modes

def wavelist(family: str | None = None, kind: Literal["all", "continuous", "discrete"] = "all") -> list[str]: ...
def pad(x: ArrayLike, pad_widths: int | Sequence[int | tuple[int, int]], mode: str) -> np.ndarray: ...
def dwt(data: ArrayLike, wavelet: Wavelet | str, mode: str = "symmetric", axis: int = -1) -> tuple[np.ndarray, np.ndarray]: ...
def __getattr__(name: str) -> Any: ...  # the rest: not described
