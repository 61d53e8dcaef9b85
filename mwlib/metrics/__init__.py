"""Every number that the papers report.

For stochastic motion prediction, per window and over a whole test set: predictions p are (N, S, F, C), truths g are (N, F, C).
For in-betweening, per sequence: p and g are (..., F, C), quaternions (..., F, J, 4).
For text to motion, per set: embeddings (N, E).
"""

import lazy_loader

from mwlib.arguments import checking

# What is imported at its first use stands in __init__.pyi: a system opens what it needs.
_door, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = checking(_door)
