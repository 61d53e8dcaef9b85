"""The network of a predictor, and its evaluations as noise estimates."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.diffusion import to_eps
from mwlib.networks import TransLinear
from mwlib.prediction.config import ModelConfig


def make_network(model: ModelConfig, shape: tuple[int, int]) -> TransLinear:
    """The untrained network that a configuration names, for coefficients of `shape`."""
    m = model
    return TransLinear(*shape, m.width, m.layers, m.heads, m.feedforward, m.dropout, m.attention_dropout)


@dataclass(frozen=True)
class NetworkBranches:
    """The network's evaluations as noise estimates; the windows' conditions are embedded once.

    Args:
        net: in evaluation mode.
        added: (N, 1, width) embedded conditions, shared by the samples of a window.
        alpha_bar: schedule.
        prediction: what the network predicts.
    """

    net: TransLinear
    added: Tensor
    alpha_bar: Tensor
    prediction: str

    def _evaluate(self, y: Tensor, t: int, added: Tensor | None) -> Tensor:
        output, _ = self.net.evaluate(y.flatten(0, 1), t, added)
        return to_eps(self.prediction, output.reshape(y.shape), y, self.alpha_bar[t])

    def _conditions(self, y: Tensor) -> Tensor:
        return self.added.expand(*y.shape[:2], -1).flatten(0, 1)

    def conditional(self, y: Float[Tensor, "N S rows columns"], t: int) -> Float[Tensor, "N S rows columns"]:
        """eps_theta(y, y_pad, t)."""
        return self._evaluate(y, t, self._conditions(y))

    def unconditional(self, y: Float[Tensor, "N S rows columns"], t: int) -> Float[Tensor, "N S rows columns"]:
        """eps_theta(y, t)."""
        return self._evaluate(y, t, None)

    def both(self, y: Float[Tensor, "N S rows columns"], t: int, with_attention: bool) -> tuple[Tensor, Tensor, Tensor | None]:
        """Conditional and unconditional estimate in one batch; attention (N, S, 2, heads, rows, rows) of the latter."""
        conditions = self._conditions(y)  # (N S, width)
        added = torch.cat([torch.zeros_like(conditions), conditions])
        output, attention = self.net.evaluate(y.flatten(0, 1), t, added, len(conditions) if with_attention else 0)
        unconditional, conditional = to_eps(self.prediction, output.unflatten(0, (2, *y.shape[:2])), y, self.alpha_bar[t])
        attention = None if attention is None else attention.unflatten(0, y.shape[:2])
        return conditional, unconditional, attention
