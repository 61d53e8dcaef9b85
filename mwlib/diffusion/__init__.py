"""Diffusion on coefficients of any kind: schedule, forward process, samplers, and guidance that all systems share."""

import lazy_loader

# What is imported at its first use stands in __init__.pyi: a system opens what it needs.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
