"""Every picture. Functions return (fig, ax) and show nothing; `show` puts a figure into a notebook, `save` into files."""

from .coefficients import energy_bars, matrix, projection_change, subbands
from .curves import curves, histograms, sampling_paths
from .diffusion import band_snr, ddim_path, loss_curves, noising, schedules
from .evaluation import bars_per_action, trajectories
from .look import CYCLE, STYLE, style, use_style
from .metric_picture import metric_picture
from .save import save, save_table, show
from .signals import filters, padding_modes, scaling_and_wavelet, signal_and_coefficients
from .skeletons import animate, film, overlay_futures, storyboard
from .tables import Table, results_table, significant

__all__ = [
    "CYCLE",
    "STYLE",
    "Table",
    "animate",
    "band_snr",
    "bars_per_action",
    "curves",
    "ddim_path",
    "energy_bars",
    "film",
    "filters",
    "histograms",
    "loss_curves",
    "matrix",
    "metric_picture",
    "noising",
    "overlay_futures",
    "padding_modes",
    "projection_change",
    "results_table",
    "sampling_paths",
    "save",
    "save_table",
    "scaling_and_wavelet",
    "schedules",
    "show",
    "signal_and_coefficients",
    "significant",
    "storyboard",
    "style",
    "subbands",
    "trajectories",
    "use_style",
]
