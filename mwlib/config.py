"""Settings: frozen dataclasses, presets, validation, YAML in and out."""

from __future__ import annotations

import difflib
import hashlib
import json
import os
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import pywt
import yaml

from .presets import PRESETS

CHOICES = {
    "up": ("y", "z"),
    "window_sampling": ("uniform", "subject_action"),
    "augment": ("none", "humanmac", "heading", "heading_mirror"),
    "transform": ("wavelet", "dct", "phase"),
    "wavelet": tuple(pywt.wavelist(kind="discrete")),
    "mode": tuple(pywt.Modes.modes),
    "coefficient_scale": ("none", "band", "coefficient"),
    "schedule": ("linear", "cosine", "sigmoid", "sqrt"),
    "prediction": ("eps", "x0", "v"),
    "target": ("pose", "displacement"),
    "lr_schedule": ("constant", "multistep", "cosine_restarts", "cosine"),
    "drop_per": ("sample", "batch"),
    "mixed_precision": ("no", "fp16", "bf16"),
    "cfg_form": ("eq7", "alg1"),
    "sampler": ("ddim", "dpmpp", "eq6"),
    "spacing": ("leading", "trailing"),
    "loss_weight": ("uniform", "metric"),
    "tabg_noise": ("independent", "shared", "eps_hat"),
    "tabg_sigma_place": ("eq9", "alg1"),
    "tabg_space": ("eps", "clean"),
    "wmsg": ("off", "every_step", "x0_only"),
}


@dataclass(frozen=True)
class DataConfig:
    """Which motions, at which rate, cut into which windows."""

    data: str = "synthetic"  # "synthetic", or a path that load_motions reads
    fps: float = 50.0  # frames per second after resampling
    history: int = 25  # H, observed frames
    future: int = 100  # F, predicted frames
    train_stride: int = 5  # frames between the starts of the training windows that statistics and baselines use
    test_stride: int = 25  # frames between the starts of the test windows
    test_windows: int = 0  # evaluate this many windows, spread evenly; 0 = all
    train_subjects: tuple[str, ...] = ()  # empty = everyone who is in neither other list
    validation_subjects: tuple[str, ...] = ()
    test_subjects: tuple[str, ...] = ()  # empty = the last quarter of the subjects; of the clips if there is one subject
    window_sampling: str = "uniform"  # every window alike, or "subject_action" as DLow and HumanMAC draw
    augment: str = "heading_mirror"  # turn about the up-axis, mirror with left and right swapped


@dataclass(frozen=True)
class ModelConfig:
    """Frequency representation and network."""

    transform: str = "wavelet"
    wavelet: str = "bior2.8"
    mode: str = "zero"
    level: int = 1
    dct_rows: int = 20
    phases: int = 8  # channels of the periodic autoencoder
    phase_seconds: float = 1.0  # its window
    phase_steps: int = 1500  # its training
    coefficient_scale: str = "none"
    target: str = "pose"  # "displacement": model the motion minus its last observed pose
    latent: int = 768
    layers: int = 12
    heads: int = 8
    feedforward: int = 1536
    dropout: float = 0.2
    attention_dropout: float = 0.2


@dataclass(frozen=True)
class DiffusionConfig:
    """The forward process and what the network predicts."""

    schedule: str = "cosine"
    steps: int = 1000
    prediction: str = "eps"


@dataclass(frozen=True)
class TrainingConfig:
    """The optimisation."""

    train_steps: int = 390_500
    batch: int = 64
    lr: float = 1e-4
    weight_decay: float = 0.01
    lr_schedule: str = "multistep"
    lr_milestones: tuple[int, ...] = (93_720, 140_580, 187_440, 234_300)  # in steps
    lr_gamma: float = 0.2
    lr_period: int = 15_620  # steps between cosine restarts
    warmup: int = 0  # steps of linear warm-up
    ema: float = 0.995
    ema_start: int = 2000  # copy the weights until this step
    drop_condition: float = 0.2
    drop_per: str = "sample"
    loss_weight: str = "uniform"  # over coefficients; "metric" weighs scaled coefficients by their variance in metres
    clip_gradient: float = 0.0  # norm; 0 = off
    mixed_precision: str = "no"
    checkpoint_every: int = 5000
    seed: int = 0


