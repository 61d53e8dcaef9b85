"""Stretching an observed history to the length of the whole motion."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def pad_history(x_history: Float[Tensor, "... H C"], frames: int, how: str = "last_frame") -> Float[Tensor, "... T C"]:
    """Fill the unknown future so that a transform over T frames can be applied.

    Source: HumanMAC; "last_frame" is its default and the reading of MotionWavelet's y_pad (Algorithm 1).

    Args:
        x_history: observed frames, metres.
        frames: T, the wanted length.
        how: "last_frame" holds the last pose, "repeat" tiles the history, "zero" leaves zeros.

    Raises:
        ValueError: unknown `how`, or a history longer than `frames`.
    """
    observed = x_history.shape[-2]
    if observed > frames:
        raise ValueError(f"the history has {observed} frames; expected at most {frames}")
    if how == "last_frame":
        index = torch.arange(frames, device=x_history.device).clamp(max=observed - 1)
    elif how == "repeat":
        index = torch.arange(frames, device=x_history.device) % observed
    elif how == "zero":
        missing = x_history.new_zeros(*x_history.shape[:-2], frames - observed, x_history.shape[-1])
        return torch.cat([x_history, missing], dim=-2)
    else:
        raise ValueError(f"how is {how!r}; expected 'last_frame', 'repeat' or 'zero'")
    return x_history.index_select(-2, index)
