"""Free-T2M as a system: data, training, scores of motions made from sentences, and baselines that need no training."""

import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from scipy.sparse import csr_array
from torch import Tensor

from mwlib.data.captioned import Parts, load_clips, one_caption_each, thinned
from mwlib.data.formats.humanml import CaptionedClip
from mwlib.matching.evaluators import Matcher, open_matcher, stands_on
from mwlib.metrics import Column, clustered_error, diversity, fid, multimodality, r_precision
from mwlib.networks.matching import UNIT
from mwlib.networks.text import vocabulary_of, words_of
from mwlib.text_to_motion.attributes import CLAIMS, claims_met, movement
from mwlib.text_to_motion.config import RANKS, Config
from mwlib.text_to_motion.model import TextToMotion
from mwlib.text_to_motion.objective import TextObjective, statistics_files

METRICS = {  # the columns of every table
    "fid": Column("FID", "lower"),
    **{f"top{k}": Column(f"R-precision top {k}", "higher") for k in range(1, RANKS + 1)},
    "mm_dist": Column("MM-Dist", "lower"),
    "diversity": Column("Diversity"),
    "multimodality": Column("MultiModality"),
}

# Beside them in a table of their own: does the body do what the sentence says, and does it move like one?
DETAILS = {
    **{name: Column(f"{name} right", "higher") for name in CLAIMS},
    "joint_speed": Column("speed of joints (m/s)"),
    "way": Column("way of the root (m)"),
    "jerk": Column("jerk (m/s³)"),
    "skate": Column("foot skate (m/s)"),
    "bone_jitter": Column("change of bone lengths (mm)", "lower", 1000.0),
}

PAIRS = 300  # of Diversity
ROWS = 256  # sentences compared together by their words: with all captions of HumanML3D they fill 140 MB
STRANGE = 0.1  # share of words that an evaluator does not know, from which on its scores are doubted: own choice

Make = Callable[[Sequence[str], Sequence[int], int], list[Tensor]]  # sentences, lengths, seed -> raw features

make_objective, open_model = TextObjective, TextToMotion.from_tensors


Clips = Sequence[CaptionedClip]


def load_data(cfg: Config) -> Parts:
    """Clips for training, validation and test.

    Raises:
        ValueError, MotionFormatError: as `load_clips`.
    """
    return load_clips(cfg.data)


def built_on(cfg: Config) -> list[str]:
    """Names, folders or files of the trained models that a training begins with or asks, and of the statistics it reads."""
    critic = stands_on(cfg.objective.critic) if cfg.objective.semantic_weight else []
    return ([cfg.model.start] if cfg.model.start else []) + critic + [str(file) for file in statistics_files(cfg)]


def judged_by(cfg: Config) -> list[str]:
    """Names, folders or files of the trained models that score the motions."""
    return stands_on(cfg.sampling.evaluator)


def nearest_caption(clips: Clips, texts: Sequence[str]) -> list[int]:
    """For each sentence the clip with a caption that shares most words with it: cosine of word counts; of equals the first.

    >>> clips = [CaptionedClip(np.zeros((40, 263), np.float32), (text,)) for text in ("a person walks", "a person runs fast")]
    >>> nearest_caption(clips, ["a man runs"])
    [1]
    """
    captions = [caption for clip in clips for caption in clip.captions]
    owner = [i for i, clip in enumerate(clips) for _ in clip.captions]
    vocabulary = {word: i for i, word in enumerate(vocabulary_of([*captions, *texts]))}
    asked, known = _counts(texts, vocabulary), _counts(captions, vocabulary).T.tocsr()
    parts = [(asked[first : first + ROWS] @ known).toarray().argmax(axis=1) for first in range(0, len(texts), ROWS)]
    return [owner[i] for i in np.concatenate(parts)]


def _counts(texts: Sequence[str], vocabulary: dict[str, int]) -> csr_array:
    """Rows of unit length."""
    words = [[vocabulary[word] for word in words_of(text)] for text in texts]
    starts = np.cumsum([0, *map(len, words)])
    places = np.array([place for row in words for place in row], int)
    counts = csr_array((np.ones(len(places)), places, starts), (len(texts), len(vocabulary)))
    counts.sum_duplicates()
    counts.data /= np.repeat(np.sqrt(counts.power(2).sum(axis=1)), np.diff(counts.indptr))
    return counts


