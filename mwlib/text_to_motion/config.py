"""Settings of text to motion, and their presets."""

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

from annotated_types import Ge

from mwlib.data.captioned import CaptionsConfig
from mwlib.diffusion.config import Steps
from mwlib.diffusion.process import check_indices
from mwlib.networks.layers import check_width
from mwlib.networks.matching import UNIT
from mwlib.networks.unet1d import check_channels
from mwlib.settings import Advanced, BelowOne, Count, Natural, NotNegative, Settings, Share
from mwlib.text_to_motion.losses import Band, Norm, Semantic, Stage
from mwlib.training.config import TrainingConfig

CLIP = "clip-vit-base-patch32"  # folder, here or under MWLIB_DATA
# Both as published: CLIP, padding that the network sees, and the collection's own Mean.npy and Std.npy.
_PUBLISHED: dict[str, Any] = dict(
    data="HumanML3D", text="clip", clip_folder=CLIP, mask_frames=False, statistics="files",
)  # fmt: skip
_MDM: dict[str, Any] = _PUBLISHED | dict(
    lr=1e-4, lr_schedule="constant", weight_decay=0.0, train_steps=600_000, ema=0.0, ema_start=0,
)  # fmt: skip
_STABLEMOFUSION: dict[str, Any] = _PUBLISHED | dict(
    network="unet", schedule="linear", steps=1000, normalisation="stablemofusion", sampler="sde_dpm", sampling_steps=10,
    lr=2e-4, weight_decay=0.01, lr_schedule="multistep", lr_gamma=0.9, lr_milestones=tuple(range(5000, 50_000, 5000)),
    train_steps=50_000, ema=0.999787, ema_start=0, clip_gradient=1.0,
)  # fmt: skip
# Own choice, for two cores: four frames make a token, the learning rate falls along a cosine, and root and contacts weigh more,
# as in StableMoFusion: of 263 numbers four say where a body goes. So weighed, they show through a hundred times their power of
# noise: under the cosine schedule steps and ways are settled within five of 50 levels, under the linear one within twenty.
_TEACHING: dict[str, Any] = dict(
    longest=120, normalisation="stablemofusion", schedule="linear", width=192, layers=4, feedforward=512, text_width=128,
    text_layers=1, dropout=0.0, attention_dropout=0.0, frames_per_token=4, lr=1e-3, lr_schedule="cosine", warmup=100,
    ema_start=200,
)  # fmt: skip

PRESETS: dict[str, dict[str, Any]] = {
    # A minute on two cores; synthetic people.
    "tiny": _TEACHING | dict(
        clips=600, width=64, layers=2, feedforward=256, text_width=64, train_steps=400, batch=32, lr=2e-3, ema=0.99, ema_start=50,
        checkpoint_every=200, test_clips=96, repeated=8, repeats=4, pool=16,
    ),
    # Half an hour on one core; synthetic people.
    "laptop": _TEACHING | dict(train_steps=8000, checkpoint_every=500),
    # The CMU clips at hand with their captions: far too few for more than a demonstration.
    "cmu": _TEACHING | dict(
        data="cmu", longest=196, dropout=0.1, train_steps=4000, checkpoint_every=500, pool=16,
        evaluator="cmu_evaluator", critic="cmu_critic",
    ),
    # MDM as first published, of 50 noising steps, for a folder of HumanML3D or KIT-ML and a GPU. It reads sentences by CLIP from
    # clip_folder (--set text=words does without), lets frames see the padding, scales by Mean.npy and Std.npy, averages no
    # weights. Its later code hides the padding and averages (--set mask_frames=true --set ema=0.9999). Own choice: batches of
    # like lengths, and the last weights where the authors took those of the best FID.
    "mdm": _MDM,
    # StableMoFusion as published, in the same sense. It averages the weights every 32 steps with a decay of 0.9932; here they
    # are averaged at every step, with its 32nd root. Own choice: batches of like lengths, and sampling in float32.
    "stablemofusion": _STABLEMOFUSION,
}  # fmt: skip
# One name builds the figures of all systems; where the others have big data, so has this one.
PRESETS |= {"laptop_paper": PRESETS["laptop"], "cmu_paper": PRESETS["cmu"], "h36m": PRESETS["mdm"], "humaneva": PRESETS["mdm"]}


