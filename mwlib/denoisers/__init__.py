"""Networks that predict noise from a noised latent."""

from .translinear import TransLinear

__all__ = ["TransLinear"]
