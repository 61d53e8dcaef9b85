"""Frequency-domain motion diffusion: motions, transforms, denoisers, samplers, metrics and pictures.

Tensors flow one way: `Motion`, windows x, transform y, denoiser and sampler, inverse, metrics and plots.
"""

from .config import Config
from .data import MotionFormatError, Windows, load_motions, windows
from .motion import Motion
from .skeleton import Skeleton

__version__ = "0.1.0"
__all__ = ["Config", "Motion", "MotionFormatError", "Skeleton", "Windows", "load_motions", "windows"]
