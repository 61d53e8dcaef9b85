"""Frequency-domain motion diffusion: motions, transforms, networks, samplers, metrics and pictures.

Tensors flow one way: `Motion`, windows x, coefficients y, network and sampler, inverse, metrics and plots.

>>> import mwlib as mw
>>> motions = mw.load_motions("synthetic", fps=25)
>>> mw.windows(motions, history=10, future=30, stride=10).x.shape[1:]
torch.Size([40, 48])
"""

from mwlib import metrics, plots
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data import MotionFormatError, Windows, load_motions, windows
from mwlib.data.formats.bvh_writing import write_bvh
from mwlib.experiments import generate, get_model, get_run, inbetween, load_run
from mwlib.prediction.config import Config
from mwlib.transforms import DCTTransform, PhaseTransform, WaveletTransform
from mwlib.version import __version__

__all__ = [
    "Config", "DCTTransform", "Motion", "MotionFormatError", "PhaseTransform", "Skeleton", "WaveletTransform", "Windows",
    "generate", "get_model", "get_run", "inbetween", "load_motions", "load_run", "metrics", "plots", "windows", "write_bvh",
    "__version__",
]  # fmt: skip
