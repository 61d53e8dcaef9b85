"""Settings and presets of MotionWavelet: every option of the method, its training and its sampling."""

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

import pywt

from mwlib.data.collections import NAMED_SOURCES
from mwlib.data.sources import SourceConfig
from mwlib.diffusion.config import DiffusionConfig
from mwlib.diffusion.process import check_indices
from mwlib.networks.layers import Precision
from mwlib.networks.translinear import check_sizes
from mwlib.settings import Advanced, BelowOne, Count, Natural, NotNegative, OneOf, Positive, Settings, Share
from mwlib.training.config import TrainingConfig

# Own choice, stable when trained for minutes: predict clean coefficients, scaled to unit deviation, with the loss
# weighed back to metres. The paper's noise prediction on raw coefficients needs hundreds of thousands of steps. Guidance is
# off: models trained so briefly gain a centimetre or two from it, at two to three times the time of sampling (the grid `main`).
_STABLE: dict[str, Any] = dict(
    prediction="y0", coefficient_scale="coefficient", loss_weight="metric",
    lr=5e-4, lr_schedule="cosine", warmup=100, attention_dropout=0.0,
    spacing="trailing", tabg_sigma=1.0, tabg_space="y0_hat", guidance_weight=0.0, wmsg="off",
    validation_subjects=("P6",), test_subjects=("P7", "P8"),
)  # fmt: skip
_LAPTOP: dict[str, Any] = _STABLE | dict(
    width=128, layers=4, heads=4, feedforward=256, dropout=0.1, representation="displacement",
    train_steps=4000, ema=0.998, ema_start=500, checkpoint_every=500, ddim_steps=20,
)  # fmt: skip

# What measurements on people held out chose instead (results/prediction.md). Few tokens make a step
# cheap, and a wide network affordable; the body's heading and all that training windows vary in make ten minutes of motion go
# further; a little more noise to start from makes up for the speed that few denoising steps lose.
_CHOSEN: dict[str, Any] = _LAPTOP | dict(
    transform="time_wavelet", wavelet="bior6.8", level=3, omit=1, coefficient_scale="none", loss_weight="uniform",
    level_weight="snr", heading="body", other_speeds=0.6, other_bones=0.08, backwards=0.3, slowed=0.15, other_arms=0.3,
    blank_condition=0.2, width=256, heads=8, feedforward=512, train_steps=7000, bones="observed", temperature=1.1,
    decoding="continued",
)  # fmt: skip
_CMU_PEOPLE: dict[str, Any] = dict(validation_subjects=("1",), test_subjects=("2", "7", "29"))


def _source(name: str) -> dict[str, Any]:
    """Data and frame rate of a preset, as load_motions knows it."""
    return dict(zip(("data", "fps"), NAMED_SOURCES[name], strict=True))


PRESETS: dict[str, dict[str, Any]] = {
    # The paper's coefficients, which the chapters explain. Half a minute on two cores: fewer frames, joints' rates and steps;
    # synthetic people.
    "tiny": _STABLE | _source("tiny") | dict(
        history=10, future=30, test_stride=10, width=64, layers=4, heads=4, feedforward=128, dropout=0.0,
        steps=200, train_steps=1000, batch=32, lr=1.5e-3, warmup=50, ema=0.99, ema_start=100, checkpoint_every=200,
        samples=20, ddim_steps=10, test_windows=48,
    ),
    # The paper's windows, and what measurements chose: a quarter to half an hour on two cores; synthetic people.
    "laptop": _CHOSEN | _source("laptop"),
    # The same on the CMU clips in ASF/AMC, found under MWLIB_DATA; whole people are held out.
    "cmu": _CHOSEN | _source("cmu") | _CMU_PEOPLE,
    # The same two at about the same cost, with the paper's coefficients.
    "laptop_paper": _LAPTOP | _source("laptop"),
    "cmu_paper": _LAPTOP | _source("cmu") | _CMU_PEOPLE,
    # MotionWavelet, Appendix A.
    "h36m": _source("h36m") | dict(
        augment="humanmac", window_sampling="subject_action",
        train_subjects=("S1", "S5", "S6", "S7", "S8"), test_subjects=("S9", "S11"),
    ),
    "humaneva": _source("humaneva") | dict(
        history=15, future=60, test_stride=15, augment="humanmac",
        window_sampling="subject_action", layers=6, feedforward=1024, lr_schedule="cosine_restarts", lr_gamma=0.9,
        train_subjects=("Train/S1", "Train/S2", "Train/S3"),
        test_subjects=("Validate/S1", "Validate/S2", "Validate/S3"),
        tabg_scale=0.0, wmsg="off",
    ),
}  # fmt: skip

Method = Literal["diffusion", "zero_velocity", "constant_velocity", "nearest_history", "nearest_displacement", "truth"]


