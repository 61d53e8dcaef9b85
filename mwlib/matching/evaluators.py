"""Evaluators and critics: trained here, shipped with the package, or published by others.

The published one is that of papers on HumanML3D and KIT-ML, read from its authors' files. Source: Guo et al. 2022 and its code
(`EvaluatorModelWrapper`, `WordVectorizer`). The files stay where they are; nothing in them is run. It reads words of its own
list and one of 15 parts of speech for each. Its code knows five kinds of words by lists of its own; a word of a list is of that
kind whatever its tag says.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.rnn import pad_sequence

from mwlib.data.formats.humanml import CaptionedClip, FeatureLayout, TaggedCaption
from mwlib.data.formats.pickles import unpickle_words
from mwlib.data.normalisation import WEIGHT, Statistics
from mwlib.data.untrusted import SMALL_TEXT, MotionFormatError, numbers, open_regular, read_array, read_bytes, read_text
from mwlib.matching.config import Config, MatchingConfig
from mwlib.networks.layers import Features, PerItem

from mwlib.networks.matching import (  # isort: skip
    UNIT, WINDOW, Codes, Embeddings, MotionEncoder, MovementEncoder, SentenceEncoder, published_weights,
)  # fmt: skip
from mwlib.networks.text import check_sentences, vocabulary_of, words_of
from mwlib.paths import CONFIG, run_folder
from mwlib.training import chunks, read_run, with_weights
from mwlib.training.checkpoint import part

CHUNK = 256  # clips or sentences embedded together
UNKNOWN, START, END, FIRST_WORD = 0, 1, 2, 3


class Vocabulary:
    """Words as numbers: 0 is any other word, 1 and 2 mark start and end of a sentence.

    Args:
        words: in the order of their numbers, which begin at 3.
        longest: words of a sentence that are read.

    >>> Vocabulary(["a", "man", "walks"], longest=20).ids(["A man walks.", "a dog"])
    (tensor([[1, 3, 4, 5, 2],
            [1, 3, 0, 2, 0]]), tensor([5, 4]))
    """

    padded = False  # whether the padding behind a sentence is read as unknown words, up to the longest that there can be

    def __init__(self, words: Sequence[str], longest: int) -> None:
        self.words, self.longest = tuple(words), longest
        self._number = {word: number for number, word in enumerate(self.words, FIRST_WORD)}

    @classmethod
    def of(cls, clips: Sequence[CaptionedClip], longest: int) -> "Vocabulary":
        """All words of the clips' captions."""
        return cls(vocabulary_of(caption for clip in clips for caption in clip.captions), longest)

    def __len__(self) -> int:
        return FIRST_WORD + len(self.words)

    def words_of(self, sentence: str) -> list[str]:
        """The words that are looked up."""
        return words_of(sentence)

    def ids(self, sentences: Sequence[str]) -> tuple[Tensor, ...]:
        """Numbers (B, L) of the words of each sentence, with start and end, and how many (B,) these are."""
        known = [[self._number.get(word, UNKNOWN) for word in self.words_of(text)[: self.longest]] for text in sentences]
        return self._table([[START, *row, END] for row in known], UNKNOWN)

    def _table(self, rows: Sequence[list[Any]], unknown: int | tuple[int, int]) -> tuple[Tensor, Tensor]:
        """Rows side by side, and their lengths; what stands after a row's own end is not read."""
        missing = [(2 + self.longest - len(row)) * self.padded for row in rows]
        filled = [torch.tensor(row + more * [unknown]) for row, more in zip(rows, missing, strict=True)]
        return pad_sequence(filled, batch_first=True), torch.tensor([*map(len, filled)])


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


