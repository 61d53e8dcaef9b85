"""Metrics of text to motion: distances between embeddings of sentences and of motions, as Guo et al. 2022 define them.

Embeddings are (N, E), row i of the one belonging to row i of the other. All is computed in float64 on the CPU.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

Embeddings = Float[Tensor, "N E"]


def fid(a: Embeddings, b: Float[Tensor, "M E"]) -> float:
    """Fréchet distance of two Gaussians: ‖μ_a - μ_b‖² + tr(S_a + S_b - 2 (S_a S_b)^½), covariances with n - 1.

    Source: Guo et al. 2022 and its code; Free-T2M, Eq. 51, has the wrong sign before the trace. Own choice: no root of a matrix
    is taken. With centred rows A = Q R, the trace of the root is the sum of the singular values of R_a R_bᵀ over the degrees of
    freedom. The root of a singular product, as fewer rows than E give, has imaginary parts; singular values have none.

    Few rows bias it upwards: compare values of equally many rows only, many times E.

    Args:
        a, b: embeddings of two sets of motions; their order does not matter.

    Raises:
        ValueError: fewer than two rows, different widths, or a value is not finite.

    >>> a = torch.tensor([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])
    >>> round(fid(a, 2 * a), 4), round(fid(a, a + 1), 4)
    (4.6667, 2.0)
    """
    if a.shape[-1] != b.shape[-1] or min(len(a), len(b)) < 2:
        raise ValueError(f"a is {tuple(a.shape)}, b is {tuple(b.shape)}; expected at least two rows each, of one width")
    (mean_a, root_a), (mean_b, root_b) = _gaussian(_float64("a", a)), _gaussian(_float64("b", b))
    shared = torch.linalg.svdvals(root_a @ root_b.T).sum()
    return float((mean_a - mean_b).square().sum() + root_a.square().sum() + root_b.square().sum() - 2 * shared)


def _gaussian(x: Embeddings) -> tuple[Float[Tensor, " E"], Float[Tensor, "R E"]]:
    """Mean, and a root of the covariance: RᵀR is the covariance."""
    mean = x.mean(0)
    return mean, torch.linalg.qr((x - mean) / (len(x) - 1) ** 0.5, mode="r").R


def r_precision(
    text: Embeddings,
    motion: Embeddings,
    pool: int = 32,
    generator: torch.Generator | None = None,
    top: int = 3,
    ranked: Literal["motions", "texts"] = "motions",
) -> Float[Tensor, " top"]:
    """Share of items whose partner is among the 1, 2, ..., `top` nearest of a pool. Chance is k / pool.

    Source: Guo et al. 2022. Its code ranks the motions of the pool for each text; its text, and the papers after it, say the
    reverse: `ranked="texts"`. A pool is `pool` items that follow each other in a random order; the rest is dropped. Of items at
    the same distance, as copies of one caption are, the first of the pool comes first, as in the code; a pool in random order
    favours nobody, and embeddings that are all equal score chance.

    Args:
        text, motion: embeddings of pairs.
        pool: items that are told apart.
        generator: of the order; None: pools are taken in the order given, which should then be random.
        top: how many ranks.
        ranked: what is ranked for each item of the other kind.

    Raises:
        ValueError: fewer pairs than the pool, `top` is not within it, shapes that do not fit, or a value is not finite.

    >>> text, motion = torch.tensor([[0.0], [1.0], [5.0]]), torch.tensor([[0.1], [5.2], [4.9]])
    >>> r_precision(text, motion, pool=3, top=2)
    tensor([0.6667, 0.6667], dtype=torch.float64)
    """
    text, motion = _pairs(text, motion)
    if not 1 <= top <= pool <= len(text):
        raise ValueError(f"top is {top}, pool {pool}, pairs {len(text)}; expected 1 <= top <= pool <= pairs")
    order = torch.arange(len(text)) if generator is None else torch.randperm(len(text), generator=generator)
    order = order[: len(order) // pool * pool].reshape(-1, pool)
    asking, found = (text, motion) if ranked == "motions" else (motion, text)
    distance = torch.cdist(asking[order], found[order], compute_mode="donot_use_mm_for_euclid_dist")
    partner = distance.diagonal(dim1=1, dim2=2)[..., None]
    earlier = torch.ones(pool, pool, dtype=torch.bool).tril(-1)
    rank = ((distance < partner) | ((distance == partner) & earlier)).sum(-1)
    return (rank[..., None] < torch.arange(1, top + 1)).double().mean((0, 1))


def mm_dist(text: Embeddings, motion: Embeddings) -> float:
    """Mean distance of a motion to its text, also called matching score.

    Source: Guo et al. 2022.

    Args:
        text, motion: embeddings of pairs.

    Raises:
        ValueError: no pairs, shapes that do not fit, or a value is not finite.

    >>> mm_dist(torch.tensor([[0.0, 0.0], [1.0, 1.0]]), torch.tensor([[3.0, 4.0], [1.0, 2.0]]))
    3.0
    """
    text, motion = _pairs(text, motion)
    return float((text - motion).norm(dim=-1).mean())


def diversity(x: Embeddings, pairs: int = 300, generator: torch.Generator | None = None) -> float:
    """Mean distance of random pairs of motions.

    Source: Guo et al. 2022. Their two draws of `pairs` items are each without replacement and independent of each other, so an
    item may meet itself.

    Args:
        x: embeddings of motions made from many texts.
        pairs: how many.
        generator: of the draws.

    Raises:
        ValueError: not more items than pairs, no generator, or a value is not finite.

    >>> diversity(torch.ones(3, 2), 2, torch.Generator())
    0.0
    """
    return multimodality(x[None], pairs, generator)


def multimodality(x: Float[Tensor, "texts samples E"], pairs: int = 10, generator: torch.Generator | None = None) -> float:
    """Mean distance of pairs of motions made from one text.

    Source: Guo et al. 2022. The pairs are drawn as in `diversity`, once for all texts.

    Args:
        x: embeddings; the paper takes 100 texts, 30 samples of each.
        pairs: how many of each text.
        generator: of the draws.

    Raises:
        ValueError: not more samples than pairs, no generator, or a value is not finite.

    >>> multimodality(torch.tensor([[[1.0], [1.0]], [[4.0], [4.0]]]), 1, torch.Generator())
    0.0
    """
    x, count = _float64("x", x), x.shape[1]
    if generator is None or not 1 <= pairs < count:
        raise ValueError(f"{pairs} pairs of {count} items, {generator}; expected fewer pairs than items, and a generator")
    first, second = (torch.randperm(count, generator=generator)[:pairs] for _ in range(2))
    return float((x[:, first] - x[:, second]).norm(dim=-1).mean())


def confidence(values: Float[Tensor, "R *rest"] | Sequence[float]) -> Float[Tensor, "*rest"]:
    """Half the width of a 95 % interval of the mean over repetitions: 1.96 deviation / sqrt(R).

    Source: Guo et al. 2022; the deviation is that of the values themselves (ddof 0).

    Args:
        values: of R repetitions.

    >>> round(float(confidence([0.50, 0.52, 0.48, 0.50])), 5)
    0.01386
    """
    values = torch.as_tensor(values, dtype=torch.float64)
    return 1.96 * values.std(0, correction=0) / len(values) ** 0.5


def _pairs(text: Tensor, motion: Tensor) -> tuple[Tensor, Tensor]:
    if text.shape != motion.shape or text.ndim != 2 or len(text) == 0:
        raise ValueError(f"text is {tuple(text.shape)}, motion {tuple(motion.shape)}; expected (N, E) both, row for row")
    return _float64("text", text), _float64("motion", motion)


def _float64(name: str, x: Tensor) -> Tensor:
    x = x.detach().cpu().double()
    if bad := int((~x.isfinite()).any(-1).sum()):
        raise ValueError(f"{name}: {bad} of {x[..., 0].numel()} embeddings are not finite; expected numbers")
    return x
