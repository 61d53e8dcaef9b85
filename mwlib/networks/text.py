"""Encoders of sentences: one vector for each word and one for the whole.

Two learn with the model that reads them; CLIP's text tower is frozen.
"""

from __future__ import annotations

import importlib
import re
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from mwlib.networks.layers import Dropout, Encoder, placed

PADDING, START, UNKNOWN = "<padding>", "<start>", "<unknown>"  # no word looks like these
LONGEST = 76  # words of a sentence that are read, those after them are not; with the start as many tokens as CLIP's
Numbers = Int[Tensor, "B L"]  # of words
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


def vocabulary_of(sentences: Iterable[str]) -> tuple[str, ...]:
    """All words, in alphabetical order.

    >>> vocabulary_of(["a man walks", "a woman walks"])
    ('a', 'man', 'walks', 'woman')
    """
    return tuple(sorted({word for sentence in sentences for word in words_of(sentence)}))


def check_sentences(texts: Sequence[str]) -> None:
    """Refuse what is no sequence of sentences.

    Raises:
        ValueError: a single string instead of several, or none.
    """
    if isinstance(texts, str) or not texts:
        raise ValueError(f"texts is {texts!r}; expected a sequence of at least one sentence")


class TextEncoder(nn.Module, ABC):
    """Anything that encodes sentences; `width` is E, the numbers of a token and of a sentence."""

    width: int

    @property
    def vocabulary(self) -> tuple[str, ...]:
        """The words that it knows; none, if it makes something of any word."""
        return ()

    def read(self, text: str) -> list[str]:
        """The words of a sentence that it looks at."""
        return "".join(letter if letter.isprintable() else " " for letter in text).split()

    @abstractmethod
    def forward(self, texts: Sequence[str]) -> EncodedText:
        """Vectors of sentences, on the device of the encoder."""


class _WordEncoder(TextEncoder):
    """A start token and one token per word, each a vector that a subclass gives it, through a transformer."""

    def __init__(self, width: int, layers: int = 2, heads: int = 4, dropout: float = 0.1) -> None:
        super().__init__()
        self.width, self.dropout = width, Dropout(dropout)
        self.encoder = Encoder(width, layers, heads, 2 * width, dropout)

    def read(self, text: str) -> list[str]:
        """The words of a sentence that it looks at: those behind the first 76 are not read."""
        return words_of(text)[:LONGEST]

    @abstractmethod
    def _number(self, word: str) -> int:
        """Of a word or special token; padding has 0."""

    @abstractmethod
    def _embed(self, numbers: Numbers) -> Float[Tensor, "B L E"]:
        """Vectors of words; on their device."""

    def numbers(self, texts: Sequence[str]) -> Numbers:
        """Of the start and the words of sentences, on the CPU; shorter sentences end in zeros.

        Raises:
            ValueError: a single string instead of several, or none.
        """
        check_sentences(texts)
        return _filled([[self._number(word) for word in (START, *self.read(text))] for text in texts])

    def forward(self, texts: Sequence[str]) -> EncodedText:
        """Vectors of sentences, on the device of the encoder. An empty sentence has its start token alone.

        Raises:
            ValueError: a single string instead of several, or none.
        """
        return self.encode_numbers(self.numbers(texts).to(next(self.parameters()).device))

    def encode_numbers(self, numbers: Numbers) -> EncodedText:
        """The same of sentences whose words have been looked up, as `numbers` gives them."""
        mask, x = numbers != 0, self._embed(numbers)
        tokens = self.encoder(self.dropout(placed(x)), mask)
        weight = mask[..., None].to(tokens)
        return EncodedText(tokens, mask, (tokens * weight).sum(1) / weight.sum(1))


