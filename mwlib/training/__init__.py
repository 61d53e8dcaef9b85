"""Training of any system: the loop, its settings, the moving average, checkpoints."""

from mwlib.training.checkpoint import CHECKPOINT, CURVES, MODEL, PREVIOUS, MovingAverage, read_model, read_outcome
from mwlib.training.config import TrainingConfig, learning_rate
from mwlib.training.loop import Objective, TrainingStep, seeded, train

__all__ = [
    "CHECKPOINT", "CURVES", "MODEL", "PREVIOUS", "MovingAverage", "Objective", "TrainingConfig", "TrainingStep", "learning_rate",
    "read_model", "read_outcome", "seeded", "train",
]  # fmt: skip