@dataclass(frozen=True)
class WindowConfig:
    """How motions are cut into windows, and which of them are drawn."""

    history: Count = 25  # H, observed frames
    future: Count = 100  # F, predicted frames
    train_stride: Advanced[Count] = 5  # frames between the starts of the training windows that baselines know
    test_stride: Count = 25  # frames between the starts of the test windows
    test_windows: Natural = 0  # evaluate this many windows, spread evenly; 0 = all
    window_sampling: Literal["uniform", "subject_action"] = "uniform"  # every window alike, or as DLow and HumanMAC draw
    augment: Literal["none", "humanmac", "heading", "heading_mirror"] = "heading_mirror"  # see TrainingWindows
    other_speeds: BelowOne = 0.0  # also train on the clips played faster and slower, by up to this share
    other_bones: BelowOne = 0.0  # deviation of a random factor of each bone's length, and of one of the whole body's
    backwards: Share = 0.0  # of the training windows: played backwards
    slowed: Share = 0.0  # of the training windows: played at a random share of their speed
    other_arms: Share = 0.0  # of the training windows: with another window's arms
    more_data: tuple[str, ...] = ()  # sources whose people are trained on besides, but for those who are held out

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
    condition_scale: Advanced[Literal["as_motion", "coefficient"]] = "as_motion"  # of the history's coefficients; or one by one
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

    drop_condition: Advanced[BelowOne] = 0.2  # how often the condition is left out, for classifier-free guidance
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
    temperature_spread: NotNegative = 0.0  # deviation of its logarithm among the samples of a window: calm ones and lively ones
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
    tabg_steps: Advanced[Share] = 0.9  # share of the denoising steps, counted from the first, in which TABG acts
    wmsg: Literal["off", "every_step", "y0_hat"] = "every_step"  # manifold shaping of y_t after each step, or of clean estimates
    bound: NotNegative = 0.0  # metres: clamp the clean estimate in motion space; 0 = off
    complete_history: bool = False  # HumanMAC's mask completion
    decoding: Literal["inverse", "continued"] = "inverse"  # futures are cut from the inverse, or continue the history smoothly
    seam: NotNegative = 0.0  # seconds; of "continued": changes of velocity where the future begins that are shorter are damped
    bones: Literal["free", "observed"] = "free"  # lengths as they come, or as in the last observed pose
    sampling_seed: Natural = 0  # of the noise
    precision: Precision = "float32"  # of the network's products while sampling; "tf32", "bf16": faster on graphics cards
    noise_on: Advanced[Literal["cpu", "device"]] = "cpu"  # where noise is drawn: a seed means the same everywhere, or is faster


@dataclass(frozen=True)
class EvaluationConfig:
    """How predictions are scored."""

    mm_threshold: Advanced[Positive] = 0.5  # metres between last poses: closer windows share futures (DLow, on Human3.6M)
    mm_singletons: Advanced[Literal["keep", "skip_all", "skip_mm"]] = "keep"  # windows close to no other, see MetricTable


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
    renamed = {  # names before version 0.2, and today's
        "latent": "width", "target": "representation", "cfg_weight": "guidance_weight", "cfg_form": "guidance_form",
    }  # fmt: skip
    newer = {"decoding": "inverse", "temperature_spread": 0.0, "seam": 0.0, "more_data": (), "condition_scale": "as_motion"}
    people = "train_subjects", "validation_subjects", "test_subjects"
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

    def check(self) -> None:
        """Refuse values that do not fit each other."""
        m, s, d, frames = self.model, self.sampling, self.diffusion, self.windows.frames
        if s.ddim_steps >= d.steps:
            raise ValueError(f"ddim_steps is {s.ddim_steps}; expected fewer than steps ({d.steps})")
        check_indices("ddim_steps", d.schedule, d.steps, s.ddim_steps, s.spacing)
        check_sizes(m.width, m.heads, m.layers)
        rules = (
            (s.tabg_window % 2 == 0, f"tabg_window is {s.tabg_window}; expected an odd number"),
            (m.transform.endswith("phase") and s.wmsg == "every_step",
             "wmsg is 'every_step' with phase codes; expected 'off' or 'y0_hat': the autoencoder would take the noise away"),
            (m.transform == "time_wavelet" and m.omit >= m.level,
             f"omit is {m.omit} of level {m.level}; expected fewer than the levels"),
            ("wavelet" in m.transform and m.level >= frames.bit_length(),  # more are of the borders only, and fill any memory
             f"level is {m.level} of {frames} frames; expected at most {frames.bit_length() - 1}"),
            (m.transform == "dct" and m.dct_rows > frames,
             f"dct_rows is {m.dct_rows}; expected at most history + future ({frames})"),
        )  # fmt: skip
        for is_wrong, message in rules:
            if is_wrong:
                raise ValueError(message)
