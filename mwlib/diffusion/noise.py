"""Gaussian noise that does not depend on how windows are grouped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


class WindowNoise:
    """Gaussian noise with one stream per window, so that chunking windows cannot change any number.

    Own choice: drawn on the CPU whatever the device, so that a seed means the same everywhere; or, if told so, where it is
    wanted, which is faster and gives other numbers on each kind of device.

    Args:
        seed: of the whole draw.
        windows: identity of each window in this chunk.
        shape: of one window: (S, rows, columns).
        device: where the noise is wanted.
        source: where it is drawn.

    >>> three, last = WindowNoise(0, [0, 1, 2], (4, 5)), WindowNoise(0, [2], (4, 5))
    >>> torch.equal(three()[2:], last())
    True
    """

    def __init__(
        self,
        seed: int,
        windows: Sequence[int],
        shape: tuple[int, ...],
        device: torch.device | str = "cpu",
        source: torch.device | str = "cpu",
    ) -> None:
        seeds = (int(np.random.SeedSequence((seed, int(w))).generate_state(1)[0]) for w in windows)
        self.generators = [torch.Generator(source).manual_seed(s) for s in seeds]
        self.shape, self.device, self.source = shape, device, source

    def __call__(self) -> Float[Tensor, "N *item"]:
        """The next draw."""
        draws = torch.empty(len(self.generators), *self.shape, device=self.source)
        for row, generator in zip(draws, self.generators, strict=True):
            row.normal_(generator=generator)
        return draws.to(self.device)