class TaggedVocabulary(Vocabulary):
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
        super().__init__(words, LONGEST)
        self._number = {word: number for number, word in enumerate(self.words)}
        if UNKNOWN_WORD not in self._number:
            raise ValueError(f"{UNKNOWN_WORD!r} is not among the {len(self.words)} words; expected it, for those that are not")

    def words_of(self, sentence: str) -> list[str]:
        """The words that are looked up: those that the collection made of a caption.

        Raises:
            ValueError: the caption has no parts of speech.
        """
        return [word for word, _ in _tagged(sentence)]

    def ids(self, sentences: Sequence[str]) -> tuple[Tensor, ...]:
        """As `Vocabulary.ids`, and one-hot parts of speech (B, L, P).

        Raises:
            ValueError: as `words_of`.
        """
        marked = [[(START_WORD, OTHER), *_tagged(text)[:LONGEST], (END_WORD, OTHER)] for text in sentences]
        rows = [[self._looked_up(*pair) for pair in caption] for caption in marked]
        table, counts = self._table(rows, self._looked_up(UNKNOWN_WORD, OTHER))
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
    def untrained(cls, model: MatchingConfig, words: int) -> "MatchingNetwork":
        """The network that a configuration names, for so many words."""
        vectors = nn.Embedding(words, model.word_width)
        text = SentenceEncoder(model.word_width, model.text_width, model.embedding)
        return cls(vectors, text, MotionEncoder(model.code_width, model.motion_width, model.embedding))

    def forward(self, words: Int[Tensor, "B L"], counts: PerItem, codes: Codes, units: PerItem) -> tuple[Embeddings, Embeddings]:
        """Embeddings of sentences and of motions."""
        return self.text(self.words(words), counts), self.motion(codes, units)


def make_movement(model: MatchingConfig, features: int) -> MovementEncoder:
    """The untrained movement encoder that a configuration names."""
    return MovementEncoder(features, model.code_width, model.code_width, model.dropout)


class Matcher(nn.Module):
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
        self, network: MatchingNetwork, movement: MovementEncoder, statistics: Statistics, vocabulary: Vocabulary, window: int = 0
    ) -> None:
        super().__init__()
        self.network, self.movement = network, movement
        self.statistics, self.vocabulary, self.window = statistics, vocabulary, window
        self.eval().requires_grad_(False)

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> "Matcher":
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

    def embed_motion(self, features: Features, lengths: PerItem) -> Embeddings:
        """Embeddings of motions, on the matcher's device; gradients pass to the features.

        A clip counts up to its last whole movement of 4 frames. What stands beyond, be it NaN, changes nothing.

        Args:
            features: raw, in the units of their layout, not normalised.
            lengths: frames of each clip.

        Raises:
            ValueError: another width, or a clip has fewer than 4 frames, or more than there are or than the window has.
        """
        width, least, most = self.statistics.layout.width, int(lengths.min()), int(lengths.max())
        if features.shape[-1] != width or least < UNIT or most > features.shape[1]:
            found = f"features are {tuple(features.shape)}, lengths {least} to {most}"
            raise ValueError(f"{found}; expected (B, T, {width}) and lengths from {UNIT} to T")
        scaled = self.statistics.normalise(features.to(self.device, torch.float32))
        return self.network.motion(*self.movement.codes(scaled, lengths, self.window))

    @torch.no_grad()
    def embed_text(self, texts: Sequence[str]) -> Embeddings:
        """Embeddings of sentences, on the matcher's device. Words that it never saw count as one unknown word.

        Raises:
            ValueError: there is no sentence; or one without parts of speech, where the vocabulary tells these.
        """
        check_sentences(texts)
        found = []
        for chunk in chunks(len(texts), CHUNK):
            words, *told = (part.to(self.device) for part in self.vocabulary.ids(texts[chunk]))
            found.append(self.network.text(self.network.words(words), *told))
        return torch.cat(found)

    @torch.no_grad()
    def embed_motions(self, motions: Sequence[Float[Tensor, "_ D"]]) -> Float[Tensor, "N E"]:
        """Embeddings of motions of any lengths, raw features each, on the CPU."""
        found = []
        for chunk in chunks(len(motions), CHUNK):
            rows = list(motions[chunk])
            x = pad_sequence(rows, batch_first=True)
            found.append(self.embed_motion(x, torch.tensor([*map(len, rows)])).cpu())
        return torch.cat(found)


