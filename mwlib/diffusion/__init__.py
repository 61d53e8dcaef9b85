"""Diffusion on coefficients of any kind: schedule, forward process, samplers, and guidance that all systems share."""

from mwlib.diffusion.config import DiffusionConfig
from mwlib.diffusion.guidance import classifier_free, reconstruction_guided
from mwlib.diffusion.keyframes import KeyframeConfig, keyframe_mask, keyframe_steps, keyframed, with_keyframes
from mwlib.diffusion.masks import Mask, history_completion, masked, pasted
from mwlib.diffusion.noise import WindowNoise
from mwlib.diffusion.process import eps_of, network_target, noised, to_eps, y0_hat_of
from mwlib.diffusion.samplers import AfterStep, Denoise, OnEstimate, Step, ddim, dpm_solver, posterior_mean
from mwlib.diffusion.schedule import alpha_bar, ddim_indices
from mwlib.diffusion.sde_solver import karras_levels, sde_dpm_solver

__all__ = [
    "AfterStep", "Denoise", "DiffusionConfig", "KeyframeConfig", "Mask", "OnEstimate", "Step", "WindowNoise", "alpha_bar",
    "classifier_free", "ddim", "ddim_indices", "dpm_solver", "eps_of", "history_completion", "karras_levels", "keyframe_mask",
    "keyframe_steps", "keyframed", "masked", "network_target", "noised", "pasted", "posterior_mean", "reconstruction_guided",
    "sde_dpm_solver", "to_eps", "with_keyframes", "y0_hat_of",
]  # fmt: skip