@dataclass(frozen=True)
class SamplingConfig:
    """The reverse process, its guidance and how much of it to run."""

    samples: int = 50
    sampler: str = "ddim"  # "dpmpp": DPM-Solver++(2M); "eq6": the paper's Eq. 6 taken literally
    ddim_steps: int = 100
    spacing: str = "leading"  # of the retained diffusion indices: HumanMAC's, or "trailing"
    eta: float = 0.0
    cfg_form: str = "eq7"
    cfg_weight: float = 0.3
    tabg_scale: float = 1.0
    tabg_sigma: float = 2.5
    tabg_threshold: float = 1.0
    tabg_window: int = 3
    tabg_noise: str = "independent"
    tabg_sigma_place: str = "eq9"
    tabg_space: str = "eps"  # Eq. 11 on noise estimates, or on "clean" ones
    tabg_steps: float = 0.9  # share of the denoising steps, counted from the first, in which TABG acts
    wmsg: str = "every_step"
    bound: float = 0.0  # metres: clamp the clean estimate in motion space; 0 = off
    complete_history: bool = False  # HumanMAC's mask completion
    sampling_seed: int = 0


GROUPS = {
    "data": DataConfig,
    "model": ModelConfig,
    "diffusion": DiffusionConfig,
    "training": TrainingConfig,
    "sampling": SamplingConfig,
}


