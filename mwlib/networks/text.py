"""Sentences as vectors: one of each word and one of the whole, by encoders that learn with the model that reads them."""

from __future__ import annotations

import re
import zlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from mwlib.networks.dropout import Dropout
from mwlib.networks.encoder import Encoder, sinusoids

PADDING, START, UNKNOWN = "<padding>", "<start>", "<unknown>"  # no word looks like these
LONGEST = 76  # words of a sentence that are read, those after them are not; with the start as many tokens as CLIP's
_WORD = re.compile(r"\w+(?:'\w+)*")


class EncodedText(NamedTuple):
    """Sentences as numbers.

    Args:
        tokens: a vector for each token.
        mask: True = a token, False = padding; at least one token in each row.
        pooled: a vector for each sentence.
    """

    tokens: Float[Tensor, "B L E"]
    mask: Bool[Tensor, "B L"]
    pooled: Float[Tensor, "B E"]


def words_of(sentence: str) -> list[str]:
    """Words of a sentence in lower case; punctuation and hyphens part them.

    >>> words_of("A left-handed man doesn't wave, twice.")
    ['a', 'left', 'handed', 'man', "doesn't", 'wave', 'twice']
    """
    return _WORD.findall(sentence.lower().replace("’", "'"))


def vocabulary_of(sentences: Iterable[str], at_least: int = 1) -> tuple[str, ...]:
    """Words that occur `at_least` so often, in alphabetical order.

    >>> vocabulary_of(["a man walks", "a woman walks"], at_least=2)
    ('a', 'walks')
    """
    found = Counter(word for sentence in sentences for word in words_of(sentence))
    return tuple(sorted(word for word, times in found.items() if times >= at_least))


class TextEncoder(nn.Module, ABC):
    """Anything that encodes sentences; `width` is E, the numbers of a token and of a sentence."""

    width: int

    @abstractmethod
    def encode(self, texts: Sequence[str]) -> EncodedText:
        """Vectors of sentences, on the device of the encoder."""

    def forward(self, texts: Sequence[str]) -> EncodedText:
        """The same."""
        return self.encode(texts)


class _WordEncoder(TextEncoder):
    """A start token and one token per word, each a vector that a subclass gives it, through a transformer."""

    def __init__(
        self, width: int, layers: int, heads: int, dropout: float, feedforward: int | None, pooling: Literal["mean", "first"]
    ) -> None:
        super().__init__()
        if pooling not in ("mean", "first"):
            raise ValueError(f"pooling is {pooling!r}; expected 'mean' or 'first'")
        self.width, self.pooling = width, pooling
        self.dropout = Dropout(dropout)
        self.encoder = Encoder(width, layers, heads, feedforward or 2 * width, dropout)

    @abstractmethod
    def _number(self, word: str) -> int:
        """Of a word or special token; padding has 0."""

    @abstractmethod
    def _embed(self, numbers: Int[Tensor, "B L"]) -> Float[Tensor, "B L E"]:
        """Vectors of words; on their device."""

    def numbers(self, texts: Sequence[str]) -> Int[Tensor, "B L"]:
        """Of the start and the words of sentences, on the CPU; shorter sentences end in zeros.

        Raises:
            ValueError: a single string instead of several, or none.
        """
        if isinstance(texts, str) or not texts:
            raise ValueError(f"texts is {texts!r}; expected a sequence of at least one sentence")
        number = self._number
        rows = [[number(START), *map(number, words_of(text)[:LONGEST])] for text in texts]
        length = max(map(len, rows))
        return torch.tensor([row + [0] * (length - len(row)) for row in rows])

    def encode(self, texts: Sequence[str]) -> EncodedText:
        """Vectors of sentences, on the device of the encoder. An empty sentence has its start token alone.

        Raises:
            ValueError: a single string instead of several, or none.
        """
        numbers = self.numbers(texts).to(next(self.parameters()).device)
        mask, x = numbers != 0, self._embed(numbers)
        x = self.dropout(x + sinusoids(torch.arange(x.shape[1], device=x.device), self.width).to(x))
        tokens = self.encoder(x, mask)
        weight = mask[..., None].to(tokens)
        pooled = tokens[:, 0] if self.pooling == "first" else (tokens * weight).sum(1) / weight.sum(1)
        return EncodedText(tokens, mask, pooled)


