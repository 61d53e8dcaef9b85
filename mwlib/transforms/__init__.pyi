from .dwt import TimeWaveletTransform, WaveletTransform
from .linear import DCTTransform, DSTTransform, LinearTransform, ScaledTransform, Transform, fit_scale, pad_history
from .phase import PhaseTransform, periodic_parameters

__all__ = [
    "DCTTransform", "DSTTransform", "LinearTransform", "PhaseTransform", "ScaledTransform", "TimeWaveletTransform", "Transform",
    "WaveletTransform", "fit_scale", "pad_history", "periodic_parameters",
]  # fmt: skip
