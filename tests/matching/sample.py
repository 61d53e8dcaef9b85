"""Toy clips whose captions say what moves and how much, and configurations that train on them in a second."""

from __future__ import annotations

import json
from functools import cache

import numpy as np

from mwlib.data.captioned import Parts
from mwlib.data.formats.humanml import CaptionedClip
from mwlib.matching.config import Config
from mwlib.matching.evaluators import Matcher
from mwlib.matching.objective import MatchingObjective

LIMBS, AMOUNTS = ("arm", "leg", "head", "hip"), ("little", "much", "nothing")
SMALL = dict(
    half="all", statistics="mdm", code_width=12, word_width=8, motion_width=14, text_width=10, embedding=6, words=20,
    dropout=0.0, loss="contrastive", margin=10.0, temperature=1.0, word_dropout=0.0, movement_steps=4, movement_batch=8,
    movement_frames=8, train_steps=6, batch=6, lr=3e-3, lr_schedule="constant", warmup=0, ema=0.9, ema_start=2,
    weight_decay=0.0, clip_gradient=0.0, checkpoint_every=3, seed=0, pool=8, repeats=3, sampling_seed=0,
)  # fmt: skip


def small(**changes) -> Config:
    """The tiny preset, made smaller; everything that the tests depend on is said here."""
    return Config.preset("tiny", **{**SMALL, **changes})


@cache
def toy_clips(count: int = 72, split: str = "train", seed: int = 0) -> tuple[CaptionedClip, ...]:
    """Features of HumanML3D's width: waves in the features of one limb, 12 to 31 frames, on noise; two captions each."""
    rng = np.random.default_rng([seed, len(split)])
    clips = []
    for number in range(count):
        limb, amount = number % 4, number // 4 % 3
        frames = int(rng.integers(12, 32))
        x = rng.normal(0, 0.02, (frames, 263)) + np.linspace(-1, 1, 263)
        wave = np.sin(np.arange(frames) / 2 + rng.uniform(0, 6))
        x[:, 4 + 60 * limb : 54 + 60 * limb] += (0.6 * amount + 0.2) * wave[:, None]
        captions = (f"The {LIMBS[limb]} moves {AMOUNTS[amount]}.", f"{AMOUNTS[amount]}, says the {LIMBS[limb]}")
        clips.append(CaptionedClip(x.astype(np.float32), captions, f"{split}{number:04d}", split))
    return tuple(clips)


@cache
def parts() -> Parts:
    """Clips to learn from, to validate with, and to be tested on."""
    return Parts([*toy_clips()], [*toy_clips(24, "val")], [*toy_clips(40, "test")])


def objective(**changes) -> MatchingObjective:
    """What trains with these settings."""
    return MatchingObjective(small(**changes), parts())


@cache
def untrained(seed: int = 0) -> Matcher:
    """A matcher with the weights that a training starts with."""
    made = objective(seed=seed)
    return Matcher.from_tensors(
        made.cfg, made.network.state_dict(), made.learnt(), {"vocabulary": json.dumps(made.vocabulary.words)}
    )
