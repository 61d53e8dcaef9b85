"""Every picture. Functions return (fig, ax) and show nothing; `show` puts a figure into a notebook, `save` into files."""

import lazy_loader

from mwlib.arguments import checking

# What is imported at its first use stands in __init__.pyi: a table of numbers waits for no picture.
_door, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = checking(_door)
