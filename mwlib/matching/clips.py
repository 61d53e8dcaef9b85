"""Captioned clips as an evaluator reads them: words as numbers, halves of the data, random pairs.

The published evaluator reads words of its own list and one of 15 parts of speech for each. Source: Guo et al. 2022 and its code
(the class that makes vectors of words). The code knows five kinds of words by lists of its own; a word of a list is of that
kind whatever its tag says.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional as F
from torch.nn.utils.rnn import pad_sequence

from mwlib.data.captioned import joined, piece
from mwlib.data.formats.humanml import CaptionedClip, TaggedCaption
from mwlib.data.normalisation import Statistics
from mwlib.matching.config import Half
from mwlib.networks.matching import UNIT
from mwlib.networks.text import vocabulary_of, words_of

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

    def windows(self, count: int, frames: int, generator: torch.Generator) -> Float[Tensor, "B T D"]:
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


UNKNOWN_WORD, START_WORD, END_WORD, OTHER = "unk", "sos", "eos", "OTHER"
LONGEST = 20  # words of a caption that are read
KINDS = {
    "Loc_VIP": "left right clockwise counterclockwise anticlockwise forward back backward up down straight curve",
    "Body_VIP": "arm chin foot feet face hand mouth leg waist eye knee shoulder thigh",
    "Obj_VIP": "stair dumbbell chair window floor car ball handrail baseball basketball",
    "Act_VIP": "walk run swing pick bring kick put squat throw hop dance jump turn stumble stop sit lift lower raise wash stand "
    "kneel stroll rub bend balance flap jog shuffle lean rotate spin spread climb",
    "Desc_VIP": "slowly carefully fast careful slow quickly happy angry sad happily angrily sadly",
}
PARTS = ("VERB", "NOUN", "DET", "ADP", "NUM", "AUX", "PRON", "ADJ", "ADV", *KINDS, OTHER)  # in the order of their numbers
_KIND = {word: kind for kind, words in KINDS.items() for word in words.split()}


class TaggedVocabulary:
    """Words as numbers, and their parts of speech.

    A word that is not in the list counts as "unk" of the part "OTHER". A tag that is none of `PARTS` counts as "OTHER". After
    20 words a caption is cut. "sos" and "eos" stand around it, and are counted.

    Own choice: a caption without tags is refused. The published evaluator never saw one: with "OTHER" for every word its scores
    would look like any others and mean less.

    Args:
        words: in the order of their numbers, "unk" among them.

    Raises:
        ValueError: "unk" is missing.

    >>> words = TaggedVocabulary(["unk", "sos", "eos", "a", "man", "walk"])
    >>> caption = TaggedCaption("a man walks", [("a", "DET"), ("man", "NOUN"), ("walk", "VERB")])
    >>> numbers, counts, parts = words.ids([caption])
    >>> numbers.tolist(), counts.tolist(), [PARTS[part] for part in parts[0].argmax(1)]
    ([[1, 3, 4, 5, 2]], [5], ['OTHER', 'DET', 'NOUN', 'Act_VIP', 'OTHER'])
    """

    def __init__(self, words: Sequence[str]) -> None:
        self.words = tuple(words)
        self._number = {word: number for number, word in enumerate(self.words)}
        if UNKNOWN_WORD not in self._number:
            raise ValueError(f"{UNKNOWN_WORD!r} is not among the {len(self.words)} words; expected it, for those that are not")

    def words_of(self, sentence: str) -> list[str]:
        """The words that are looked up: those that the collection made of a caption.

        Raises:
            ValueError: the caption has no parts of speech.
        """
        return [word for word, _ in _tagged(sentence)]

    def ids(self, sentences: Sequence[str]) -> tuple[Int[Tensor, "B L"], Int[Tensor, " B"], Float[Tensor, "B L P"]]:
        """Numbers of the words of each caption with start and end, how many these are, and one-hot parts of speech.

        Raises:
            ValueError: as `words_of`.
        """
        marked = [[(START_WORD, OTHER), *_tagged(text)[:LONGEST], (END_WORD, OTHER)] for text in sentences]
        rows = [torch.tensor([self._looked_up(*pair) for pair in caption]) for caption in marked]
        table = pad_sequence(rows, batch_first=True)  # what stands after a caption's own end is not read
        counts = torch.tensor([len(row) for row in rows])
        return table[..., 0], counts, F.one_hot(table[..., 1], len(PARTS)).float()

    def _looked_up(self, word: str, tag: str) -> tuple[int, int]:
        """Number and part of a word."""
        if word not in self._number:
            word, tag = UNKNOWN_WORD, OTHER
        part = _KIND.get(word, tag)
        return self._number[word], PARTS.index(part if part in PARTS else OTHER)


def _tagged(sentence: str) -> tuple[tuple[str, str], ...]:
    if not isinstance(sentence, TaggedCaption) or not sentence.tagged:
        raise ValueError(
            f"{sentence[:80]!r} has no parts of speech; expected a caption of HumanML3D or KIT-ML, whose texts tell them "
            "(word/POS): the published evaluator reads no others"
        )
    return sentence.tagged
