"""The denoiser with its text encoder, and the trained model: sentences in, features of motions out."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from mwlib.data.formats.humanml import FeatureLayout
from mwlib.data.load import data_folder
from mwlib.data.normalisation import Statistics
from mwlib.diffusion import Denoise, Step, WindowNoise, alpha_bar, classifier_free, ddim, ddim_indices, posterior_mean, to_eps
from mwlib.diffusion.samplers import sde_dpm_solver
from mwlib.networks.layers import Dropped, Features, PerItem, Valid
from mwlib.networks.matching import UNIT
from mwlib.networks.mdm import MDM
from mwlib.networks.text import ClipText, EncodedText, HashedNgrams, TextEncoder, WordTransformer
from mwlib.networks.unet1d import ConditionalUNet
from mwlib.settings import several, shown, whole, wholes
from mwlib.text_to_motion.config import Config, ModelConfig
from mwlib.training import TrainedModel, chunks, identities, with_weights

WHERE_WORDS = "which `mwlib generate --words` lists"
FORGET = 0.02  # share of the words that training hides, so that unknown ones mean something: own choice


class TextDenoiser(nn.Module):
    """(y_t, t, sentences) -> the clean motion.

    Args:
        cfg: sizes and kinds.
        features: D.
        steps: M, of the diffusion.
        vocabulary: words that the text encoder "words" learns.
    """

    def __init__(self, cfg: ModelConfig, features: int, steps: int, vocabulary: Sequence[str]) -> None:
        super().__init__()
        self.text = make_text(cfg, vocabulary)
        width = self.text.width
        if cfg.network == "mdm":
            self.body: nn.Module = MDM(
                features, steps, cfg.width, cfg.layers, cfg.heads, cfg.feedforward, cfg.dropout, text_width=width,
                mask_frames=cfg.mask_frames, frames_per_token=cfg.frames_per_token,
                attention_dropout=cfg.attention_dropout, detail=cfg.detail,
            )  # fmt: skip
        else:
            self.body = ConditionalUNet(
                features, steps, cfg.width, cfg.multipliers, width, dropout=cfg.dropout, mask_frames=cfg.mask_frames
            )

    def forward(
        self, y_t: Features, t: PerItem, mask: Valid, text: EncodedText | Sequence[str], drop: Dropped | None = None
    ) -> Features:
        """The clean motion, normalised; samples with `drop` do not see their sentence."""
        encoded = text if isinstance(text, EncodedText) else self.text(text)
        return self.body(y_t, t, mask, encoded, drop)


def make_text(cfg: ModelConfig, vocabulary: Sequence[str]) -> TextEncoder:
    """The untrained text encoder that a configuration names; CLIP's weights come from their file.

    CLIP reads 20 tokens for MDM and 75 for the U-Net, which sees the padding, too: as published for each of them.

    Raises:
        FileNotFoundError, ImportError: as `ClipText`.
    """
    if cfg.text == "clip":
        places = Path(cfg.clip_folder), data_folder() / cfg.clip_folder
        folder = next((place for place in places if place.is_dir()), places[0])
        return ClipText(folder, longest=75, padded=True) if cfg.network == "unet" else ClipText(folder)
    if cfg.text == "ngrams":
        return HashedNgrams(width=cfg.text_width, layers=cfg.text_layers, heads=cfg.heads, dropout=cfg.dropout)
    return WordTransformer(vocabulary, cfg.text_width, FORGET, layers=cfg.text_layers, heads=cfg.heads, dropout=cfg.dropout)


def noisy(mask: Valid, cfg: ModelConfig) -> Bool[Tensor, "B T 1"]:
    """Features that take part in the diffusion: all where the network sees the padding, as in both published codes."""
    return (mask | (not cfg.mask_frames))[..., None]


CHUNK = 32  # motions sampled together on a processor


class TextToMotion(TrainedModel):
    """A network with what it was trained for, and settings of the sampling.

    Args:
        net: trained weights (the moving average).
        statistics: of the features that it was trained on.
        cfg: of the training; the group `sampling` says how it samples.
    """

    def __init__(self, net: TextDenoiser, statistics: Statistics, cfg: Config) -> None:
        super().__init__(net, cfg)
        self.statistics, self.alpha_bar = statistics, alpha_bar(cfg.forward.schedule, cfg.forward.steps)

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> "TextToMotion":
        """The model that a finished training left (see `mwlib.training.read_model`)."""
        statistics = Statistics.from_tensors(cfg.forward.normalisation, learnt)
        words = WordTransformer.vocabulary_in(weights, "text.") if cfg.model.text == "words" else ()
        net = with_weights(lambda: TextDenoiser(cfg.model, statistics.layout.width, cfg.forward.steps, words), weights)
        return cls(net, statistics, cfg)

    @property
    def layout(self) -> FeatureLayout:
        """What a row of features means."""
        return self.statistics.layout

    def check(self, texts: Sequence[str], frames: Sequence[int]) -> None:
        """Refuse sentences and lengths that the model was not made for."""
        texts, frames = several("texts", texts, "sentences"), wholes("frames", frames)
        if len(texts) != len(frames) or not texts:
            raise ValueError(f"{len(frames)} lengths for {len(texts)} sentences; expected one each, and at least one sentence")
        for i, text in enumerate(texts):
            if not isinstance(text, str) or not text.strip():
                raise ValueError(f"texts[{i}] is {shown(text)}; expected a sentence")
        shortest, longest = self.lengths
        if wrong := [n for n in frames if not shortest <= n <= longest]:
            raise ValueError(
                f"frames is {wrong[0]}; expected {shortest} to {longest} at {self.layout.fps:g} Hz, as the model was trained"
            )

    @property
    def lengths(self) -> tuple[int, int]:
        """The fewest and the most frames of a motion."""
        return self.cfg.data.shortest // UNIT * UNIT, self.cfg.data.longest

    def check_words(self, texts: Sequence[str]) -> list[str]:
        """Refuse sentences of which the model understands nothing.

        A model that makes something of any word, by CLIP or parts of words, only refuses a sentence without one.

        Returns:
            The words that the model does not know, each once.

        Raises:
            ValueError: a sentence has no word, or none that the model knows.
        """
        known, strange = {*self.net.text.vocabulary}, {}
        for i, text in enumerate(texts):
            words = self.net.text.read(text)
            if not words:
                raise ValueError(f"texts[{i}] is {shown(text)}, without a word; expected a sentence")
            unknown = [word for word in words if known and word not in known]
            if len(unknown) == len(words):
                raise ValueError(
                    f"texts[{i}] is {shown(text)}, of which the model knows no word; expected some of its {len(known)} words, "
                    f"{WHERE_WORDS}"
                )
            strange |= dict.fromkeys(unknown)
        return [*strange]

    @torch.inference_mode()
    def sample(
        self,
        texts: Sequence[str],
        frames: Sequence[int],
        seed: int | None = None,
        *,
        ids: Sequence[int] | None = None,
        progress: bool = False,
    ) -> list[Float[Tensor, "_ D"]]:
        """Features of one motion for each sentence, raw, on the CPU.

        Args:
            texts: sentences.
            frames: length of each motion at the layout's rate.
            seed: None = the settings'.
            ids: identity of each motion (default 0..N-1): its noise depends on seed and identity only.
            progress: show a bar.

        Raises:
            ValueError: a length does not fit the model, a sentence is empty, their numbers differ, the seed is no whole number,
                or the settings of the sampling make numbers overflow.
        """
        self.check(texts, frames)
        seed = self.sampling.sampling_seed if seed is None else seed
        ids = identities(ids, len(texts))
        order = sorted(range(len(texts)), key=lambda i: frames[i])  # like lengths together: less padding
        found: dict[int, Tensor] = {}
        for chunk in chunks(len(order), CHUNK, progress):
            part = order[chunk]
            asked = [texts[i] for i in part], [frames[i] for i in part]
            *_, last = self.steps(*asked, seed, [ids[i] for i in part])  # pyright: ignore[reportArgumentType]  (noise checks it)
            raw = self.finite(self.statistics.denormalise(last.y)).cpu()
            found |= {i: row[: frames[i]].clone() for i, row in zip(part, raw, strict=True)}
        return [found[i] for i in range(len(texts))]

    def steps(self, texts: Sequence[str], frames: Sequence[int], seed: int, ids: Sequence[int] | None = None) -> Iterator[Step]:
        """The denoising steps of one batch, normalised features; the last one's `y` is clean.

        What is padded with zeros stays zeros, unless the network sees the padding (`mask_frames`): that is then denoised, too.

        Args:
            texts, frames, seed, ids: as in `sample`. Wants `torch.inference_mode` around it where no gradient is needed.
        """
        self.check(texts, frames)
        lengths = torch.tensor([*frames])
        noise = WindowNoise(
            whole("seed", seed), identities(ids, len(texts)), (self.cfg.data.longest, self.layout.width), self.device
        )
        most = self.cfg.padded or int(lengths.max())
        mask = (torch.arange(most) < lengths[:, None]).to(self.device)
        kept = noisy(mask, self.cfg.model)

        def draw() -> Tensor:  # so many frames whatever the others' lengths: a motion does not depend on its batch
            """Noise of the frames that take part."""
            return noise()[:, :most] * kept

        denoise, steps = self._denoise(texts, mask), self.cfg.forward.steps
        count = self.sampling.sampling_steps or steps
        if self.sampling.sampler == "sde_dpm":
            return sde_dpm_solver(denoise, draw(), self.alpha_bar, count, noise=draw)
        indices = ddim_indices(steps, count, "trailing")
        if self.sampling.sampler == "ddim":
            return ddim(denoise, draw(), self.alpha_bar, indices)
        return posterior_mean(denoise, draw(), self.alpha_bar, indices, noise=draw)

    def _denoise(self, texts: Sequence[str], mask: Valid) -> Denoise:
        """(y_t, t) -> eps, with classifier-free guidance: y_u + s (y_c - y_u) of clean estimates, in one pass."""
        s, encoded = self.sampling, self.net.text(texts)
        lowest = self.cfg.forward.steps if s.guidance == 1 else s.guidance_above * self.cfg.forward.steps

        twice = EncodedText._make(torch.cat([x, x]) for x in encoded)
        drop = torch.arange(2 * len(mask), device=mask.device) >= len(mask)

        def denoise(y: Features, t: int) -> Features:
            """(y_t, t) -> eps."""
            guided = t >= lowest
            y_t, valid, text = (torch.cat([y, y]), torch.cat([mask, mask]), twice) if guided else (y, mask, encoded)
            y0_hat = self.net(y_t, torch.full((len(y_t),), t, device=y.device), valid, text, drop[: len(y_t)])
            if guided:
                told, untold = y0_hat.chunk(2)
                y0_hat = classifier_free(told, untold, s.guidance, "alg1")
            return to_eps("y0", y0_hat * noisy(mask, self.cfg.model), y, self.alpha_bar[t])

        return denoise
