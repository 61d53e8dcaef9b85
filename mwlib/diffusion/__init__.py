"""Diffusion on coefficients of any kind: schedule, forward process, samplers, and guidance that all systems share."""
# ruff: noqa: F403  (each module lists what it offers)

from mwlib.diffusion import conditioning, config, process, samplers
from mwlib.diffusion.conditioning import *
from mwlib.diffusion.config import *
from mwlib.diffusion.process import *
from mwlib.diffusion.samplers import *

__all__: list[str] = []
__all__ += conditioning.__all__
__all__ += config.__all__
__all__ += process.__all__
__all__ += samplers.__all__
