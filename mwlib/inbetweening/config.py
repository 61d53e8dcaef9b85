"""Settings of in-betweening, and named sets of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from mwlib.data.collections import NAMED_SOURCES
from mwlib.data.sources import SourceConfig
from mwlib.diffusion.config import DiffusionConfig, KeyframeConfig
from mwlib.diffusion.process import check_indices
from mwlib.inbetweening.losses import Diversity, Smoothness
from mwlib.networks.layers import check_width
from mwlib.settings import Advanced, BelowOne, Count, Natural, NotNegative, Positive, Settings
from mwlib.training.config import TrainingConfig

# Own choice, by measurement: the network sees the keyframes, and says how a motion departs from interpolation.
_CONDITIONED: dict[str, Any] = dict(
    condition_on_keyframes=True, target="departure", tokens="sines", output="wiener", prediction="y0", level_weight="snr",
    scheme="none", lr=1e-3, lr_schedule="cosine", warmup=100, spacing="trailing", ddim_steps=20, bones="keyframes",
)  # fmt: skip
_LAPTOP: dict[str, Any] = _CONDITIONED | dict(
    rows=16, width=128, layers=4, heads=4, feedforward=256, dropout=0.1,
    train_steps=4000, ema=0.998, ema_start=500, checkpoint_every=500,
)  # fmt: skip

PRESETS: dict[str, dict[str, Any]] = {
    # FreqDiffusionBridge as far as its text tells: an unconditional model says the noise, 100 of 1,000 steps, keyframes replaced.
    # Own choice, for the text that we have lost them: HumanMAC's network and optimiser, and weights of the losses.
    "as_published": dict(
        data="lafan1", fps=30.0, lr=3e-4, lr_schedule="constant", train_steps=100_000, ema_start=2000,
        diversity_weight=0.01, smoothness_weight=0.1, length_weight=20.0, angle_weight=5.0,
        validation_subjects=("3",), test_subjects=("2", "5"),
    ),
    # Half a minute on two cores; synthetic people.
    "tiny": _CONDITIONED | dict(
        data="synthetic", fps=25.0, between=22, test_stride=12, test_windows=48, validation_subjects=("P6",),
        test_subjects=("P7", "P8"), width=64, layers=4, heads=4, feedforward=128, dropout=0.0, steps=200, train_steps=400,
        batch=32, lr=2e-3, warmup=50, ema=0.99, ema_start=100, checkpoint_every=200, ddim_steps=10,
    ),
    # A quarter of an hour on two cores; synthetic people.
    "laptop": _LAPTOP | dict(
        data="synthetic", fps=30.0, validation_subjects=("P6",), test_subjects=("P7", "P8"),
    ),
    # The CMU clips on 17 joints, found under MWLIB_DATA; whole people are held out. Any length up to 3 s; a frame beyond each
    # keyframe tells its velocity, where there is one. The temperature was chosen on the validation person, by jerk and speed.
    "cmu": _LAPTOP | dict(
        data="cmu/asfamc", fps=30.0, past=2, future=2, between=90, shortest=5, coast=24.0, hide=0.3, departure_scale="window",
        mean_width=256, other_speeds=0.2, rows=32, level_weight="unit", width=64, feedforward=128, train_steps=8000,
        ema_start=200, checkpoint_every=250, temperature=0.5, test_windows=40,
        validation_subjects=("1",), test_subjects=("2", "7", "29"),
    ),
    # Ten files of LaFAN1 as they lie under MWLIB_DATA: rotations of its 22 joints. Trained for minutes the model is too free;
    # the temperature was chosen on the validation person, by speed and jerk.
    "lafan1": _LAPTOP | dict(
        data="lafan1", fps=30.0, state="rotations", temperature=0.5, validation_subjects=("3",), test_subjects=("2", "5"),
    ),
    # The protocol of `mwlib lafan1-benchmark`: ten frames before, one after, up to 45 between; persons 1 to 4 train, 5 tests.
    "lafan1_official": _LAPTOP | dict(
        data="lafan1", fps=30.0, state="rotations", temperature=0.5, past=10, between=45, shortest=5, coast=8.0,
        departure_scale="window", mean_width=256, other_speeds=0.2, level_weight="unit", width=64, feedforward=128,
        train_subjects=("1", "2", "3", "4"), test_subjects=("5",),
    ),
    # 81 files of Bandai-Namco under MWLIB_DATA: rotations of 22 joints. They name no people; whole styles are held out.
    "bandai": _LAPTOP | dict(
        data="bandai_namco", fps=30.0, state="rotations", temperature=0.5, test_stride=10,
        validation_subjects=("angry",), test_subjects=("old", "youthful"),
    ),
    # Human3.6M's people by convention; the paper names no split, rate or window.
    "h36m": _LAPTOP | dict(
        data=NAMED_SOURCES["h36m"][0], fps=25.0, train_subjects=("S1", "S5", "S6", "S7", "S8"), test_subjects=("S9", "S11"),
    ),
    "humaneva": _LAPTOP | dict(
        data=NAMED_SOURCES["humaneva"][0], fps=30.0, train_subjects=("Train/S1", "Train/S2", "Train/S3"),
        test_subjects=("Validate/S1", "Validate/S2", "Validate/S3"),
    ),
}  # fmt: skip
PRESETS |= {"laptop_paper": PRESETS["laptop"], "cmu_paper": PRESETS["cmu"]}  # one name builds the figures of all systems


Method = Literal["diffusion", "zero_velocity", "interpolation", "hermite", "minimum_jerk", "gaussian", "truth"]


@dataclass(frozen=True)
class TaskConfig:
    """The task: frames that are given, and frames that are asked for."""

    past: Count = 1  # frames given before those between; the last of them is the first keyframe
    future: Count = 1  # frames given after those between; the first of them is the last keyframe
    between: Count = 30  # N, frames between the two keyframes
    shortest: Natural = 0  # any N from here to `between`, which the network then sees; 0 = always `between`
    state: Literal["positions", "rotations"] = "positions"  # of the body: places of joints, or root and six numbers per rotation
    mirror: bool = True  # also train on mirror images, where left and right are built alike
    other_speeds: BelowOne = 0.0  # also train on the clips played faster and slower, by up to this share
    more_data: tuple[str, ...] = ()  # sources whose people are trained on besides, but for those who are held out
    test_stride: Count = 40  # frames between the starts of the test windows
    test_windows: Natural = 0  # evaluate this many windows, spread evenly; 0 = all

    @property
    def frames(self) -> int:
        """T = past + N + future, of a window."""
        return self.gap + self.steps

    @property
    def gap(self) -> int:
        """N + 2, frames from the first to the last keyframe."""
        return self.between + 2

    @property
    def fewest(self) -> int:
        """The smallest T that the model is for."""
        return self.smallest_gap + self.steps

    @property
    def smallest_gap(self) -> int:
        """As `gap`, of the smallest T."""
        return (self.shortest or self.between) + 2

    @property
    def steps(self) -> int:
        """Steps from frame to frame that are given beyond the keyframes."""
        return self.past + self.future - 2


@dataclass(frozen=True)
class ModelConfig:
    """Tokens, and the network that denoises them."""

    tokens: Literal["cosines", "sines", "frames"] = "cosines"  # DCT, DST of what vanishes at both ends, or frames ("without DCT")
    rows: Natural = 0  # cosines or sines kept, where there are so many; 0 = all
    target: Literal["motion", "departure"] = "motion"  # what is diffused: the motion, or how it departs from interpolation
    # Of departures: that of the longest windows, of each length, or what a second network says of each window
    departure_scale: Literal["longest", "each", "window"] = "longest"
    condition_on_keyframes: bool = False  # whether the network sees the keyframes, or the sampler alone
    output: Literal["direct", "wiener"] = "direct"  # what `prediction` says; or what the best linear denoiser misses
    more_keyframes: Advanced[Natural] = 0  # with condition_on_keyframes: train on up to so many more, anywhere between
    coast: NotNegative = 0.0  # frames in which the interpolation forgets the velocity at an end; 0: it is a straight line
    hide: BelowOne = 0.0  # share of training windows that do not show what is beyond an end; then a model can do without
    mean_width: Natural = 0  # of a network that says the mean departure of each window; 0: there is none, and that mean is 0
    width: Count = 512  # of the network
    layers: Count = 8  # blocks, an even number
    heads: Count = 8  # of the attention
    feedforward: Count = 1024  # hidden width of the feed-forward layers
    dropout: BelowOne = 0.2  # in feed-forward and style layers
    attention_dropout: Advanced[BelowOne] = 0.0  # on attention weights; on the CPU anything but 0 is slow


@dataclass(frozen=True)
class ObjectiveConfig:
    """Weights of the losses; those on bodies are multiplied by alpha_bar for each window."""

    level_weight: Literal["uniform", "snr", "unit"] = "uniform"  # "snr": signal over noise, bounded; "unit": Wiener's share
    diversity_weight: NotNegative = 0.0  # lambda_d
    diversity: Diversity = "distance"  # how alike samples are, see diversity_loss
    diversity_scale: Advanced[Positive] = 10.0  # metres², of "exponential"
    draws: Count = 2  # M, noise draws of each window that are compared
    smoothness_weight: NotNegative = 0.0  # lambda_s
    smoothness: Advanced[Smoothness] = "step"  # see smoothness_loss
    length_weight: NotNegative = 0.0  # lambda_l, of bone lengths
    angle_weight: NotNegative = 0.0  # lambda_a, of angles between bones
    contact_weight: NotNegative = 0.0  # of the speed of feet where the truth's stand, see contact_loss


@dataclass(frozen=True)
class SamplingConfig:
    """The reverse process and how much of it to run."""

    method: Method = "diffusion"  # or a baseline; "truth" is what is to be found, for its speed and jerk
    samples: Count = 10  # K, motions for each pair of poses
    ddim_steps: Count = 100  # denoising steps
    temperature: Positive = 1.0  # deviation of the noise that sampling starts from
    spacing: Literal["leading", "trailing"] = "leading"  # of the retained diffusion indices, see ddim_indices
    bones: Literal["free", "keyframes"] = "free"  # of places: lengths as they come, or between those of the keyframes
    sampling_seed: Natural = 0  # of the noise


@dataclass(frozen=True)
class Config(Settings):
    """Everything that a run of in-betweening depends on.

    >>> cfg = Config.preset("tiny", between=20)
    >>> cfg.task.frames, cfg.model.condition_on_keyframes
    (22, True)

    Raises:
        ValueError: see `Settings`, and settings that do not fit each other.
    """

    system: ClassVar[str] = "inbetweening"
    presets = PRESETS
    renamed = {"keyframes": "condition_on_keyframes", "sizes": "departure_scale"}
    newer = {
        "past": 1, "future": 1, "coast": 0.0, "hide": 0.0, "departure_scale": "longest", "other_speeds": 0.0, "mean_width": 0,
        "more_data": (),
    }  # fmt: skip
    people = "train_subjects", "validation_subjects", "test_subjects"
    after_training: ClassVar[frozenset[str]] = frozenset(
        {"sampling", "imposing", "test_stride", "test_windows", "checkpoint_every"}
    )

    data: SourceConfig = field(default_factory=SourceConfig)
    task: TaskConfig = field(default_factory=TaskConfig)
    model: ModelConfig = field(default_factory=ModelConfig)
    diffusion: DiffusionConfig = field(default_factory=DiffusionConfig)
    objective: ObjectiveConfig = field(default_factory=ObjectiveConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    imposing: KeyframeConfig = field(default_factory=KeyframeConfig)

    def check(self) -> None:
        """Refuse values that do not fit each other."""
        m, task, s = self.model, self.task, self.sampling
        check_width(m.width, m.heads)
        most = task.gap - 2 * (m.tokens == "sines")
        unseen = "but condition_on_keyframes is false; expected condition_on_keyframes=true"
        rules = (
            (m.layers % 2, f"layers is {m.layers}; expected an even number (long skips pair the blocks)"),
            (m.rows > most, f"rows is {m.rows}; expected at most {most}, as many {m.tokens} as there are"),
            (m.tokens == "sines" and m.target != "departure",
             f"tokens are sines, but target is {m.target}; expected departure: it vanishes at both ends"),
            (m.rows and m.tokens == "frames",
             f"rows is {m.rows} with frames as tokens; expected 0: only cosines or sines can be left out"),
            (task.between < 2, f"between is {task.between}; expected at least 2: seams and jerk are those of four frames"),
            (task.shortest > task.between, f"shortest is {task.shortest}; expected at most between ({task.between})"),
            (m.output == "wiener" and self.diffusion.prediction != "y0",
             f"output is wiener with prediction {self.diffusion.prediction}; expected prediction=y0"),
            (self.objective.level_weight == "unit" and m.output == "direct",
             "level_weight is unit, but output is direct; expected output=wiener, which has a unit"),
            (m.departure_scale == "each" and m.target != "departure",
             f"departure_scale is each, but target is {m.target}; expected departure, whose scale it is"),
            (m.coast and task.past < 2,
             f"coast is {m.coast:g} with past {task.past}; expected a past of 2 or more, which has a velocity"),
            (m.hide and not task.steps, f"hide is {m.hide:g}, but past and future are 1; expected 2 or more of one"),
            (m.departure_scale == "window" and (m.tokens, m.output) != ("sines", "wiener"),
             f"departure_scale is window with {m.tokens} and output {m.output}; expected sines and wiener, whose unit it says"),
            (m.departure_scale == "window" and (m.more_keyframes or self.imposing.scheme != "none"),
             "departure_scale is window; expected scheme=none and no more_keyframes: it looks at both ends alone"),
            (m.mean_width and m.departure_scale != "window",
             f"mean_width is {m.mean_width} with departure_scale {m.departure_scale}; expected window, whose mean it says"),
            (s.ddim_steps >= self.diffusion.steps,
             f"ddim_steps is {s.ddim_steps}; expected fewer than steps ({self.diffusion.steps})"),
            *((bool(value) and not m.condition_on_keyframes, f"{what}, {unseen}") for value, what in (
                (m.more_keyframes, f"more_keyframes is {m.more_keyframes}"),
                (m.target == "departure", "target is departure"),
                (task.shortest, f"shortest is {task.shortest}"),
                (task.past > 1, f"past is {task.past}"),
                (task.future > 1, f"future is {task.future}"),
            )),
        )  # fmt: skip
        for is_wrong, message in rules:
            if is_wrong:
                raise ValueError(message)
        check_indices("ddim_steps", self.diffusion.schedule, self.diffusion.steps, s.ddim_steps, s.spacing)
