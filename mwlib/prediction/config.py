"""Settings of MotionWavelet: every option of the method, its training and its sampling."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

import pywt

from mwlib.data.sources import SourceConfig
from mwlib.diffusion.config import DiffusionConfig
from mwlib.diffusion.schedule import alpha_bar, ddim_indices
from mwlib.metrics.table import MM_SINGLETONS
from mwlib.networks.precision import Precision
from mwlib.prediction.presets import PRESETS, RENAMED
from mwlib.settings import BelowOne, Count, Natural, NotNegative, OneOf, Positive, Settings, Share
from mwlib.training.config import TrainingConfig

MOST_SIGNAL = 0.15  # alpha_bar where sampling starts from noise; 20 leading steps of the cosine schedule start at 0.006

Method = Literal["diffusion", "zero_velocity", "constant_velocity", "nearest_history", "nearest_displacement", "truth"]


@dataclass(frozen=True)
class WindowConfig:
    """How motions are cut into windows, and which of them are drawn."""

    history: Count = 25  # H, observed frames
    future: Count = 100  # F, predicted frames
    train_stride: Count = 5  # frames between the starts of the training windows that baselines know
    test_stride: Count = 25  # frames between the starts of the test windows
    test_windows: Natural = 0  # evaluate this many windows, spread evenly; 0 = all
    window_sampling: Literal["uniform", "subject_action"] = "uniform"  # every window alike, or as DLow and HumanMAC draw
    augment: Literal["none", "humanmac", "heading", "heading_mirror"] = "heading_mirror"  # see TrainingWindows
    other_speeds: BelowOne = 0.0  # also train on the clips played faster and slower, by up to this share
    other_bones: BelowOne = 0.0  # deviation of a random factor of each bone's length, and of one of the whole body's
    backwards: Share = 0.0  # of the training windows: played backwards
    slowed: Share = 0.0  # of the training windows: played at a random share of their speed
    other_arms: Share = 0.0  # of the training windows: with another window's arms

    @property
    def frames(self) -> int:
        """T = H + F."""
        return self.history + self.future


@dataclass(frozen=True)
class ModelConfig:
    """Frequency representation and network."""

    transform: Literal["wavelet", "time_wavelet", "dct", "phase", "straight_phase"] = "wavelet"  # the frequency view
    wavelet: Annotated[str, OneOf(tuple(pywt.wavelist(kind="discrete")))] = "bior2.8"  # basis, in PyWavelets' spelling
    mode: Annotated[str, OneOf(tuple(pywt.Modes.modes))] = "zero"  # extension at the borders
    level: Count = 1  # of the wavelet decomposition
    omit: Natural = 0  # levels of "time_wavelet", from the finest, whose details are left out
    dct_rows: Natural = 0  # cosine coefficients kept; 0 = 20 of 125 frames, HumanMAC's share
    phases: Count = 8  # channels of the periodic autoencoder
    phase_seconds: Positive = 1.0  # its window
    phase_steps: Count = 1500  # its training
    coefficient_scale: Literal["none", "band", "coefficient"] = "none"  # to unit deviation: not, per sub-band, one by one
    representation: Literal["pose", "displacement", "relaxing"] = "pose"  # what is modelled, see Representation
    fade_seconds: Positive = 0.5  # of "relaxing"
    heading: Literal["world", "body"] = "world"  # motions as they face, or turned by the heading of the last observed pose
    width: Count = 768  # of the network
    layers: Count = 12  # blocks, an even number
    heads: Count = 8  # of the attention
    feedforward: Count = 1536  # hidden width of the feed-forward layers
    dropout: BelowOne = 0.2  # in feed-forward and style layers
    attention_dropout: BelowOne = 0.2  # on attention weights; on the CPU anything but 0 is slow


@dataclass(frozen=True)
class ObjectiveConfig:
    """What the network is asked for in training."""

    drop_condition: Share = 0.2  # how often the condition is left out, for classifier-free guidance
    drop_per: Literal["sample", "batch"] = "sample"  # one coin each, or one for all
    loss_weight: Literal["uniform", "metric"] = "uniform"  # "metric" weighs scaled coefficients by their variance in metres
    level_weight: Literal["uniform", "snr"] = "uniform"  # of noise levels; "snr": by signal over noise, see SNR_BOUNDS
    blank_condition: BelowOne = 0.0  # share of the condition's coefficients that are set to zero, at random


@dataclass(frozen=True)
class SamplingConfig:
    """The reverse process, its guidance and how much of it to run."""

    method: Method = "diffusion"  # or a baseline; "truth" is what is to be predicted, for its speed and jerk
    samples: Count = 50  # S, futures of each history
    sampler: Literal["ddim", "dpmpp", "eq6"] = "ddim"  # "dpmpp": DPM-Solver++(2M); "eq6": the paper's Eq. 6 taken literally
    ddim_steps: Count = 100  # denoising steps
    spacing: Literal["leading", "trailing"] = "leading"  # of the retained diffusion indices, see ddim_indices
    temperature: Positive = 1.0  # deviation of the noise that sampling starts from
    eta: NotNegative = 0.0  # share of the posterior deviation that DDIM draws anew
    guidance_form: Literal["eq7", "alg1"] = "eq7"  # spelling of classifier-free guidance, see classifier_free
    guidance_weight: float = 0.3  # w of that spelling
    tabg_scale: float = 1.0  # s of Eq. 11; 0 = off
    tabg_sigma: NotNegative = 2.5  # noise scale of Eq. 9, in the coefficients' unit
    tabg_threshold: float = 1.0  # phi of the mask
    tabg_window: Count = 3  # m of the mask, an odd number of rows
    tabg_noise: Literal["independent", "shared", "eps_hat"] = "independent"  # the two draws of Eq. 9 and 10
    tabg_sigma_place: Literal["eq9", "alg1"] = "eq9"  # sigma before or after the scaling by sqrt(alpha_bar)
    tabg_space: Literal["eps", "y0_hat"] = "eps"  # Eq. 11 on noise estimates, or on clean ones
    tabg_steps: Share = 0.9  # share of the denoising steps, counted from the first, in which TABG acts
    wmsg: Literal["off", "every_step", "y0_hat"] = "every_step"  # manifold shaping of y_t after each step, or of clean estimates
    bound: NotNegative = 0.0  # metres: clamp the clean estimate in motion space; 0 = off
    complete_history: bool = False  # HumanMAC's mask completion
    bones: Literal["free", "observed"] = "free"  # lengths as they come, or as in the last observed pose
    sampling_seed: Natural = 0  # of the noise
    precision: Precision = "float32"  # of the network's products while sampling; "tf32", "bf16": faster on graphics cards
    noise_on: Literal["cpu", "device"] = "cpu"  # where noise is drawn: a seed means the same everywhere, or is faster


@dataclass(frozen=True)
class EvaluationConfig:
    """How predictions are scored."""

    mm_threshold: Positive = 0.5  # metres between last observed poses: closer windows share their futures (DLow, on Human3.6M)
    mm_singletons: Annotated[str, OneOf(MM_SINGLETONS)] = "keep"  # windows that are close to no other, see MetricTable


@dataclass(frozen=True)
class Config(Settings):
    """Everything that a run of MotionWavelet depends on, in eight groups whose field names are unique across groups.

    >>> cfg = Config.preset("tiny", guidance_weight=0.5)
    >>> cfg.windows.frames, cfg.sampling.guidance_weight
    (40, 0.5)

    Raises:
        ValueError: see `Settings`, and settings that do not fit each other.
    """

    system: ClassVar[str] = "prediction"
    presets = PRESETS
    renamed = RENAMED
    after_training: ClassVar[frozenset[str]] = frozenset(
        {"sampling", "evaluation", "test_stride", "test_windows", "checkpoint_every"}
    )

    data: SourceConfig = field(default_factory=SourceConfig)
    windows: WindowConfig = field(default_factory=WindowConfig)
    model: ModelConfig = field(default_factory=ModelConfig)
    diffusion: DiffusionConfig = field(default_factory=DiffusionConfig)
    objective: ObjectiveConfig = field(default_factory=ObjectiveConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Self:
        """A named preset with some fields changed, e.g. ``Config.preset("tiny", guidance_weight=0.5)``.

        With other data than the preset's own, its subjects no longer mean anything: all three lists are emptied.

        Raises:
            ValueError: unknown preset or field; the message lists the valid ones.
        """
        base = super().preset(name)
        if changes.get("data", base.data.data) != base.data.data:  # other data, other people
            base = base.override(train_subjects=(), validation_subjects=(), test_subjects=())
        return base.override(**changes)

    def check(self) -> None:
        """Refuse values that do not fit each other."""
        m, s = self.model, self.sampling
        if m.width % m.heads or m.width % 2:
            raise ValueError(f"width is {m.width}; expected an even multiple of heads ({m.heads})")
        if m.layers % 2:
            raise ValueError(f"layers is {m.layers}; expected an even number (long skips pair the blocks)")
        if s.tabg_window % 2 == 0:
            raise ValueError(f"tabg_window is {s.tabg_window}; expected an odd number")
        if s.ddim_steps >= self.diffusion.steps:
            raise ValueError(f"ddim_steps is {s.ddim_steps}; expected fewer than steps ({self.diffusion.steps})")
        self._check_indices()
        if m.transform.endswith("phase") and s.wmsg == "every_step":
            raise ValueError(
                "wmsg is 'every_step' with phase codes; expected 'off' or 'y0_hat': the autoencoder would take the noise away"
            )
        if m.transform == "time_wavelet" and not m.omit < m.level:
            raise ValueError(f"omit is {m.omit} of level {m.level}; expected fewer than the levels")
        if m.transform == "dct" and m.dct_rows > self.windows.frames:
            raise ValueError(f"dct_rows is {m.dct_rows}; expected at most history + future ({self.windows.frames})")

    def _check_indices(self) -> None:
        """Refuse diffusion indices that no network was trained on, and a start that is not yet noise."""
        s, d = self.sampling, self.diffusion
        indices = ddim_indices(d.steps, s.ddim_steps, s.spacing)
        if indices[-1] == 0:
            most = 2 * d.steps // 3
            raise ValueError(f"ddim_steps is {s.ddim_steps} of {d.steps}, which reaches t = 0; expected at most {most}")
        signal = float(alpha_bar(d.schedule, d.steps)[indices[0]])
        if signal > MOST_SIGNAL:
            raise ValueError(
                f"ddim_steps is {s.ddim_steps} of {d.steps}, spacing {s.spacing}: sampling would start from noise at t = "
                f"{indices[0]}, where alpha_bar is {signal:.2f}; expected at most {MOST_SIGNAL:g}, as with spacing=trailing"
            )
