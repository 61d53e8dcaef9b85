"""Windows as coefficients: the frequency view of a trained model, what it is relative to, and the scales of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.kinematics import heading, turn_heading
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data.windows import Bodies, TrainingWindows, Variation
from mwlib.diffusion.conditioning import beside_samples
from mwlib.prediction.config import Config, ModelConfig, WindowConfig
from mwlib.training.checkpoint import part

from mwlib.transforms import (  # isort: skip
    DCTTransform, PhaseTransform, ScaledTransform, TimeWaveletTransform, Transform, WaveletTransform, fit_scale,
)  # fmt: skip

import numpy as np

from mwlib.transforms.linear import Constant, pad_history

Observed = Float[Tensor, "N H C"]
Seen = Float[Tensor, "*n H C"]  # with an axis for the samples, or without
Whole = Float[Tensor, "N *S T C"]
SCALES = ("mean", "deviation", "condition_mean", "condition_deviation")
# Windows at a time of which a periodic autoencoder learns. Own choice: four, as in equal time many small steps lose less.
LEARNING_WINDOWS = {"phase": 16, "straight_phase": 4}
LEAST_SEEN = 0.02  # metres: what of a condition varies less is not blown up
SCALE_WINDOWS = 2048  # drawn for the scales: deviations are then known to 1.6 %, whatever the size of the data


class Representation:
    """Windows to coefficients and back, as a network sees them.

    `motion` is the scaled transform of what is modelled, `condition` that of the padded history, `history` and `frames` are H
    and T. `relative` says to what the motion is modelled: nothing ("pose"), its last observed pose ("displacement"), or what is
    observed, and then a pose that relaxes from the last observed one to the resting one ("relaxing"), of whose difference a
    share 1/e is left after `fade` frames. `facing` are bodies whose motions are turned so that the hips of the last observed
    pose lie along the first horizontal axis; None: motions are modelled as they face.

    Args:
        base: the frequency view, fitted if it is one that is fitted.
        learnt: the scales and, for "relaxing", the resting pose "rest" (C,), the mean over training windows.
        cfg: lengths, and what is modelled.
        bodies: whose motions.
    """

    def __init__(self, base: Transform, learnt: Mapping[str, Tensor], cfg: Config, bodies: Bodies) -> None:
        scales = [learnt[f"scale.{name}"] for name in SCALES]
        self.motion, self.condition = ScaledTransform(base, *scales[:2]), ScaledTransform(base, *scales[2:])
        self.history, self.frames, self.relative = cfg.windows.history, cfg.windows.frames, cfg.model.representation
        self.fade, self.facing = cfg.model.fade_seconds * bodies.fps, bodies if cfg.model.heading == "body" else None
        self._learnt = learnt

    def origin(self, x_history: Seen) -> Float[Tensor, "*n _T C"]:
        """What the modelled motion is relative to, for all frames or for each; of turned histories, where they are turned."""
        last = x_history[..., -1:, :]
        if self.relative == "pose":
            return torch.zeros_like(last)
        if self.relative == "displacement":
            return last
        rest = self._learnt["rest"].to(last)
        ahead = torch.arange(1, self.frames - self.history + 1).to(last)[:, None]
        return torch.cat([x_history, rest + (last - rest) * torch.exp(-ahead / self.fade)], dim=-2)

    def modelled(self, x: Whole, x_history: Observed) -> Whole:
        """Motions, metres, as what is transformed: turned, minus their origin."""
        seen = beside_samples(x_history, x)
        return turned(x, seen, self.facing, -1) - self.origin(self._turned(seen))

    def placed(self, r: Whole, x_history: Observed) -> Whole:
        """Inverse of `modelled`."""
        seen = beside_samples(x_history, r)
        return turned(r + self.origin(self._turned(seen)), seen, self.facing, 1)

    def _turned(self, x_history: Seen) -> Seen:
        """Histories as the model sees them."""
        return turned(x_history, x_history, self.facing, -1)

    def encode(self, x: Float[Tensor, "N T C"]) -> Float[Tensor, "N rows columns"]:
        """Whole windows, metres, to scaled coefficients."""
        return self.motion(self.modelled(x, x[:, : self.history]))

    def encode_history(self, x_history: Observed) -> Float[Tensor, "N rows columns"]:
        """Observed frames, held over the future, to the coefficients of the condition."""
        return self.condition(pad_history(self._turned(x_history), self.frames))

    def decode(self, y: Float[Tensor, "N S rows columns"], x_history: Observed) -> Float[Tensor, "N S T C"]:
        """Coefficients to whole motions (T frames), metres."""
        return self.placed(self.motion.inverse(y), x_history)

    def continued(
        self, y: Float[Tensor, "N S rows columns"], x_history: Observed, continuation: Continuation
    ) -> Float[Tensor, "N S F C"]:
        """Coefficients to futures, metres, that continue what was observed."""
        x_history = x_history[:, None]
        seen = self._turned(x_history)
        return turned(continuation(y, seen, self.origin(seen)), x_history, self.facing, 1)

    def learnt(self) -> dict[str, Tensor]:
        """Scales, and what the transform learnt: all that `restored_representation` needs to build this one again."""
        return {**self._learnt} | {f"transform.{name}": tensor for name, tensor in self.motion.base.tensors().items()}


def _scales(*scales: Any) -> dict[str, Tensor]:
    """Mean and deviation of motions, then of conditions, as `Representation.learnt` names them."""
    return {f"scale.{name}": torch.as_tensor(scale).clone() for name, scale in zip(SCALES, scales, strict=True)}


def turned(x: Whole, x_history: Seen, facing: Bodies | None, sign: int) -> Whole:
    """Motions turned by the heading of their last observed pose, or against it (-1); as they are without bodies."""
    if facing is None:
        return x
    return turn_heading(x, sign * heading(x_history[..., -1, :], facing.skeleton, facing.up), facing.up)


def make_transform(model: ModelConfig, frames: int, channels: int, fps: float, seed: int = 0) -> Transform:
    """The frequency view that a configuration names; "phase" and "straight_phase" are yet untrained.

    Args:
        model: names the view.
        frames, channels: T and C of the motions.
        fps: frames per second, for the window of the phase.
        seed: of the phase network's weights and training.
    """
    if model.transform in LEARNING_WINDOWS:
        window = max(2 * int(model.phase_seconds * fps / 2) + 1, 3)
        return PhaseTransform(frames, channels, model.phases, window, fps, seed, straight=model.transform == "straight_phase")
    if model.transform == "dct":
        return DCTTransform(frames, channels, model.dct_rows or max(1, round(frames * 20 / 125)))
    if model.transform == "time_wavelet":
        return TimeWaveletTransform(frames, channels, model.wavelet, model.level, model.omit)
    return WaveletTransform(frames, channels, model.wavelet, model.mode, model.level)


def transform_of(cfg: Config, skeleton: Skeleton) -> Transform:
    """`make_transform` for the windows and bodies of a configuration."""
    return make_transform(cfg.model, cfg.windows.frames, 3 * (len(skeleton) - 1), cfg.data.fps, cfg.training.seed)


def restored_representation(cfg: Config, learnt: Mapping[str, Tensor], bodies: Bodies) -> Representation:
    """The representation of an earlier training, and the transform with what it learnt."""
    base = transform_of(cfg, bodies.skeleton)
    if isinstance(base, PhaseTransform):
        base.restore(part(learnt, "transform."))
    return Representation(base, learnt, cfg, bodies)


def training_windows(motions: Sequence[Motion], cut: WindowConfig) -> TrainingWindows:
    """The windows that a training draws, as its settings say."""
    variation = Variation(cut.other_speeds, cut.other_bones, cut.backwards, cut.slowed, cut.other_arms, pivot=cut.history - 1)
    return TrainingWindows(motions, cut.frames, cut.window_sampling, cut.augment, variation)


def fit_representation(cfg: Config, motions: Sequence[Motion]) -> Representation:
    """Fit a transform that learns, then the scales, on windows as they are drawn in training.

    Own choice: scales of the windows as they lie in the clips would not do. Where all people face one way, coefficients of
    turned windows are up to 15 such deviations wide. The draws are the same for every seed.

    Args:
        cfg: how the clips are cut and drawn, the kind of scaling, and what is modelled.
        motions: training clips.
    """
    draw, bodies, model = _turned_windows(cfg, motions), Bodies.of(motions), cfg.model
    base = transform_of(cfg, bodies.skeleton)
    if isinstance(base, PhaseTransform):
        base.fit(learning_windows(cfg, motions, LEARNING_WINDOWS[model.transform]), model.phase_steps)
    is_plain = model.coefficient_scale == "none" and model.condition_scale == "as_motion" and model.representation != "relaxing"
    count = 1 if is_plain else SCALE_WINDOWS
    x = draw(count, torch.Generator().manual_seed(0))
    return Representation(base, fit_scales(base, x, cfg, bodies), cfg, bodies)


def fit_scales(base: Transform, x: Float[Tensor, "N T C"], cfg: Config, bodies: Bodies) -> dict[str, Tensor]:
    """Means and deviations of the coefficients of motion and condition over training windows, as in `Representation.learnt`.

    Args:
        base: the frequency view.
        x: windows, turned if the model's are.
        cfg, bodies: as in `Representation`.
    """
    model, frames = cfg.model, cfg.windows.frames
    learnt = _scales(*(torch.zeros(base.shape), torch.ones(base.shape)) * 2)
    if model.representation == "relaxing":
        learnt["rest"] = x.mean((0, 1))
    seen, kind = x[:, : cfg.windows.history], model.coefficient_scale
    origin = Representation(base, learnt, cfg, bodies).origin(seen)
    mean, deviation = fit_scale(base, x - origin, kind)
    if model.condition_scale == "coefficient":  # own choice: else poses, which vary most, drown how people move
        mean_seen, spread = fit_scale(base, pad_history(seen, frames), "coefficient")
        of_condition = mean_seen, spread.clamp_min(LEAST_SEEN)
    else:
        of_condition = (mean, deviation) if model.representation == "pose" else fit_scale(base, pad_history(seen, frames), kind)
    return learnt | _scales(mean, deviation, *of_condition)


def _turned_windows(cfg: Config, motions: Sequence[Motion]) -> Callable[[int, torch.Generator], Float[Tensor, "N T C"]]:
    """So many windows as they are drawn in training, turned if the model's are."""
    source, facing = training_windows(motions, cfg.windows), Bodies.of(motions) if cfg.model.heading == "body" else None

    def draw(count: int, generator: torch.Generator) -> Tensor:
        """So many windows, turned as the model sees them."""
        x = source.draw(count, generator)
        return turned(x, x[:, : cfg.windows.history], facing, -1)

    return draw


