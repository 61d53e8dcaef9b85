from . import evaluation, inbetweening, prediction, text
from .evaluation import MetricTable, coverage, error_at, first_step, jerk, median_jerk, pose_change, seam_jerk, speed
from .inbetweening import (
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
)  # fmt: skip
from .prediction import (
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
from .table import Column, clustered_error, summary
from .text import confidence, diversity, fid, mm_dist, multimodality, r_precision

__all__ = [
    "Column", "MetricTable", "MultimodalFutures", "NPSS", "ade", "apd", "apde", "bone_length_error", "bone_length_jitter",
    "clustered_error", "cmd", "confidence", "continued", "coverage", "diversity", "error_at", "evaluation", "fde", "fid",
    "first_step", "foot_contacts", "foot_skate", "inbetweening", "jerk", "keyframe_error", "l2p", "l2q", "mean_ade",
    "median_jerk", "mm_dist", "mmade", "mmfde", "multimodal_apd", "multimodal_futures", "multimodality", "nearer_share", "npss",
    "path_length", "pose_change", "prediction", "r_precision", "sample_ade", "seam_jerk", "seam_ratio", "speed", "step_length",
    "summary", "text",
]  # fmt: skip
