"""A system in one file, the smallest that the house can hold: diffusion of 1-D curves. Nothing outside this file knows it."""

import sys
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import nn

from mwlib.diffusion import DiffusionConfig, WindowNoise, alpha_bar, ddim, ddim_indices, noised
from mwlib.experiments import register
from mwlib.metrics import Column
from mwlib.settings import Count, Natural, Positive, Settings
from mwlib.training import Objective, TrainingConfig, seeded

METRICS = {"energy": Column("energy")}


@dataclass(frozen=True)
class CurveConfig:
    data: str = "sines"  # what the curves are
    amplitude: Positive = 1.0  # of the curves
    width: Count = 32  # of the network


@dataclass(frozen=True)
class SamplingConfig:
    sampling_seed: Natural = 0  # of the noise


@dataclass(frozen=True)
class Config(Settings):
    system: ClassVar[str] = "curves"
    presets = {"tiny": {"train_steps": 40, "lr": 3e-3, "lr_schedule": "constant", "ema_start": 0, "checkpoint_every": 10}}
    after_training = frozenset({"sampling", "checkpoint_every"})
    curves: CurveConfig = field(default_factory=CurveConfig)
    diffusion: DiffusionConfig = field(default_factory=lambda: DiffusionConfig(steps=50))
    training: TrainingConfig = field(default_factory=TrainingConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)


@dataclass(frozen=True)
class load_data:  # the data of a configuration: sines of any phase
    cfg: Config

    def fingerprints(self):
        return f"{self.cfg.curves.data}{self.cfg.curves.amplitude}", "none"


class make_objective(Objective):
    def __init__(self, cfg, data, learnt):
        self.cfg, self.alpha_bar = cfg, alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)
        with seeded(cfg.training.seed, 0):
            self.network = nn.Sequential(nn.Linear(17, cfg.curves.width), nn.SiLU(), nn.Linear(cfg.curves.width, 16))

    def draw(self, batch, generator):
        return self.cfg.curves.amplitude * torch.sin(6.283 * (torch.arange(16) / 16 + torch.rand(batch, 1, generator=generator)))

    def loss(self, network, batch, generator):
        t, eps = torch.randint(1, 50, (len(batch), 1), generator=generator), torch.randn(batch.shape, generator=generator)
        return (network(torch.cat([noised(batch, eps, self.alpha_bar[t[:, 0]]), t / 50], dim=-1)) - eps).square().mean()


def open_model(cfg, weights, learnt, about):
    network = make_objective(cfg, None, {}).network
    network.load_state_dict(weights)
    return network


def evaluate(cfg, get_model, data, progress):
    network, start = get_model(), WindowNoise(cfg.sampling.sampling_seed, range(32), (16,))()
    denoise = lambda y, t: network(torch.cat([y, torch.full((32, 1), t / 50)], dim=-1)).detach()  # noqa: E731
    *_, last = ddim(denoise, start, alpha_bar(cfg.diffusion.schedule, 50), ddim_indices(50, 10))
    energy = last.y.square().mean(-1)
    return {"mean": {"energy": float(energy.mean())}, "standard_error": {"energy": float(energy.std() / 32**0.5)}, "windows": 32}


register(sys.modules[__name__])
