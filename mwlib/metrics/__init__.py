"""Every number that the papers report.

For stochastic motion prediction, per window and over a whole test set: predictions p are (N, S, F, C), truths g are (N, F, C).
For in-betweening, per sequence: p and g are (..., F, C), quaternions (..., F, J, 4).
For text to motion, per set: embeddings (N, E).
"""

from mwlib.metrics.inbetweening import (
    NPSS,
    bone_length_error,
    continued,
    foot_contacts,
    foot_skate,
    keyframe_error,
    l2p,
    l2q,
    nearer_share,
    npss,
    path_length,
    seam_ratio,
)
from mwlib.metrics.prediction import (
    MultimodalFutures,
    ade,
    apd,
    apde,
    bone_length_jitter,
    cmd,
    fde,
    mean_ade,
    mmade,
    mmfde,
    multimodal_apd,
    multimodal_futures,
    sample_ade,
    step_length,
)  # fmt: skip
from mwlib.metrics.realism import coverage, error_at, jerk, pose_change, speed
from mwlib.metrics.table import Column, MetricTable, clustered_error
from mwlib.metrics.text import confidence, diversity, fid, mm_dist, multimodality, r_precision

__all__ = [
    "Column",
    "MetricTable",
    "MultimodalFutures",
    "NPSS",
    "ade",
    "apd",
    "apde",
    "bone_length_error",
    "bone_length_jitter",
    "clustered_error",
    "cmd",
    "confidence",
    "continued",
    "coverage",
    "diversity",
    "error_at",
    "fde",
    "fid",
    "foot_contacts",
    "foot_skate",
    "jerk",
    "keyframe_error",
    "l2p",
    "l2q",
    "mean_ade",
    "mm_dist",
    "mmade",
    "mmfde",
    "multimodal_apd",
    "multimodal_futures",
    "multimodality",
    "nearer_share",
    "npss",
    "path_length",
    "pose_change",
    "r_precision",
    "sample_ade",
    "seam_ratio",
    "speed",
    "step_length",
]
