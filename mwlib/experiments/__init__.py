"""Runs, results and tables of any system: trained or measured once, found again by hash."""

import lazy_loader

# What is imported at its first use stands in __init__.pyi: a command line that asks for help waits for no torch.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
