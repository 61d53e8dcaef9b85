"""Learning rates against their formulas and against torch."""

from __future__ import annotations

import pytest
import torch

from mwlib.training import TrainingConfig, learning_rate


def test_learning_rates():
    c = TrainingConfig(lr=1.0, lr_schedule="multistep", lr_milestones=(10, 20), lr_gamma=0.2)
    assert [learning_rate(c, s) for s in (0, 9, 10, 19, 20)] == pytest.approx([1, 1, 0.2, 0.2, 0.04])
    c = TrainingConfig(lr=1.0, lr_schedule="cosine_restarts", lr_period=10, lr_gamma=0.9)
    assert [learning_rate(c, s) for s in (0, 5, 10, 25)] == pytest.approx([1, 0.5, 0.9, 0.405])
    c = TrainingConfig(lr=1.0, lr_schedule="cosine", train_steps=100, warmup=10)
    assert [learning_rate(c, s) for s in (0, 50)] == pytest.approx([0.1, 0.5])
    c = TrainingConfig(lr=1.0, lr_schedule="constant", warmup=4)
    assert [learning_rate(c, s) for s in (0, 1, 3, 4, 10_000)] == pytest.approx([0.25, 0.5, 1, 1, 1])


def test_warm_up_multiplies_every_schedule():
    for schedule in ("constant", "multistep", "cosine", "cosine_restarts"):
        options = dict(lr=0.3, lr_schedule=schedule, lr_milestones=(2,), train_steps=20, lr_period=3)
        for step in range(9):
            share = min((step + 1) / 4, 1)
            warm = learning_rate(TrainingConfig(**options, warmup=4), step)
            assert warm == pytest.approx(share * learning_rate(TrainingConfig(**options), step)), schedule


def test_restart_schedule_equals_torch():
    c = TrainingConfig(lr=1.0, lr_schedule="cosine_restarts", lr_period=10, lr_gamma=1.0)
    parameter = torch.nn.Parameter(torch.zeros(1))
    optimiser = torch.optim.SGD([parameter], lr=1.0)
    theirs = torch.optim.lr_scheduler.CosineAnnealingWarmRestarts(optimiser, 10)
    for step in range(25):
        assert learning_rate(c, step) == pytest.approx(theirs.get_last_lr()[0])
        optimiser.step()
        theirs.step()