META = ("Comp_v6_KLD01/meta/", "Comp_v6_KLD005/meta/")  # where the authors' archives of HumanML3D and KIT-ML have statistics
CHECKPOINTS = "the checkpoints that https://github.com/EricGuo5513/text-to-motion links"
GLOVE = "glove.zip, which https://github.com/EricGuo5513/text-to-motion links"


_STATISTICS = ["{}.npy", *(meta + "{}.npy" for meta in META), "t2m_{}.npy", "kit_{}.npy"]
# Of each file where people get it, and where it may lie in the folder; the first place is the one to advise.
FILES = {
    "weights": (CHECKPOINTS, "text_mot_match/model/finest.tar", "finest.tar"),
    "mean": (CHECKPOINTS, *(place.format("mean") for place in _STATISTICS)),
    "deviation": (CHECKPOINTS, *(place.format("std") for place in _STATISTICS)),
    "vectors": (GLOVE, "our_vab_data.npy", "glove/our_vab_data.npy"),
    "words": (GLOVE, *(f"{folder}our_vab_words.{kind}" for kind in ("pkl", "txt") for folder in ("", "glove/"))),
    "rows": (GLOVE, "our_vab_idx.pkl", "glove/our_vab_idx.pkl"),
}


def published_files(folder: Path) -> dict[str, Path]:
    """Those files of a published evaluator that a folder has, by what they hold; none: it is another folder."""
    places = {part: [folder / place for place in places] for part, (_, *places) in FILES.items()}
    return {part: file for part, files in places.items() for file in [*filter(Path.is_file, files)][:1]}


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
    if missing := [f"{folder / FILES[part][1]} (from {FILES[part][0]})" for part in needed if part not in files]:
        raise FileNotFoundError(f"the published evaluator in {folder} is not whole; missing: {'; '.join(missing)}")
    text, motion, movement = published_weights(files["weights"])
    statistics = Statistics.read(files["mean"], files["deviation"], "evaluator")
    words, vectors = _vocabulary(files)
    own = movement.features, text.input_emb.in_features, text.parts_of_speech
    beside = statistics.layout.width, vectors.shape[1], len(PARTS)
    if own != beside:
        sizes = "features, numbers of a word and parts of speech"
        raise ValueError(f"{files['weights']} has {own} {sizes}; expected {beside}, as the files beside it")
    _warn_of_other_statistics(statistics, files["deviation"])
    network = MatchingNetwork(nn.Embedding.from_pretrained(vectors), text, motion)
    return Matcher(network, movement, statistics, TaggedVocabulary(words), WINDOW)


def _vocabulary(files: dict[str, Path]) -> tuple[list[str], Float[Tensor, "V W"]]:
    """Words, and their vectors in the same order."""
    file = files["vectors"]
    with open_regular(file) as stream:
        array = read_array(stream, file, "array")
    fits = array.ndim == 2 and array.dtype.kind == "f"
    vectors = numbers(array, fits, file, "array", "numbers of shape (words, 300)").astype(np.float32)
    if files["words"].suffix == ".txt":
        words = read_text(files["words"], SMALL_TEXT).split()
        rows = {word: row for row, word in enumerate(words)}
    else:
        words, rows = (unpickle_words(read_bytes(files[part], SMALL_TEXT), files[part]) for part in ("words", "rows"))
    if not isinstance(words, list) or not isinstance(rows, dict):
        found = f"a {type(words).__name__}, and a {type(rows).__name__} in {files.get('rows')}"
        raise MotionFormatError(files["words"], "pickle", found, "a list, and a dictionary")
    wrong = [word for word in words if not 0 <= rows.get(word, -1) < len(vectors)]
    if wrong or not words:
        found = f"no row for {len(wrong)} of {len(words)} words, such as {wrong[:3]}"
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
        matcher = Matcher.from_tensors(*read_run(Config, finished_run(name, ADVICE)))
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
