"""The diffused form of windows: normalised, perhaps as a departure from interpolation, in cosines, sines or frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.inbetweening.config import ModelConfig
from mwlib.inbetweening.space import OtherStates, States, Tracks
from mwlib.inbetweening.windows import Future, Keyframes, Past, coasting, given, interpolated, parted
from mwlib.transforms import DCTTransform, DSTTransform, Transform
from mwlib.transforms.linear import OrthonormalRows

SIZED_ON = 1000  # windows
QUIETEST = 1e-4  # deviation of a coefficient below which it is not told from noise
LEAST = 1e-2  # deviation, metres or parts of a unit vector, below which a channel is not blown up to 1
FINEST = 1e-3  # the same for steps from frame to frame, and for departures in short windows
STATISTICS = ("mean", "deviation", "departure", "power", "velocity", "axes")
FITTED_AT = 6, 12, 24, 48  # frames of windows, beside the longest, whose departures give the axes
Room = Float[Tensor, "*#lead T 1"]  # see `Representation.room`
Entering = Float[Tensor, "*lead entering"]  # what a network is told of a window, in one row


@dataclass(eq=False)
class Representation:
    """The diffused form of motions of up to T frames from the first to the last keyframe.

    Frames beyond the keyframes are part of the conditioning: the steps from each to the next, in every token. Own choice:
    they are not diffused, so that they cost no tokens, and what is diffused still vanishes at both ends.

    Args:
        model: tokens, target.
        frames: T, the most.
        mean, deviation: of the states of the training windows, per channel.
        departure: deviation of what is left of them after interpolation, per channel. Or (lengths, C): of windows of each length
            t up to T, times the root of (t - 2) / (T - 2), so that tokens are as large at all lengths.
        power: deviation of each token's numbers in windows of T frames; of departure_scale "window" (lengths, rows, C), in
            windows of each length up to T.
        velocity: size of the steps beyond the keyframes, per channel; None without any.
        axes: (C, C) orthonormal, principal axes of departures in metres, largest first; of departure_scale "window".
    """

    model: ModelConfig
    frames: int
    mean: Tensor
    deviation: Tensor
    departure: Tensor
    power: Tensor
    velocity: Tensor | None = None
    axes: Tensor | None = None

    @classmethod
    def fit(cls, model: ModelConfig, frames: int, x: Tracks, past: int = 1, fewest: int = 0, future: int = 1) -> Representation:
        """Statistics of training windows.

        Args:
            model, frames: as of the class.
            x: windows of past + T + future - 2 frames.
            past, future: the first so many frames and the last are given.
            fewest: the smallest T, of departure_scale "each" and "window".
        """
        before, inner, after = parted(x, past, future)
        steps = torch.cat(_steps(inner, before, after), dim=1).flatten(0, 1)
        velocity = steps.square().mean(0).sqrt().clamp_min(FINEST) if len(steps) else None
        flat, one = inner.flatten(0, 1), torch.ones(x.shape[-1])  # in place of what is fitted below
        fitted = cls(model, frames, flat.mean(0), flat.std(0).clamp_min(LEAST), one, one, velocity)
        shorter = (fitted._cut(x[:SIZED_ON], n, past, future) for n in range(fewest, frames + 1))
        if model.departure_scale == "window":
            fitted.axes = fitted._principal(fitted._cut(x, n, past, future) for n in (*FITTED_AT, frames))
            fitted.power = torch.stack([fitted._sizes(*part) for part in shorter])
            return fitted
        left = inner - fitted._cut(x, frames, past, future)[1]
        fitted.departure = left[:, 1:-1].flatten(0, 1).square().mean(0).sqrt().clamp_min(LEAST)
        if model.departure_scale == "each":
            fitted.departure = torch.stack([fitted._size(part - line) for part, line, _ in shorter])
        y = fitted.transform(frames)(fitted.modelled(inner, inner - left))
        fitted.power = y.square().mean(0).sqrt().clamp_min(QUIETEST)
        return fitted

    def _cut(self, x: Tracks, frames: int, past: int, future: int) -> tuple[Tensor, Tensor, Tensor]:
        """The first so many frames of windows from the first keyframe on, with the interpolation and the room there."""
        before, inner, after = parted(x[:, : frames + past + future - 2], past, future)
        return inner, self.interpolation(inner, before, given(inner.shape[1]), after), self.room(inner, before, after)

    def _principal(self, windows: Iterable[tuple[Tensor, Tensor, Tensor]]) -> Float[Tensor, "C C"]:
        """Axes along which windows of several lengths depart from interpolation, each length counting as much."""
        total = torch.zeros(2 * self.mean.shape)
        for inner, line, room in windows:
            z = ((inner - line) / room)[:, 1:-1].flatten(0, 1)
            total += z.T @ z / z.square().sum()
        return torch.linalg.eigh(total).eigenvectors.flip(-1)

    def _sizes(self, inner: Tensor, line: Tensor, room: Tensor) -> Float[Tensor, "rows C"]:
        """Deviation of each token's numbers in windows of one length, 1 where it has no such token."""
        y = self.transform(inner.shape[1])(self.modelled(inner, line, room))
        found = torch.ones(self.transform(self.frames).shape)
        found[: y.shape[1]] = y.square().mean(0).sqrt().clamp_min(QUIETEST)
        return found

    def usual(self, frames: int) -> Float[Tensor, "rows C"]:
        """Of departure_scale "window": see `power`, of windows of so many frames."""
        return self.power[frames - self.frames - 1, : self.transform(frames).shape[0]]

    def _size(self, left: Tracks) -> Float[Tensor, " C"]:
        """Of departures in windows of one length, see `departure`."""
        share = (left.shape[1] - 2) / (self.frames - 2)
        return left[:, 1:-1].square().mean((0, 1)).sqrt().clamp_min(FINEST) * share**0.5

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
        return _transform(self.model.tokens, frames, len(self.mean), self.model.rows or frames)

    def interpolation(self, x: States, before: Past, mask: Keyframes, after: Future | None = None) -> States:
        """Interpolation between keyframes, see `coasting` and `interpolated`.

        Args:
            x: states from the first to the last keyframe; those that are not keyframes are not looked at.
            before, after: the frames before and after them; NaN where they are not known.
            mask: True at keyframes.
        """
        return coasting(x, before, mask, self.model.coast, after) if self.model.coast else interpolated(x, mask)

    def room(self, x: States, before: Past, after: Future) -> Float[Tensor, "*lead T 1"]:
        """By what departures are divided in every frame of a window: sin(pi u / 2) where the velocity at the first keyframe is
        known, times cos(pi u / 2) where that at the last is, u from 0 to 1. So what vanishes at both ends in sines is a motion
        that has these velocities there. Source: own choice. One everywhere but with departure_scale "window".
        """
        share = torch.linspace(0, torch.pi / 2, x.shape[-2], dtype=x.dtype, device=x.device)
        found = x.new_ones((*x.shape[:-1], 1))
        if self.model.departure_scale == "window":
            for beyond, wave in ((before, share.sin()), (after, share.cos())):
                if beyond.shape[-2]:
                    found = torch.where(_known(beyond)[..., None, None], found * wave[:, None], found)
        return found.clamp_min(LEAST)

    def modelled(self, x: States, line: OtherStates, room: Room | float = 1.0) -> States:
        """States as what is diffused, in time.

        Args:
            x: states.
            line: interpolation between their keyframes; of target "departure".
            room: see `room`.
        """
        if self.model.target == "departure":
            z = (x - line) / (self._departure(x.shape[-2]).to(x) * room)
            return z if self.axes is None else z @ self.axes.to(z)
        return (x - self.mean.to(x)) / self.deviation.to(x)

    def states(self, z: States, line: OtherStates, room: Room | float = 1.0) -> States:
        """Inverse of `modelled`."""
        if self.model.target == "departure":
            z = z if self.axes is None else z @ self.axes.to(z).T
            return z * (self._departure(z.shape[-2]).to(z) * room) + line
        return z * self.deviation.to(z) + self.mean.to(z)

    def ends(self, line: States, before: Past, after: Future) -> Entering:
        """What is given of a window in one row: both keyframes, the steps beyond them, which of these are known, the length."""
        poses = (line[..., [0, -1], :] - self.mean.to(line)) / self.deviation.to(line)
        length = torch.full_like(line[..., 0, :1], line.shape[-2]).log()
        return torch.cat([poses.flatten(-2), self._beyond(line, before, after), length], dim=-1)

    def _beyond(self, line: Tensor, before: Tensor, after: Tensor | None) -> Entering:
        """Steps beyond the keyframes, 0 where they are not known; and, of a model that may do without, which are known."""
        if self.velocity is None:
            return line[..., 0, :0]
        steps = torch.cat(_steps(line, before, after), dim=-2)
        known = _known(steps[..., None, :]).to(line) if self.model.hide else line[..., 0, :0]
        return torch.cat([(steps / self.velocity.to(line)).nan_to_num().flatten(-2), known], dim=-1)

    def conditioning(
        self, line: States, before: Past, mask: Bool[Tensor, "*lead T"], after: Future | None = None
    ) -> Float[Tensor, "*lead rows conditioning"]:
        """The network's input beside noised tokens: interpolation and mask in tokens; each token's frequency and the length,
        of the most; and in every token all steps beyond the keyframes.
        """
        frames = line.shape[-2]
        tf = self.transform(frames)
        seen = tf((line - self.mean.to(line)) / self.deviation.to(line))
        where = tf(mask[..., None].expand(line.shape).to(line))[..., :1]
        rows = torch.arange(tf.shape[0], device=line.device, dtype=line.dtype) / frames
        place = torch.stack([rows, torch.full_like(rows, frames / self.frames)], dim=-1)
        beyond = self._beyond(line, before, after)[..., None, :].expand(*seen.shape[:-1], -1)
        return torch.cat([seen, where, place.expand(*seen.shape[:-1], 2), beyond], dim=-1)


@lru_cache(maxsize=512)
def _transform(tokens: str, frames: int, channels: int, rows: int) -> Transform:
    if tokens == "frames":
        return OrthonormalRows(np.eye(frames), channels, "frames")  # no transform: "without DCT"
    kind, most = (DCTTransform, frames) if tokens == "cosines" else (DSTTransform, frames - 2)
    return kind(frames, channels, min(rows, most))


def _steps(x: Tensor, before: Tensor, after: Tensor | None) -> list[Float[Tensor, "*lead steps C"]]:
    """From frame to frame up to the first keyframe, and from the last one on."""
    there = x[..., :0, :] if after is None else after
    return [torch.cat([before, x[..., :1, :]], dim=-2).diff(dim=-2), torch.cat([x[..., -1:, :], there], dim=-2).diff(dim=-2)]


def _known(beyond: Float[Tensor, "*lead frames C"]) -> Bool[Tensor, "*lead"]:
    """Whether all of some frames is known."""
    return beyond.isfinite().all(-1).all(-1)
