"""Dropout that costs little on the CPU."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class Dropout(nn.Module):
    """Drop elements with probability p and scale the rest by 1/(1-p).

    Own choice: torch draws one double for every element on the CPU, a quarter of a training step here; this draws
    one byte, so p is rounded to the next of 256ths there. On a GPU it is torch's own.

    Args:
        p: probability, 0 to below 1.
    """

    def __init__(self, p: float) -> None:
        super().__init__()
        self.p, self.dropped = p, round(256 * p)

    def forward(self, x: Tensor) -> Tensor:
        """The identity when not training."""
        if not self.training or self.dropped == 0:
            return x
        if x.device.type != "cpu":
            return F.dropout(x, self.p)
        words = torch.randint(-(2**63), 2**63 - 1, (x.numel() // 8 + 1,))
        kept = words.view(torch.uint8)[: x.numel()].reshape(x.shape) >= self.dropped
        return x * kept.to(x.dtype).mul_(256 / (256 - self.dropped))
