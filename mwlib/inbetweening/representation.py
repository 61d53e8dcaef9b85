"""The diffused form of windows: normalised, perhaps as a departure from interpolation, in cosines, sines or frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.inbetweening.config import ModelConfig
from mwlib.inbetweening.windows import coasting, given, interpolated
from mwlib.transforms import DCTTransform, DSTTransform, Transform
from mwlib.transforms.linear import OrthonormalRows

SIZED_ON = 1000  # windows
QUIETEST = 1e-4  # deviation of a coefficient below which it is not told from noise
LEAST = 1e-2  # deviation, metres or parts of a unit vector, below which a channel is not blown up to 1
FINEST = 1e-3  # the same for steps from frame to frame, and for departures in short windows
STATISTICS = ("mean", "deviation", "departure", "power", "velocity")


@dataclass(eq=False)
class Representation:
    """The diffused form of motions of up to T frames from the first to the last keyframe.

    Frames before the first keyframe are part of the conditioning: the steps from each to the next, in every token. Own choice:
    they are not diffused, so that a past costs no tokens, and what is diffused still vanishes at both ends.

    Args:
        model: tokens, target.
        frames: T, the most.
        mean, deviation: of the states of the training windows, per channel.
        departure: deviation of what is left of them after interpolation, per channel. Or (lengths, C): of windows of each length
            t up to T, times the root of (t - 2) / (T - 2), so that tokens are as large at all lengths.
        power: deviation of each token's numbers in windows of T frames.
        velocity: size of the steps of the past, per channel; None without a past.
    """

    model: ModelConfig
    frames: int
    mean: Tensor
    deviation: Tensor
    departure: Tensor
    power: Tensor
    velocity: Tensor | None = None

    def __post_init__(self) -> None:
        self._transforms: dict[int, Transform] = {}

    @classmethod
    def fit(cls, model: ModelConfig, frames: int, x: Float[Tensor, "N T C"], past: int = 1, fewest: int = 0) -> Representation:
        """Statistics of training windows.

        Args:
            model, frames: as of the class.
            x: windows of past - 1 + T frames.
            past: the first so many frames and the last are given.
            fewest: the smallest T, of departure_scale "each".
        """
        before, x = x[:, : past - 1], x[:, past - 1 :]
        steps = torch.cat([before, x[:, :1]], dim=1).diff(dim=1).flatten(0, 1)
        velocity = steps.square().mean(0).sqrt().clamp_min(FINEST) if past > 1 else None
        flat, one = x.flatten(0, 1), torch.ones(x.shape[-1])  # in place of what is fitted below
        fitted = cls(model, frames, flat.mean(0), flat.std(0).clamp_min(LEAST), one, one, velocity)
        left = x - fitted.interpolation(x, before, given(x.shape[1]))
        fitted.departure = left[:, 1:-1].flatten(0, 1).square().mean(0).sqrt().clamp_min(LEAST)
        if model.departure_scale == "each":
            fitted.departure = torch.stack([fitted._size(x[:SIZED_ON, :n], before[:SIZED_ON]) for n in range(fewest, frames + 1)])
        y = fitted.transform(frames)(fitted.modelled(x, x - left))
        fitted.power = y.square().mean(0).sqrt().clamp_min(QUIETEST)
        return fitted

    def _size(self, x: Float[Tensor, "N T C"], before: Float[Tensor, "N P C"]) -> Float[Tensor, " C"]:
        """Of departures in windows of one length, see `departure`."""
        left = (x - self.interpolation(x, before, given(x.shape[1])))[:, 1:-1]
        share = (x.shape[1] - 2) / (self.frames - 2)
        return left.square().mean((0, 1)).sqrt().clamp_min(FINEST) * share**0.5

    def _departure(self, frames: int) -> Float[Tensor, " C"]:
        """The divisor of departures in windows of so many frames."""
        return self.departure if self.departure.ndim == 1 else self.departure[frames - self.frames - 1]

    @classmethod
    def restore(cls, model: ModelConfig, frames: int, learnt: Mapping[str, Tensor]) -> Representation:
        """As `learnt` left it."""
        return cls(model, frames, **{name: learnt[name] for name in STATISTICS if name in learnt})

    def learnt(self) -> dict[str, Tensor]:
        """The statistics."""
        return {name: tensor for name in STATISTICS if (tensor := getattr(self, name)) is not None}

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

    def interpolation(
        self, x: Float[Tensor, "*lead T C"], before: Float[Tensor, "*lead P C"], mask: Bool[Tensor, "*#lead T"]
    ) -> Float[Tensor, "*lead T C"]:
        """Interpolation between keyframes, see `coasting` and `interpolated`.

        Args:
            x: states from the first to the last keyframe; those that are not keyframes are not looked at.
            before: the frames before them.
            mask: True at keyframes.
        """
        return coasting(x, before, mask, self.model.coast) if self.model.coast else interpolated(x, mask)

    def modelled(self, x: Float[Tensor, "*lead T C"], line: Float[Tensor, "*#lead T C"] | None) -> Float[Tensor, "*lead T C"]:
        """States as what is diffused, in time.

        Args:
            x: states.
            line: interpolation between their keyframes; of target "departure".
        """
        if self.model.target == "departure" and line is not None:
            return (x - line) / self._departure(x.shape[-2]).to(x)
        return (x - self.mean.to(x)) / self.deviation.to(x)

    def states(self, z: Float[Tensor, "*lead T C"], line: Float[Tensor, "*#lead T C"] | None) -> Float[Tensor, "*lead T C"]:
        """Inverse of `modelled`."""
        if self.model.target == "departure" and line is not None:
            return z * self._departure(z.shape[-2]).to(z) + line
        return z * self.deviation.to(z) + self.mean.to(z)

    def conditioning(
        self, line: Float[Tensor, "*lead T C"], before: Float[Tensor, "*lead P C"], mask: Bool[Tensor, "*lead T"]
    ) -> Float[Tensor, "*lead rows conditioning"]:
        """The network's input beside noised tokens: interpolation and mask in tokens; each token's frequency and the length,
        of the most; and in every token all steps of the past.
        """
        frames = line.shape[-2]
        tf = self.transform(frames)
        seen = tf((line - self.mean.to(line)) / self.deviation.to(line))
        where = tf(mask[..., None].expand(line.shape).to(line))[..., :1]
        rows = torch.arange(tf.shape[0], device=line.device, dtype=line.dtype) / frames
        place = torch.stack([rows, torch.full_like(rows, frames / self.frames)], dim=-1)
        columns = [seen, where, place.expand(*seen.shape[:-1], 2)]
        if self.velocity is not None:
            steps = torch.cat([before, line[..., :1, :]], dim=-2).diff(dim=-2) / self.velocity.to(line)
            columns.append(steps.flatten(-2)[..., None, :].expand(*seen.shape[:-1], -1))
        return torch.cat(columns, dim=-1)
