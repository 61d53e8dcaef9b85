"""Guidance against a slow transcription of Algorithm 1, what must vanish when it is off, and the network's two branches."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import alpha_bar, eps_of, noised, to_eps, y0_hat_of
from mwlib.prediction.guidance import TABG, NetworkBranches, attention_mask, guided, temporal_attention
from mwlib.prediction.predictor import Predictor
from tests.sample_settings import two_people, untrained

A_BAR = alpha_bar("cosine", 1000)
K, D = 9, 4


class Fake(NetworkBranches):
    """Two-branch "network" with made-up attention that counts its evaluations."""

    def __init__(self):
        self.calls = 0
        g = torch.Generator().manual_seed(5)
        self.mix = torch.randn(K, K, generator=g, dtype=torch.float64)

    def unconditional(self, y, t):
        self.calls += 1
        return torch.tanh(self.mix @ y) + 1e-3 * t

    def conditional(self, y, t):
        self.calls += 1
        return torch.sin(self.mix @ y) - 1e-3 * t

    def both(self, y, t, with_attention):
        pair = self.conditional(y, t), self.unconditional(y, t)
        return *pair, self.attention(y) if with_attention else None

    def attention(self, y):
        scores = torch.stack([torch.stack([y @ y.mT * s for s in (0.5, 1.0)], 1) for s in (1.0, 2.0)], 1)
        return torch.softmax(scores + self.mix, dim=-1)


def algorithm_1(fake, y, t, w, s, sigma, phi, m, z, z2, form):
    """One sample at a time, row by row, in the paper's order."""
    out = torch.empty_like(y)
    eps_all, cond_all, attention = fake.unconditional(y, t), fake.conditional(y, t), fake.attention(y)
    a = float(A_BAR[t])
    for n in range(len(y)):
        eps, cond = eps_all[n], cond_all[n]
        maps = attention[n].reshape(-1, K, K)
        a_t = [sum(float(m_[i, j]) for m_ in maps for i in range(K)) / len(maps) for j in range(K)]
        mask = [any(a_t[j] > phi for j in range(K) if abs(i - j) <= (m - 1) // 2) for i in range(K)]
        y0 = (y[n] - (1 - a) ** 0.5 * eps) / a**0.5 + sigma * z[n]
        tilde = a**0.5 * y0 + (1 - a) ** 0.5 * z2[n]
        hat = torch.stack([tilde[i] if mask[i] else y[n, i] for i in range(K)])
        degraded = eps + s * (fake.unconditional(hat[None], t)[0] - eps)
        out[n] = (1 + w) * cond - w * degraded if form == "eq7" else degraded + w * (cond - degraded)
    return out


@pytest.mark.parametrize("form", ["eq7", "alg1"])
@pytest.mark.parametrize("noise", ["independent", "shared"])
@pytest.mark.parametrize("t", [1, 400, 991])
def test_equals_algorithm_1(form, noise, t, generator):
    y, z, z2 = torch.randn(3, 6, K, D, generator=generator, dtype=torch.float64)
    tabg = TABG(scale=1.3, sigma=0.7, threshold=1.05, window=3, noise=noise)
    a = float(A_BAR[t])  # two independent draws are one draw of their joint deviation
    one = (a**0.5 * 0.7 * z + (1 - a) ** 0.5 * z2) / (a * 0.7**2 + 1 - a) ** 0.5 if noise == "independent" else z
    found = guided(Fake(), A_BAR, weight=0.4, form=form, tabg=tabg, draw=lambda: one)(y, t)
    expected = algorithm_1(Fake(), y, t, 0.4, 1.3, 0.7, 1.05, 3, z, z if noise == "shared" else z2, form)
    torch.testing.assert_close(found, expected, atol=1e-10, rtol=1e-10)


def test_what_is_off_vanishes_and_costs_nothing(generator):
    y = torch.randn(2, K, D, generator=generator, dtype=torch.float64)
    draw = lambda: torch.zeros_like(y)  # noqa: E731

    def run(**options):
        fake = Fake()
        return guided(fake, A_BAR, draw=draw, **options)(y, 400), fake.calls

    conditional = Fake().conditional(y, 400)
    for form, neutral in (("eq7", 0.0), ("alg1", 1.0)):
        out, calls = run(weight=neutral, form=form, tabg=TABG())
        assert torch.equal(out, conditional) and calls == 1
    plain, calls = run(weight=0.5)
    assert calls == 2
    for tabg in (TABG(scale=0.0), TABG(active=[500])):
        out, calls = run(weight=0.5, tabg=tabg)
        assert torch.equal(out, plain) and calls == 2
    assert run(weight=0.5, tabg=TABG(active=[400]))[1] == 3


def test_attention_mean_is_one_and_the_mask_widens(generator):
    maps = torch.softmax(torch.randn(3, 2, 4, K, K, generator=generator), dim=-1)
    a_t = temporal_attention(maps)
    torch.testing.assert_close(a_t.mean(-1), torch.ones(3))
    by_hand = sum(maps[:, block, head] for block in range(2) for head in range(4)).sum(1) / 8
    torch.testing.assert_close(a_t, by_hand)
    assert not attention_mask(torch.ones(K), 1.0, 3).any(), "where all rows are alike none is attended more"
    one = torch.zeros(K)
    one[4] = 2.0
    assert attention_mask(one, 1.0, 1)[:, 0].nonzero()[:, 0].tolist() == [4]
    assert attention_mask(one, 1.0, 5)[:, 0].nonzero()[:, 0].tolist() == [2, 3, 4, 5, 6]
    one[[0, 4]] = torch.tensor([2.0, 0.0])
    assert attention_mask(one, 1.0, 3)[:, 0].nonzero()[:, 0].tolist() == [0, 1]


def test_readings_of_the_noise(generator):
    y, eps, z = torch.randn(3, 2, K, D, generator=generator, dtype=torch.float64)
    attention = torch.full((2, 2, 2, K, K), 1 / K, dtype=torch.float64)
    everywhere = dict(threshold=0.5, sigma=0.8)
    a = float(A_BAR[400])
    y0 = (y - (1 - a) ** 0.5 * eps) / a**0.5
    found = TABG(noise="eps_hat", **everywhere).degraded(y, eps, attention, a, lambda: z)
    torch.testing.assert_close(found, noised(y0 + 0.8 * z, eps, a))
    found = TABG(noise="shared", sigma_place="alg1", **everywhere).degraded(y, eps, attention, a, lambda: z)
    torch.testing.assert_close(found, noised(y0 + 0.8 * z / a**0.5, z, a))


def test_comparing_y0_hat_ofs_ignores_the_other_noise(generator):
    """A network that finds the same clean latent in y and in the degraded y is not moved by TABG."""
    clean = torch.randn(K, D, generator=generator, dtype=torch.float64)

    class Sure(Fake):
        def unconditional(self, y, t):
            return eps_of(y, clean.expand_as(y), A_BAR[t])

        conditional = unconditional

    y = torch.randn(2, K, D, generator=generator, dtype=torch.float64)
    draw = lambda: torch.randn(y.shape, generator=generator, dtype=torch.float64)  # noqa: E731
    for t in (400, 991):
        moved = {
            space: guided(Sure(), A_BAR, weight=0.5, tabg=TABG(space=space, threshold=0.0), draw=draw)(y, t)
            for space in ("y0_hat", "eps")
        }
        error = {k: (y0_hat_of(y, v, A_BAR[t]) - clean).abs().max() for k, v in moved.items()}
        assert error["y0_hat"] < 1e-8 and error["eps"] > 0.5


def test_tabg_needs_noise():
    with pytest.raises(ValueError, match="noise source"):
        guided(Fake(), A_BAR, weight=0.3, tabg=TABG())


T, SAMPLES = 30, 3


@pytest.fixture(scope="module", params=["pose", "displacement"])
def predictor(request) -> Predictor:
    return untrained(representation=request.param, prediction="v")


@pytest.fixture(scope="module")
def past() -> torch.Tensor:
    x = torch.from_numpy(two_people().train[0].root_relative()).float()
    return torch.stack([x[start : start + 6] for start in (0, 9, 20, 31)])


def close(found, expected):
    torch.testing.assert_close(found, expected, atol=2e-5, rtol=1e-4)


def test_both_is_the_network_with_the_condition_and_without(predictor, past):
    branches, y = predictor.branches(past), predictor.noise(0, range(4), SAMPLES)()
    conditions = predictor.representation.encode_history(past)[:, None].expand(y.shape)
    with torch.no_grad():
        told, (blind, maps) = predictor.net(y, T, conditions), predictor.net(y, T, return_attention=True)
        conditional, unconditional, attention = branches.both(y, T, with_attention=True)
        alone = branches.conditional(y, T), branches.unconditional(y, T)
        assert branches.both(y, T, with_attention=False)[2] is None
    expected = [to_eps("v", output, y, predictor.alpha_bar[T]) for output in (told, blind)]
    for found, other, truth in zip((conditional, unconditional), alone, expected, strict=True):
        close(found, truth)
        close(other, truth)
    close(attention, maps)
    assert (expected[0] - expected[1]).abs().max() > 0.01, "else nothing tells them apart"


def test_another_history_changes_its_own_window_and_the_conditional_branch_alone(predictor, past):
    y = predictor.noise(0, range(4), SAMPLES)()
    other = past.clone()
    other[2] += 0.3
    with torch.no_grad():
        before, after = (predictor.branches(x).both(y, T, with_attention=True) for x in (past, other))
    moved = (after[0] - before[0]).abs().flatten(1).amax(1)
    assert moved[2] > 1e-3 and moved[[0, 1, 3]].max() < 1e-5
    close(after[1], before[1])
    close(after[2], before[2])