class WordTransformer(_WordEncoder):
    """A learned vector for each word of a vocabulary, through a transformer.

    The vocabulary is a tensor of the state, so that weights and words cannot part. Own choice, for small data without CLIP: no
    paper here learns its words.

    Args:
        vocabulary: words as `words_of` splits them. All others share one token.
        width: E, an even multiple of `heads`.
        layers: of the transformer; with 0 a sentence is a bag of words with their places.
        heads, dropout: of the transformer.
        feedforward: hidden width; None = 2 width.
        pooling: a sentence is the mean of its tokens, or the start token.
        forget: share of the words that training replaces by the shared token, which otherwise learns nothing.

    Raises:
        ValueError: no word, one twice, or one that `words_of` would split or change.
    """

    def __init__(
        self,
        vocabulary: Sequence[str],
        width: int = 128,
        layers: int = 2,
        heads: int = 4,
        dropout: float = 0.1,
        feedforward: int | None = None,
        pooling: Literal["mean", "first"] = "mean",
        forget: float = 0.0,
    ) -> None:
        super().__init__(width, layers, heads, dropout, feedforward, pooling)
        if wrong := [word for word in vocabulary if words_of(word) != [word]]:
            raise ValueError(f"vocabulary has {wrong[0]!r}; expected words in lower case, without spaces or punctuation")
        if not 0 < len(set(vocabulary)) == len(vocabulary):
            raise ValueError(f"vocabulary has {len(vocabulary)} words, {len(set(vocabulary))} different; expected each once")
        self.forget = forget
        self.spelling: Tensor
        self.register_buffer("spelling", torch.frombuffer(bytearray("\n".join(vocabulary).encode()), dtype=torch.uint8).clone())
        self._learn_numbers(vocabulary)
        self.words = nn.Embedding(len(self._numbers), width)

    @staticmethod
    def vocabulary_in(state: Mapping[str, Tensor], prefix: str = "") -> tuple[str, ...]:
        """The words that saved weights are of, to build the encoder with.

        Args:
            state: of the encoder, or of a network that holds it.
            prefix: what the encoder's names begin with there.
        """
        return tuple(bytes(state[f"{prefix}spelling"].tolist()).decode().split("\n"))

    @property
    def vocabulary(self) -> tuple[str, ...]:
        """Its words."""
        return tuple(self._numbers)[3:]

    def _learn_numbers(self, vocabulary: Sequence[str]) -> None:
        self._numbers = {word: number for number, word in enumerate([PADDING, START, UNKNOWN, *vocabulary])}

    def _load_from_state_dict(self, state_dict: Mapping[str, Tensor], prefix: str, *others: Any) -> None:
        super()._load_from_state_dict(state_dict, prefix, *others)
        self._learn_numbers(self.vocabulary_in({"spelling": self.spelling}))

    def _number(self, word: str) -> int:
        return self._numbers.get(word, 2)

    def _embed(self, numbers: Int[Tensor, "B L"]) -> Float[Tensor, "B L E"]:
        if self.training and self.forget:
            forgotten = (torch.rand(numbers.shape, device=numbers.device) < self.forget) & (numbers > 1)
            numbers = numbers.masked_fill(forgotten, 2)
        return self.words(numbers)


class HashedNgrams(_WordEncoder):
    """A word is the mean of the learned vectors of its groups of three letters, so that unseen words have vectors, too.

    "walks" has <wa, wal, alk, lks, ks>, as has most of "walking". Which vector a group has is its CRC-32 modulo `buckets`: the
    same on every machine. Source: fastText (Bojanowski et al. 2017) hashes groups of letters; own choice: threes alone.

    Args:
        buckets: number of learned vectors; groups that share one are not told apart.
        width: E, an even multiple of `heads`.
        layers, heads, dropout, feedforward, pooling: as in `WordTransformer`.

    Raises:
        ValueError: no bucket.
    """

    def __init__(
        self,
        buckets: int = 4096,
        width: int = 128,
        layers: int = 2,
        heads: int = 4,
        dropout: float = 0.1,
        feedforward: int | None = None,
        pooling: Literal["mean", "first"] = "mean",
    ) -> None:
        super().__init__(width, layers, heads, dropout, feedforward, pooling)
        if buckets < 1:
            raise ValueError(f"buckets is {buckets}; expected at least 1")
        self.buckets = buckets
        self.groups = nn.EmbeddingBag(buckets, width, mode="mean")
        self._numbers: dict[str, int] = {}  # of all words met
        self._hashes: list[list[int]] = []
        self._number(PADDING)

    def hashes(self, word: str) -> list[int]:
        """Buckets of a word's groups of three letters, its ends marked.

        >>> HashedNgrams(1000, width=8).hashes("go")  # <go, go>
        [623, 52]
        """
        marked = f"<{word}>"
        return [zlib.crc32(marked[i : i + 3].encode()) % self.buckets for i in range(len(marked) - 2)]

    def _number(self, word: str) -> int:
        if word not in self._numbers:
            self._numbers[word] = len(self._hashes)
            self._hashes.append(self.hashes(word))
        return self._numbers[word]

    def _embed(self, numbers: Int[Tensor, "B L"]) -> Float[Tensor, "B L E"]:
        different, place = numbers.unique(return_inverse=True)  # each word is averaged once
        hashes = [self._hashes[number] for number in different.tolist()]
        order = sorted(range(len(hashes)), key=hashes.__getitem__)  # sums must not depend on which words were met earlier
        starts = torch.tensor([0, *(len(hashes[i]) for i in order[:-1])]).cumsum(0).to(numbers.device)
        together = torch.tensor([h for i in order for h in hashes[i]]).to(numbers.device)
        return self.groups(together, starts)[torch.tensor(order).argsort().to(numbers.device)[place]]
