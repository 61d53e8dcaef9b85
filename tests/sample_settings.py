"""A configuration that trains in a second, and motions for it."""

from __future__ import annotations

from copy import deepcopy
from functools import cache

import torch

from mwlib.data.sources import Split
from mwlib.data.windows import prepare
from mwlib.prediction.config import Config
from mwlib.prediction.objective import PredictionObjective
from mwlib.prediction.predictor import Predictor
from mwlib.synthetic.motions import synthetic_motions

SMALL = dict(
    fps=10.0, history=6, future=14, width=16, layers=2, heads=2, feedforward=16, dropout=0.1, attention_dropout=0.1,
    train_steps=12, batch=8, checkpoint_every=3, ema_start=4, steps=50, ddim_steps=5, samples=3, warmup=0,
    loss_weight="uniform",
)  # fmt: skip


def small(**changes) -> Config:
    """The tiny preset, made smaller."""
    return Config.preset("tiny", **{**SMALL, **changes})


@cache
def two_people() -> Split:
    """One synthetic person to train on, another for the validation loss."""
    motions = prepare(synthetic_motions(subjects=2), 10.0)
    return Split(motions[:12], motions[12:], [])


_OBJECTIVES: dict[str, PredictionObjective] = {}  # one for all settings of the sampling


def untrained(**changes) -> Predictor:
    """A predictor that does something without a training: random weights also where a training starts from zero."""
    cfg = small(**changes)
    if cfg.training_hash() not in _OBJECTIVES:
        _OBJECTIVES[cfg.training_hash()] = PredictionObjective(cfg, two_people())
    objective = _OBJECTIVES[cfg.training_hash()]
    network, generator = deepcopy(objective.network), torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.normal_(std=0.1, generator=generator)
    return Predictor(network, objective.representation, cfg, objective.bodies)
