"""The evaluator that papers on HumanML3D and KIT-ML share, from the files that its authors published.

Source: Guo et al. 2022 and its code (`EvaluatorModelWrapper`, `WordVectorizer`). The files stay where they are; nothing in
them is run.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from mwlib.data.archives import read_array
from mwlib.data.errors import MotionFormatError
from mwlib.data.formats.pickles import unpickle_words
from mwlib.data.opening import open_regular, read_bytes
from mwlib.data.reading import SMALL_TEXT, bounded, read_text
from mwlib.networks.matching import published_weights
from mwlib.text_to_motion.matching import Matcher, MatchingNetwork
from mwlib.text_to_motion.statistics import WEIGHT, Statistics
from mwlib.text_to_motion.tagged_words import PARTS, TaggedVocabulary

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
    deviations of root and contacts are 25 times smaller than in the collection's Std.npy. It warns where they are not.

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
    statistics = Statistics.of_files(files["mean"], files["deviation"], "evaluator")
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
    return Matcher(network, movement, statistics, TaggedVocabulary(words))


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
