"""Networks."""

from mwlib.networks.translinear import TransLinear

__all__ = ["TransLinear"]
