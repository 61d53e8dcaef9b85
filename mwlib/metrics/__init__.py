"""Every number that the papers report.

For stochastic motion prediction, per window and over a whole test set: predictions p are (N, S, F, C), truths g are (N, F, C).
For in-betweening, per sequence: p and g are (..., F, C), quaternions (..., F, J, 4).
For text to motion, per set: embeddings (N, E).
"""
# ruff: noqa: F403  (each module lists what it offers)

from mwlib.metrics import evaluation, inbetweening, prediction, realism, table, text
from mwlib.metrics.evaluation import *
from mwlib.metrics.inbetweening import *
from mwlib.metrics.prediction import *
from mwlib.metrics.realism import *
from mwlib.metrics.table import *
from mwlib.metrics.text import *

__all__: list[str] = []
__all__ += evaluation.__all__
__all__ += inbetweening.__all__
__all__ += prediction.__all__
__all__ += realism.__all__
__all__ += table.__all__
__all__ += text.__all__
