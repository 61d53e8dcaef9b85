"""Evaluators and critics: trained here, shipped with the package, or published by others.

The published one is that of papers on HumanML3D and KIT-ML, read from its authors' files. Source: Guo et al. 2022 and its code
(`EvaluatorModelWrapper`, `WordVectorizer`). The files stay where they are; nothing in them is run.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from mwlib.data.formats.humanml import FeatureLayout
from mwlib.data.formats.pickles import unpickle_words
from mwlib.data.normalisation import WEIGHT, Statistics
from mwlib.data.untrusted import SMALL_TEXT, MotionFormatError, bounded, open_regular, read_array, read_bytes, read_text
from mwlib.matching.clips import PARTS, TaggedVocabulary, Vocabulary
from mwlib.matching.config import Config, MatchingConfig
from mwlib.networks.matching import UNIT, WINDOW, MotionEncoder, MovementEncoder, SentenceEncoder, published_weights
from mwlib.paths import CONFIG, run_folder
from mwlib.training import read_run, with_weights
from mwlib.training.checkpoint import part

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
        window: frames to which motions are padded, see `MovementEncoder.codes`; 0: more than the longest has.
    """

    def __init__(
        self,
        network: MatchingNetwork,
        movement: MovementEncoder,
        statistics: Statistics,
        vocabulary: Vocabulary | TaggedVocabulary,
        window: int = 0,
    ) -> None:
        self.network, self.movement = network.eval().requires_grad_(False), movement.eval().requires_grad_(False)
        self.statistics, self.vocabulary, self.window = statistics, vocabulary, window

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> Matcher:
        """The matcher that a finished training left (see `mwlib.training.read_model`)."""
        statistics = Statistics.from_tensors(cfg.model.statistics, learnt)
        vocabulary = Vocabulary(json.loads(about["vocabulary"]), cfg.model.words)
        network = with_weights(lambda: MatchingNetwork.untrained(cfg.model, len(vocabulary)), weights)
        movement = with_weights(lambda: make_movement(cfg.model, statistics.layout.width), part(learnt, "movement."))
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
            ValueError: another width, or a clip has fewer than 4 frames, or more than there are or than the window has.
        """
        width = self.statistics.layout.width
        if features.shape[-1] != width or int(lengths.min()) < UNIT or int(lengths.max()) > features.shape[1]:
            found = f"features are {tuple(features.shape)}, lengths {int(lengths.min())} to {int(lengths.max())}"
            raise ValueError(f"{found}; expected (B, T, {width}) and lengths from {UNIT} to T")
        scaled = self.statistics.normalise(features.to(self.device, torch.float32))
        return self.network.motion(*self.movement.codes(scaled, lengths, self.window))

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


META = ("Comp_v6_KLD01/meta/", "Comp_v6_KLD005/meta/")  # where the authors' archives of HumanML3D and KIT-ML have statistics
CHECKPOINTS = "the checkpoints that https://github.com/EricGuo5513/text-to-motion links"
GLOVE = "glove.zip, which https://github.com/EricGuo5513/text-to-motion links"


class _Wanted(NamedTuple):
    """A file: where it may lie in the folder, the first place being the one to advise; and where people get it."""

    places: tuple[str, ...]
    origin: str


def _statistics(name: str) -> _Wanted:
    return _Wanted((f"{name}.npy", *(f"{meta}{name}.npy" for meta in META), f"t2m_{name}.npy", f"kit_{name}.npy"), CHECKPOINTS)


def _words(name: str, *others: str) -> _Wanted:
    return _Wanted(tuple(folder + file for file in (name, *others) for folder in ("", "glove/")), GLOVE)


FILES = {
    "weights": _Wanted(("text_mot_match/model/finest.tar", "finest.tar"), CHECKPOINTS),
    "mean": _statistics("mean"),
    "deviation": _statistics("std"),
    "vectors": _words("our_vab_data.npy"),
    "words": _words("our_vab_words.pkl", "our_vab_words.txt"),
    "rows": _words("our_vab_idx.pkl"),
}


def published_files(folder: Path) -> dict[str, Path]:
    """Those files of a published evaluator that a folder has, by what they hold; none: it is another folder."""
    places = {part: (folder / place for place in wanted.places) for part, wanted in FILES.items()}
    found = {part: next((file for file in files if file.is_file()), None) for part, files in places.items()}
    return {part: file for part, file in found.items() if file is not None}


def open_published(folder: Path) -> Matcher:
    """The published evaluator, frozen, on the CPU.

    It reads captions with parts of speech, see `TaggedVocabulary`, and scales motions by its own mean and deviation: the
    deviations of root and contacts are 25 times smaller than in the collection's Std.npy. It warns where they are not. As
    published it pads motions to 196 frames, and reads none that are longer.

    Args:
        folder: with ``text_mot_match/model/finest.tar``, ``mean.npy``, ``std.npy``, ``our_vab_data.npy``, ``our_vab_words.pkl``
            and ``our_vab_idx.pkl``; other places are in `FILES`. A text ``our_vab_words.txt`` will do for the two pickles: a word
            a line, in the order of the vectors.

    Raises:
        FileNotFoundError: some of the files are missing; the message names each, where it comes from and where it belongs.
        MotionFormatError: a file is malformed; a pickle holds anything but words and whole numbers.
        ValueError: the files do not belong together.
    """
    files = published_files(folder)
    needed = [part for part in FILES if part != "rows" or "words" not in files or files["words"].suffix != ".txt"]
    if missing := [f"{folder / FILES[part].places[0]} (from {FILES[part].origin})" for part in needed if part not in files]:
        raise FileNotFoundError(f"the published evaluator in {folder} is not whole; missing: {'; '.join(missing)}")
    text, motion, movement = published_weights(files["weights"])
    statistics = Statistics.read(files["mean"], files["deviation"], "evaluator")
    words, vectors = _vocabulary(files)
    found = {
        "features": (movement.features, statistics.layout.width),
        "numbers of a word": (text.input_emb.in_features, vectors.shape[1]),
        "parts of speech": (text.parts_of_speech, len(PARTS)),
    }
    for name, (own, other) in found.items():
        if own != other:
            raise ValueError(f"{files['weights']} has {own} {name}; expected {other}, as the files beside it")
    _warn_of_other_statistics(statistics, files["deviation"])
    network = MatchingNetwork(nn.Embedding.from_pretrained(vectors), text, motion)
    return Matcher(network, movement, statistics, TaggedVocabulary(words), WINDOW)


def _vocabulary(files: dict[str, Path]) -> tuple[list[str], Float[Tensor, "V W"]]:
    """Words, and their vectors in the same order."""
    with open_regular(files["vectors"]) as stream:
        vectors = read_array(stream, files["vectors"], "array")
    if vectors.ndim != 2 or vectors.dtype.kind != "f":
        found = f"{vectors.dtype} of shape {vectors.shape}"
        raise MotionFormatError(files["vectors"], "array", found, "numbers of shape (words, 300)")
    vectors = bounded(vectors, files["vectors"], "array").astype(np.float32)
    if files["words"].suffix == ".txt":
        words = read_text(files["words"], SMALL_TEXT).split()
        rows = dict(zip(words, range(len(words)), strict=True))
    else:
        words, rows = (unpickle_words(read_bytes(files[part], SMALL_TEXT), files[part]) for part in ("words", "rows"))
    if not isinstance(words, list) or not isinstance(rows, dict):
        found = f"a {type(words).__name__}, and a {type(rows).__name__} in {files.get('rows')}"
        raise MotionFormatError(files["words"], "pickle", found, "a list, and a dictionary")
    wrong = [word for word in words if not 0 <= rows.get(word, -1) < len(vectors)]
    if wrong or not words:
        found = f"no row for {len(wrong)} of {len(words)} words{f', such as {wrong[0]!r}' if wrong else ''}"
        raise MotionFormatError(files["words"], "words", found, f"words with rows from 0 to {len(vectors) - 1}")
    return words, torch.from_numpy(vectors[[rows[word] for word in words]])


def _warn_of_other_statistics(statistics: Statistics, file: Path) -> None:
    """Contacts are 0 or 1, so that their mean tells what their deviation was before it was divided."""
    contacts = statistics.layout.blocks["contacts"]
    mean = statistics.mean[contacts].clamp(0, 1)
    weight = float((mean * (1 - mean)).sqrt().mean() / statistics.deviation[contacts].mean())
    if not 0.5 < weight / WEIGHT["evaluator"] < 2:  # own choice: 25.0 in both published pairs; Std.npy has 1
        warnings.warn(
            f"{file} divides the deviation of contacts by {weight:.3g}; expected {WEIGHT['evaluator']:g}, as in the evaluator's "
            "own statistics: scores of motions scaled by others mean little",
            stacklevel=2,
        )


ADVICE = (
    "train one on your data with `mwlib train --system matching --set data=FOLDER` and name its folder, or name one with "
    "the files of the published evaluator"
)


def open_matcher(name: str, layout: FeatureLayout) -> Matcher:
    """A trained matching network, frozen, on the CPU.

    Args:
        name: folder of a finished run of "matching"; or one with the files of the published evaluator, see `open_published`; or
            "evaluator" or "critic", which come with the package and know the sentences and bodies of the synthetic people, or
            "cmu_evaluator" or "cmu_critic" for the CMU clips. A folder of that name comes first.
        layout: of the features that it is to judge.

    Raises:
        FileNotFoundError: there is no such model; the message says how to train one, or which published files are missing.
        MotionFormatError: a published file is malformed.
        ValueError: it judges other features, is a run of another system, or its config.yaml is not what trained it.
    """
    if published_files(Path(name)):
        matcher = open_published(Path(name))
    else:
        folder = finished_run(name, ADVICE)
        matcher = Matcher.from_tensors(*read_run(Config, folder))
    if matcher.statistics.layout != layout:
        raise ValueError(f"{name} judges {matcher.statistics.layout.name}; expected {layout.name}, as the clips have it")
    return matcher


def stands_on(name: str) -> list[str]:
    """What a judge's scores depend on: the files of the published evaluator, else the judge itself by its name."""
    return [str(file) for file in published_files(Path(name)).values()] or [name]


def finished_run(name: str, advice: str) -> Path:
    """The folder of a run, or of the model that comes with the package under this name.

    Args:
        name: of either.
        advice: what to do if there is neither.

    Raises:
        FileNotFoundError: there is neither.
    """
    folder = run_folder(name)
    if folder is None:
        raise FileNotFoundError(f"{name}/{CONFIG} is missing: no finished run there; {advice}")
    return folder
