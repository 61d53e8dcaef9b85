"""The denoiser: TransLinear on frequency tokens, without MotionWavelet's condition; perhaps told the keyframes."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from mwlib.inbetweening.config import ModelConfig, TaskConfig
from mwlib.networks import TransLinear

TOLD = 3  # numbers of a token beside the interpolation: mask, frequency, length


class KeyframeNetwork(nn.Module):
    """What the network says of noised tokens.

    Source: FreqDiffusionBridge, Sec. 3.2, tells of linear layers, self-attention over the tokens and an embedding of the step
    that is added; HumanMAC's network, which does this and has skips and a learned place for each token, stands in. Own choice:
    what is told enters as columns beside each token's numbers.

    Args:
        model: sizes; whether keyframes are told.
        rows: most tokens.
        channels: numbers per token.
    """

    def __init__(self, model: ModelConfig, rows: int, channels: int) -> None:
        super().__init__()
        told = channels + TOLD if model.keyframes == "told" else 0
        self.net = TransLinear(
            rows, channels, model.width, model.layers, model.heads, model.feedforward, model.dropout, model.attention_dropout,
            told=told, conditioned=False,
        )  # fmt: skip

    @property
    def device(self) -> torch.device:
        """Where it lives."""
        return self.net.position.device

    def forward(
        self,
        y_t: Float[Tensor, "B rows channels"],
        t: Int[Tensor, " B"] | int,
        told: Float[Tensor, "B rows told"] | None = None,
    ) -> Float[Tensor, "B rows channels"]:
        """Its output. Fewer tokens than the most are followed by zeros.

        Args:
            y_t: noised tokens.
            t: diffusion index, one for all or one per item.
            told: see `Representation.told`; what was built to be told must be.
        """
        entering = y_t if told is None else torch.cat([y_t, told], dim=-1)
        missing = self.net.rows - y_t.shape[-2]
        output, _ = self.net.evaluate(nn.functional.pad(entering, (0, 0, 0, missing)), t, None)
        return output[:, : y_t.shape[-2]]


def make_network(model: ModelConfig, task: TaskConfig, channels: int) -> KeyframeNetwork:
    """The untrained network that a configuration names."""
    return KeyframeNetwork(model, model.rows or task.frames, channels)
