"""Batches of clips of different lengths, with a caption each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from mwlib.data.captions import CaptionedClip
from mwlib.networks.matching import UNIT

SHORTENED = 1 / 3  # of the pieces
BUCKETS = 8  # groups of clips of like lengths, one of which a batch comes from: own choice, a third less padding


class Batch(NamedTuple):
    """Normalised features, padded with zeros; which frames a sample has; its caption."""

    y: Float[Tensor, "B T D"]
    mask: Bool[Tensor, "B T"]
    lengths: Int[Tensor, " B"]
    captions: list[str]


def piece(
    full: Int[Tensor, " B"], shorter: Float[Tensor, " B"], place: Float[Tensor, " B"]
) -> tuple[Int[Tensor, " B"], Int[Tensor, " B"]]:
    """Lengths of pieces of clips, and where they start.

    Source: Guo et al., 2022, their loader: the length is cut to a multiple of 4, one time in three by 4 more; the piece starts
    anywhere.

    Args:
        full: frames of each clip, at least 4.
        shorter, place: random numbers between 0 and 1.
    """
    units = full // UNIT
    lengths = UNIT * torch.where(shorter < SHORTENED, units - 1, units).clamp_min(1)
    return lengths, (place * (full - lengths + 1)).long()


class Pool:
    """Clips laid end to end, so that a batch is one look-up.

    Args:
        clips: at least one, none shorter than `UNIT` frames.
        normalised: their features in the same order, as the network sees them.
        padded: frames to which every batch is filled up; 0 = to its longest clip.
    """

    def __init__(self, clips: Sequence[CaptionedClip], normalised: Sequence[Float[Tensor, "_ D"]], padded: int = 0) -> None:
        self.clips, self.flat, self.padded = clips, torch.cat(list(normalised)), padded
        self.lengths = torch.tensor([len(part) for part in normalised])
        self.starts = torch.cat([torch.zeros(1, dtype=torch.long), self.lengths.cumsum(0)[:-1]])
        order = self.lengths.argsort(stable=True)
        self.buckets = [part for part in order.tensor_split(min(BUCKETS, len(clips))) if len(part)]

    def to(self, device: torch.device) -> None:
        """Move the features."""
        self.flat = self.flat.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Batch:
        """Random clips of like lengths, a random caption of each, and a random piece of it."""
        sizes = torch.tensor([len(bucket) for bucket in self.buckets], dtype=torch.float)
        bucket = self.buckets[int(torch.multinomial(sizes, 1, generator=generator))]
        picked = bucket[torch.randint(len(bucket), (batch,), generator=generator)]
        lengths, offset = piece(self.lengths[picked], *(torch.rand(batch, generator=generator) for _ in range(2)))
        words = torch.rand(batch, generator=generator).tolist()
        captions = [
            self.clips[i].captions[int(w * len(self.clips[i].captions))] for i, w in zip(picked.tolist(), words, strict=True)
        ]
        return self._batch(self.starts[picked] + offset, lengths, captions)

    def whole(self, numbers: Sequence[int], captions: Sequence[str]) -> Batch:
        """Given clips from their beginning, cut to a multiple of 4 frames."""
        picked = torch.tensor(numbers)
        return self._batch(self.starts[picked], self.lengths[picked] // UNIT * UNIT, list(captions))

    def _batch(self, starts: Tensor, lengths: Int[Tensor, " B"], captions: list[str]) -> Batch:
        frames = torch.arange(self.padded or int(lengths.max()))
        mask = frames < lengths[:, None]
        y = self.flat[torch.where(mask, starts[:, None] + frames, 0).to(self.flat.device)]
        mask = mask.to(y.device)
        return Batch(y * mask[..., None], mask, lengths.to(y.device), captions)


def one_caption_each(clips: Sequence[CaptionedClip], seed: int) -> list[str]:
    """A random caption of every clip."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    return [clip.captions[int(rng.integers(len(clip.captions)))] for clip in clips]
