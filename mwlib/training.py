"""Training: a loop that yields every step, a moving average, and resume to the bit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from accelerate import Accelerator
from torch import Tensor, nn

from .checkpoint import load_tensors, save_tensors, write_atomic, write_json
from .config import Config, TrainingConfig
from .data.windows import TrainingWindows, windows
from .denoisers import TransLinear
from .diffusion import noised, target
from .motion import Motion
from .predictor import Predictor, make_network, make_transform
from .schedule import alpha_bar
from .transforms import PhaseTransform, ScaledTransform, Transform, fit_scale, pad_history

CHECKPOINT, MODEL, CONFIG = "checkpoint.safetensors", "model.safetensors", "config.yaml"


class TrainingStep(NamedTuple):
    """One optimisation step: its number (from 1), loss, learning rate, and the validation loss where one was taken."""

    step: int
    loss: float
    lr: float
    validation: float | None


def learning_rate(cfg: TrainingConfig, step: int) -> float:
    """Learning rate of step 0, 1, ...

    Source: MotionWavelet, Appendix A: "multistep" (Human3.6M), "cosine_restarts" with each restart's peak times gamma
    (HumanEva-I). Own choice: "cosine" to zero over the whole run, and linear warm-up, for short runs.
    """
    lr = cfg.lr * min(1.0, (step + 1) / cfg.warmup) if cfg.warmup else cfg.lr
    if cfg.lr_schedule == "multistep":
        return lr * cfg.lr_gamma ** sum(step >= m for m in cfg.lr_milestones)
    if cfg.lr_schedule == "cosine_restarts":
        cycle, within = divmod(step, cfg.lr_period)
        return lr * cfg.lr_gamma**cycle * 0.5 * (1 + math.cos(math.pi * within / cfg.lr_period))
    if cfg.lr_schedule == "cosine":
        return lr * 0.5 * (1 + math.cos(math.pi * step / cfg.train_steps))
    return lr


@contextmanager
def seeded(*numbers: int) -> Iterator[torch.Generator]:
    """A generator, and torch's global one (dropout draws from it), set by numbers alone; the global one is put back after.

    Own choice: every step's randomness is a function of (seed, step, process), so there is no state to save. The numbers
    are mixed first, as torch's CPU generator looks at the low 32 bits of a seed only.
    """
    seed, other = (int(n) for n in np.random.SeedSequence(numbers).generate_state(2))
    with torch.random.fork_rng([torch.cuda.current_device()] if torch.cuda.is_available() else []):
        torch.manual_seed(seed)
        yield torch.Generator().manual_seed(other)


class Objective:
    """Eq. 5 and its siblings: the loss of one batch of windows.

    Args:
        cfg: configuration.
        latent, conditioning: scaled transforms of motion and padded history.
    """

    def __init__(self, cfg: Config, latent: ScaledTransform, conditioning: ScaledTransform) -> None:
        self.cfg, self.latent, self.conditioning = cfg, latent, conditioning
        self.alpha_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)
        weight = torch.as_tensor(latent.deviation) ** 2
        self.weight = weight / weight.mean() if cfg.training.loss_weight == "metric" else None

    def __call__(self, net: nn.Module, x: Tensor, generator: torch.Generator) -> Tensor:
        """Mean squared error of the network's output; t uniform in 1..M-1, condition dropped at random."""
        cfg, device = self.cfg, x.device
        padded = pad_history(x[:, : cfg.data.history], cfg.frames)
        origin = x[:, cfg.data.history - 1, None] if cfg.model.target == "displacement" else 0.0
        y = self.latent(x - origin)
        t = torch.randint(1, len(self.alpha_bar), (len(x),), generator=generator)
        eps = torch.randn(y.shape, generator=generator).to(device)
        coins = torch.rand(len(x) if cfg.training.drop_per == "sample" else 1, generator=generator)
        keep = (coins >= cfg.training.drop_condition).expand(len(x)).to(device)
        a = self.alpha_bar[t].to(device)
        output = net(noised(y, eps, a), t.to(device), self.conditioning(padded), keep=keep)
        error = (output - target(cfg.diffusion.prediction, y, eps, a)) ** 2
        return error.mean() if self.weight is None else (error * self.weight.to(device)).mean()


