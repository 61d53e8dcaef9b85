"""Training of an evaluator: codes of movements by an auto-encoder, then sentences and motions to match.

Source: Guo et al. 2022 and its code.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional as F

from mwlib.data.captioned import Parts
from mwlib.data.formats.humanml import LAYOUTS
from mwlib.data.normalisation import Statistics
from mwlib.matching.clips import FIRST_WORD, UNKNOWN, PairedClips, Pairs, Vocabulary, of_half
from mwlib.matching.config import Config
from mwlib.matching.evaluators import MatchingNetwork, make_movement
from mwlib.networks.matching import MovementDecoder, MovementEncoder
from mwlib.training import Objective, seeded, with_weights
from mwlib.training.checkpoint import part

VALIDATION_PAIRS = 256


def contrastive_loss(
    text: Float[Tensor, "B E"], motion: Float[Tensor, "B E"], shift: int, margin: float = 10.0
) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """Mean d² of pairs, and mean max(0, margin - d)² of texts with the motions `shift` rows on; the loss is their sum.

    Source: Guo et al. 2022 and its code, which draws the shift from 0 to B-2. A shift of 0 takes true pairs as negatives, and B-1
    is never drawn; so it is refused here, and 1 to B-1 are drawn.

    Args:
        text, motion: embeddings of pairs.
        shift: from 1 to B - 1.
        margin: beyond it negatives do not count.

    Raises:
        ValueError: another shift.
    """
    if not 1 <= shift < len(text):
        raise ValueError(f"shift is {shift} in a batch of {len(text)}; expected 1 to {len(text) - 1}: at 0 pairs are negatives")
    apart = (text - motion.roll(-shift, 0)).square().sum(-1).clamp_min(1e-12).sqrt()
    return (text - motion).square().sum(-1).mean(), (margin - apart).clamp_min(0).square().mean()


def infonce_loss(
    text: Float[Tensor, "B E"], motion: Float[Tensor, "B E"], same: Bool[Tensor, "B B"], temperature: float = 1.0
) -> Float[Tensor, ""]:
    """-log of the share of the true partner among all of the batch, by exp(-d² / temperature); mean of both directions.

    Own choice: every other pair of the batch is a negative, not one, and near ones count most, so captions that differ in a word
    are told apart sooner. As TMR (Petrovich et al. 2023), which takes cosines, negatives with the same caption are left out;
    distances here, since the metrics use these.

    Args:
        text, motion: embeddings of pairs.
        same: pairs of rows with the same caption; the diagonal does not matter.
        temperature: of the exponential.
    """
    logits = -(text[:, None] - motion).square().sum(-1) / temperature
    left_out = same & ~torch.eye(len(text), dtype=torch.bool, device=same.device)
    logits = logits.masked_fill(left_out, -torch.inf)
    target = torch.arange(len(text), device=text.device)
    return (F.cross_entropy(logits, target) + F.cross_entropy(logits.T, target)) / 2


def movement_loss(
    decoded: Float[Tensor, "B T D"], x: Float[Tensor, "B T D"], codes: Float[Tensor, "B U C"], sparsity: float, smoothness: float
) -> Float[Tensor, ""]:
    """Mean |error|, and small weights on the codes' mean size and mean step.

    Source: Guo et al. 2022 and its code.
    """
    return F.l1_loss(decoded, x) + sparsity * codes.abs().mean() + smoothness * codes.diff(dim=1).abs().mean()


def train_movements(clips: PairedClips, cfg: Config, features: int) -> tuple[MovementEncoder, list[float]]:
    """The movement encoder, trained with a decoder that is thrown away, then frozen; and the loss of each step.

    On the CPU, so that a seed gives one result whatever device the rest is trained on.
    """
    o = cfg.objective
    with seeded(cfg.training.seed, 0) as generator:
        encoder = make_movement(cfg.model, features).train()
        decoder = MovementDecoder(features, cfg.model.code_width, cfg.model.code_width)
        optimiser = torch.optim.Adam([*encoder.parameters(), *decoder.parameters()], lr=o.movement_lr, fused=True)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, o.movement_steps)
        curve = []
        for _ in range(o.movement_steps):
            x = clips.windows(o.movement_batch, o.movement_frames, generator)
            codes = encoder(x)
            loss = movement_loss(decoder(codes), x, codes, o.sparsity, o.smoothness)
            loss.backward()
            optimiser.step()
            optimiser.zero_grad()
            schedule.step()
            curve.append(float(loss.detach()))
    return encoder.eval().requires_grad_(False), curve


class MatchingObjective(Objective):
    """The training of a matcher, as `mwlib.training.train` takes it.

    Own choice: the codes of movements are fitted before the first step and kept with what was learnt, as they are frozen after.

    Args:
        cfg: configuration.
        data: clips for training, of which `cfg.model.half` takes its share, and for the validation loss.
        learnt: what was learnt in an earlier part of the same training; empty: it is learnt now.

    Raises:
        ValueError: clips without names, too few or too short ones, or features of no known layout.
    """

    network: MatchingNetwork

    def __init__(self, cfg: Config, data: Parts, learnt: Mapping[str, Tensor] | None = None) -> None:
        self.cfg = cfg
        chosen = of_half(data.train, cfg.model.half)
        width = chosen[0].features.shape[-1]
        if width not in LAYOUTS:
            raise ValueError(f"features are {width} wide; expected one of {', '.join(map(str, LAYOUTS))}")
        kind = cfg.model.statistics
        arrays = [clip.features for clip in chosen]
        self.statistics = Statistics.from_tensors(kind, learnt) if learnt else Statistics.measured(arrays, LAYOUTS[width], kind)
        self.vocabulary = Vocabulary.of(chosen, cfg.model.words)
        self.clips = PairedClips(chosen, self.statistics, self.vocabulary)
        self.held_out = PairedClips(data.val, self.statistics, self.vocabulary) if data.val else None
        if learnt:
            encoder = with_weights(lambda: make_movement(cfg.model, width), part(learnt, "movement."))
            self.movement = encoder.eval().requires_grad_(False)
        else:
            self.movement, _ = train_movements(self.clips, cfg, width)
        with seeded(cfg.training.seed, 0):
            self.network = MatchingNetwork.untrained(cfg.model, len(self.vocabulary))

    def to(self, device: torch.device) -> None:
        """Move the movement encoder; batches follow it."""
        self.movement.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Pairs:
        """Pairs of different clips."""
        return self.clips.draw(batch, generator)

    def loss(self, network: nn.Module, batch: Pairs, generator: torch.Generator) -> Float[Tensor, ""]:
        """The configured loss; some words are unknown while the network is in training mode."""
        o = self.cfg.objective
        if network.training and o.word_dropout:
            lost = torch.rand(batch.words.shape, generator=generator) < o.word_dropout
            words = batch.words.masked_fill(lost & (batch.words >= FIRST_WORD), UNKNOWN)
        else:
            words = batch.words
        seen = batch._replace(words=words).to(self.movement.out_net.weight.device)
        with torch.no_grad():
            codes, units = self.movement.codes(seen.x, seen.lengths)
        text, motion = network(seen.words, seen.word_counts, codes, units)
        if o.loss == "infonce":
            same = (batch.words[:, None] == batch.words).all(-1).to(text.device)
            return infonce_loss(text, motion, same, o.temperature)
        shift = int(torch.randint(1, len(text), (1,), generator=generator))
        return torch.stack(contrastive_loss(text, motion, shift, o.margin)).sum()

    def held_out_loss(self, network: nn.Module, generator: torch.Generator) -> float | None:
        """Loss on pairs held out, always the same ones; None if there are none."""
        if self.held_out is None:
            return None
        return float(self.loss(network, self.held_out.draw(VALIDATION_PAIRS, generator), generator))

    def learnt(self) -> dict[str, Tensor]:
        """Statistics and the codes of movements."""
        return {**self.statistics.tensors(), **{f"movement.{name}": v for name, v in self.movement.state_dict().items()}}

    def about(self) -> dict[str, str]:
        """The words."""
        return {"vocabulary": json.dumps(self.vocabulary.words)}
