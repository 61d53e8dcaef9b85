from .conditioning import (
    Mask,
    classifier_free,
    history_completion,
    keyframe_mask,
    keyframed,
    masked,
    pasted,
    reconstruction_guided,
    with_keyframes,
)  # fmt: skip
from .config import DiffusionConfig, KeyframeConfig
from .process import (
    alpha_bar,
    check_indices,
    ddim_indices,
    eps_of,
    network_target,
    noised,
    snr_weights,
    to_eps,
    y0_hat_of,
)  # fmt: skip
from .samplers import (
    AfterStep,
    Denoise,
    OnEstimate,
    Step,
    WindowNoise,
    ddim,
    dpm_solver,
    karras_levels,
    posterior_mean,
    sde_dpm_solver,
)  # fmt: skip

__all__ = [
    "AfterStep", "Denoise", "DiffusionConfig", "KeyframeConfig", "Mask", "OnEstimate", "Step", "WindowNoise", "alpha_bar",
    "check_indices", "classifier_free", "ddim", "ddim_indices", "dpm_solver", "eps_of", "history_completion", "karras_levels",
    "keyframe_mask", "keyframed", "masked", "network_target", "noised", "pasted", "posterior_mean",
    "reconstruction_guided", "sde_dpm_solver", "snr_weights", "to_eps", "with_keyframes", "y0_hat_of",
]  # fmt: skip