def any_clip(clips: Clips, count: int, seed: int) -> list[int]:
    """Random clips: people who move well and do not listen."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4,)))
    return rng.integers(len(clips), size=count).tolist()


def mean_pose(clips: Clips, frames: Sequence[int]) -> list[Float[Tensor, "_ D"]]:
    """The mean of all features, in every frame: who moves like nobody."""
    total = np.sum([clip.features.sum(0, dtype=np.float64) for clip in clips], axis=0)
    mean = torch.from_numpy((total / sum(len(clip.features) for clip in clips)).astype(np.float32))
    return [mean.repeat(n, 1) for n in frames]


def make_motions(cfg: Config, get_model: Callable[[], TextToMotion], parts: Parts, test: Clips) -> Make:
    """What `method` names: the trained model, asked for only here, or a baseline.

    "truth": the clips themselves. "other_captions": the clips themselves, each with the next one's sentence. "any_clip": random
    training clips. "nearest_caption": the training clip whose caption shares most words. "mean_pose": the mean of all features.
    """
    if cfg.sampling.method == "diffusion":
        return get_model().sample
    train, own = parts.train, _whole(test)
    baselines: dict[str, Make] = {
        "truth": lambda texts, frames, seed: own,
        "other_captions": lambda texts, frames, seed: [own[-1], *own[:-1]],
        "any_clip": lambda texts, frames, seed: _whole(train[i] for i in any_clip(train, len(texts), seed)),
        "nearest_caption": lambda texts, frames, seed: _whole(train[i] for i in nearest_caption(train, texts)),
        "mean_pose": lambda texts, frames, seed: mean_pose(train, frames),
    }
    return baselines[cfg.sampling.method]


def _whole(clips: Iterable[CaptionedClip]) -> list[Tensor]:
    """Features of clips up to their last whole movement."""
    return [torch.from_numpy(clip.features[: len(clip.features) // UNIT * UNIT]) for clip in clips]


def evaluate(cfg: Config, get_model: Callable[[], TextToMotion], parts: Parts, progress: bool = False) -> dict[str, Any]:
    """Metrics of a configuration on the test clips.

    Args:
        cfg: method and settings of the sampling.
        get_model: the trained model, asked for only where the method needs one.
        parts: the data.
        progress: show nothing; the sampling has a bar of its own.

    Returns:
        "mean" and "standard_error" by metric (of the set metrics over replicates, where there are several; of the others over
        clips), "windows" (clips), "values" of each clip by metric with the "clips" that they belong to.

    Warns where the evaluator does not know many words of the captions, as the one that comes with the package on other data.

    Raises:
        ValueError: there are fewer than three test clips; or the evaluator needs parts of speech, and a caption has none.
        FileNotFoundError, MotionFormatError: as `open_matcher`.
    """
    test = thinned(parts.test, cfg.sampling.test_clips)
    if len(test) < RANKS:
        raise ValueError(f"there are {len(test)} test clips; expected at least {RANKS}, to rank them by their captions")
    make, judge = make_motions(cfg, get_model, parts, test), open_matcher(cfg.sampling.evaluator, parts.layout)
    _warn_of_strange_words(cfg.sampling.evaluator, judge, test)
    known = _whole(test)
    lengths, real = [*map(len, known)], judge.embed_motions(known)
    rounds, values = [], []
    for replicate in range(cfg.sampling.replicates):
        seed = cfg.sampling.sampling_seed + 1000 * replicate
        texts = one_caption_each(test, seed)
        motions = make(texts, lengths, seed)
        words, found = judge.embed_text(texts).cpu(), judge.embed_motions(motions)
        of_sets = set_scores(words, found, real, cfg.sampling.pool, seed)
        rounds.append(of_sets | {"fid": round(of_sets["fid"], 9)})  # of equal sets: 0, not what rounding leaves
        rows = [movement(x, parts.layout) | claims_met(x, clip, parts.layout) for x, clip in zip(motions, test, strict=True)]
        of_clips = {name: [row.get(name, float("nan")) for row in rows] for name in DETAILS}
        values.append({"mm_dist": (words - found).norm(dim=-1).tolist()} | of_clips)
    if cfg.sampling.method == "diffusion":
        rounds[0]["multimodality"] = _multimodality(cfg, make, judge, test, lengths)
    return _summary(rounds, values, [clip.name for clip in test])


def _warn_of_strange_words(name: str, judge: Matcher, test: Clips) -> None:
    words = [word for clip in test for text in clip.captions for word in judge.vocabulary.words_of(text)]
    known = {*judge.vocabulary.words}
    strange = [word for word in words if word not in known]
    if len(strange) > STRANGE * len(words):
        warnings.warn(
            f"{name} does not know {len(strange)} of {len(words)} words of the test captions, such as {strange[0]!r}: its scores "
            "mean little; expected one that was trained on such data (`mwlib train --system matching --set data=FOLDER`)",
            stacklevel=3,
        )


def set_scores(text: Tensor, motion: Tensor, real: Tensor, pool: int, seed: int) -> dict[str, float]:
    """Metrics of a whole set by their names.

    Args:
        text, motion: embeddings (N, E) of the sentences and of the motions made from them.
        real: embeddings of real motions.
        pool: of R-precision, at most N.
        seed: of pools and pairs.
    """
    generator = torch.Generator().manual_seed(seed)
    top = r_precision(text, motion, pool=min(pool, len(text)), generator=generator)
    return {
        "fid": fid(motion, real),
        **{f"top{k}": float(share) for k, share in enumerate(top, 1)},
        "diversity": diversity(motion, pairs=min(PAIRS, len(motion) - 1), generator=generator),
    }


def right_by_action(model: TextToMotion, test: Clips, found: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Of each action that test clips are known to show: in what share of its "clips" the motion shows it, too.

    Args:
        model: not asked again.
        test: clips, with those that were evaluated.
        found: what `evaluate` gave.
    """
    shown = {clip.name: clip.attributes.get("action") for clip in test}
    right: dict[str, list[float]] = defaultdict(list)
    for name, value in zip(found["clips"], found["values"]["action"], strict=True):
        if shown[name] is not None and np.isfinite(value):
            right[str(shown[name])].append(value)
    return {action: {"right": float(np.mean(values)), "clips": len(values)} for action, values in sorted(right.items())}


