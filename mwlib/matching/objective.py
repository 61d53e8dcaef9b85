"""Training of an evaluator on random pairs: codes of movements by an auto-encoder, then sentences and motions to match.

Source: Guo et al. 2022 and its code.
"""

import json
import re
import zlib
from collections.abc import Mapping, Sequence
from itertools import compress
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from mwlib.data.captioned import Parts, joined, piece
from mwlib.data.formats.humanml import CaptionedClip
from mwlib.data.normalisation import Statistics
from mwlib.matching.config import Config, Half
from mwlib.matching.evaluators import FIRST_WORD, UNKNOWN, MatchingNetwork, Vocabulary, make_movement
from mwlib.networks.layers import Features, PerItem
from mwlib.networks.matching import UNIT, Codes, Embeddings, MovementDecoder, MovementEncoder
from mwlib.training import Objective, seeded, with_weights
from mwlib.training.checkpoint import part

VALIDATION_PAIRS = 256


def of_half(clips: Sequence[CaptionedClip], half: Half) -> list[CaptionedClip]:
    """The clips that an evaluator or a critic may learn from; no clip, mirror image or stretch of it is in both halves.

    Own choice: a clip's half follows from its name alone, so that more clips change nothing for those that were there. What
    follows a space in a name, and an M before digits, are not looked at: HumanML3D's "M000021 line 2" is 000021.

    Args:
        clips: with names.
        half: "all" takes every clip.

    Raises:
        ValueError: a clip has no name, or no clip is left.

    >>> clips = [CaptionedClip(np.zeros((8, 263)), ("a man walks",), name) for name in ("000001", "M000001", "000005")]
    >>> [clip.name for clip in of_half(clips, "evaluator")]
    ['000001', 'M000001']
    """
    if half == "all":
        return [*clips]
    if nameless := sum(not clip.name for clip in clips):
        raise ValueError(
            f"{nameless} of {len(clips)} clips have no name; expected one for each, which says its half, or half=all"
        )
    wanted = ("evaluator", "critic").index(half)
    stems = (re.sub(r"^M(?=\d)", "", clip.name.split(" ")[0]) for clip in clips)
    chosen = [*compress(clips, (zlib.crc32(stem.encode()) % 2 == wanted for stem in stems))]
    if not chosen:
        raise ValueError(f"none of {len(clips)} clips is in the half of the {half}; expected more clips, or half=all")
    return chosen


class Pairs(NamedTuple):
    """Sentences and motions, row for row."""

    words: Int[Tensor, "B L"]
    word_counts: PerItem
    x: Features
    lengths: PerItem

    def to(self, device: torch.device) -> "Pairs":
        """The same on another device."""
        return self._make(part.to(device) for part in self)


class PairedClips:
    """Clips and their captions, of which random pairs are drawn.

    Args:
        clips: at least two, each of 4 frames or more.
        statistics: scales the features.
        vocabulary: numbers the words.

    Raises:
        ValueError: fewer clips, a clip that is shorter or has no caption.
    """

    def __init__(self, clips: Sequence[CaptionedClip], statistics: Statistics, vocabulary: Vocabulary) -> None:
        if len(clips) < 2:
            raise ValueError(f"there are {len(clips)} clips; expected at least 2 to be told apart")
        for clip in clips:
            if len(clip.features) < UNIT or not clip.captions:
                found = f"{len(clip.features)} frames and {len(clip.captions)} captions"
                raise ValueError(f"clip {clip.name!r} has {found}; expected at least {UNIT} frames and a caption")
        self.frames = joined(clips, statistics)
        self.words, self.word_counts = vocabulary.ids([caption for clip in clips for caption in clip.captions])
        self.captions = torch.tensor([len(clip.captions) for clip in clips])
        self.first_caption = self.captions.cumsum(0) - self.captions

    def draw(self, count: int, generator: torch.Generator) -> Pairs:
        """So many different clips, or all if there are fewer, each with one of its captions.

        Of each a random piece of whole movements, see `piece`.
        """
        clip = torch.randperm(len(self.frames.lengths), generator=generator)[:count]
        share = torch.rand(3, len(clip), generator=generator)
        caption = self.first_caption[clip] + (share[0] * self.captions[clip]).long()
        length, start = piece(self.frames.lengths[clip], share[1], share[2])
        counts = self.word_counts[caption]
        return Pairs(self.words[caption, : counts.max()], counts, self.frames.take(clip, start, int(length.max())), length)

    def windows(self, count: int, frames: int, generator: torch.Generator) -> Features:
        """Random windows, every one that there is as likely as any other.

        Raises:
            ValueError: no clip has so many frames.
        """
        there, longest = (self.frames.lengths - frames + 1).clamp_min(0), int(self.frames.lengths.max())
        if longest < frames:
            raise ValueError(f"the longest clip has {longest} frames; expected {frames} as movement_frames says")
        clip = torch.multinomial(there.double(), count, replacement=True, generator=generator)
        start = (torch.rand(count, generator=generator) * there[clip]).long()
        return self.frames.take(clip, start, frames)


def contrastive_loss(
    text: Embeddings, motion: Embeddings, shift: int, margin: float = 10.0
) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """Mean d² of pairs, and mean max(0, margin - d)² of texts with the motions `shift` rows on; the loss is their sum.

    Source: Guo et al. 2022 and its code, which draws the shift from 0 to B-2. A shift of 0 takes true pairs as negatives, and B-1
    is never drawn; so 1 to B-1 are drawn here.

    Args:
        text, motion: embeddings of pairs.
        shift: from 1 to B - 1.
        margin: beyond it negatives do not count.
    """
    apart = (text - motion.roll(-shift, 0)).square().sum(-1).clamp_min(1e-12).sqrt()
    return (text - motion).square().sum(-1).mean(), (margin - apart).clamp_min(0).square().mean()


def infonce_loss(text: Embeddings, motion: Embeddings, same: Bool[Tensor, "B B"], temperature: float = 1.0) -> Float[Tensor, ""]:
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


def movement_loss(decoded: Features, x: Features, codes: Codes, sparsity: float, smoothness: float) -> Float[Tensor, ""]:
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
        ValueError: clips without names, or too few or too short ones.
    """

    network: MatchingNetwork

    def __init__(self, cfg: Config, data: Parts, learnt: Mapping[str, Tensor] | None = None) -> None:
        self.cfg, kind = cfg, cfg.model.statistics
        chosen = of_half(data.train, cfg.model.half)
        if learnt:
            self.statistics = Statistics.from_tensors(kind, learnt)
        else:
            self.statistics = Statistics.measured([clip.features for clip in chosen], data.layout, kind)
        width = data.layout.width
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
        o, words = self.cfg.objective, batch.words
        if network.training and o.word_dropout:
            lost = torch.rand(words.shape, generator=generator) < o.word_dropout
            words = words.masked_fill(lost & (words >= FIRST_WORD), UNKNOWN)
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
