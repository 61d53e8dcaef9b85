"""Sentences and motions in one space: what judges a generator, and what a generator may be trained with."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from mwlib.networks.matching import UNIT, MotionEncoder, MovementEncoder, SentenceEncoder
from mwlib.text_to_motion.matching_clips import Vocabulary
from mwlib.text_to_motion.matching_config import Config, MatchingConfig
from mwlib.text_to_motion.statistics import Statistics
from mwlib.text_to_motion.tagged_words import TaggedVocabulary

CHUNK = 256  # clips or sentences embedded together


class MatchingNetwork(nn.Module):
    """The two encoders that are trained to match, and the vectors of the words.

    Args:
        words: vectors.
        text: embeds sentences.
        motion: embeds codes of motions.
    """

    def __init__(self, words: nn.Embedding, text: SentenceEncoder, motion: MotionEncoder) -> None:
        super().__init__()
        self.words, self.text, self.motion = words, text, motion

    @classmethod
    def untrained(cls, model: MatchingConfig, words: int) -> MatchingNetwork:
        """The network that a configuration names, for so many words."""
        vectors = nn.Embedding(words, model.word_width)
        text = SentenceEncoder(model.word_width, model.text_width, model.embedding)
        return cls(vectors, text, MotionEncoder(model.code_width, model.motion_width, model.embedding))

    def forward(
        self, words: Int[Tensor, "B L"], counts: Int[Tensor, " B"], codes: Float[Tensor, "B U C"], units: Int[Tensor, " B"]
    ) -> tuple[Float[Tensor, "B E"], Float[Tensor, "B E"]]:
        """Embeddings of sentences and of motions."""
        return self.text(self.words(words), counts), self.motion(codes, units)


def make_movement(model: MatchingConfig, features: int) -> MovementEncoder:
    """The untrained movement encoder that a configuration names."""
    return MovementEncoder(features, model.code_width, model.code_width, model.dropout)


class Matcher:
    """Trained encoders, frozen, with the statistics and the words that they were trained with.

    Motions come in as raw features; the matcher scales them itself, so that nobody can forget it or take another model's scale.
    Weights are frozen, but gradients pass to the motion: as a critic it may take part in a loss.

    Args:
        network: of sentences and motions.
        movement: codes of motions.
        statistics: scales features.
        vocabulary: numbers words; a `TaggedVocabulary` tells their parts of speech, too.
    """

    def __init__(
        self,
        network: MatchingNetwork,
        movement: MovementEncoder,
        statistics: Statistics,
        vocabulary: Vocabulary | TaggedVocabulary,
    ) -> None:
        self.network, self.movement = network.eval().requires_grad_(False), movement.eval().requires_grad_(False)
        self.statistics, self.vocabulary = statistics, vocabulary

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> Matcher:
        """The matcher that a finished training left (see `mwlib.training.read_model`)."""
        statistics = Statistics.from_tensors(cfg.model.statistics, learnt)
        vocabulary = Vocabulary(json.loads(about["vocabulary"]), cfg.model.words)
        with torch.random.fork_rng([]):  # initial weights are drawn and thrown away
            network = MatchingNetwork.untrained(cfg.model, len(vocabulary))
            movement = make_movement(cfg.model, statistics.layout.width)
        network.load_state_dict(weights)
        movement.load_state_dict({name: learnt[f"movement.{name}"] for name in movement.state_dict()})
        return cls(network, movement, statistics, vocabulary)

    @property
    def device(self) -> torch.device:
        """Where it lives."""
        return self.network.words.weight.device

    def to(self, device: torch.device | str) -> Matcher:
        """Move the networks."""
        self.network.to(device)
        self.movement.to(device)
        return self

    def embed_motion(self, features: Float[Tensor, "B T D"], lengths: Int[Tensor, " B"]) -> Float[Tensor, "B E"]:
        """Embeddings of motions, on the matcher's device; gradients pass to the features.

        A clip counts up to its last whole movement of 4 frames. What stands beyond, be it NaN, changes nothing.

        Args:
            features: raw, in the units of their layout, not normalised.
            lengths: frames of each clip.

        Raises:
            ValueError: another width, or a clip has fewer than 4 frames, or more than there are.
        """
        width = self.statistics.layout.width
        if features.shape[-1] != width or int(lengths.min()) < UNIT or int(lengths.max()) > features.shape[1]:
            found = f"features are {tuple(features.shape)}, lengths {int(lengths.min())} to {int(lengths.max())}"
            raise ValueError(f"{found}; expected (B, T, {width}) and lengths from {UNIT} to T")
        scaled = self.statistics.scale(features.to(self.device, torch.float32)).values
        return self.network.motion(*self.movement.codes(scaled, lengths))

    @torch.no_grad()
    def embed_text(self, texts: Sequence[str]) -> Float[Tensor, "B E"]:
        """Embeddings of sentences, on the matcher's device. Words that it never saw count as one unknown word.

        Raises:
            ValueError: there is no sentence; or one without parts of speech, where the vocabulary tells these.
        """
        if isinstance(texts, str) or not texts:
            raise ValueError(f"texts is {texts!r}; expected a list of sentences")
        found = []
        for first in range(0, len(texts), CHUNK):
            words, counts, *parts = self.vocabulary.ids(texts[first : first + CHUNK])
            told = (part.to(self.device) for part in parts)
            found.append(self.network.text(self.network.words(words.to(self.device)), counts, *told))
        return torch.cat(found)

    @torch.no_grad()
    def embed_motions(self, motions: Sequence[Float[Tensor, "_ D"]]) -> Float[Tensor, "N E"]:
        """Embeddings of motions of any lengths, raw features each, on the CPU."""
        found = []
        for first in range(0, len(motions), CHUNK):
            rows = list(motions[first : first + CHUNK])
            x = nn.utils.rnn.pad_sequence(rows, batch_first=True)
            found.append(self.embed_motion(x, torch.tensor([len(row) for row in rows])).cpu())
        return torch.cat(found)
