"""Frequency views of a motion, one interface: ``tf(x)``, ``tf.inverse(y)``, ``tf.project(y)``, ``tf.shape``."""

from .dct import DCTTransform
from .dwt import WaveletTransform
from .linear import LinearTransform
from .padding import pad_history
from .scaled import ScaledTransform, fit_scale

__all__ = ["DCTTransform", "LinearTransform", "ScaledTransform", "WaveletTransform", "fit_scale", "pad_history"]