class _State:
    """Everything that training changes, and how it is saved."""

    def __init__(self, cfg: Config, motions: Sequence[Motion], device: torch.device, learnt: dict[str, Tensor]) -> None:
        self.cfg, self.step = cfg, 0
        data = windows(motions, cfg.data.history, cfg.data.future, cfg.data.train_stride)
        channels = data.x.shape[-1]
        self.base = make_transform(cfg, channels)
        if isinstance(self.base, PhaseTransform):
            _fit_phase(cfg, self.base, motions, learnt)
        self.scales = fit_scales(cfg, self.base, data.x)
        with seeded(cfg.training.seed, 0):
            self.net = make_network(cfg, self.base.shape).to(device)
        self.ema = [p.detach().clone() for p in self.net.parameters()]
        self.optimiser = torch.optim.AdamW(
            self.net.parameters(), lr=cfg.training.lr, weight_decay=cfg.training.weight_decay, fused=True
        )
        self.channels, self.curve, self.validation = channels, [], []

    def update_ema(self) -> None:
        """Copy the weights until `ema_start`, then average (HumanMAC)."""
        decay = self.cfg.training.ema if self.step > self.cfg.training.ema_start else 0.0
        with torch.no_grad():
            torch._foreach_lerp_(self.ema, [p.detach() for p in self.net.parameters()], 1 - decay)

    def averaged(self) -> TransLinear:
        """A copy of the network with the averaged weights."""
        net = make_network(self.cfg, tuple(self.scales["mean"].shape)).to(self.ema[0].device)
        with torch.no_grad():
            for parameter, average in zip(net.parameters(), self.ema, strict=True):
                parameter.copy_(average)
        return net

    def learnt(self) -> dict[str, Tensor]:
        """What the frequency view learnt, by name; nothing for a linear one."""
        return {f"phase.{k}": v for k, v in self.base.tensors().items()}

    def _names(self) -> list[str]:
        return [name for name, _ in self.net.named_parameters()]

    def tensors(self) -> dict[str, Tensor]:
        """Flat names to tensors."""
        out = {f"net.{k}": v for k, v in self.net.state_dict().items()} | self.learnt()
        out |= {f"ema.{k}": v for k, v in zip(self._names(), self.ema, strict=True)}
        for name, parameter in self.net.named_parameters():
            for key, value in self.optimiser.state.get(parameter, {}).items():
                out[f"adam.{key}.{name}"] = value
        out["curve"] = torch.tensor(self.curve, dtype=torch.float64)
        out["validation"] = torch.tensor(self.validation, dtype=torch.float64).reshape(-1, 2)
        return out

    def restore(self, tensors: dict[str, Tensor], step: int) -> None:
        """Inverse of `tensors`."""
        self.step = step
        self.net.load_state_dict(_part(tensors, "net."))
        for average, name in zip(self.ema, self._names(), strict=True):
            average.copy_(tensors[f"ema.{name}"])
        for name, parameter in self.net.named_parameters():
            moments = {k: tensors[f"adam.{k}.{name}"] for k in ("step", "exp_avg", "exp_avg_sq")}
            self.optimiser.state[parameter] = {k: v.to(parameter.device) for k, v in moments.items()}
        self.curve, self.validation = tensors["curve"].tolist(), tensors["validation"].tolist()


def _fit_phase(cfg: Config, base: PhaseTransform, motions: Sequence[Motion], learnt: dict[str, Tensor]) -> None:
    """Take over what was learnt before, or train on augmented windows as the network will see them, sixteen at a time."""
    if learnt:
        base.restore(learnt)
        return
    source = TrainingWindows(motions, cfg.frames, cfg.data.window_sampling, cfg.data.augment)

    def draw(generator: torch.Generator) -> Tensor:
        x = source.draw(16, generator)
        if cfg.model.target == "pose":
            return x
        history = x[:, : cfg.data.history]  # a displacement to model, and a condition that is a pose
        return torch.cat([x - history[:, -1:], pad_history(history, cfg.frames)])

    base.fit(draw, cfg.model.phase_steps)


def fit_scales(cfg: Config, base: Transform, x: Tensor) -> dict[str, Tensor]:
    """Means and deviations of latent and condition over training windows x (N, T, C), for `Predictor`."""
    history = cfg.data.history
    relative = x - x[:, history - 1, None] if cfg.model.target == "displacement" else x
    mean, deviation = fit_scale(base, relative, cfg.model.coefficient_scale)
    scales = {"mean": mean, "deviation": deviation, "condition_mean": mean, "condition_deviation": deviation}
    if cfg.model.target == "displacement":
        padded = pad_history(x[:, :history], cfg.frames)
        scales["condition_mean"], scales["condition_deviation"] = fit_scale(base, padded, cfg.model.coefficient_scale)
    return {k: v.clone() for k, v in scales.items()}


