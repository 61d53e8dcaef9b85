"""Diffusion on coefficients of any kind: schedule, forward process, samplers, and guidance that all systems share."""

from mwlib.diffusion.conditioning import (
    KeyframeConfig,
    Mask,
    classifier_free,
    history_completion,
    keyframe_mask,
    keyframe_steps,
    keyframed,
    masked,
    pasted,
    reconstruction_guided,
    with_keyframes,
)
from mwlib.diffusion.config import DiffusionConfig
from mwlib.diffusion.process import alpha_bar, ddim_indices, eps_of, network_target, noised, snr_weights, to_eps, y0_hat_of
from mwlib.diffusion.samplers import (
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
)

__all__ = [
    "AfterStep", "Denoise", "DiffusionConfig", "KeyframeConfig", "Mask", "OnEstimate", "Step", "WindowNoise", "alpha_bar",
    "classifier_free", "ddim", "ddim_indices", "dpm_solver", "eps_of", "history_completion", "karras_levels", "keyframe_mask",
    "keyframe_steps", "keyframed", "masked", "network_target", "noised", "pasted", "posterior_mean", "reconstruction_guided",
    "sde_dpm_solver", "snr_weights", "to_eps", "with_keyframes", "y0_hat_of",
]  # fmt: skip