def card_of_actions(rows: Mapping[str, Mapping[str, float]]) -> list[str]:
    """What a card says of `right_by_action`, as Markdown paragraphs."""
    lines = ["| action | right | clips |", "|---|---:|---:|"]
    lines += [f"| {action.replace('_', ' ')} | {row['right']:.2f} | {row['clips']} |" for action, row in rows.items()]
    return ["Action right, by the action that the sentence names:\n\n" + "\n".join(lines)]


more_rows, more_of_card = right_by_action, card_of_actions  # what the card of a shipped model says beside the tables


def _multimodality(cfg: Config, make: Make, judge: Matcher, test: Clips, lengths: Sequence[int]) -> float:
    """Of so many motions for each of some sentences."""
    s = cfg.sampling
    picked = np.repeat(thinned(range(len(test)), s.repeated), s.repeats)
    motions = make([test[i].captions[0] for i in picked], [lengths[i] for i in picked], s.sampling_seed + 500)
    found = judge.embed_motions(motions).unflatten(0, (-1, s.repeats))
    return multimodality(found, s.repeats - 1, torch.Generator().manual_seed(s.sampling_seed))


def _over_replicates(values: Float[np.ndarray, "R N"]) -> Float[np.ndarray, " N"]:
    """Means over the replicates that have a value; NaN where none has."""
    return np.ma.masked_invalid(values).mean(axis=0).filled(np.nan)


def _summary(
    rounds: Sequence[dict[str, float]], values: Sequence[dict[str, list[float]]], names: Sequence[str]
) -> dict[str, Any]:
    of_sets = {name: [found[name] for found in rounds if name in found] for name in rounds[0]}
    of_clips = {name: _over_replicates(np.array([found[name] for found in values])) for name in values[0]}
    known = {name: value for name, value in of_clips.items() if np.isfinite(value).any()}
    error = {n: float(np.std(value, ddof=1) / len(value) ** 0.5) for n, value in of_sets.items() if len(value) == len(rounds) > 1}
    return {
        "mean": {n: float(np.mean(value)) for n, value in of_sets.items()} | {n: float(np.nanmean(v)) for n, v in known.items()},
        "standard_error": error | {name: clustered_error(value, names) for name, value in known.items()},
        "windows": len(names),
        "values": {name: value.tolist() for name, value in of_clips.items()},
        "clips": list(names),
    }
