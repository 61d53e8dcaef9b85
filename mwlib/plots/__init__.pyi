from .bodies import end_poses, filmstrip, overlay_futures, pose_grid, storyboard
from .chapters.bridging import bridged_coordinate, imposed_steps, keyframe_samples, spectra, training_view
from .chapters.diagrams import bridging_overview, free_overview, overview, tabg_diagram
from .chapters.diffusion import (
    band_snr,
    ddim_path,
    density_map,
    histograms,
    loss_curves,
    noising,
    particles,
    sampling_paths,
    schedules,
)  # fmt: skip
from .chapters.free_t2m import (
    coupling_bars,
    emerging_way,
    energy_by_coefficient,
    kept_power,
    known_share,
    parallel_snr,
    recovery_by_coefficient,
    ways,
)  # fmt: skip
from .chapters.guidance import (
    arrows,
    attention_heads,
    attention_over_steps,
    attention_part,
    attention_vectors,
    claimed_and_measured,
    controlled_poses,
    row_support,
)  # fmt: skip
from .chapters.metrics import metric_picture
from .chapters.wavelets import (
    cascade,
    dots,
    error_by_size,
    filters,
    padding_modes,
    responses,
    same_spectrum,
    signal_and_coefficients,
    sliding_filter,
    tilings,
    windows_and_sinusoids,
)  # fmt: skip
from .lines import (
    bars_per_action,
    curves,
    energy_bars,
    matrix,
    predicted_curves,
    projection_change,
    small_multiples,
    subbands,
    trajectories,
)  # fmt: skip
from .look import CYCLE, STYLE, style, use_style
from .loops import Loop, loop
from .playing import Player, player
from .routes import passages
from .saving import save, save_table, show
from .tables import Table, results_table, significant

__all__ = [
    "CYCLE", "Loop", "Player", "STYLE", "Table", "arrows", "attention_heads", "attention_over_steps", "attention_part",
    "attention_vectors", "band_snr", "bars_per_action", "bridged_coordinate", "bridging_overview", "cascade",
    "claimed_and_measured", "controlled_poses", "coupling_bars", "curves", "ddim_path",
    "density_map", "dots", "emerging_way", "end_poses", "energy_bars", "energy_by_coefficient", "error_by_size", "filmstrip",
    "filters", "free_overview", "histograms", "imposed_steps", "kept_power", "keyframe_samples", "known_share", "loop",
    "loss_curves", "matrix", "metric_picture", "noising", "overlay_futures", "overview", "padding_modes",
    "parallel_snr", "particles", "passages", "player", "pose_grid", "predicted_curves", "projection_change",
    "recovery_by_coefficient", "responses", "results_table", "row_support", "same_spectrum", "sampling_paths", "save",
    "save_table", "schedules", "show", "signal_and_coefficients", "significant", "small_multiples",
    "sliding_filter", "spectra", "storyboard", "style", "subbands", "tabg_diagram", "tilings", "training_view",
    "trajectories", "use_style", "ways", "windows_and_sinusoids",
]  # fmt: skip
