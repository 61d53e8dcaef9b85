"""Frequency views of a motion, one interface: ``tf(x)``, ``tf.inverse(y)``, ``tf.project(y)``, ``tf.shape``."""

from .dct import DCTTransform
from .dwt import WaveletTransform
from .linear import LinearTransform, Transform
from .padding import pad_history
from .phase import PhaseTransform, periodic_parameters
from .scaled import ScaledTransform, fit_scale

__all__ = [
    "DCTTransform", "LinearTransform", "PhaseTransform", "ScaledTransform", "Transform", "WaveletTransform", "fit_scale",
    "pad_history", "periodic_parameters",
]  # fmt: skip
