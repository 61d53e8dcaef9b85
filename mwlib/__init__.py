"""Frequency-domain motion diffusion: motions, transforms, networks, samplers, metrics and pictures.

Tensors flow one way: `Motion`, windows x, coefficients y, network and sampler, inverse, metrics and plots.

>>> import mwlib as mw
>>> motions = mw.load_motions("synthetic", fps=25)
>>> mw.windows(motions, history=10, future=30, stride=10).x.shape[1:]
torch.Size([40, 48])
"""

import lazy_loader

# What is imported at its first use stands in __init__.pyi: a command line that asks for help waits for no torch.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