class WordTransformer(_WordEncoder):
    """A learned vector for each word of a vocabulary, through a transformer.

    The vocabulary is a tensor of the state, so that weights and words cannot part. Own choice, for small data without CLIP: no
    paper here learns its words.

    Args:
        vocabulary: words as `words_of` splits them. All others share one token.
        width: E, an even multiple of `heads`.
        forget: share of the words that training replaces by the shared token, which otherwise learns nothing.
        transformer: layers (with 0 a sentence is a bag of words with their places), heads and dropout.

    Raises:
        ValueError: no word, one twice, or one that `words_of` would split or change.
    """

    def __init__(self, vocabulary: Sequence[str], width: int = 128, forget: float = 0.0, **transformer: Any) -> None:
        super().__init__(width, **transformer)
        plain = {word for word in vocabulary if words_of(word) == [word]}
        if not 0 < len(plain) == len(vocabulary):
            found = (
                f"{len(vocabulary)} words, {len(plain)} of them plain and different, others are {[*{*vocabulary} - plain][:3]}"
            )
            raise ValueError(f"vocabulary has {found}; expected each once, in lower case, without spaces or punctuation")
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

    def _embed(self, numbers: Numbers) -> Float[Tensor, "B L E"]:
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
        transformer: layers, heads and dropout, as in `WordTransformer`.
    """

    def __init__(self, buckets: int = 4096, width: int = 128, **transformer: Any) -> None:
        super().__init__(width, **transformer)
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

    def _embed(self, numbers: Numbers) -> Float[Tensor, "B L E"]:
        hashes = [self._hashes[number] for number in numbers.flatten().tolist()]
        starts = torch.tensor([0, *map(len, hashes[:-1])]).cumsum(0)
        together = self.groups(torch.tensor([h for own in hashes for h in own]).to(numbers.device), starts.to(numbers.device))
        return together.unflatten(0, numbers.shape)


CLIP_CONTEXT = 77  # tokens of CLIP, start and end included
CLIP_SOURCE = "https://huggingface.co/openai/clip-vit-base-patch32"
CLIP_KEPT = 10_000  # sentences whose vectors are held, as the tower is slow on a CPU (12 layers) and never changes
CLIP_FILES = (("config.json",), ("model.safetensors", "pytorch_model.bin"), ("tokenizer.json", "vocab.json"))  # one of each


class _Tower:
    """Weights that many copies of an encoder share, and that no optimiser, average or checkpoint meets."""

    def __init__(self, network: Any, tokenizer: Any) -> None:
        self.network, self.tokenizer = network, tokenizer
        self.known: dict[str, tuple[Tensor, Tensor]] = {}  # sentence -> its tokens and vector, on the CPU

    def __deepcopy__(self, memo: dict[int, Any]) -> _Tower:
        return self


class ClipText(TextEncoder):
    """Sentences by the text tower of CLIP ViT-B/32, which does not learn and is no part of a checkpoint: the folder is needed.

    `pooled` is the projected output at the end token, as MDM takes it; `tokens` are the outputs after the last norm, before the
    projection, as StableMoFusion takes them. A token of CLIP sees those before it only, so that padding changes neither.

    Source: Radford et al. 2021; the code of MDM (20 tokens between start and end) and of StableMoFusion (75, and its denoiser
    attends to the padding, too). Own choice: padding is masked unless asked for.

    Args:
        folder: holds the files of https://huggingface.co/openai/clip-vit-base-patch32.
        longest: tokens between start and end that are kept, at most 75; 20 as MDM, 75 as StableMoFusion.
        padded: give all 77 places as tokens, padding as CLIP encodes it, as StableMoFusion does.

    Raises:
        ImportError: the library is missing; the message says how to install it.
        FileNotFoundError: a file is missing; the message says where to get it and where to put it.
        ValueError: the folder holds another tower or lacks weights.
    """

    def __init__(self, folder: str | Path, longest: int = 20, padded: bool = False) -> None:
        super().__init__()
        self.longest, self.padded = longest, padded
        self._tower = _opened(Path(folder))
        config = self._tower.network.config
        self.width = int(config.hidden_size)
        if config.projection_dim != self.width:
            found = f"{self.width} numbers per token and {config.projection_dim} per sentence"
            raise ValueError(f"{folder} holds a tower of {found}; expected that of ViT-B/32, 512 and 512")

    def _apply(self, fn: Any, recurse: bool = True) -> ClipText:
        self._tower.network._apply(fn, recurse)  # .to(device) moves the tower
        return super()._apply(fn, recurse)

    def ids(self, texts: Sequence[str]) -> list[list[int]]:
        """Numbers of CLIP's tokens: start, at most `longest` others, end."""
        return self._tower.tokenizer(list(texts), truncation=True, max_length=self.longest + 2)["input_ids"]

    def forward(self, texts: Sequence[str]) -> EncodedText:
        """Vectors of sentences, on the device of the tower.

        Raises:
            ValueError: a single string instead of several, or none.
        """
        check_sentences(texts)
        known, device = self._tower.known, self._tower.network.device
        if new := [text for text in dict.fromkeys(texts) if text not in known]:
            known |= self._encode_new(new)
        rows, pooled = zip(*(known[text] for text in texts), strict=True)
        for text in [*known][: max(len(known) - CLIP_KEPT, 0)]:  # those that came first
            del known[text]
        tokens = nn.utils.rnn.pad_sequence([*rows], batch_first=True)
        mask = torch.arange(tokens.shape[1]) < torch.tensor([*map(len, rows)])[:, None]
        return EncodedText(*(part.to(device) for part in (tokens, mask, torch.stack(pooled))))

    @torch.no_grad()
    def _encode_new(self, texts: Sequence[str]) -> dict[str, tuple[Tensor, Tensor]]:
        rows = self.ids(texts)
        numbers = _filled(rows, CLIP_CONTEXT if self.padded else 0)  # as by OpenAI
        out = self._tower.network(input_ids=numbers.to(self._tower.network.device))
        told = zip(texts, rows, out.last_hidden_state.cpu(), out.text_embeds.cpu(), strict=True)
        return {text: (x[: None if self.padded else len(row)].clone(), pooled.clone()) for text, row, x, pooled in told}


