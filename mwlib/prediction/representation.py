"""Windows as coefficients: the frequency view of a trained model, what it is relative to, and the scales of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.data.windowing import TrainingWindows
from mwlib.prediction.config import ModelConfig, WindowConfig
from mwlib.transforms import DCTTransform, PhaseTransform, ScaledTransform, Transform, WaveletTransform, fit_scale, pad_history

SCALES = ("mean", "deviation", "condition_mean", "condition_deviation")
SCALE_WINDOWS = 2048  # drawn for the scales: deviations are then known to 1.6 %, whatever the size of the data


@dataclass(frozen=True)
class Representation:
    """Windows to coefficients and back, as a network sees them.

    Args:
        motion: scaled transform of what is modelled.
        condition: scaled transform of the padded history.
        history, frames: H and T.
        relative: whether the motion minus its last observed pose is modelled ("displacement").
    """

    motion: ScaledTransform
    condition: ScaledTransform
    history: int
    frames: int
    relative: bool

    def origin(self, x_history: Float[Tensor, "N H C"]) -> Float[Tensor, "N 1 C"]:
        """What the modelled motion is relative to: nothing, or the last observed pose."""
        last = x_history[:, -1:]
        return last if self.relative else torch.zeros_like(last)

    def encode(self, x: Float[Tensor, "N T C"]) -> Float[Tensor, "N rows columns"]:
        """Whole windows, metres, to scaled coefficients."""
        return self.motion(x - self.origin(x[:, : self.history]))

    def encode_history(self, x_history: Float[Tensor, "N H C"]) -> Float[Tensor, "N rows columns"]:
        """Observed frames, held over the future, to the coefficients of the condition."""
        return self.condition(pad_history(x_history, self.frames))

    def decode(self, y: Float[Tensor, "N S rows columns"], x_history: Float[Tensor, "N H C"]) -> Float[Tensor, "N S T C"]:
        """Coefficients to whole motions (T frames), metres."""
        return self.motion.inverse(y) + self.origin(x_history)[:, None]

    def learnt(self) -> dict[str, Tensor]:
        """Scales, and what the transform learnt: all that `make_representation` needs to build this one again."""
        scales = (self.motion.mean, self.motion.deviation, self.condition.mean, self.condition.deviation)
        out = {f"scale.{name}": torch.as_tensor(scale) for name, scale in zip(SCALES, scales, strict=True)}
        return out | {f"transform.{name}": tensor for name, tensor in self.motion.base.tensors().items()}


def make_transform(model: ModelConfig, frames: int, channels: int, fps: float, seed: int = 0) -> Transform:
    """The frequency view that a configuration names; "phase" is yet untrained.

    Args:
        model: names the view.
        frames, channels: T and C of the motions.
        fps: frames per second, for the window of the phase.
        seed: of the phase network's weights and training.
    """
    if model.transform == "phase":
        window = 2 * int(model.phase_seconds * fps / 2) + 1
        return PhaseTransform(frames, channels, model.phases, max(window, 3), fps, seed)
    if model.transform == "dct":
        return DCTTransform(frames, channels, model.dct_rows or max(1, round(frames * 20 / 125)))
    return WaveletTransform(frames, channels, model.wavelet, model.mode, model.level)


def make_representation(
    base: Transform, learnt: Mapping[str, Tensor], windows: WindowConfig, model: ModelConfig
) -> Representation:
    """The representation that `Representation.learnt` describes.

    Args:
        base: the frequency view, fitted if it is one that is fitted.
        learnt: holds the scales.
        windows, model: lengths, and what is modelled.
    """
    mean, deviation, condition_mean, condition_deviation = (learnt[f"scale.{name}"] for name in SCALES)
    return Representation(
        ScaledTransform(base, mean, deviation), ScaledTransform(base, condition_mean, condition_deviation),
        windows.history, windows.frames, model.representation == "displacement",
    )  # fmt: skip


def fit_representation(base: Transform, motions: Sequence[Motion], cut: WindowConfig, model: ModelConfig) -> Representation:
    """Fit a transform that learns, then the scales, on windows as they are drawn in training.

    Own choice: scales of the windows as they lie in the clips would not do. Where all people face one way, coefficients of
    turned windows are up to 15 such deviations wide. The draws are the same for every seed.

    Args:
        base: from `make_transform`.
        motions: training clips.
        cut: how they are cut and drawn.
        model: kind of scaling, and what is modelled.
    """
    source = TrainingWindows(motions, cut.frames, cut.window_sampling, cut.augment)
    if isinstance(base, PhaseTransform):
        _fit_phase(base, source, cut.history, model)
    count = 1 if model.coefficient_scale == "none" else SCALE_WINDOWS
    x = source.draw(count, torch.Generator().manual_seed(0))
    return make_representation(base, fit_scales(base, x, cut.history, model), cut, model)


def fit_scales(base: Transform, x: Float[Tensor, "N T C"], history: int, model: ModelConfig) -> dict[str, Tensor]:
    """Means and deviations of the coefficients of motion and condition over training windows, as in `Representation.learnt`."""
    relative = model.representation == "displacement"
    mean, deviation = fit_scale(base, x - x[:, history - 1, None] if relative else x, model.coefficient_scale)
    scales = [mean, deviation, mean, deviation]
    if relative:
        padded = pad_history(x[:, :history], x.shape[1])
        scales[2:] = fit_scale(base, padded, model.coefficient_scale)
    return {f"scale.{name}": scale.clone() for name, scale in zip(SCALES, scales, strict=True)}


def _fit_phase(base: PhaseTransform, source: TrainingWindows, history: int, model: ModelConfig) -> None:
    """Train on what is modelled and on what is conditioned on, sixteen windows at a time."""

    def draw(generator: torch.Generator) -> Tensor:
        x = source.draw(16, generator)
        if model.representation == "pose":
            return x
        observed = x[:, :history]  # a displacement to model, and a condition that is a pose
        return torch.cat([x - observed[:, -1:], pad_history(observed, source.frames)])

    base.fit(draw, model.phase_steps)
