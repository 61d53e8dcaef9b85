"""Training of any system: the loop, its settings, the moving average, checkpoints, the base of trained models."""

import lazy_loader

# What is imported at its first use stands in __init__.pyi: a system opens what it needs.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