def train(
    cfg: Config, motions: Sequence[Motion], folder: Path | None = None, validation: Sequence[Motion] = ()
) -> Iterator[TrainingStep]:
    """Train, yielding every step; stops by itself after `train_steps`.

    With a folder, a checkpoint is written every `checkpoint_every` steps and at the end (to a temporary name, then
    renamed), and an existing one is taken up: on the CPU the result is bit-identical to a run that was never stopped.
    Several processes started by ``accelerate launch`` share each batch.

    Args:
        cfg: configuration.
        motions: training clips.
        folder: where checkpoint and model go; None keeps nothing.
        validation: clips for the validation loss at each checkpoint, never trained on.

    Raises:
        ValueError: the folder's checkpoint belongs to another configuration, or the motions do not fit.
    """
    c = cfg.training
    accelerator = Accelerator(mixed_precision=c.mixed_precision)
    saved, step = _saved(cfg, folder / CHECKPOINT) if folder is not None and (folder / CHECKPOINT).exists() else ({}, 0)
    state = _State(cfg, motions, accelerator.device, _part(saved, "phase."))
    if saved:
        state.restore(saved, step)
    latent = ScaledTransform(state.base, state.scales["mean"], state.scales["deviation"])
    conditioning = ScaledTransform(state.base, state.scales["condition_mean"], state.scales["condition_deviation"])
    objective = Objective(cfg, latent, conditioning)
    source = TrainingWindows(motions, cfg.frames, cfg.data.window_sampling, cfg.data.augment, accelerator.device)
    net, optimiser = accelerator.prepare(state.net, state.optimiser)
    held_out = windows(validation, cfg.data.history, cfg.data.future, cfg.data.test_stride).x if validation else None
    while state.step < c.train_steps:
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(c, state.step)
        with seeded(c.seed, state.step + 1, accelerator.process_index) as generator:
            net.train()
            x = source.draw(max(c.batch // accelerator.num_processes, 1), generator)
            with accelerator.autocast():
                loss = objective(net, x, generator)
            accelerator.backward(loss)
            if c.clip_gradient:
                accelerator.clip_grad_norm_(net.parameters(), c.clip_gradient)
            optimiser.step()
            optimiser.zero_grad()
        state.step += 1
        state.update_ema()
        state.curve.append(float(loss.detach()))
        boundary = state.step % c.checkpoint_every == 0 or state.step == c.train_steps
        value = None
        if boundary and held_out is not None:
            value = validation_loss(objective, state.averaged(), held_out.to(accelerator.device))
            state.validation.append((state.step, value))
        if boundary and folder is not None and accelerator.is_main_process:
            _save(state, folder)
        yield TrainingStep(state.step, state.curve[-1], optimiser.param_groups[0]["lr"], value)


@torch.inference_mode()
def validation_loss(objective: Objective, net: TransLinear, x: Tensor) -> float:
    """Loss of averaged weights on held-out windows with fixed noise, without dropout."""
    net.eval()
    with seeded(7, 7) as generator:
        parts = x.split(256)
        return sum(float(objective(net, part, generator)) * len(part) for part in parts) / len(x)


def _saved(cfg: Config, file: Path) -> tuple[dict[str, Tensor], int]:
    """A checkpoint's tensors and step, if it is of this configuration."""
    tensors, metadata = load_tensors(file)
    found, expected = metadata["training_hash"], cfg.training_hash()
    if found != expected:
        raise ValueError(f"{file} was made with configuration {found}; expected {expected}: use another folder")
    return tensors, int(metadata["step"])


def _part(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names begin so, by the rest of their names."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


def _save(state: _State, folder: Path) -> None:
    metadata = {"step": str(state.step), "training_hash": state.cfg.training_hash(), "channels": str(state.channels)}
    folder.mkdir(parents=True, exist_ok=True)
    if state.step == state.cfg.training.train_steps:
        model = {f"net.{k}": v for k, v in state.averaged().state_dict().items()} | state.learnt()
        save_tensors(folder / MODEL, model | {f"scale.{k}": v for k, v in state.scales.items()}, metadata)
        write_atomic(folder / CONFIG, state.cfg.to_yaml())
        curves = {"loss": state.curve, "validation": state.validation}
        write_json(folder / "curves.json", curves)
    save_tensors(folder / CHECKPOINT, state.tensors(), metadata)


def load_run(folder: str | Path) -> Predictor:
    """The trained model of a run folder, on the CPU (``.to(device)`` moves it).

    Raises:
        FileNotFoundError: the folder holds no finished model; the message names the missing file.
    """
    folder = Path(folder)
    for name in (CONFIG, MODEL):
        if not (folder / name).exists():
            raise FileNotFoundError(f"{folder / name} is missing: no finished training run in this folder")
    cfg = Config.from_yaml(folder / CONFIG)
    tensors, metadata = load_tensors(folder / MODEL)
    scales, channels = _part(tensors, "scale."), int(metadata["channels"])
    net = make_network(cfg, tuple(scales["mean"].shape))
    net.load_state_dict(_part(tensors, "net."))
    base = make_transform(cfg, channels)
    if isinstance(base, PhaseTransform):
        base.restore(_part(tensors, "phase."))
    return Predictor(cfg, net, scales, channels, base)
