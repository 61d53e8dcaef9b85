"""The moving average of a network's weights."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn


class MovingAverage:
    """Exponential moving average of weights: a copy of them until `start` steps, decayed by `decay` after that.

    Source: HumanMAC (its code); MotionWavelet, Appendix A, gives the decay.

    Args:
        network: whose weights are averaged.
        decay: share of the old average that stays at each step.
        start: step until which the average is a copy.
    """

    def __init__(self, network: nn.Module, decay: float, start: int) -> None:
        self.network, self.decay, self.start = network, decay, start
        self.weights = [p.detach().clone() for p in network.parameters()]

    @torch.no_grad()
    def update(self, step: int) -> None:
        """Take in the weights after step 1, 2, ..."""
        decay = self.decay if step > self.start else 0.0
        average = get_ema_multi_avg_fn(decay)
        average(self.weights, [p.detach() for p in self.network.parameters()], step)

    @torch.no_grad()
    def averaged(self) -> nn.Module:
        """A copy of the network, in evaluation mode, with the averaged weights."""
        network = copy.deepcopy(self.network).eval()
        for parameter, average in zip(network.parameters(), self.weights, strict=True):
            parameter.copy_(average)
        return network

    def tensors(self) -> dict[str, Tensor]:
        """The averages by the names of the weights."""
        names = [name for name, _ in self.network.named_parameters()]
        return dict(zip(names, self.weights, strict=True))

    @torch.no_grad()
    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Take over what `tensors` gave."""
        for (name, _), average in zip(self.network.named_parameters(), self.weights, strict=True):
            average.copy_(tensors[name])
