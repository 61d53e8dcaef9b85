"""Frequency views of a motion, one interface: ``tf(x)``, ``tf.inverse(y)``, ``tf.project(y)``, ``tf.shape``."""

from mwlib.transforms.dwt import TimeWaveletTransform, WaveletTransform
from mwlib.transforms.linear import LinearTransform, Transform, pad_history
from mwlib.transforms.phase import PhaseTransform, periodic_parameters
from mwlib.transforms.scaled import ScaledTransform, fit_scale
from mwlib.transforms.trigonometric import DCTTransform, DSTTransform

__all__ = [
    "DCTTransform", "DSTTransform", "LinearTransform", "PhaseTransform", "ScaledTransform", "TimeWaveletTransform", "Transform",
    "WaveletTransform", "fit_scale", "pad_history", "periodic_parameters",
]  # fmt: skip