def learning_windows(cfg: Config, motions: Sequence[Motion], count: int) -> Callable[[torch.Generator], Float[Tensor, "B T C"]]:
    """What a transform that learns is fitted on, a batch at a time: what is modelled, and what is conditioned on.

    Args:
        cfg: how the clips are cut and drawn, and what is modelled.
        motions: training clips.
        count: windows of a batch; a displacement has a condition that is a pose, so that B is twice as many.
    """
    draw = _turned_windows(cfg, motions)

    def both(generator: torch.Generator) -> Tensor:
        """What is modelled of so many windows and, of displacements, the padded histories."""
        x = draw(count, generator)
        observed = x[:, : cfg.windows.history]
        padded = pad_history(observed, cfg.windows.frames)
        return x if cfg.model.representation == "pose" else torch.cat([x - observed[:, -1:], padded])

    return both


INSIDE = 0.011  # seconds: shorter movements inside a future are damped; below a recording's noise
ENDS = 0.035  # seconds: the same at both ends of the future, where coefficients say least
REACH = 0.08  # seconds: how far from an end its damping falls to a share 1/e


class Continuation:
    """Futures that have the drawn coefficients as far as a smooth motion through the observed frames can have them.

    A transform's own inverse ignores what was observed, and a DWT along time takes frames beyond the window for a repetition of
    it, so that kept levels alone lose the last frames. The coefficients do not: with h the observed frames, c the coefficients
    along time, c = A x of a motion x, and D the third difference, the future is

        f = argmin |A [h; f] - c|^2 + sum_n lambda_n |(D [h; f])_n|^2,    lambda_n = (tau_n fps)^6.

    `seam` adds (seam fps)^4 |f_1 - 2 h_H + h_(H-1)|^2, the change of velocity where the future begins.

    That is a smoothing spline (Reinsch, 1967) of coefficients in place of values, and linear in c and h: two constant matrices.
    tau is `INSIDE`, and `ENDS` where the future begins and ends; given in seconds, it means the same at every rate. Own choice,
    like these times: the papers cut the future from the inverse. A transform that is not one matrix along time is inverted first.

    Args:
        transform: of whole windows.
        history, frames: H and T.
        fps: frames per second.
        seam: seconds.

    >>> import torch
    >>> from mwlib.transforms.dwt import TimeWaveletTransform
    >>> x = torch.linspace(0, 1, 40)[:, None] ** 2 * torch.ones(3)
    >>> tf = TimeWaveletTransform(40, 3, level=3, omit=1)
    >>> f = Continuation(tf, 10, 40, 20.0)(tf(x), x[:10])
    >>> bool((tf.inverse(tf(x)) - x)[10:].abs().max() > 0.01), bool((f - x[10:]).abs().max() < 1e-3)
    (True, True)
    """

    def __init__(self, transform: Transform, history: int, frames: int, fps: float, seam: float = 0.0) -> None:
        self.transform, self.frames = transform, frames
        rows = transform.time_rows()
        self._rows = None if rows is None else Constant(rows)
        a = np.eye(frames) if rows is None else rows
        at = np.arange(frames - 3) + 1.5  # the middle of each third difference
        away = np.minimum(np.abs(at - (history - 0.5)), frames - 1 - at) / (REACH * fps)
        weight = (INSIDE * fps) ** 6 + (ENDS * fps) ** 6 * np.exp(-away)
        turn = (seam * fps) ** 2 * np.diff(np.eye(frames), n=2, axis=0)[history - 2 : history - 1]
        d = np.concatenate([np.sqrt(weight)[:, None] * np.diff(np.eye(frames), n=3, axis=0), turn])
        (ah, af), (dh, df) = (np.split(m, [history], axis=1) for m in (a, d))
        solved = np.linalg.solve(af.T @ af + df.T @ df, np.concatenate([af.T, -(af.T @ ah + df.T @ dh)], axis=1))
        self.of_coefficients, self.of_history = (Constant(m) for m in np.split(solved, [len(a)], axis=1))

    def __call__(
        self,
        y: Float[Tensor, "*n rows columns"],
        x_history: Float[Tensor, "*m H C"],
        origin: Float[Tensor, "*m _T C"] | float = 0.0,
    ) -> Float[Tensor, "*n F C"]:
        """The futures, as smooth as they are with the history, whatever they are modelled relative to.

        Args:
            y: coefficients of the motions minus their origin.
            x_history: observed frames, metres; its leading axes, and those of the origin, broadcast to those of y.
            origin: what is subtracted from motions before they are transformed, of all frames or for each.
        """
        c = self.transform.along_time(y)
        if isinstance(origin, Tensor):
            origin = origin.expand(*origin.shape[:-2], self.frames, -1)
            c = c + (origin if self._rows is None else self._rows.like(c) @ origin)
        return self.of_coefficients.like(c) @ c + self.of_history.like(c) @ x_history
