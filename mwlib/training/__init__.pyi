from .checkpoint import CHECKPOINT, CURVES, MODEL, PREVIOUS, MovingAverage, read_model, read_outcome, read_run
from .config import TrainingConfig, learning_rate
from .loop import Objective, TrainingStep, seeded, train
from .model import TrainedModel, chunks, identities, with_weights

__all__ = [
    "CHECKPOINT", "CURVES", "MODEL", "PREVIOUS", "MovingAverage", "Objective", "TrainedModel", "TrainingConfig", "TrainingStep",
    "chunks", "identities", "learning_rate", "read_model", "read_outcome", "read_run", "seeded", "train",
    "with_weights",
]  # fmt: skip
