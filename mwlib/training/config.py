"""Settings of the optimisation, and the learning rate that they describe."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from mwlib.settings import Advanced, BelowOne, Count, Natural, NotNegative, Positive


@dataclass(frozen=True)
class TrainingConfig:
    """The optimisation."""

    train_steps: Count = 390_500  # batches
    batch: Annotated[int, Interval(ge=1, le=65_536)] = 64  # items in each, over all processes
    lr: Positive = 1e-4  # learning rate
    weight_decay: NotNegative = 0.01  # of AdamW
    lr_schedule: Literal["constant", "multistep", "cosine_restarts", "cosine"] = "multistep"  # see learning_rate
    lr_milestones: tuple[Count, ...] = (93_720, 140_580, 187_440, 234_300)  # steps after which "multistep" multiplies by lr_gamma
    lr_gamma: Positive = 0.2  # that factor; of "cosine_restarts", the factor from peak to peak
    lr_period: Advanced[Count] = 15_620  # steps between cosine restarts
    warmup: Natural = 0  # steps of linear warm-up
    ema: BelowOne = 0.995  # decay of the moving average of the weights
    ema_start: Natural = 2000  # copy the weights until this step
    clip_gradient: NotNegative = 0.0  # largest norm of the gradient; 0 = no limit
    mixed_precision: Advanced[Literal["no", "fp16", "bf16"]] = "no"  # of the network's products
    checkpoint_every: Count = 5000  # steps
    seed: Natural = 0  # of the weights, batches, noise and dropout


def learning_rate(cfg: TrainingConfig, step: int) -> float:
    """Learning rate of step 0, 1, ...

    Source: MotionWavelet, Appendix A: "multistep" (Human3.6M), "cosine_restarts" with each restart's peak times gamma
    (HumanEva-I). Own choice: "cosine" to zero over the whole run, and linear warm-up, for short runs.

    >>> cfg = TrainingConfig(lr=0.1, lr_schedule="cosine", train_steps=100)
    >>> [round(learning_rate(cfg, step), 3) for step in (0, 50, 99)]
    [0.1, 0.05, 0.0]
    """
    lr = cfg.lr * min(1.0, (step + 1) / cfg.warmup) if cfg.warmup else cfg.lr
    if cfg.lr_schedule == "multistep":
        return lr * cfg.lr_gamma ** sum(step >= m for m in cfg.lr_milestones)
    if cfg.lr_schedule == "cosine_restarts":
        cycle, within = divmod(step, cfg.lr_period)
        return lr * cfg.lr_gamma**cycle * 0.5 * (1 + math.cos(math.pi * within / cfg.lr_period))
    if cfg.lr_schedule == "cosine":
        return lr * 0.5 * (1 + math.cos(math.pi * step / cfg.train_steps))
    return lr
