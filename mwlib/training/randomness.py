"""Randomness as a function of numbers: nothing to save, nothing to restore."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch


@contextmanager
def seeded(*numbers: int) -> Iterator[torch.Generator]:
    """Yield a generator seeded from the numbers; seed torch's global one too, and restore it on exit.

    Dropout and initial weights draw from the global one. Own choice: every step's randomness is a function of (seed, step,
    process). The numbers are mixed first, as torch's CPU generator looks at the low 32 bits of a seed only.
    """
    seed, other = (int(n) for n in np.random.SeedSequence(numbers).generate_state(2))
    with torch.random.fork_rng([torch.cuda.current_device()] if torch.cuda.is_available() else []):
        torch.manual_seed(seed)
        yield torch.Generator().manual_seed(other)
