"""Gaussian noise that does not depend on how windows are grouped."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


class WindowNoise:
    """Gaussian noise with one stream per window, so that chunking windows cannot change any number.

    Own choice: drawn on the CPU whatever the device, so that a seed means the same everywhere.

    Args:
        seed: of the whole draw.
        windows: identity of each window in this chunk.
        shape: of one window: (S, rows, columns).
        device: where the noise is wanted.

    >>> three, last = WindowNoise(0, [0, 1, 2], (4, 5)), WindowNoise(0, [2], (4, 5))
    >>> torch.equal(three()[2:], last())
    True
    """

    def __init__(self, seed: int, windows: Sequence[int], shape: tuple[int, ...], device: torch.device | str = "cpu") -> None:
        seeds = (int(np.random.SeedSequence((seed, int(w))).generate_state(1)[0]) for w in windows)
        self.generators = [torch.Generator().manual_seed(s) for s in seeds]
        self.shape, self.device = shape, device

    def __call__(self) -> Float[Tensor, "N *item"]:
        """The next draw."""
        draws = torch.empty(len(self.generators), *self.shape)
        parts = min(torch.get_num_threads(), len(draws))
        others = [_helpers().submit(self._fill, draws, k, parts, torch.is_inference_mode_enabled()) for k in range(1, parts)]
        self._fill(draws, 0, parts, torch.is_inference_mode_enabled())
        for other in others:
            other.result()
        return draws.to(self.device)

    def _fill(self, draws: Tensor, first: int, parts: int, mode: bool) -> None:
        """Every `parts`-th window's draw, from the first; torch lets the other threads draw at the same time."""
        with torch.inference_mode(mode):  # a thread does not inherit it
            for row, generator in zip(draws[first::parts], self.generators[first::parts], strict=True):
                row.normal_(generator=generator)


@cache
def _helpers() -> ThreadPoolExecutor:
    """Threads that stay, as starting one costs as much as it saves."""
    return ThreadPoolExecutor(max(1, torch.get_num_threads() - 1), "window noise")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)
