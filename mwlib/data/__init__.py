"""Motions: one reader per on-disk format, a synthetic generator, and the windows that models are fed with."""

from mwlib.data.load import load_motions
from mwlib.data.untrusted import BrokenFilesWarning, MotionFormatError
from mwlib.data.windows import Windows, windows

__all__ = ["BrokenFilesWarning", "MotionFormatError", "Windows", "load_motions", "windows"]
