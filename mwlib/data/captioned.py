"""Captioned clips: those that a configuration names, their split, and batches of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from mwlib.data.captioned_cmu import captioned_cmu
from mwlib.data.captioned_people import captioned_people
from mwlib.data.formats.humanml import LAYOUTS, CaptionedClip, FeatureLayout, TaggedCaption, read_folder
from mwlib.data.load import data_folder, find_source
from mwlib.hashing import sha256
from mwlib.networks.matching import UNIT
from mwlib.settings import Count, Natural


@dataclass(frozen=True)
class CaptionsConfig:
    """Which clips."""

    data: str = "people"  # "people", "cmu", or a folder laid out as HumanML3D or KIT, here or under MWLIB_DATA
    clips: Count = 2400  # of "people"; other data are what they are
    shortest: Count = 40  # frames: shorter clips are left out; at least 4. KIT's loader takes 24
    longest: Count = 196  # frames: longer clips are cut
    few: Natural = 0  # train on so many clips only, spread evenly; 0 = all


class Parts(NamedTuple):
    """Clips by what they may be used for; no clip, and where people are known no person, is in two parts."""

    train: list[CaptionedClip]
    val: list[CaptionedClip]
    test: list[CaptionedClip]

    def fingerprints(self) -> tuple[str, str]:
        """Of the clips that a model is trained on, and of those that it is tested on."""
        return fingerprint([*self.train, *self.val]), fingerprint(self.test)

    @property
    def layout(self) -> FeatureLayout:
        """What a row of features means."""
        return LAYOUTS[self.train[0].features.shape[1]]


def load_clips(source: CaptionsConfig) -> Parts:
    """The configured clips, parted as their collection parts them.

    Raises:
        ValueError: nothing is left to train or to test on.
        FileNotFoundError: there is no such folder.
        MotionFormatError: as the reader of the data.
    """
    clips = [_cut(clip, source.longest) for clip in _clips(source) if len(clip.features) >= source.shortest]
    train, val, test = ([clip for clip in clips if clip.split == split] for split in ("train", "val", "test"))
    if source.few:
        train = [train[i] for i in np.linspace(0, len(train) - 1, min(source.few, len(train))).round().astype(int)]
    if not train or not test:
        found = f"{source.data} has {len(train)} clips to train and {len(test)} to test on"
        raise ValueError(f"{found}, of {source.shortest} frames or more; expected some of both")
    return Parts(train, val, test)


def _clips(source: CaptionsConfig) -> list[CaptionedClip]:
    if source.data == "people":
        return _people(source.clips)
    if source.data == "cmu":
        return _cmu(data_folder().absolute())
    try:
        folder = find_source(source.data)
    except FileNotFoundError:
        found = f"data is {source.data!r}, which is neither here nor in {data_folder()}, the folder of data (MWLIB_DATA)"
        raise FileNotFoundError(f"{found}; expected people, cmu, or a folder laid out as HumanML3D or KIT") from None
    return _folder(folder)


@cache
def _people(clips: int) -> list[CaptionedClip]:
    return captioned_people(clips)


@cache
def _cmu(folder: Path) -> list[CaptionedClip]:
    return captioned_cmu(folder)


@cache
def _folder(folder: Path) -> list[CaptionedClip]:
    return read_folder(folder)


def _cut(clip: CaptionedClip, longest: int) -> CaptionedClip:
    """A clip that is cut may not show any more what was known of it."""
    if len(clip.features) <= longest:
        return clip
    return CaptionedClip(clip.features[:longest], clip.captions, clip.name, clip.split)


def fingerprint(clips: Sequence[CaptionedClip]) -> str:
    """Eight hex digits over names, captions, their parts of speech where these are told, and features."""
    return sha256(_contents(clips))[:8]


def _contents(clips: Sequence[CaptionedClip]) -> Iterator[bytes | str]:
    for clip in clips:
        tagged = [caption.tagged for caption in clip.captions if isinstance(caption, TaggedCaption)]
        yield f"{clip.name}/{clip.captions}/{clip.features.shape}{tagged or ''}"
        yield np.ascontiguousarray(clip.features, dtype=np.float32).tobytes()


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
