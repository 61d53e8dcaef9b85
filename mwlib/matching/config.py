"""Settings of evaluators and critics: networks that put sentences and motions into one space."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from mwlib.data.captioned import CaptionsConfig
from mwlib.data.normalisation import Kind
from mwlib.networks.matching import UNIT
from mwlib.settings import Advanced, BelowOne, Count, Natural, NotNegative, Positive, Settings
from mwlib.training.config import TrainingConfig

Half = Literal["evaluator", "critic", "all"]
Loss = Literal["contrastive", "infonce"]


@dataclass(frozen=True)
class MatchingConfig:
    """Who is learnt from, and the networks. The widths of the published evaluators are 512, 512, 1024, 512 and 512."""

    half: Half = "evaluator"  # of the training clips: a critic of a loss must not be the judge, nor know its clips
    statistics: Kind = "evaluator"  # how features are scaled: "evaluator" lets root and contacts weigh 25 times as much
    code_width: Count = 128  # numbers of a movement's code
    word_width: Count = 64  # of a word's vector
    motion_width: Count = 128  # of the GRU that reads codes
    text_width: Count = 128  # of the GRU that reads words
    embedding: Count = 64  # numbers of an embedding; FID needs many times as many motions
    words: Count = 20  # of a sentence that are read
    dropout: BelowOne = 0.2  # in the movement encoder, while it learns


@dataclass(frozen=True)
class MatchingLossConfig:
    """What is trained: first codes of movements, then the match of sentences and motions."""

    loss: Loss = "contrastive"  # as published; or own choice: all others of the batch as negatives: parts fine captions better
    margin: Positive = 10.0  # of "contrastive": negatives farther than this do not count
    temperature: Positive = 1.0  # of "infonce": squared distances are divided by it
    word_dropout: BelowOne = 0.05  # words replaced by the unknown one, which else would never learn
    movement_steps: Count = 1500  # batches of movement_batch windows for the codes
    movement_batch: Count = 128  # windows
    movement_frames: Count = 24  # of each, a multiple of 4
    movement_lr: Positive = 1e-3  # first learning rate; it falls to zero along a cosine
    sparsity: Advanced[NotNegative] = 0.001  # weight of the codes' mean size
    smoothness: Advanced[NotNegative] = 0.001  # weight of the mean step from code to code


@dataclass(frozen=True)
class JudgingConfig:
    """How an evaluator is itself evaluated, on real pairs."""

    pool: Count = 32  # items that R-precision tells apart
    repeats: Count = 20  # orders and captions drawn
    sampling_seed: Natural = 0  # of those


_SMALL: dict[str, Any] = dict(
    lr=1e-3, lr_schedule="cosine", warmup=50, ema=0.99, ema_start=100, clip_gradient=1.0, loss="infonce",
    movement_batch=32,
)  # fmt: skip
PRESETS: dict[str, dict[str, Any]] = {
    # Half a minute on one core; synthetic people.
    "tiny": _SMALL | dict(
        clips=600, code_width=64, word_width=32, motion_width=64, text_width=64, embedding=32,
        movement_steps=200, train_steps=300, batch=32, lr=2e-3, checkpoint_every=100,
    ),
    # Three minutes on one core; synthetic people.
    "laptop": _SMALL | dict(movement_steps=800, train_steps=800, checkpoint_every=200),
    # As published, for a folder of HumanML3D under MWLIB_DATA; for a GPU.
    "humanml3d": dict(
        data="HumanML3D", code_width=512, word_width=300, motion_width=1024, text_width=512, embedding=512, half="all",
        movement_steps=50_000, movement_lr=1e-4, train_steps=200_000, batch=32, lr=1e-4, lr_schedule="constant",
        weight_decay=0.0, clip_gradient=0.5, ema=0.0, ema_start=0, word_dropout=0.0,
    ),
}  # fmt: skip
# A hundred clips: too few to halve, and for more than the sizes of tiny. It tells captions of people never seen from each other
# hardly better than guessing does.
PRESETS |= {"cmu": PRESETS["tiny"] | dict(data="cmu", half="all", train_steps=400, pool=16)}
# One name builds the figures of all systems.
PRESETS |= {"laptop_paper": PRESETS["laptop"], "cmu_paper": PRESETS["cmu"]}
_PUBLISHED = PRESETS["humanml3d"]
PRESETS |= {"mdm": _PUBLISHED, "stablemofusion": _PUBLISHED, "h36m": _PUBLISHED, "humaneva": _PUBLISHED}


@dataclass(frozen=True)
class Config(Settings):
    """Everything that an evaluator depends on.

    A critic, which a generator's loss may ask, is the same with another seed and the other half of the clips:

    >>> cfg = Config.preset("tiny", half="critic", seed=1)
    >>> cfg.model.embedding, cfg.objective.loss
    (32, 'infonce')

    Raises:
        ValueError: see `Settings`; or windows of movements that are no multiple of 4 frames, or batches of one.
    """

    system: ClassVar[str] = "matching"
    presets = PRESETS
    after_training: ClassVar[frozenset[str]] = frozenset({"judging", "checkpoint_every"})

    data: CaptionsConfig = field(default_factory=CaptionsConfig)
    model: MatchingConfig = field(default_factory=MatchingConfig)
    objective: MatchingLossConfig = field(default_factory=MatchingLossConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    judging: JudgingConfig = field(default_factory=JudgingConfig)

    def check(self) -> None:
        """Refuse values that do not fit each other."""
        if self.objective.movement_frames % UNIT:
            raise ValueError(f"movement_frames is {self.objective.movement_frames}; expected a multiple of {UNIT}")
        if self.training.batch < 2:
            raise ValueError(f"batch is {self.training.batch}; expected at least 2: the negatives are the others")
