"""Scores of motions made from sentences by the papers' protocol, and the known ways in which such scores go wrong or differ."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from mwlib.data.captioned import one_caption_each, piece, thinned
from mwlib.data.formats.humanml import CaptionedClip
from mwlib.data.normalisation import Statistics
from mwlib.hashing import sha256
from mwlib.matching.evaluators import Matcher
from mwlib.metrics import mm_dist, multimodality
from mwlib.networks.matching import UNIT, Embeddings
from mwlib.settings import whole as whole_number
from mwlib.text_to_motion.config import RANKS
from mwlib.text_to_motion.model import TextToMotion
from mwlib.text_to_motion.system import set_scores

MM_PAIRS = 10  # of MultiModality, for each sentence
REAL = "real motions"
Scores = dict[str, float]


@dataclass(frozen=True)
class Protocol:
    """How motions are made and judged; the defaults are those of papers on HumanML3D.

    Source: Guo et al. 2022 and its code, which MDM and StableMoFusion took over; `repeated` and `repeats` are for MultiModality.

    Args:
        pool: of R-precision.
        clips: motions that are made; 0: one for each clip. MDM's code makes about 1,000. Real motions are always all.
        frames: of every motion that is made; 0: as many as its clip has.
        whole: take clips from their first frame, none shortened; else a random piece of whole movements, see `piece`.
        padded_words: take each sentence for as long as the longest can be, so that padding is read as unknown words: MDM's code
            until its issue 182.
        own_statistics: show the judge motions in the scale of the model that made them, not in its own.
        best_of: of each sentence, keep that of so many motions which the judge likes best: what a model can gain that asks its
            judge, as one does whose critic is the evaluator.
        repeated, repeats: sentences, and motions of each.

    Raises:
        ValueError: a number is out of range.
    """

    pool: int = 32
    clips: int = 0
    frames: int = 0
    whole: bool = False
    padded_words: bool = False
    own_statistics: bool = False
    best_of: int = 1
    repeated: int = 100
    repeats: int = 30

    def __post_init__(self) -> None:
        for name, least in (("pool", RANKS), ("best_of", 1), ("repeated", 1), ("repeats", 2), ("clips", 0), ("frames", 0)):
            whole_number(name, getattr(self, name), least)
        if 0 < self.clips < RANKS or self.frames % UNIT:
            found = f"clips is {self.clips}, frames {self.frames}"
            raise ValueError(f"{found}; expected at least {RANKS} clips or 0 for all, and frames in fours or 0")


def deviations(how: Protocol, longest: int, clips: int) -> dict[str, dict[str, Any]]:
    """By name, what each known deviation changes: a score in print may have any of them.

    Args:
        how: the protocol that they deviate from.
        longest: frames that the model can make.
        clips: in the test set; of HumanML3D's 4,384 ids MDM's code takes 1,000, so here the same share.
    """
    return {
        "padding read as words": {"padded_words": not how.padded_words},
        "scaled by the model's statistics": {"own_statistics": not how.own_statistics},
        "best of 4 by the judge": {"best_of": 4},
        f"pool of {how.pool // 2}": {"pool": max(how.pool // 2, RANKS)},
        "23 % of the motions": {"clips": max(round(clips * 1000 / 4384), RANKS)},
        f"all motions of {longest} frames": {"frames": longest // UNIT * UNIT},
        "clips whole": {"whole": not how.whole},
    }


class Once:
    """A model whose motions of one seed are made once, however often they are asked for.

    Args:
        model: trained.
        seed: of the noise.
        progress: show a bar.
    """

    def __init__(self, model: TextToMotion, seed: int, progress: bool = False) -> None:
        self.model, self.seed, self.progress = model, seed, progress
        self._made: dict[tuple[str, int, int], Tensor] = {}

    def __call__(self, texts: Sequence[str], frames: Sequence[int], ids: Sequence[int]) -> list[Float[Tensor, "_ D"]]:
        """Raw features of each motion; `ids` as in `TextToMotion.sample`."""
        keys = [*zip(texts, frames, ids, strict=True)]
        if new := [key for key in dict.fromkeys(keys) if key not in self._made]:
            words, lengths, own = zip(*new, strict=True)
            made = self.model.sample(words, lengths, self.seed, ids=own, progress=self.progress)
            self._made |= zip(new, made, strict=True)
        return [self._made[key] for key in keys]


def scores(make: Once, judge: Matcher, test: Sequence[CaptionedClip], how: Protocol) -> dict[str, Scores]:
    """Scores of one replicate: of the model, and of real motions against other pieces of themselves.

    Args:
        make: the model, with the replicate's seed, from which captions, pieces, pools and pairs are drawn, too.
        judge: the evaluator.
        test: clips.
        how: the protocol.

    Returns:
        By "model" and "real motions": fid, top1 to top3, mm_dist, diversity; of the model multimodality, too.

    Raises:
        ValueError: lengths or statistics do not fit the model or the judge.
    """
    model, seed, texts = make.model, make.seed, one_caption_each(test, make.seed)
    real, again = (_pieces(test, how, seed + n) for n in (0, 1))
    known = judge.embed_motions(real)

    def of_sets(text: Embeddings, motion: Embeddings) -> Scores:
        """Scores of motions made from sentences beside the real ones."""
        return set_scores(text, motion, known, how.pool, seed) | {"mm_dist": mm_dist(text, motion)}

    found = {REAL: of_sets(judge.embed_text(texts).cpu(), judge.embed_motions(again))}
    seen = copy(judge)
    seen.statistics = model.statistics if how.own_statistics else judge.statistics
    seen.vocabulary = copy(judge.vocabulary)
    seen.vocabulary.padded = how.padded_words
    picked = thinned(range(len(test)), how.clips)
    frames = [how.frames or min(max(len(x), model.lengths[0]), model.lengths[1]) for x in again]

    def made(numbers: Sequence[int], times: int) -> Float[Tensor, "N times E"]:
        """Embeddings of so many motions of each numbered sentence."""
        each = [(i, k) for i in numbers for k in range(times)]
        motions = make([texts[i] for i, _ in each], [frames[i] for i, _ in each], [i + len(test) * k for i, k in each])
        return seen.embed_motions(motions).unflatten(0, (len(numbers), times))

    words, many = seen.embed_text([texts[i] for i in picked]).cpu(), made(picked, how.best_of)
    nearest = (words[:, None] - many).norm(dim=-1).argmin(1)
    found["model"] = of_sets(words, many[torch.arange(len(many)), nearest])
    generator = torch.Generator().manual_seed(seed)
    repeated = torch.randperm(len(test), generator=generator)[: how.repeated].sort().values.tolist()
    pairs = min(MM_PAIRS, how.repeats - 1)
    found["model"]["multimodality"] = multimodality(made(repeated, how.repeats), pairs, generator)
    return found


def _pieces(test: Sequence[CaptionedClip], how: Protocol, seed: int) -> list[Float[Tensor, "_ D"]]:
    """Real motions as the protocol cuts them."""
    full = torch.tensor([len(clip.features) for clip in test])
    shares = torch.rand(2, len(test), generator=torch.Generator().manual_seed(seed))
    lengths, starts = (full // UNIT * UNIT, 0 * full) if how.whole else piece(full, *shares)
    cuts = zip(test, starts.tolist(), lengths.tolist(), strict=True)
    return [torch.from_numpy(clip.features[start : start + length]) for clip, start, length in cuts]


def fingerprint(networks: Sequence[nn.Module], statistics: Statistics) -> str:
    """SHA-256 over the weights of networks and the statistics that they go with."""
    tensors = chain(*(network.state_dict().items() for network in networks), statistics.tensors().items())
    return sha256(part for name, x in tensors for part in (name, np.ascontiguousarray(x.cpu()).tobytes()))
