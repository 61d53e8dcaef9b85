from . import metrics, plots
from .body.motion import Motion
from .body.skeleton import Skeleton
from .data import MotionFormatError, Windows, load_motions, windows
from .data.formats.bvh import write_bvh
from .data.formats.glb_writing import write_glb
from .experiments import generate, get_model, get_run, inbetween, load_run
from .prediction.config import Config
from .transforms import DCTTransform, PhaseTransform, WaveletTransform
from .version import __version__

__all__ = [
    "Config", "DCTTransform", "Motion", "MotionFormatError", "PhaseTransform", "Skeleton", "WaveletTransform", "Windows",
    "generate", "get_model", "get_run", "inbetween", "load_motions", "load_run", "metrics", "plots", "windows", "write_bvh",
    "write_glb", "__version__",
]  # fmt: skip
