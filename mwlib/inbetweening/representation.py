"""Windows as what is diffused: normalised, perhaps as a departure from interpolation, and in cosines or frames."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.inbetweening.config import ModelConfig
from mwlib.inbetweening.windows import interpolated
from mwlib.transforms import DCTTransform, DSTTransform, Transform
from mwlib.transforms.linear import OrthonormalRows

QUIETEST = 1e-4  # deviation of a coefficient below which it is not told from noise
LEAST = 1e-2  # deviation, metres or parts of a unit vector, below which a channel is not blown up to 1
STATISTICS = ("mean", "deviation", "departure", "power")


class Representation:
    """What is diffused, for motions of up to T frames.

    Args:
        model: tokens, target.
        frames: T, the most.
        mean, deviation: of the states of the training windows, per channel.
        departure: deviation of what is left of them after interpolation, per channel.
        power: deviation of each token's numbers in windows of T frames.
    """

    def __init__(
        self, model: ModelConfig, frames: int, mean: Tensor, deviation: Tensor, departure: Tensor, power: Tensor | None = None
    ) -> None:
        self.model, self.frames = model, frames
        self.mean, self.deviation, self.departure = mean, deviation, departure
        self._transforms: dict[int, Transform] = {}
        self.power = torch.ones(self.transform(frames).shape) if power is None else power

    @classmethod
    def fit(cls, model: ModelConfig, frames: int, x: Float[Tensor, "N T C"]) -> Representation:
        """Statistics of training windows."""
        mask = torch.zeros(x.shape[1], dtype=torch.bool)
        mask[[0, -1]] = True
        left = x - interpolated(x, mask)
        rest = left[:, 1:-1].flatten(0, 1).square().mean(0).sqrt()
        flat = x.flatten(0, 1)
        fitted = cls(model, frames, flat.mean(0), flat.std(0).clamp_min(LEAST), rest.clamp_min(LEAST))
        y = fitted.transform(frames)(fitted.modelled(x, x - left))
        fitted.power = y.square().mean(0).sqrt().clamp_min(QUIETEST)
        return fitted

    @classmethod
    def restore(cls, model: ModelConfig, frames: int, learnt: Mapping[str, Tensor]) -> Representation:
        """As `learnt` left it."""
        return cls(model, frames, *(learnt[name] for name in STATISTICS))

    def learnt(self) -> dict[str, Tensor]:
        """The statistics."""
        return {name: getattr(self, name) for name in STATISTICS}

    def transform(self, frames: int) -> Transform:
        """From motions of so many frames to tokens."""
        if frames not in self._transforms:
            channels = len(self.mean)
            kind, rows = self.model.tokens, self.model.rows or frames
            if kind == "frames":
                self._transforms[frames] = OrthonormalRows(np.eye(frames), channels, "frames")  # no transform: "without DCT"
            elif kind == "cosines":
                self._transforms[frames] = DCTTransform(frames, channels, min(rows, frames))
            else:
                self._transforms[frames] = DSTTransform(frames, channels, min(rows, frames - 2))
        return self._transforms[frames]

    def modelled(self, x: Float[Tensor, "*lead T C"], hint: Float[Tensor, "*#lead T C"] | None) -> Float[Tensor, "*lead T C"]:
        """States as what is diffused, in time.

        Args:
            x: states.
            hint: interpolation between their keyframes; of target "departure".
        """
        if self.model.target == "departure" and hint is not None:
            return (x - hint) / self.departure.to(x)
        return (x - self.mean.to(x)) / self.deviation.to(x)

    def states(self, z: Float[Tensor, "*lead T C"], hint: Float[Tensor, "*#lead T C"] | None) -> Float[Tensor, "*lead T C"]:
        """Inverse of `modelled`."""
        if self.model.target == "departure" and hint is not None:
            return z * self.departure.to(z) + hint
        return z * self.deviation.to(z) + self.mean.to(z)

    def told(self, hint: Float[Tensor, "*lead T C"], mask: Bool[Tensor, "*lead T"]) -> Float[Tensor, "*lead rows told"]:
        """What the network is told: interpolation and mask in tokens; each token's frequency and the length, of the most."""
        frames = hint.shape[-2]
        tf = self.transform(frames)
        seen = tf((hint - self.mean.to(hint)) / self.deviation.to(hint))
        where = tf(mask[..., None].expand(hint.shape).to(hint))[..., :1]
        rows = torch.arange(tf.shape[0], device=hint.device, dtype=hint.dtype) / frames
        place = torch.stack([rows, torch.full_like(rows, frames / self.frames)], dim=-1)
        return torch.cat([seen, where, place.expand(*seen.shape[:-1], 2)], dim=-1)
