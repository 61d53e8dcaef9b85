"""Toy clips with captions: smooth features of two kinds, named by their sentences."""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d

from mwlib.data.captioned import Parts
from mwlib.data.formats.humanml import HUMANML3D, CaptionedClip
from mwlib.text_to_motion.config import Config
from mwlib.text_to_motion.model import TextToMotion
from mwlib.text_to_motion.objective import TextObjective

SMALL = dict(
    data="toy", shortest=8, longest=24, width=16, layers=2, heads=2, feedforward=32, text_width=16, text_layers=1,
    frames_per_token=1, steps=10, train_steps=6, batch=4, checkpoint_every=3, ema_start=2, lr_schedule="constant",
    test_clips=0, repeated=2, repeats=3, pool=4, dropout=0.0,
)  # fmt: skip


def small(**changes) -> Config:
    """Settings that train in a second."""
    return Config.preset("tiny").override(**{**SMALL, **changes})


def clip(number: int, split: str = "train") -> CaptionedClip:
    """Features around plus or minus one, by what the sentence says."""
    rng = np.random.default_rng(number)
    frames, up = 8 + number % 13, number % 2 == 0
    x = gaussian_filter1d(rng.normal(size=(frames, HUMANML3D.width)), 2.0, axis=0) + (1.0 if up else -1.0)
    texts = ("a person goes up", "someone rises") if up else ("a person goes down", "someone falls")
    return CaptionedClip(x.astype(np.float32), texts, f"toy_{number}", split)


@cache
def toy() -> Parts:
    """Thirty clips to train, six each to validate and to test."""
    numbers = iter(range(100))
    return Parts(*([clip(next(numbers), split) for _ in range(n)] for n, split in ((30, "train"), (6, "val"), (6, "test"))))


def untrained(**changes) -> TextToMotion:
    """A model that listens to its sentence, though nobody taught it what sentences mean."""
    cfg = small(**changes)
    objective = TextObjective(cfg, toy())
    generator = torch.Generator().manual_seed(9)
    with torch.no_grad():
        for weights in objective.network.parameters():  # some layers begin at zero
            weights.add_(0.03 * torch.randn(weights.shape, generator=generator))
    return TextToMotion.from_tensors(cfg, objective.network.state_dict(), objective.learnt(), objective.about())
