"""Tensor files with checksums, the moving average of weights, and checkpoints of a training."""

import copy
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from mwlib.files import write_atomic
from mwlib.hashing import sha256
from mwlib.paths import CONFIG
from mwlib.settings import Settings

Chosen = TypeVar("Chosen", bound=Settings)
Tensors = dict[str, Tensor]  # by their names
Texts = Mapping[str, str]


class DamagedFileError(ValueError):
    """A file that this library wrote does not hold what was written: truncated, flipped, or another kind of file."""


def save_tensors(file: Path, tensors: Mapping[str, Tensor], metadata: Texts) -> None:
    """Tensors and text to one safetensors file, atomically."""
    write_atomic(file, packed(tensors, metadata))


def packed(tensors: Mapping[str, Tensor], metadata: Texts) -> bytes:
    """What `save_tensors` writes. No code can hide in it, and the same content gives the same bytes."""
    whole = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in sorted(tensors.items())}
    text = json.dumps(dict(metadata), sort_keys=True)
    # one entry, as safetensors writes several in random order
    return save(whole, {"mwlib": json.dumps([text, _sha256(whole, text)])})


def load_tensors(file: Path) -> tuple[Tensors, dict[str, str]]:
    """Inverse of `save_tensors`, onto the CPU.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is truncated or changed; or not written by this library, or by a version before 0.2.
    """
    try:
        with safe_open(file, framework="pt") as handle:
            tensors = {name: handle.get_tensor(name) for name in sorted(handle.keys())}
            text, expected = json.loads(handle.metadata()["mwlib"])
    except SafetensorError as error:
        raise DamagedFileError(f"{file} is damaged: {error}; expected a whole file as mwlib wrote it") from None
    except (KeyError, ValueError, TypeError):
        raise DamagedFileError(
            f"{file} has no SHA-256 of mwlib's in its head; expected a file written by mwlib 0.2 or later"
        ) from None
    if (found := _sha256(tensors, text)) != expected:
        raise DamagedFileError(f"{file} is damaged: its content has SHA-256 {found[:12]}…; expected {expected[:12]}…")
    return tensors, json.loads(text)


def _sha256(tensors: Mapping[str, Tensor], text: str) -> str:
    """Of the text, then each tensor's name, type, shape and bytes."""
    parts: list[bytes | str] = [text]
    for name, x in tensors.items():
        parts += f"{name} {x.dtype} {tuple(x.shape)}", x.reshape(-1).view(torch.uint8).numpy().tobytes()
    return sha256(parts)


class MovingAverage:
    """Exponential moving average of weights: a copy of them until `start` steps, decayed by `decay` after that.

    Source: HumanMAC (its code); MotionWavelet, Appendix A, gives the decay.

    Args:
        network: whose weights are averaged; `weights` has the averages by their names.
        decay: share of the old average that stays at each step.
        start: step until which the average is a copy.
    """

    def __init__(self, network: nn.Module, decay: float, start: int) -> None:
        self.network, self.decay, self.start = network, decay, start
        self.weights = {name: p.detach().clone() for name, p in network.named_parameters()}

    @torch.no_grad()
    def update(self, step: int) -> None:
        """Take in the weights after step 1, 2, ..."""
        average = get_ema_multi_avg_fn(self.decay if step > self.start else 0.0)
        average([*self.weights.values()], [*self.network.parameters()], step)

    def averaged(self) -> nn.Module:
        """A copy of the network, in evaluation mode, with the averaged weights."""
        network = copy.deepcopy(self.network).eval()
        network.load_state_dict(self.weights, strict=False)  # buffers are as they were
        return network


CHECKPOINT, PREVIOUS, MODEL, CURVES = "checkpoint.safetensors", "previous.safetensors", "model.safetensors", "curves.json"


