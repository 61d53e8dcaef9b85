"""The diffused form of windows: normalised, perhaps as a departure from interpolation, in cosines, sines or frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.diffusion.conditioning import beside_samples
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.space import States, Tracks
from mwlib.inbetweening.windows import Future, Keyframes, Past, coasting, given, interpolated, parted
from mwlib.transforms import DCTTransform, DSTTransform, Transform
from mwlib.transforms.linear import OrthonormalRows

SIZED_ON = 1000  # windows
QUIETEST = 1e-4  # deviation of a coefficient below which it is not told from noise
LEAST = 1e-2  # deviation, metres or parts of a unit vector, below which a channel is not blown up to 1
FINEST = 1e-3  # the same for steps from frame to frame, and for departures in short windows
STATISTICS = ("mean", "deviation", "departure", "power", "velocity", "axes")
FITTED_AT = 6, 12, 24, 48  # frames of windows, beside the longest, whose departures give the axes
Entering = Float[Tensor, "*lead entering"]  # what a network is told of a window, in one row


class Gap(NamedTuple):
    """Windows from the first to the last keyframe, and what is known around them.

    Args:
        x: states; those that are not keyframes need not be known.
        before, after: the frames before and after them; NaN where they are not known.
        mask: True at keyframes.
        line: interpolation between keyframes, see `coasting` and `interpolated`.
        room: by what departures are divided in every frame: sin(pi u / 2) where the velocity at the first keyframe is known,
            times cos(pi u / 2) where that at the last is, u from 0 to 1. So what vanishes at both ends in sines is a motion that
            has these velocities there. Source: own choice. One everywhere but with departure_scale "window".
    """

    x: States
    before: Past
    after: Future
    mask: Keyframes
    line: States
    room: Float[Tensor, "*lead T 1"]

    @property
    def frames(self) -> int:
        """From the first to the last keyframe."""
        return self.x.shape[-2]


@dataclass(eq=False)
class Representation:
    """The diffused form of motions of up to T frames from the first to the last keyframe.

    Frames beyond the keyframes are part of the conditioning: the steps from each to the next, in every token. Own choice:
    they are not diffused, so that they cost no tokens, and what is diffused still vanishes at both ends.

    Args:
        cfg: the task, which says T, and the model: tokens, target.
        mean, deviation: of the states of the training windows, per channel.
        departure: deviation of what is left of them after interpolation, per channel. Or (lengths, C): of windows of each length
            t up to T, times the root of (t - 2) / (T - 2), so that tokens are as large at all lengths.
        power: deviation of each token's numbers in windows of T frames; of departure_scale "window" (lengths, rows, C), in
            windows of each length up to T.
        velocity: size of the steps beyond the keyframes, per channel; None without any.
        axes: (C, C) orthonormal, principal axes of departures in metres, largest first; of departure_scale "window".
    """

    cfg: Config
    mean: Tensor
    deviation: Tensor
    departure: Tensor
    power: Tensor
    velocity: Tensor | None = None
    axes: Tensor | None = None

    @classmethod
    def fit(cls, cfg: Config, x: Tracks) -> Representation:
        """Statistics of training windows, from the first frame of the past to the last of the future."""
        task = cfg.task
        before, inner, after = parted(x, task.past, task.future)
        steps = torch.cat(_steps(inner, before, after), dim=1).flatten(0, 1)
        velocity = steps.square().mean(0).sqrt().clamp_min(FINEST) if len(steps) else None
        flat, one = inner.flatten(0, 1), torch.ones(x.shape[-1])  # in place of what is fitted below
        fitted = cls(cfg, flat.mean(0), flat.std(0).clamp_min(LEAST), one, one, velocity)
        shorter = (fitted._cut(x[:SIZED_ON], n) for n in range(task.smallest_gap, task.gap + 1))
        if cfg.model.departure_scale == "window":
            fitted.axes = fitted._principal(fitted._cut(x, n) for n in (*FITTED_AT, task.gap))
            fitted.power = torch.stack([fitted._sizes(part) for part in shorter])
            return fitted
        gap = fitted._cut(x, task.gap)
        left = inner - gap.line
        fitted.departure = left[:, 1:-1].flatten(0, 1).square().mean(0).sqrt().clamp_min(LEAST)
        if cfg.model.departure_scale == "each":
            fitted.departure = torch.stack([fitted._size(part) for part in shorter])
        fitted.power = fitted._sizes(gap._replace(line=inner - left))
        return fitted

    def gap(self, x: States, mask: Keyframes) -> Gap:
        """Windows as they are diffused.

        Args:
            x: states from the first frame of the past to the last of the future; NaN where frames beyond the keyframes are not
                known. Those between keyframes are not looked at by the interpolation.
            mask: True at keyframes.
        """
        task, coast = self.cfg.task, self.cfg.model.coast
        before, inner, after = parted(x, task.past, task.future)
        mask = mask[..., task.past - 1 :][..., : inner.shape[-2]]
        line = coasting(inner, before, mask, coast, after) if coast else interpolated(inner, mask)
        share = torch.linspace(0, torch.pi / 2, inner.shape[-2], dtype=x.dtype, device=x.device)
        room = x.new_ones((*inner.shape[:-1], 1))
        if self.cfg.model.departure_scale == "window":
            for beyond, wave in ((before, share.sin()), (after, share.cos())):
                if beyond.shape[-2]:
                    room = torch.where(_known(beyond)[..., None, None], room * wave[:, None], room)
        return Gap(inner, before, after, mask, line, room.clamp_min(LEAST))

    def _cut(self, x: Tracks, frames: int) -> Gap:
        """The first so many frames of windows from the first keyframe on, or as many as there are."""
        task, part = self.cfg.task, x[:, : frames + self.cfg.task.steps]
        return self.gap(part, given(part.shape[1], task.past, task.future))

    def _principal(self, gaps: Iterable[Gap]) -> Float[Tensor, "C C"]:
        """Axes along which windows of several lengths depart from interpolation, each length counting as much."""
        total = torch.zeros(2 * self.mean.shape)
        for gap in gaps:
            z = ((gap.x - gap.line) / gap.room)[:, 1:-1].flatten(0, 1)
            total += z.T @ z / z.square().sum()
        return torch.linalg.eigh(total).eigenvectors.flip(-1)

    def _sizes(self, gap: Gap) -> Float[Tensor, "rows C"]:
        """Deviation of each token's numbers in windows of one length, 1 where it has no such token."""
        y = self.tokens(gap)
        found = torch.ones(self.transform(self.cfg.task.gap).shape)
        found[: y.shape[1]] = y.square().mean(0).sqrt().clamp_min(QUIETEST)
        return found

    def usual(self, frames: int) -> Float[Tensor, "rows C"]:
        """Of departure_scale "window": see `power`, of windows of so many frames."""
        return self.power[frames - self.cfg.task.gap - 1, : self.transform(frames).shape[0]]

    def _size(self, gap: Gap) -> Float[Tensor, " C"]:
        """Of departures in windows of one length, see `departure`."""
        share = (gap.frames - 2) / (self.cfg.task.gap - 2)
        return (gap.x - gap.line)[:, 1:-1].square().mean((0, 1)).sqrt().clamp_min(FINEST) * share**0.5

    def _departure(self, gap: Gap) -> Float[Tensor, "*lead T C"]:
        """The divisor of departures in every frame of windows."""
        known = self.departure if self.departure.ndim == 1 else self.departure[gap.frames - self.cfg.task.gap - 1]
        return known.to(gap.room) * gap.room

    @classmethod
    def restore(cls, cfg: Config, learnt: Mapping[str, Tensor]) -> Representation:
        """As `learnt` left it."""
        return cls(cfg, **{name: learnt[name] for name in STATISTICS if name in learnt})

    def learnt(self) -> dict[str, Tensor]:
        """The statistics."""
        return {name: tensor for name in STATISTICS if (tensor := getattr(self, name)) is not None}

    def transform(self, frames: int) -> Transform:
        """From motions of so many frames to tokens."""
        return _transform(self.cfg.model.tokens, frames, len(self.mean), self.cfg.model.rows or frames)

    def modelled(self, gap: Gap) -> States:
        """States as what is diffused, in time."""
        if self.cfg.model.target == "departure":
            z = (gap.x - gap.line) / self._departure(gap)
            return z if self.axes is None else z @ self.axes.to(z)
        return self._normalised(gap.x)

    def tokens(self, gap: Gap) -> Float[Tensor, "*lead rows C"]:
        """States as what is diffused, see `transform`."""
        return self.transform(gap.frames)(self.modelled(gap))

    def states(self, z: States, gap: Gap) -> States:
        """Inverse of `modelled`; z may have an axis for samples that the windows have not."""
        if self.cfg.model.target == "departure":
            z = z if self.axes is None else z @ self.axes.to(z).T
            return z * beside_samples(self._departure(gap), z) + beside_samples(gap.line, z)
        return z * self.deviation.to(z) + self.mean.to(z)

    def _normalised(self, x: States) -> States:
        return (x - self.mean.to(x)) / self.deviation.to(x)

    def ends(self, gap: Gap) -> Entering:
        """What is given of a window in one row: both keyframes, the steps beyond them, which of these are known, the length."""
        poses = self._normalised(gap.line[..., [0, -1], :])
        length = torch.full_like(gap.line[..., 0, :1], gap.frames).log()
        return torch.cat([poses.flatten(-2), self._beyond(gap), length], dim=-1)

    def _beyond(self, gap: Gap) -> Entering:
        """Steps beyond the keyframes, 0 where they are not known; and, of a model that may do without, which are known."""
        nothing = gap.line[..., 0, :0]
        if self.velocity is None:
            return nothing
        steps = torch.cat(_steps(gap.line, gap.before, gap.after), dim=-2)
        known = _known(steps[..., None, :]).to(steps) if self.cfg.model.hide else nothing
        return torch.cat([(steps / self.velocity.to(steps)).nan_to_num().flatten(-2), known], dim=-1)

    def conditioning(self, gap: Gap) -> Float[Tensor, "*lead rows conditioning"]:
        """The network's input beside noised tokens: interpolation and mask in tokens; each token's frequency and the length,
        of the most; and in every token all steps beyond the keyframes.
        """
        line, tf = gap.line, self.transform(gap.frames)
        seen = tf(self._normalised(line))
        where = tf(gap.mask[..., None].expand(line.shape).to(line))[..., :1]
        rows = torch.arange(tf.shape[0], device=line.device, dtype=line.dtype) / gap.frames
        place = torch.stack([rows, torch.full_like(rows, gap.frames / self.cfg.task.gap)], dim=-1)
        beyond = self._beyond(gap)[..., None, :].expand(*seen.shape[:-1], -1)
        return torch.cat([seen, where, place.expand(*seen.shape[:-1], 2), beyond], dim=-1)


@lru_cache(maxsize=512)
def _transform(tokens: str, frames: int, channels: int, rows: int) -> Transform:
    if tokens == "frames":
        return OrthonormalRows(np.eye(frames), channels, "frames")  # no transform: "without DCT"
    kind, most = (DCTTransform, frames) if tokens == "cosines" else (DSTTransform, frames - 2)
    return kind(frames, channels, min(rows, most))


def _steps(x: Tensor, before: Tensor, after: Tensor) -> list[Float[Tensor, "*lead steps C"]]:
    """From frame to frame up to the first keyframe, and from the last one on."""
    return [torch.cat([before, x[..., :1, :]], dim=-2).diff(dim=-2), torch.cat([x[..., -1:, :], after], dim=-2).diff(dim=-2)]


def _known(beyond: Float[Tensor, "*lead frames C"]) -> Bool[Tensor, "*lead"]:
    """Whether all of some frames is known."""
    return beyond.isfinite().all(-1).all(-1)
