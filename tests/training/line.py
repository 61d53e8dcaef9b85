"""An objective so small that its training is worked out by hand: a line through the sums of random triples."""

from __future__ import annotations

import os
from pathlib import Path

import torch

from mwlib.training import Objective, TrainingConfig, train

SETTINGS = TrainingConfig(
    train_steps=7, batch=8, lr=0.05, lr_milestones=(2, 5), lr_gamma=0.5, weight_decay=0.3, ema=0.7, ema_start=3,
    clip_gradient=0.1, checkpoint_every=2, seed=5,
)  # fmt: skip


class Line(Objective):
    """Three weights that should all become 1; remembers those it was validated with."""

    def __init__(self):
        self.network, self.validated = torch.nn.Linear(3, 1, bias=False), []
        torch.nn.init.zeros_(self.network.weight)

    def draw(self, batch, generator):
        return torch.randn(batch, 3, generator=generator)

    def loss(self, network, batch, generator):
        return (network(batch)[:, 0] - batch.sum(1)).square().mean()

    def validate(self, network):
        assert not network.training
        self.validated.append(network.weight.detach()[0].clone())
        return float(network.weight.detach().sum())


def one_of_several(folder: Path) -> None:
    """A process of several that train together; it leaves its weights in the folder."""
    torch.set_num_threads(1)
    line = Line()
    list(train(lambda learnt: line, SETTINGS, folder))
    torch.save(line.network.weight.detach()[0], folder / f"{os.environ['RANK']}.pt")
    torch.distributed.destroy_process_group()
