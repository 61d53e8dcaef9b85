"""Guidance that any conditional diffusion model can use."""

from __future__ import annotations

from torch import Tensor


def classifier_free(conditional: Tensor, unconditional: Tensor, w: float, form: str = "eq7") -> Tensor:
    """Mix two noise estimates.

    Source: MotionWavelet Eq. 7, (1+w) cond - w uncond ("eq7"), or the last but one line of Algorithm 1,
    uncond + w (cond - uncond) ("alg1"). They are the same with w_alg1 = 1 + w_eq7.

    Raises:
        ValueError: unknown form.

    >>> conditional, unconditional = torch.tensor(2.0), torch.tensor(1.0)
    >>> classifier_free(conditional, unconditional, 0.5), classifier_free(conditional, unconditional, 1.5, "alg1")
    (tensor(2.5000), tensor(2.5000))
    """
    if form == "eq7":
        return ((1 + w) * conditional).sub_(w * unconditional)
    if form == "alg1":
        return unconditional + w * (conditional - unconditional)
    raise ValueError(f"form is {form!r}; expected 'eq7' or 'alg1'")
