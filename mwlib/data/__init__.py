"""Motions: one reader per on-disk format, a synthetic generator, and the windows that models are fed with."""

from .errors import MotionFormatError
from .load import load_motions
from .windows import Windows, windows

__all__ = ["MotionFormatError", "Windows", "load_motions", "windows"]