@dataclass(eq=False)
class State:
    """Everything that training changes, and how it is saved.

    Args:
        network: what is optimised.
        average: the moving average of its weights.
        optimiser: AdamW over its parameters.
        learnt: what the objective learnt before the first step (scales, a fitted transform).
        key: hash of what the training depends on.
        about: short texts that the finished model carries.
        scaler: of the losses in half precision, where there is one.
        step: steps taken.
        curve: their losses.
        validation: step and loss on data held out, where it was taken.
    """

    network: nn.Module
    average: MovingAverage
    optimiser: torch.optim.Optimizer
    learnt: Tensors
    key: str
    about: dict[str, str]
    scaler: torch.amp.GradScaler | None = None
    step: int = 0
    curve: list[float] = field(default_factory=list)
    validation: list[tuple[int, float]] = field(default_factory=list)
    _seconds: float = 0.0
    _since: float = field(default_factory=time.monotonic)

    @property
    def seconds(self) -> float:
        """Time spent in training, over all restarts."""
        return self._seconds + time.monotonic() - self._since

    def tensors(self) -> Tensors:
        """Flat names to tensors."""
        out = _prefixed("net.", self.network.state_dict()) | _prefixed("objective.", self.learnt)
        out |= _prefixed("ema.", self.average.weights)
        for name, parameter in self.network.named_parameters():
            out |= {f"adam.{key}.{name}": value for key, value in self.optimiser.state[parameter].items()}
        out["curve"] = torch.tensor(self.curve, dtype=torch.float64)
        out["validation"] = torch.tensor(self.validation, dtype=torch.float64).reshape(-1, 2)
        return out

    def restore(self, tensors: Mapping[str, Tensor], metadata: Texts) -> None:
        """Inverse of `tensors`."""
        self.step, self._seconds = int(metadata["step"]), float(metadata["seconds"])
        self.network.load_state_dict(part(tensors, "net."))
        for name, parameter in self.network.named_parameters():
            self.average.weights[name].copy_(tensors[f"ema.{name}"])
            moments = {k: tensors[f"adam.{k}.{name}"] for k in ("step", "exp_avg", "exp_avg_sq")}
            self.optimiser.state[parameter] = {k: v.to(parameter.device) for k, v in moments.items()}
        self.curve, self.validation = tensors["curve"].tolist(), [(int(at), loss) for at, loss in tensors["validation"].tolist()]
        if self.scaler:
            self.scaler.load_state_dict(json.loads(metadata["scaler"]))

    def save(self, folder: Path, is_last: bool) -> None:
        """Write the checkpoint; after the last step the model and its curves before it, so that a checkpoint of the last step
        proves that they are there.

        Raises:
            ValueError: weights are not finite; nothing is written then.
        """
        if broken := [name for name, weights in self.average.weights.items() if not weights.isfinite().all()]:
            raise ValueError(f"weights {broken[0]} are not finite after step {self.step}; expected numbers; try a smaller lr")
        scaler = json.dumps(self.scaler.state_dict() if self.scaler else {})
        metadata = {"step": str(self.step), "key": self.key, "seconds": f"{self.seconds:.1f}", "scaler": scaler}
        if is_last:
            self.mend(folder)
        if (folder / CHECKPOINT).exists():
            os.replace(folder / CHECKPOINT, folder / PREVIOUS)
        save_tensors(folder / CHECKPOINT, self.tensors(), metadata)

    def mend(self, folder: Path) -> None:
        """After the last step: write model and curves where a file is missing or holds anything else."""
        model = _prefixed("net.", self.average.averaged().state_dict()) | _prefixed("objective.", self.learnt)
        curves = json.dumps({"loss": self.curve, "validation": self.validation}, indent=1)
        finished = {MODEL: packed(model, {"key": self.key, **self.about}), CURVES: curves.encode()}
        for name, content in finished.items():
            if not (folder / name).exists() or (folder / name).read_bytes() != content:
                write_atomic(folder / name, content)


