"""Metrics of text to motion against values by hand, SciPy's root of a matrix, and slow loops."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from scipy.linalg import sqrtm

from mwlib.metrics import confidence, diversity, fid, mm_dist, multimodality, r_precision

TEXT = torch.tensor([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [4.0, 4.0]])
MOTION = torch.tensor([[1.0, 0.0], [3.0, 3.0], [0.0, 5.0], [3.0, 0.0]])


def normal(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def scipy_fid(a: np.ndarray, b: np.ndarray) -> float:
    """As the published code has it."""
    one, two = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    return float(((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(one + two - 2 * np.real(sqrtm(one @ two))))


def test_fid_by_hand():
    a = torch.tensor([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])
    b = torch.tensor([[1.0, 1.0], [5.0, 1.0], [1.0, 3.0], [5.0, 3.0]])
    assert fid(a, b) == pytest.approx(19 / 3, abs=1e-12) and fid(b, a) == pytest.approx(19 / 3, abs=1e-12)


def test_fid_agrees_with_a_root_of_the_matrix():
    a, b = normal(200, 12), normal(90, 12, seed=1) @ normal(12, 12, seed=2) * 0.3 + 0.5
    assert fid(a, b) == pytest.approx(scipy_fid(a.double().numpy(), b.double().numpy()), rel=1e-9)


def test_fid_of_a_set_with_itself_is_nothing_even_where_the_covariance_is_singular():
    for rows in (7, 300):
        x = 100 * normal(rows, 32)
        assert fid(x, x[torch.randperm(rows)]) == pytest.approx(0, abs=1e-9)
        assert fid(x, x + 2) == pytest.approx(4 * 32, rel=1e-6)


def test_fid_of_few_rows_is_biased_upwards():
    few, many = (fid(normal(n, 16), normal(n, 16, seed=1)) for n in (40, 4000))
    assert few > 20 * many


def test_r_precision_by_hand():
    """The last text has two motions at one distance, its own the second; the second motion has two texts, its own the first."""
    np.testing.assert_allclose(r_precision(TEXT, MOTION, 4), [0.5, 0.5, 1], atol=1e-12)
    np.testing.assert_allclose(r_precision(TEXT, MOTION, 4, ranked="texts"), [0.5, 0.75, 1], atol=1e-12)
    assert r_precision(TEXT, MOTION, 4, top=1).shape == (1,)


@pytest.mark.parametrize("ranked", ["motions", "texts"])
def test_r_precision_agrees_with_a_loop(ranked):
    text, motion = normal(50, 3), normal(50, 3) + normal(50, 3, seed=1)
    found = r_precision(text, motion, 8, torch.Generator().manual_seed(3), top=5, ranked=ranked)
    order = torch.randperm(50, generator=torch.Generator().manual_seed(3)).tolist()
    hits = np.zeros(5)
    for first in range(0, 48, 8):
        pool = order[first : first + 8]
        for i in pool:
            apart = [float((text[i] - motion[j] if ranked == "motions" else text[j] - motion[i]).double().norm()) for j in pool]
            hits[sorted(range(8), key=lambda k: apart[k]).index(pool.index(i)) :][:5] += 1  # noqa: E203
    np.testing.assert_allclose(found, hits / 48, atol=1e-12)


@pytest.mark.parametrize("pool", [8, 16, 32, 64])
def test_r_precision_of_strangers_is_chance(pool, generator):
    found = r_precision(normal(6400, 4), normal(6400, 4, seed=1), pool, generator)
    chance = torch.arange(1, 4) / pool
    assert ((found - chance).abs() < 4 * (chance / 6400).sqrt()).all()


def test_equal_distances_are_no_hits_but_chances(generator):
    np.testing.assert_allclose(r_precision(torch.ones(20, 5), torch.ones(20, 5), 10, generator), [0.1, 0.2, 0.3], atol=1e-12)
    doubles = torch.tensor([[0.0], [0.0], [9.0]])  # one caption twice: one of the two motions finds the other's
    np.testing.assert_allclose(r_precision(doubles, doubles, 3, generator, ranked="texts"), [2 / 3, 1, 1], atol=1e-12)


def test_pools_are_drawn_and_the_rest_is_dropped():
    text, motion = torch.arange(10.0)[:, None], torch.arange(10.0)[:, None]
    motion[9] = 100.0
    assert r_precision(text, motion, 3)[0] == 1  # the tenth is in no pool
    different = {float(r_precision(normal(9, 2), normal(9, 2, seed=1), 3, torch.Generator().manual_seed(s))[0]) for s in range(9)}
    assert len(different) > 1


def test_mm_dist_by_hand():
    assert mm_dist(TEXT, MOTION) == pytest.approx(2.32135, abs=5e-6)


def drawn(count: int, pairs: int, seed: int) -> list[list[int]]:
    """The pairs of items that a seed gives: two draws without replacement, one after the other."""
    generator = torch.Generator().manual_seed(seed)
    return [torch.randperm(count, generator=generator)[:pairs].tolist() for _ in range(2)]


def test_diversity_by_hand(generator):
    x = torch.tensor([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0], [0.0, 1.0]])
    first, second = drawn(4, 2, seed=3)
    expected = np.mean([math.dist(x[a].tolist(), x[b].tolist()) for a, b in zip(first, second, strict=True)])
    assert expected > 0 and diversity(x, 2, torch.Generator().manual_seed(3)) == pytest.approx(expected)
    assert diversity(normal(5000, 64), 4000, generator) == pytest.approx(128**0.5, rel=0.01)


def test_multimodality_by_hand(generator):
    x = torch.tensor([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[2.0, 2.0], [2.0, 5.0], [6.0, 2.0]]])
    first, second = drawn(3, 2, seed=3)
    expected = np.mean([math.dist(y[a].tolist(), y[b].tolist()) for y in x for a, b in zip(first, second, strict=True)])
    assert expected > 0 and multimodality(x, 2, torch.Generator().manual_seed(3)) == pytest.approx(expected)
    assert multimodality(normal(30, 1, 4).expand(30, 12, 4), 10, generator) == 0


def test_draws_are_without_replacement_so_there_must_be_more_items_than_pairs(generator):
    x = torch.zeros(11, 11)
    x[torch.arange(11), torch.arange(11)] = torch.arange(11).double().exp().float()
    seen = {round(diversity(x, 10, torch.Generator().manual_seed(s)), 6) for s in range(20)}
    assert len(seen) == 20
    for call in (lambda: diversity(x, 11, generator), lambda: multimodality(x[None], 11, generator), lambda: diversity(x, 3)):
        with pytest.raises(ValueError, match="expected fewer pairs than items, and a generator"):
            call()


def test_confidence_by_hand():
    assert float(confidence([0.50, 0.52, 0.48, 0.50])) == pytest.approx(0.01386, abs=5e-6)
    many = normal(20, 3).double()
    np.testing.assert_allclose(confidence(many), 1.96 * many.numpy().std(0) / 20**0.5)


def test_it_computes_in_float64():
    far = torch.tensor([[1e4, 0.0], [1e4, 1e-3], [1e4, 3e-3]])
    assert mm_dist(far[:1], far[1:2]) == pytest.approx(1e-3, rel=1e-6)
    assert fid(far, far + torch.tensor([0.0, 1.0])) == pytest.approx(1.0, rel=1e-6)
    assert r_precision(far, far, 3).dtype == torch.float64


def test_bad_embeddings_are_refused(unchecked, generator):
    bad = TEXT.clone()
    bad[1, 0] = torch.nan
    for call in (
        lambda: fid(bad, TEXT),
        lambda: mm_dist(TEXT, bad),
        lambda: r_precision(bad, TEXT, 4),
        lambda: diversity(bad, 2),
    ):
        with pytest.raises(ValueError, match="1 of 4 embeddings are not finite"):
            call()
    with pytest.raises(ValueError, match="at least two rows each, of one width"):
        fid(TEXT, TEXT[:1])
    with pytest.raises(ValueError, match="of one width"):
        fid(TEXT, TEXT[:, :1])
    with pytest.raises(ValueError, match="row for row"):
        mm_dist(TEXT, MOTION[:3])
    for pool, top in ((5, 3), (2, 3), (4, 0)):
        with pytest.raises(ValueError, match="expected 1 <= top <= pool <= pairs"):
            r_precision(TEXT, MOTION, pool, generator, top)