RANKS = 3  # of R-precision, top 1 to 3

Method = Literal["diffusion", "truth", "other_captions", "any_clip", "nearest_caption", "mean_pose"]


@dataclass(frozen=True)
class ModelConfig:
    """The denoiser, and what reads the sentences."""

    network: Literal["mdm", "unet"] = "mdm"  # MDM's encoder, or StableMoFusion's conditional U-Net
    width: Count = 512  # of MDM; of the U-Net the base width, of which `multipliers` are multiples
    layers: Count = 8  # of MDM
    heads: Count = 4  # of MDM
    feedforward: Count = 1024  # of MDM
    dropout: BelowOne = 0.1  # of both networks
    attention_dropout: BelowOne = 0.1  # of MDM, on attention weights; on the CPU anything but 0 is slow
    frames_per_token: Count = 1  # of MDM; more is quicker
    detail: Natural = 0  # of MDM: channels of what corrects single frames afterwards; 0 = none
    mask_frames: bool = True  # of both: hide padding from valid frames; as first published they see it, noise and all
    multipliers: Advanced[tuple[Count, ...]] = (2, 2, 2, 2)  # of the U-Net, one for each level
    text: Literal["words", "ngrams", "clip"] = "words"  # a small transformer, hashed parts of words, or CLIP from a file
    text_width: Count = 512  # of "words" and "ngrams"
    text_layers: Natural = 2  # of "words" and "ngrams"
    start: str = ""  # weights to begin with, of a run of the same sizes: a name that comes with the package, or a folder
    clip_folder: str = ""  # of CLIP ViT-B/32, read for "clip" only, here or under MWLIB_DATA: see `mwlib.networks.text`


@dataclass(frozen=True)
class ForwardConfig:
    """The forward process; the network says the clean motion."""

    schedule: Literal["linear", "cosine", "sigmoid", "sqrt"] = "cosine"  # of the noise, see `alpha_bar`
    steps: Steps = 50  # M, noising steps
    normalisation: Literal["mdm", "stablemofusion"] = "mdm"  # of the features, see `mwlib.data.normalisation`
    statistics: Literal["clips", "files"] = "clips"  # of the features: of the training clips, or Mean.npy and Std.npy of the data


@dataclass(frozen=True)
class ObjectiveConfig:
    """The losses and their weights: lambda_1 L_simple + lambda_2 L_LF + lambda_3 L_S."""

    simple_weight: Advanced[NotNegative] = 1.0  # lambda_1
    level_weight: Literal["uniform", "root_snr"] = "uniform"  # of all losses by noise level; see LEAST_SNR
    low_weight: NotNegative = 0.0  # lambda_2, of the low-frequency loss
    semantic_weight: NotNegative = 0.0  # lambda_3, of the semantic loss
    lf_norm: Norm = "l1"  # of the low-frequency loss, see low_frequency_loss
    lf_band: Band = "low"  # or what lies above, as in the paper's Table 6
    lf_k: Count = 10  # cosines that it keeps
    lf_hz: Advanced[NotNegative] = 0.0  # or all below this frequency; 0 = lf_k says
    stage: Stage = "prose"  # at which noise each loss counts, see stage_weights
    semantic: Semantic = "cos_gt"  # see semantic_loss
    s_th: Advanced[Share] = 0.5  # S_th of "reward" and "hinge"
    critic: str = "critic"  # of the semantic loss: comes with the package, or the folder of a run or of the published evaluator
    drop_text: Advanced[BelowOne] = 0.1  # share of samples that are trained without their sentence, for guidance