def read_checkpoint(folder: Path | None, key: str) -> tuple[Tensors, dict[str, str]]:
    """Tensors and metadata of the checkpoint in a folder, or of the one before if that is damaged; nothing if there is none.

    Raises:
        DamagedFileError: there are checkpoints, and all are damaged.
        ValueError: it belongs to a training with other settings.
    """
    damaged = []
    for file in [folder / CHECKPOINT, folder / PREVIOUS] if folder else []:
        try:
            tensors, metadata = load_tensors(file)
        except FileNotFoundError:
            continue
        except DamagedFileError as error:
            damaged.append(error)
            continue
        if metadata["key"] != key:
            raise ValueError(f"{file} was made with configuration {metadata['key']}; expected {key}: use another folder")
        return tensors, metadata
    if damaged:
        raise DamagedFileError(f"{damaged[0]} No earlier checkpoint is whole; delete {folder} to train again")
    return {}, {}


def read_model(folder: Path) -> tuple[Tensors, Tensors, dict[str, str]]:
    """A finished training: averaged weights, what the objective learnt, and the texts that go with them.

    Raises:
        FileNotFoundError: the folder holds no finished model; the message names the missing file.
        DamagedFileError: the model is damaged, or was written by a version before 0.2; the message has a remedy, if there is one.
    """
    file = folder / MODEL
    again = f"; {CHECKPOINT} is there: train with the run's settings, and the model is made from it"
    remedy = again * (folder / CHECKPOINT).exists()
    if not file.exists():
        raise FileNotFoundError(f"{file} is missing: no finished training run in this folder{remedy}")
    try:
        tensors, metadata = load_tensors(file)
    except DamagedFileError as error:
        raise DamagedFileError(f"{error}{remedy}") from None
    return part(tensors, "net."), part(tensors, "objective."), metadata


def part(tensors: Mapping[str, Tensor], prefix: str) -> Tensors:
    """The tensors whose names begin so, by the rest of their names."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


def _prefixed(prefix: str, tensors: Mapping[str, Any]) -> Tensors:
    return {f"{prefix}{name}": tensor for name, tensor in tensors.items()}


def read_curves(folder: Path) -> dict[str, Any] | None:
    """The losses of a finished training; None if the file is missing or damaged."""
    try:
        return json.loads((folder / CURVES).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None


def read_run(kind: type[Chosen], folder: Path) -> tuple[Chosen, Tensors, Tensors, dict[str, str]]:
    """A finished run of one system: its configuration, and what `read_model` gives.

    Raises:
        FileNotFoundError, DamagedFileError: as in `read_model`.
        ValueError: config.yaml is not whole or not valid, or is not the configuration that trained the model.
    """
    cfg = kind.from_yaml(folder / CONFIG)
    parts = read_model(folder)
    check_trained(cfg, parts[2], folder / CONFIG)
    return cfg, *parts


def check_trained(cfg: Settings, about: Texts, place: Path) -> None:
    """Refuse a configuration that is not the one that trained a model.

    Args:
        cfg: the configuration.
        about: the model's texts.
        place: where the configuration is from, for the message.

    Raises:
        ValueError: it is another; the message has the settings that differ, if the model carries its own.
    """
    if (found := cfg.training_hash()) == (key := about.get("key")):
        return
    before, now = (flat(tree) for tree in (json.loads(about.get("settings", "{}")), cfg.trained()))
    others = changes(before, now) if before else f"their hash is {found}; expected {key}"
    raise ValueError(f"{place} is not the configuration that trained {MODEL}: {others}. {NOT_BY_EDITING}")


NOT_BY_EDITING = (
    "A run's settings are not changed by editing: those of sampling by with_sampling, all others by another training; delete the "
    "file and train with the run's settings, and it is written again"
)


def changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Settings that differ, as words."""
    names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
    return ", ".join(f"{name} is {now.get(name)!r}; expected {before.get(name)!r}" for name in names)


def flat(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Settings without their groups."""
    groups = [group for group in tree.values() if isinstance(group, dict)]
    return {name: value for group in groups for name, value in group.items()}


def read_outcome(folder: Path) -> dict[str, Any]:
    """Of a finished training: last loss, last validation loss (None without one), and seconds over all restarts."""
    curves: Any = read_curves(folder)
    validation = curves["validation"][-1][1] if curves["validation"] else None
    seconds = float(load_tensors(folder / CHECKPOINT)[1]["seconds"])
    return {"loss": curves["loss"][-1], "validation": validation, "steps": len(curves["loss"]), "seconds": seconds}
