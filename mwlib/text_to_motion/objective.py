"""Training of Free-T2M: the losses of diffusion, of low frequencies and of meaning, on random clips with captions."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor, nn

from mwlib.data.captioned import Batch, ClipBatches, Parts
from mwlib.data.formats.humanml import FeatureLayout
from mwlib.data.load import find_source
from mwlib.data.normalisation import Kind, Statistics
from mwlib.data.untrusted import MotionFormatError
from mwlib.diffusion import alpha_bar, noised, snr_weights
from mwlib.matching.evaluators import Matcher, finished_run, open_matcher
from mwlib.networks.layers import Features
from mwlib.networks.text import WordTransformer, vocabulary_of
from mwlib.text_to_motion.config import Config

from mwlib.text_to_motion.losses import (  # isort: skip
    LowPass, PerSample, low_frequency_loss, masked_error, semantic_loss, stage_weights,
)  # fmt: skip
from mwlib.text_to_motion.model import TextDenoiser, noisy
from mwlib.training import Objective, read_model, seeded

VALIDATION_BATCHES = 4  # of 64 clips
CHUNK = 256  # clips whose power is measured together
# Own choice, of "root_snr": a noise level weighs as the root of signal over noise, at most 1 and at least the root of this.
# Errors at little noise are a tenth of those at much, and unweighted a small part of the loss.
LEAST_SNR = 0.01


class TextObjective(Objective):
    """The training of a text-to-motion model, as `mwlib.training.train` takes it.

    Args:
        cfg: configuration.
        parts: clips for training and validation.
        learnt: what was learnt in an earlier part of the same training; empty: it is fitted now.

    Raises:
        FileNotFoundError: the critic of the semantic loss is missing, or the run to start from.
        MotionFormatError: Mean.npy or Std.npy of the data is missing or malformed, where `statistics` asks for them.
        ValueError: the run to start from has other sizes.
    """

    def __init__(self, cfg: Config, parts: Parts, learnt: Mapping[str, Tensor] | None = None) -> None:
        self.cfg, self.layout = cfg, parts.layout
        self.alpha_bar = alpha_bar(cfg.forward.schedule, cfg.forward.steps)
        weighed, start = cfg.objective.level_weight == "root_snr", cfg.model.start
        self.level = snr_weights(self.alpha_bar, (LEAST_SNR, 1.0)).sqrt() if weighed else torch.ones(cfg.forward.steps)
        advice = "name a run of text_to_motion, or leave start empty"
        weights, found, _ = read_model(finished_run(start, advice)) if start else ({}, {}, {})
        if learnt or found:
            self.statistics = Statistics.from_tensors(cfg.forward.normalisation, learnt or found)
        elif cfg.forward.statistics == "files":
            self.statistics = published_statistics(cfg, self.layout)
        else:
            features = [clip.features for clip in parts.train]
            self.statistics = Statistics.measured(features, self.layout, cfg.forward.normalisation)
        self.clips = ClipBatches(parts.train, self.statistics, cfg.padded)
        self.held_out = ClipBatches(parts.val, self.statistics, cfg.padded) if parts.val else None
        self.low_pass = LowPass(cfg.data.longest, cfg.objective.lf_k, cfg.objective.lf_hz, self.layout.fps)
        self.power = self._power() if cfg.objective.stage == "snr" else None
        self.critic = open_matcher(cfg.objective.critic, self.layout) if cfg.objective.semantic_weight else None
        if weights and cfg.model.text == "words":
            vocabulary = WordTransformer.vocabulary_in(weights, "text.")
        else:
            vocabulary = vocabulary_of(caption for clip in parts.train for caption in clip.captions)
        with seeded(cfg.training.seed, 0):
            self.network: nn.Module = TextDenoiser(cfg.model, self.layout.width, cfg.forward.steps, vocabulary)
        if weights:
            own = self.network.state_dict().items()
            weights = {name: x for name, x in own if name.startswith("body.detail.")} | weights  # a correction begins at zero
            try:
                self.network.load_state_dict(weights)
            except RuntimeError as error:
                raise ValueError(f"start is {start!r}: {error}; expected a run of the same sizes") from None

    def _power(self) -> Float[Tensor, " K"]:
        """Of the low cosines of the training clips, over all features."""
        count, total = len(self.clips.clips), torch.zeros(())
        for part in torch.arange(count).split(CHUNK):
            batch = self.clips.whole(part.tolist(), [])
            total = total + self.low_pass.coefficients(batch.y, batch.lengths).square().mean(2).sum(0)
        return total / count

    def to(self, device: torch.device) -> None:
        """Move the clips and the critic."""
        for part in filter(None, (self.clips, self.held_out, self.critic)):
            part.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Batch:
        """Clips of like lengths with a caption each."""
        return self.clips.draw(batch, generator)

    def loss(self, network: nn.Module, batch: Batch, generator: torch.Generator) -> Float[Tensor, ""]:
        """lambda_1 L_simple + lambda_2 L_LF + lambda_3 L_S, each sample at its own t (Eq. 17, with a plus: see semantic_loss)."""
        o, size = self.cfg.objective, len(batch.y)
        t = torch.randint(len(self.alpha_bar), (size,), generator=generator)
        eps = torch.randn(batch.y.shape, generator=generator).to(batch.y.device)
        drop = (torch.rand(size, generator=generator) < o.drop_text).to(batch.y.device)
        y_t = noised(batch.y, eps, self.alpha_bar[t]) * noisy(batch.mask, self.cfg.model)
        y0_hat = network(y_t, t.to(batch.y.device), batch.mask, batch.captions, drop)
        error = y0_hat - batch.y
        total = o.simple_weight * masked_error(error, batch.mask)
        low, semantic = (w.to(total.device) for w in stage_weights(o.stage, t, self.alpha_bar, self.power))
        if o.low_weight:
            slow = low_frequency_loss(error, batch.lengths, self.low_pass, o.lf_norm, o.lf_band)
            total = total + o.low_weight * low * slow
        if self.critic is not None:
            total = total + o.semantic_weight * self._semantic(self.critic, y0_hat, batch, semantic)
        return (self.level[t].to(total.device) * total).mean()

    def _semantic(self, critic: Matcher, y0_hat: Features, batch: Batch, weight: PerSample) -> PerSample:
        """Times its weight; the critic looks at none of the samples of weight 0."""
        o, rows = self.cfg.objective, weight.nonzero()[:, 0]
        if len(rows) == 0:
            return torch.zeros_like(weight)
        lengths = batch.lengths[rows]
        estimate = critic.embed_motion(self.statistics.denormalise(y0_hat[rows]), lengths)
        with torch.no_grad():
            truth = critic.embed_motion(self.statistics.denormalise(batch.y[rows]), lengths)
            text = critic.embed_text([batch.captions[row] for row in rows.tolist()])
        loss = semantic_loss(estimate, truth, text, o.semantic, o.s_th)
        return torch.zeros_like(weight).index_put((rows,), weight[rows] * loss)

    def held_out_loss(self, network: nn.Module, generator: torch.Generator) -> float | None:
        """Mean loss on people held out; None if there are none."""
        if self.held_out is None:
            return None
        losses = [self.loss(network, self.held_out.draw(64, generator), generator) for _ in range(VALIDATION_BATCHES)]
        return float(torch.stack(losses).mean())

    def learnt(self) -> dict[str, Tensor]:
        """Mean and deviation of the features."""
        return self.statistics.tensors()


def statistics_files(cfg: Config) -> list[Path]:
    """Mean.npy and Std.npy of the folder of data, where the settings ask for them.

    Raises:
        FileNotFoundError: there is no such folder.
    """
    return [find_source(cfg.data.data) / name for name in ("Mean.npy", "Std.npy")] if cfg.forward.statistics == "files" else []


def published_statistics(cfg: Config, layout: FeatureLayout, files: Sequence[Path] = (), kind: Kind = "mdm") -> Statistics:
    """Mean.npy and Std.npy of the folder of data, or two other files of this kind, as the settings' `normalisation` scales them.

    Raises:
        FileNotFoundError: there is no such folder.
        MotionFormatError: a file is missing, malformed or of another layout.
    """
    mean, deviation = files or statistics_files(cfg)
    found = Statistics.read(mean, deviation, kind)
    if found.layout != layout:
        raise MotionFormatError(mean.parent, mean.name, f"{found.layout.width} numbers", f"{layout.width} for {layout.name}")
    return found.of_kind(cfg.forward.normalisation)
