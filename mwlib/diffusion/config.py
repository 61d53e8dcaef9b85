"""Settings of the forward process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mwlib.settings import Count


@dataclass(frozen=True)
class DiffusionConfig:
    """The forward process and what the network predicts."""

    schedule: Literal["linear", "cosine", "sigmoid", "sqrt"] = "cosine"  # of the noise, see `alpha_bar`
    steps: Count = 1000  # M, noising steps
    prediction: Literal["eps", "y0", "v"] = "eps"  # what the network says: noise, clean coefficients, or both mixed
