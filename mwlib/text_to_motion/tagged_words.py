"""Captions as the published evaluator reads them: words of its list, and one of 15 parts of speech for each.

Source: Guo et al. 2022 and its code (the class that makes vectors of words). The code knows five kinds of words by lists of its
own; a word of a list is of that kind whatever its tag says.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional as F
from torch.nn.utils.rnn import pad_sequence

from mwlib.data.captions import TaggedCaption

UNKNOWN, START, END, OTHER = "unk", "sos", "eos", "OTHER"
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
        if UNKNOWN not in self._number:
            raise ValueError(f"{UNKNOWN!r} is not among the {len(self.words)} words; expected it, for those that are not")

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
        marked = [[(START, OTHER), *_tagged(text)[:LONGEST], (END, OTHER)] for text in sentences]
        rows = [torch.tensor([self._looked_up(*pair) for pair in caption]) for caption in marked]
        table = pad_sequence(rows, batch_first=True)  # what stands after a caption's own end is not read
        counts = torch.tensor([len(row) for row in rows])
        return table[..., 0], counts, F.one_hot(table[..., 1], len(PARTS)).float()

    def _looked_up(self, word: str, tag: str) -> tuple[int, int]:
        """Number and part of a word."""
        if word not in self._number:
            word, tag = UNKNOWN, OTHER
        part = _KIND.get(word, tag)
        return self._number[word], PARTS.index(part if part in PARTS else OTHER)


def _tagged(sentence: str) -> tuple[tuple[str, str], ...]:
    if not isinstance(sentence, TaggedCaption) or not sentence.tagged:
        raise ValueError(
            f"{sentence[:80]!r} has no parts of speech; expected a caption of HumanML3D or KIT-ML, whose texts tell them "
            "(word/POS): the published evaluator reads no others"
        )
    return sentence.tagged
