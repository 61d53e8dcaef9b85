"""Yardsticks that need no training: a motion for each sentence, by looking it up or by ignoring it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from scipy.sparse import csr_array
from torch import Tensor

from mwlib.data.captions import CaptionedClip
from mwlib.networks.text import words_of

ROWS = 256  # sentences compared together: with all captions of HumanML3D they fill 140 MB


def nearest_caption(clips: Sequence[CaptionedClip], texts: Sequence[str]) -> list[int]:
    """For each sentence the clip with a caption that shares most words with it: cosine of word counts; of equals the first.

    >>> clips = [CaptionedClip(np.zeros((40, 263), np.float32), (text,)) for text in ("a person walks", "a person runs fast")]
    >>> nearest_caption(clips, ["a man runs"])
    [1]
    """
    captions = [caption for clip in clips for caption in clip.captions]
    owner = [i for i, clip in enumerate(clips) for _ in clip.captions]
    vocabulary = {word: i for i, word in enumerate(sorted({word for text in [*captions, *texts] for word in words_of(text)}))}
    asked, known = _counts(texts, vocabulary), _counts(captions, vocabulary).T.tocsr()
    parts = [(asked[first : first + ROWS] @ known).toarray().argmax(axis=1) for first in range(0, len(texts), ROWS)]
    return [owner[int(i)] for i in np.concatenate(parts)]


def _counts(texts: Sequence[str], vocabulary: dict[str, int]) -> csr_array:
    """Rows of unit length."""
    rows = [Counter(vocabulary[word] for word in words_of(text)) for text in texts]
    sizes = [np.sqrt(sum(n * n for n in row.values())) or 1.0 for row in rows]
    places = [(i, word, n / size) for i, (row, size) in enumerate(zip(rows, sizes, strict=True)) for word, n in row.items()]
    at, words, values = zip(*places, strict=True) if places else ((), (), ())
    return csr_array((values, (at, words)), shape=(len(texts), len(vocabulary)))


def any_clip(clips: Sequence[CaptionedClip], count: int, seed: int) -> list[int]:
    """Random clips: people who move well and do not listen."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4,)))
    return rng.integers(len(clips), size=count).tolist()


def mean_pose(clips: Sequence[CaptionedClip], frames: Sequence[int]) -> list[Float[Tensor, "_ D"]]:
    """The mean of all features, in every frame: who moves like nobody."""
    total = np.sum([clip.features.sum(0, dtype=np.float64) for clip in clips], axis=0)
    mean = torch.from_numpy((total / sum(len(clip.features) for clip in clips)).astype(np.float32))
    return [mean.repeat(n, 1) for n in frames]
