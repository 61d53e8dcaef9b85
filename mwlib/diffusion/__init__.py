"""Diffusion on coefficients of any kind: schedule, forward process, samplers, and guidance that all systems share."""

from mwlib.diffusion.config import DiffusionConfig
from mwlib.diffusion.guidance import classifier_free
from mwlib.diffusion.masks import Mask, history_completion, masked
from mwlib.diffusion.noise import WindowNoise
from mwlib.diffusion.process import eps_of, network_target, noised, to_eps, y0_hat_of
from mwlib.diffusion.samplers import AfterStep, Denoise, OnEstimate, Step, ddim, dpm_solver, posterior_mean
from mwlib.diffusion.schedule import alpha_bar, ddim_indices

__all__ = [
    "AfterStep", "Denoise", "DiffusionConfig", "Mask", "OnEstimate", "Step", "WindowNoise", "alpha_bar", "classifier_free",
    "ddim", "ddim_indices", "dpm_solver", "eps_of", "history_completion", "masked", "network_target", "noised", "posterior_mean",
    "to_eps", "y0_hat_of",
]  # fmt: skip
