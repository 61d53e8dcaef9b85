"""Every picture. Functions return (fig, ax) and show nothing; `show` puts a figure into a notebook, `save` into files."""

from mwlib.plots.attention import attention_heads, attention_over_steps, attention_part, attention_vectors, row_support
from mwlib.plots.bases import basis_card, dots
from mwlib.plots.bridging import bridged_coordinate, imposed_steps, seams, spectra, training_view
from mwlib.plots.coefficients import energy_bars, matrix, projection_change, subbands
from mwlib.plots.control import controlled_poses
from mwlib.plots.curves import curves, histograms, sampling_paths
from mwlib.plots.diagrams import bridging_overview, overview, tabg_diagram
from mwlib.plots.diffusion import band_snr, ddim_path, loss_curves, noising, schedules
from mwlib.plots.evaluation import bars_per_action, trajectories
from mwlib.plots.filmstrip import filmstrip
from mwlib.plots.frequency import cascade, responses, same_spectrum, sliding_filter, tilings
from mwlib.plots.guidance import arrows, claimed_and_measured, noised_rows, pose_grid
from mwlib.plots.keyframes import keyframe_samples, scheme_errors
from mwlib.plots.look import CYCLE, STYLE, style, use_style
from mwlib.plots.loops import Loop, loop
from mwlib.plots.metric_picture import metric_picture
from mwlib.plots.particles import density_map, particles
from mwlib.plots.passages import broken_bodies, passages
from mwlib.plots.phase import error_by_size, phase_circles, predicted_curves, windows_and_sinusoids
from mwlib.plots.player import Player, player
from mwlib.plots.save import save, save_table, show
from mwlib.plots.sentences import emerging_way, free_overview, ways
from mwlib.plots.signals import filters, padding_modes, scaling_and_wavelet, signal_and_coefficients
from mwlib.plots.skeletons import end_poses, overlay_futures, storyboard
from mwlib.plots.spectra_of_motion import (
    coupling_bars,
    energy_by_coefficient,
    kept_power,
    known_share,
    parallel_snr,
    recovery_by_coefficient,
)
from mwlib.plots.tables import Table, results_table, significant

__all__ = [
    "CYCLE",
    "Loop",
    "Player",
    "STYLE",
    "Table",
    "arrows",
    "attention_heads",
    "attention_over_steps",
    "attention_part",
    "attention_vectors",
    "band_snr",
    "bars_per_action",
    "basis_card",
    "bridged_coordinate",
    "bridging_overview",
    "broken_bodies",
    "cascade",
    "claimed_and_measured",
    "controlled_poses",
    "coupling_bars",
    "curves",
    "ddim_path",
    "density_map",
    "dots",
    "emerging_way",
    "end_poses",
    "energy_bars",
    "energy_by_coefficient",
    "error_by_size",
    "filmstrip",
    "filters",
    "free_overview",
    "histograms",
    "kept_power",
    "keyframe_samples",
    "known_share",
    "loop",
    "imposed_steps",
    "loss_curves",
    "matrix",
    "metric_picture",
    "noised_rows",
    "noising",
    "overlay_futures",
    "overview",
    "padding_modes",
    "parallel_snr",
    "particles",
    "passages",
    "phase_circles",
    "player",
    "pose_grid",
    "predicted_curves",
    "projection_change",
    "recovery_by_coefficient",
    "results_table",
    "responses",
    "row_support",
    "same_spectrum",
    "sampling_paths",
    "save",
    "save_table",
    "scaling_and_wavelet",
    "schedules",
    "scheme_errors",
    "seams",
    "show",
    "signal_and_coefficients",
    "significant",
    "sliding_filter",
    "spectra",
    "storyboard",
    "style",
    "subbands",
    "tabg_diagram",
    "tilings",
    "training_view",
    "trajectories",
    "use_style",
    "windows_and_sinusoids",
    "ways",
]
