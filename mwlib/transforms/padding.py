"""Stretching an observed history to the length of the whole motion."""

from __future__ import annotations

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