@dataclass(frozen=True)
class Config:
    """Everything a run depends on, in five groups whose field names are unique across groups.

    Raises:
        ValueError: a value has the wrong type, is out of range or not among its choices; the message
            names the field, the value and what is accepted.
    """

    data: DataConfig = field(default_factory=DataConfig)
    model: ModelConfig = field(default_factory=ModelConfig)
    diffusion: DiffusionConfig = field(default_factory=DiffusionConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)

    def __post_init__(self) -> None:
        for group in GROUPS:
            part = getattr(self, group)
            for item in fields(part):
                value = _typed(item.name, getattr(part, item.name), item.default)
                object.__setattr__(part, item.name, value)
        _check_ranges(self)

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Config:
        """A named preset with some fields changed, e.g. ``Config.preset("tiny", cfg_weight=0.5)``.

        With other data than the preset's own, its subjects no longer mean anything: all three lists are emptied.

        Raises:
            ValueError: unknown preset or field; the message lists the valid ones.
        """
        if name not in PRESETS:
            raise ValueError(f"unknown preset {name!r}; expected one of {sorted(PRESETS)}")
        base = cls().override(**PRESETS[name])
        if changes.get("data", base.data.data) != base.data.data:  # other data, other people
            base = base.override(train_subjects=(), validation_subjects=(), test_subjects=())
        return base.override(**changes)

    def override(self, **changes: Any) -> Config:
        """A copy with some fields changed; group names are not needed.

        Raises:
            ValueError: a name is not a field; the message lists the valid ones.
        """
        groups = {}
        owner = field_owners()
        for name, value in changes.items():
            if name not in owner:
                near = difflib.get_close_matches(name, owner, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise ValueError(f"unknown parameter {name!r}{hint} Valid ones: {', '.join(sorted(owner))}")
            groups.setdefault(owner[name], {})[name] = value
        return replace(self, **{g: replace(getattr(self, g), **part) for g, part in groups.items()})

    def get(self, name: str) -> Any:
        """The value of a field, whichever group holds it."""
        return getattr(getattr(self, field_owners()[name]), name)

    @property
    def frames(self) -> int:
        """T = H + F."""
        return self.data.history + self.data.future

    def training_hash(self) -> str:
        """Eight hex digits over what a trained model depends on (everything but sampling and test windows)."""
        parts = {g: asdict(getattr(self, g)) for g in ("data", "model", "diffusion", "training")}
        for name in ("test_stride", "test_windows"):
            parts["data"].pop(name)
        parts["training"].pop("checkpoint_every")
        if self.model.transform != "phase":
            for name in ("phases", "phase_seconds", "phase_steps"):
                parts["model"].pop(name)
        return _digest(parts)

    def hash(self) -> str:
        """Eight hex digits over every field."""
        return _digest(asdict(self))

    def to_yaml(self) -> str:
        """All fields as YAML text, grouped."""
        return yaml.safe_dump(json.loads(json.dumps(asdict(self))), sort_keys=False)

    @classmethod
    def from_yaml(cls, source: str | Path) -> Config:
        """Read what `to_yaml` wrote; groups or fields left out keep their defaults.

        Raises:
            ValueError: the text is not a mapping of groups, or holds an unknown field or a bad value.
        """
        text = source.read_text() if isinstance(source, Path) else source
        tree = yaml.safe_load(text) or {}
        if not isinstance(tree, dict) or not set(tree) <= set(GROUPS):
            raise ValueError(f"expected the groups {list(GROUPS)}; found {tree if not isinstance(tree, dict) else list(tree)}")
        return cls().override(**{k: v for group in tree.values() for k, v in (group or {}).items()})


def field_owners() -> dict[str, str]:
    """Field name -> the group it belongs to."""
    return {item.name: group for group, kind in GROUPS.items() for item in fields(kind)}


def data_folder() -> Path:
    """Where relative data sources are looked up: MWLIB_DATA, or the working folder."""
    return Path(os.environ.get("MWLIB_DATA", "."))


def _typed(name: str, value: Any, default: Any) -> Any:
    """Check one value against the type of its default; whole floats and sequences are converted."""
    if isinstance(default, tuple):
        if isinstance(value, str) or not hasattr(value, "__iter__"):
            raise ValueError(f"{name} is {value!r}; expected a list")
        kind = int if name == "lr_milestones" else str
        return tuple(kind(v) for v in value)
    if isinstance(default, bool) or isinstance(value, bool):
        if not (isinstance(default, bool) and isinstance(value, bool)):
            raise ValueError(f"{name} is {value!r}; expected {type(default).__name__}")
        return value
    if isinstance(default, float) and isinstance(value, int):
        return float(value)
    if not isinstance(value, type(default)):
        raise ValueError(f"{name} is {value!r} ({type(value).__name__}); expected {type(default).__name__}, e.g. {default!r}")
    if name in CHOICES and value not in CHOICES[name]:
        raise ValueError(f"{name} is {value!r}; expected one of {', '.join(CHOICES[name])}")
    return value


_AT_LEAST_ONE = (
    "history",
    "future",
    "train_stride",
    "test_stride",
    "level",
    "dct_rows",
    "phases",
    "phase_steps",
    "latent",
    "layers",
    "heads",
    "feedforward",
)
_AT_LEAST_ONE += ("train_steps", "batch", "checkpoint_every", "lr_period", "samples", "ddim_steps", "tabg_window")
_SHARES = ("dropout", "attention_dropout", "ema", "drop_condition", "tabg_steps")


def _check_ranges(cfg: Config) -> None:
    for name in _AT_LEAST_ONE:
        if cfg.get(name) < 1:
            raise ValueError(f"{name} is {cfg.get(name)}; expected at least 1")
    for name in _SHARES:
        if not 0 <= cfg.get(name) <= 1:
            raise ValueError(f"{name} is {cfg.get(name)}; expected 0 to 1")
    for name in ("fps", "lr", "phase_seconds"):
        if not cfg.get(name) > 0:
            raise ValueError(f"{name} is {cfg.get(name)}; expected more than 0")
    if cfg.model.latent % cfg.model.heads or (cfg.model.latent // cfg.model.heads) < 1 or cfg.model.latent % 2:
        raise ValueError(f"latent is {cfg.model.latent}; expected an even multiple of heads ({cfg.model.heads})")
    if cfg.model.layers % 2:
        raise ValueError(f"layers is {cfg.model.layers}; expected an even number (long skips pair the blocks)")
    if cfg.sampling.tabg_window % 2 == 0:
        raise ValueError(f"tabg_window is {cfg.sampling.tabg_window}; expected an odd number")
    if cfg.sampling.ddim_steps >= cfg.diffusion.steps:
        raise ValueError(f"ddim_steps is {cfg.sampling.ddim_steps}; expected fewer than steps ({cfg.diffusion.steps})")
    if cfg.model.transform == "dct" and cfg.model.dct_rows > cfg.frames:
        raise ValueError(f"dct_rows is {cfg.model.dct_rows}; expected at most history + future ({cfg.frames})")


def _digest(tree: dict) -> str:
    return hashlib.sha256(json.dumps(tree, sort_keys=True).encode()).hexdigest()[:8]
