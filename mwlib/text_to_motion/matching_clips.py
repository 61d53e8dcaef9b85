"""Captioned clips as an evaluator learns from them: which half, words as numbers, random pairs and random windows."""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.data.captions import CaptionedClip
from mwlib.networks.matching import UNIT
from mwlib.networks.text import vocabulary_of, words_of
from mwlib.text_to_motion.draws import piece
from mwlib.text_to_motion.matching_config import Half
from mwlib.text_to_motion.statistics import Statistics

UNKNOWN, START, END, FIRST_WORD = 0, 1, 2, 3


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
    stems = [re.sub(r"^M(?=\d)", "", clip.name.split(" ")[0]) for clip in clips]
    wanted = ("evaluator", "critic").index(half)
    chosen = [clip for clip, stem in zip(clips, stems, strict=True) if zlib.crc32(stem.encode()) % 2 == wanted]
    if not chosen:
        raise ValueError(f"none of {len(clips)} clips is in the half of the {half}; expected more clips, or half=all")
    return chosen


class Vocabulary:
    """Words as numbers: 0 is any other word, 1 and 2 mark start and end of a sentence.

    Args:
        words: in the order of their numbers, which begin at 3.
        longest: words of a sentence that are read.

    >>> Vocabulary(["a", "man", "walks"], longest=20).ids(["A man walks.", "a dog"])
    (tensor([[1, 3, 4, 5, 2],
            [1, 3, 0, 2, 0]]), tensor([5, 4]))
    """

    def __init__(self, words: Sequence[str], longest: int) -> None:
        self.words, self.longest = tuple(words), longest
        self._number = {word: number for number, word in enumerate(self.words, FIRST_WORD)}

    @classmethod
    def of(cls, clips: Sequence[CaptionedClip], longest: int) -> Vocabulary:
        """All words of the clips' captions."""
        return cls(vocabulary_of(caption for clip in clips for caption in clip.captions), longest)

    def __len__(self) -> int:
        return FIRST_WORD + len(self.words)

    def words_of(self, sentence: str) -> list[str]:
        """The words that are looked up."""
        return words_of(sentence)

    def ids(self, sentences: Sequence[str]) -> tuple[Int[Tensor, "B L"], Int[Tensor, " B"]]:
        """Numbers of the words of each sentence, with start and end, and how many these are."""
        known = [[self._number.get(word, UNKNOWN) for word in self.words_of(text)[: self.longest]] for text in sentences]
        rows = [torch.tensor([START, *row, END]) for row in known]
        return torch.nn.utils.rnn.pad_sequence(rows, batch_first=True), torch.tensor([len(row) for row in rows])


class Pairs(NamedTuple):
    """Sentences and motions, row for row."""

    words: Int[Tensor, "B L"]
    word_counts: Int[Tensor, " B"]
    x: Float[Tensor, "B T D"]
    lengths: Int[Tensor, " B"]

    def to(self, device: torch.device) -> Pairs:
        """The same on another device."""
        return Pairs(*(part.to(device) for part in self))


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
        self.flat = torch.cat([statistics.scale(torch.from_numpy(clip.features)).values.float() for clip in clips])
        self.lengths = torch.tensor([len(clip.features) for clip in clips])
        self.first = self.lengths.cumsum(0) - self.lengths
        self.words, self.word_counts = vocabulary.ids([caption for clip in clips for caption in clip.captions])
        self.captions = torch.tensor([len(clip.captions) for clip in clips])
        self.first_caption = self.captions.cumsum(0) - self.captions

    def draw(self, count: int, generator: torch.Generator) -> Pairs:
        """So many different clips, or all if there are fewer, each with one of its captions.

        Of each a random piece of whole movements, see `piece`.
        """
        clip = torch.randperm(len(self.lengths), generator=generator)[:count]
        share = torch.rand(3, len(clip), generator=generator)
        caption = self.first_caption[clip] + (share[0] * self.captions[clip]).long()
        length, start = piece(self.lengths[clip], share[1], share[2])
        counts = self.word_counts[caption]
        return Pairs(self.words[caption, : counts.max()], counts, self._cut(clip, start, length), length)

    def windows(self, count: int, frames: int, generator: torch.Generator) -> Float[Tensor, "B T D"]:
        """Random windows, every one that there is as likely as any other.

        Raises:
            ValueError: no clip has so many frames.
        """
        there = (self.lengths - frames + 1).clamp_min(0)
        if not there.any():
            raise ValueError(f"the longest clip has {int(self.lengths.max())} frames; expected {frames} as movement_frames says")
        clip = torch.multinomial(there.double(), count, replacement=True, generator=generator)
        start = (torch.rand(count, generator=generator) * there[clip]).long()
        return self._cut(clip, start, torch.full((count,), frames))

    def _cut(self, clip: Int[Tensor, " B"], start: Int[Tensor, " B"], length: Int[Tensor, " B"]) -> Float[Tensor, "B T D"]:
        """Frames from `start` on, as many as the longest has; what lies beyond a row's own length is anything."""
        place = (self.first[clip] + start)[:, None] + torch.arange(int(length.max()))
        return self.flat[place.clamp_max(len(self.flat) - 1)]