def _filled(rows: Sequence[Sequence[int]], length: int = 0) -> Numbers:
    """Rows of one length, that of the longest or more, which end in zeros."""
    length = max(length, *map(len, rows))
    return torch.tensor([[*row, *[0] * (length - len(row))] for row in rows])


def _opened(folder: Path) -> _Tower:
    """Tower and tokenizer, from files alone, without the library's bar and its list of weights that are CLIP's other half."""
    try:
        library: Any = importlib.import_module("transformers")
    except ImportError as error:
        wanted = "which is not installed: pip install 'transformers>=4.50,<6'"
        raise ImportError(f"CLIP's text tower needs the library transformers, {wanted}") from error
    if missing := [" or ".join(names) for names in CLIP_FILES if not any((folder / name).is_file() for name in names)]:
        raise FileNotFoundError(
            f"{folder} has no {', no '.join(missing)}; expected CLIP ViT-B/32: fetch config.json, model.safetensors (or "
            f"pytorch_model.bin), vocab.json, merges.txt and tokenizer.json from {CLIP_SOURCE} into that folder"
        )
    logging = library.utils.logging
    level, had_bar = logging.get_verbosity(), logging.is_progress_bar_enabled()
    logging.set_verbosity_error()
    logging.disable_progress_bar()
    try:
        network, about = library.CLIPTextModelWithProjection.from_pretrained(
            folder, local_files_only=True, output_loading_info=True
        )
        tokenizer = library.CLIPTokenizer.from_pretrained(folder, local_files_only=True)
    finally:
        logging.set_verbosity(level)
        if had_bar:
            logging.enable_progress_bar()
    if missing := sorted(about["missing_keys"]):
        raise ValueError(
            f"{folder} has no weights for {missing[0]}, one of {len(missing)}; expected CLIP ViT-B/32 from {CLIP_SOURCE}"
        )
    return _Tower(network.float().eval().requires_grad_(False), tokenizer)
