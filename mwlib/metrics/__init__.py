"""Every number that the papers report.

For stochastic motion prediction, per window and over a whole test set: predictions p are (N, S, F, C), truths g are (N, F, C).
"""

from mwlib.metrics.column import Column
from mwlib.metrics.multimodal import MultimodalFutures, multimodal_apd, multimodal_futures
from mwlib.metrics.prediction import (
    ade,
    apd,
    apde,
    bone_length_jitter,
    cmd,
    fde,
    mmade,
    mmfde,
    step_length,
)  # fmt: skip
from mwlib.metrics.realism import coverage, error_at, jerk, pose_change, speed
from mwlib.metrics.table import MetricTable
from mwlib.metrics.uncertainty import clustered_error

__all__ = [
    "Column",
    "MetricTable",
    "MultimodalFutures",
    "ade",
    "apd",
    "apde",
    "bone_length_jitter",
    "clustered_error",
    "cmd",
    "coverage",
    "error_at",
    "fde",
    "jerk",
    "mmade",
    "mmfde",
    "multimodal_apd",
    "multimodal_futures",
    "pose_change",
    "speed",
    "step_length",
]
