"""Training of any system: the loop, its settings, the moving average, checkpoints, the base of trained models."""

from mwlib.training.checkpoint import CHECKPOINT, CURVES, MODEL, PREVIOUS, MovingAverage, read_model, read_outcome, read_run
from mwlib.training.config import TrainingConfig, learning_rate
from mwlib.training.loop import Objective, TrainingStep, seeded, train
from mwlib.training.model import TrainedModel, chunks, identities, with_weights

__all__ = [
    "CHECKPOINT", "CURVES", "MODEL", "PREVIOUS", "MovingAverage", "Objective", "TrainedModel", "TrainingConfig", "TrainingStep",
    "chunks", "identities", "learning_rate", "read_model", "read_outcome", "read_run", "seeded", "train",
    "with_weights",
]  # fmt: skip