@dataclass(frozen=True)
class SamplingConfig:
    """The reverse process, how much of it to run, and who judges the result."""

    method: Method = "diffusion"  # or a baseline; see `make_motions`
    sampler: Literal["ddpm", "ddim", "sde_dpm"] = "ddpm"  # ancestral, deterministic, or SDE-DPM-Solver++ with Karras' levels
    sampling_steps: Natural = 0  # denoising steps; 0 = all
    guidance: NotNegative = 2.5  # s of classifier-free guidance; 1 = none
    guidance_above: Share = 0.0  # no guidance at noise levels below this share of them (Kynkäänniemi et al. 2024)
    evaluator: str = "evaluator"  # of the metrics: comes with the package, or the folder of a run or of the published evaluator
    test_clips: Natural = 0  # evaluate so many, spread evenly; 0 = all
    pool: Count = 32  # of R-precision
    replicates: Advanced[Count] = 1  # how often all is drawn again; confidence intervals need several
    repeated: Count = 20  # sentences for multimodality
    repeats: Annotated[int, Ge(2)] = 10  # motions of each of them
    sampling_seed: Natural = 0  # of noise, captions and pools


@dataclass(frozen=True)
class Config(Settings):
    """Everything that a run of text-to-motion depends on.

    >>> cfg = Config.preset("tiny", low_weight=1.0)
    >>> cfg.objective.lf_norm, cfg.forward.steps
    ('l1', 50)

    Raises:
        ValueError: see `Settings`, and settings that do not fit each other.
    """

    system: ClassVar[str] = "text_to_motion"
    presets = PRESETS
    after_training: ClassVar[frozenset[str]] = frozenset({"sampling", "checkpoint_every"})
    newer = {"statistics": "clips", "guidance_above": 0.0, "detail": 0, "level_weight": "uniform"}

    data: CaptionsConfig = field(default_factory=CaptionsConfig)
    model: ModelConfig = field(default_factory=ModelConfig)
    forward: ForwardConfig = field(default_factory=ForwardConfig)
    objective: ObjectiveConfig = field(default_factory=ObjectiveConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Self:
        """A named preset with some fields changed; "synthetic", the embedded data of all systems, here are the "people"."""
        return super().preset(name, **changes | ({"data": "people"} if changes.get("data") == "synthetic" else {}))

    @property
    def padded(self) -> int:
        """Frames to which batches are filled up: MDM does not see padding, convolutions do, so that theirs is always the same."""
        return 0 if self.model.network == "mdm" and self.model.mask_frames else self.data.longest

    def check(self) -> None:
        """Refuse values that do not fit each other."""
        m, s, steps, data = self.model, self.sampling, self.forward.steps, self.data
        rules = (
            (m.text == "clip" and not m.clip_folder, "text is clip, clip_folder empty; expected the folder of CLIP ViT-B/32"),
            (self.forward.statistics == "files" and data.data in ("people", "cmu"),
             f"statistics is files, data {data.data}; expected a folder with Mean.npy and Std.npy, or clips"),
            (s.sampling_steps > steps, f"sampling_steps is {s.sampling_steps}; expected at most steps ({steps})"),
            (s.pool < RANKS or 0 < s.test_clips < RANKS,
             f"pool is {s.pool} and test_clips {s.test_clips}; expected at least {RANKS}, or test_clips=0 for all"),
            (data.shortest < UNIT, f"shortest is {data.shortest}; expected at least {UNIT} frames"),
            (data.longest < data.shortest, f"longest is {data.longest}; expected at least shortest ({data.shortest})"),
        )  # fmt: skip
        for is_wrong, message in rules:
            if is_wrong:
                raise ValueError(message)
        if m.text != "clip":
            check_width(m.text_width, m.heads, "text_width")
        if m.network == "unet":
            check_channels(m.width, m.multipliers)
        else:
            check_width(m.width, m.heads)
        check_indices("sampling_steps", self.forward.schedule, steps, s.sampling_steps or steps, "trailing", 0)
