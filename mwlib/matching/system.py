"""Evaluators as a system: data, training, and their scores on real pairs with null checks."""

from collections.abc import Callable
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from tqdm import tqdm

from mwlib.data.captioned import Parts, load_clips
from mwlib.matching.config import Config
from mwlib.matching.evaluators import Matcher
from mwlib.matching.objective import MatchingObjective
from mwlib.metrics import Column, confidence, diversity, fid, mm_dist, r_precision
from mwlib.networks.matching import Embeddings

POOLS = (8, 16, 32, 64)  # of Free-T2M's Table 10
PAIRS = 300  # of diversity, or one fewer than there are clips

RANKS = 3  # of R-precision, top 1 to 3

METRICS = {
    **{f"top{k}": Column(f"R@{k}", "higher") for k in range(1, RANKS + 1)},
    "shuffled": Column("R@3, captions shuffled"),
    "chance": Column("R@3 by chance"),
    "mm_dist": Column("MM-Dist", "lower"),
    "diversity": Column("Diversity"),
    "fid_halves": Column("FID of two halves", "lower"),
}
DETAILS = {f"top{k}_of_{pool}": Column(f"R@{k} of {pool}", "higher") for pool in POOLS for k in range(1, RANKS + 1)}


make_objective, open_model = MatchingObjective, Matcher.from_tensors


def load_data(cfg: Config) -> Parts:
    """Captioned clips for training, validation and test.

    Raises:
        ValueError: as in `load_clips`.
    """
    return load_clips(cfg.data)


def null_checks(
    text: Embeddings, motion: Embeddings, generator: torch.Generator, pool: int = 32, top: int = RANKS
) -> tuple[Float[Tensor, " top"], float]:
    """What to read before any model's row: R-precision with shuffled captions, and FID of two random halves of real motions.

    An evaluation that is sound gives the captions of others k / pool. No model can be measured to be nearer than the FID of one
    half with the other, with as many motions.

    Source: own choice; a published evaluation ran for two years with a fault that scores of real data showed.

    Args:
        text, motion: embeddings of real pairs that the evaluator has not seen.
        generator: of the order, of the captions and of the halves.
        pool, top: of R-precision.

    Raises:
        ValueError: as in `r_precision` and `fid`.

    >>> x = torch.randn(640, 4, generator=torch.Generator().manual_seed(0))
    >>> shuffled, halves = null_checks(x, x, torch.Generator().manual_seed(1))
    >>> bool(shuffled[2] < 0.15), halves < 0.2
    (True, True)
    """
    strangers, order = (torch.randperm(len(text), generator=generator).to(text.device) for _ in range(2))
    shuffled = r_precision(text[strangers], motion, pool, generator, top)
    half = len(text) // 2
    return shuffled, fid(motion[order[:half]], motion[order[half:]])


def evaluate(cfg: Config, get_model: Callable[[], Matcher], data: Parts, progress: bool = False) -> dict[str, Any]:
    """Scores of real pairs that an evaluator has not seen: the most that a model may be expected to reach.

    Every repetition draws one caption of each clip, and pools.

    Args:
        cfg: pool and repetitions.
        get_model: the trained evaluator.
        data: the clips; those for the test are scored.
        progress: show a bar on stderr.

    Returns:
        "mean" and "standard_error" (over repetitions) by metric, and "windows", the number of clips. Pools larger than the test
        set are left out.

    Raises:
        ValueError: fewer test clips than the pool.
    """
    matcher, clips = get_model(), data.test
    if len(clips) < cfg.judging.pool:
        raise ValueError(f"there are {len(clips)} test clips; expected at least the pool of {cfg.judging.pool}")
    motion = matcher.embed_motions([torch.from_numpy(clip.features) for clip in clips])
    text = matcher.embed_text([caption for clip in clips for caption in clip.captions]).cpu()
    counts = torch.tensor([len(clip.captions) for clip in clips])
    first = counts.cumsum(0) - counts
    generator, rows = torch.Generator().manual_seed(cfg.judging.sampling_seed), []
    for _ in tqdm(range(cfg.judging.repeats), desc="judging", disable=not progress, leave=False):
        drawn = (torch.rand(len(clips), generator=generator) * counts).long()
        rows.append(_scores(text[first + drawn], motion, cfg.judging.pool, generator))
    values = {name: torch.tensor([row[name] for row in rows], dtype=torch.float64) for name in rows[0]}
    error = {name: float(confidence(value)) / 1.96 for name, value in values.items()}
    return {"mean": {name: float(v.mean()) for name, v in values.items()}, "standard_error": error, "windows": len(clips)}


def _scores(text: Tensor, motion: Tensor, pool: int, generator: torch.Generator) -> dict[str, float]:
    """All metrics of one draw of captions."""
    shuffled, halves = null_checks(text, motion, generator, pool)
    own = r_precision(text, motion, pool, generator).tolist()
    found = {f"top{k}": share for k, share in enumerate(own, 1)} | {
        "shuffled": float(shuffled[-1]),
        "chance": RANKS / pool,
        "mm_dist": mm_dist(text, motion),
        "diversity": diversity(motion, min(PAIRS, len(motion) - 1), generator),
        "fid_halves": halves,
    }
    for size in (size for size in POOLS if size <= len(motion)):
        of_pool = r_precision(text, motion, size, generator).tolist()
        found |= {f"top{k}_of_{size}": share for k, share in enumerate(of_pool, 1)}
    return found
