"""The network of a predictor, and its evaluations as noise estimates."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.diffusion import to_eps
from mwlib.networks import TransLinear
from mwlib.networks.precision import Precision, products_in
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
        precision: of the network's products.
    """

    net: TransLinear
    added: Tensor
    alpha_bar: Tensor
    prediction: str
    precision: Precision = "float32"

    def _evaluate(self, y: Tensor, t: int, added: Tensor | None, attention_rows: int = 0) -> tuple[Tensor, Tensor | None]:
        items = y.flatten(0, -3)
        with products_in(self.precision, items.device):
            output, attention = self.net.evaluate(items, t, added, attention_rows)
        attention = None if attention is None else attention.to(items.dtype)
        return to_eps(self.prediction, output.to(items.dtype), items, self.alpha_bar[t]), attention

    def _conditions(self, y: Tensor) -> Tensor:
        return self.added.expand(*y.shape[:2], -1).flatten(0, 1)

    def conditional(self, y: Float[Tensor, "N S rows columns"], t: int) -> Float[Tensor, "N S rows columns"]:
        """eps_theta(y, y_pad, t)."""
        return self._evaluate(y, t, self._conditions(y))[0].reshape(y.shape)

    def unconditional(self, y: Float[Tensor, "N S rows columns"], t: int) -> Float[Tensor, "N S rows columns"]:
        """eps_theta(y, t)."""
        return self._evaluate(y, t, None)[0].reshape(y.shape)

    def both(self, y: Float[Tensor, "N S rows columns"], t: int, with_attention: bool) -> tuple[Tensor, Tensor, Tensor | None]:
        """Conditional and unconditional estimate in one batch; attention (N, S, 2, heads, rows, rows) of the latter."""
        conditions = self._conditions(y)  # (N S, width)
        added = torch.cat([torch.zeros_like(conditions), conditions])
        count = len(conditions)
        eps, attention = self._evaluate(torch.cat([y, y]), t, added, count if with_attention else 0)
        attention = None if attention is None else attention.reshape(*y.shape[:2], *attention.shape[1:])
        return eps[count:].reshape(y.shape), eps[:count].reshape(y.shape), attention
