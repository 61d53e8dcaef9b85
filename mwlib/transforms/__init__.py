"""Frequency views of a motion, one interface: ``tf(x)``, ``tf.inverse(y)``, ``tf.project(y)``, ``tf.shape``."""

import lazy_loader

from mwlib.arguments import checking

# What is imported at its first use stands in __init__.pyi: a system opens what it needs.
_door, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = checking(_door)
