"""The two losses: worked values, identities, and stages."""

from __future__ import annotations

import pytest
import torch
from scipy.fft import dct, idct
from torch.testing import assert_close

from mwlib.diffusion import alpha_bar
from mwlib.text_to_motion.losses import LowPass, low_frequency_loss, masked_error, semantic_loss, stage_weights

X, Y = torch.tensor([[1.0, 2.0, 3.0, 6.0], [1.0, 3.0, 3.0, 5.0]])[..., None]
FOUR = torch.tensor([4])


def some(generator_seed: int = 0, lengths: tuple[int, ...] = (9, 16, 12), width: int = 5):
    """Errors of samples of different lengths, with rubbish beyond them."""
    g = torch.Generator().manual_seed(generator_seed)
    n = torch.tensor(lengths)
    return torch.randn(len(n), int(n.max()), width, generator=g, dtype=torch.float64), n


@pytest.mark.parametrize("rows, l1, mse, low", [
    (1, 0.0, 0.0, [3.0, 3.0, 3.0, 3.0]),
    (2, 0.42678, 0.21339, [0.6893, 2.0429, 3.9571, 5.3107]), (4, 0.5, 0.5, [1.0, 2.0, 3.0, 6.0]),
])  # fmt: skip
def test_worked_values_of_the_low_frequency_loss(rows, l1, mse, low):
    low_pass = LowPass(4, rows)
    assert_close(low_pass(X[None], FOUR).flatten(), torch.tensor(low), atol=1e-4, rtol=0)
    assert float(low_frequency_loss((X - Y)[None], FOUR, low_pass, "l1")) == pytest.approx(l1, abs=1e-5)
    assert float(low_frequency_loss((X - Y)[None], FOUR, low_pass, "mse")) == pytest.approx(mse, abs=1e-5)


def test_low_pass_is_scipys_projection_on_each_samples_own_length():
    x, lengths = some()
    found = LowPass(20, rows=4)(x, lengths)
    for row, out, n in zip(x, found, lengths.tolist(), strict=True):
        y = dct(row[:n].numpy(), norm="ortho", axis=0)
        y[4:] = 0
        assert_close(out[:n], torch.from_numpy(idct(y, norm="ortho", axis=0)), atol=1e-6, rtol=0)
        assert not out[n:].any()
    x, lengths = some()
    low_pass, padded = LowPass(40, rows=3), torch.nn.functional.pad(x, (0, 0, 0, 20), value=7.0)
    for norm in ("l1", "mse"):
        assert_close(low_frequency_loss(x, lengths, low_pass, norm), low_frequency_loss(padded, lengths, low_pass, norm))
    x, lengths = some()
    low_pass, all_of_them = LowPass(16, rows=3), LowPass(16, rows=16)
    once = low_pass(x, lengths)
    assert_close(low_pass(once, lengths), once, atol=1e-6, rtol=0)
    mask = torch.arange(16)[:, None] < lengths[:, None, None]
    assert_close(all_of_them(x, lengths), x * mask, atol=1e-6, rtol=0)


def test_hertz_keep_more_of_longer_samples():
    low_pass = LowPass(196, rows=1, hertz=0.5, fps=20.0)
    assert [low_pass.rows[n - 1] for n in (10, 40, 196)] == [1, 2, 10]
    x, lengths = some(lengths=(40, 196))
    assert (low_pass.coefficients(x, lengths).abs().sum(-1) > 0).sum(-1).tolist() == [2, 10]


def test_squares_of_low_frequencies_only_weigh_the_main_loss_anew():
    """Parseval: L_simple + 0.7 L_LF is a mean of squares of cosines with weight 1.7 on k < K; so is its gradient."""
    x, lengths = some(lengths=(16, 16))
    x = x.requires_grad_()
    mask, low_pass = torch.ones(2, 16, dtype=torch.bool), LowPass(16, rows=3)
    total = masked_error(x, mask) + 0.7 * low_frequency_loss(x, lengths, low_pass, "mse")
    y = LowPass(16, rows=16).coefficients(x, lengths)
    weight = 1 + 0.7 * (torch.arange(16) < 3).double()[:, None]
    weighted = (weight * y.square()).mean((-2, -1))
    assert_close(total, weighted, atol=1e-6, rtol=1e-6)
    gradients = [torch.autograd.grad(loss.sum(), x, retain_graph=True)[0] for loss in (total, weighted)]
    assert_close(*gradients, atol=1e-6, rtol=1e-6)


def test_the_high_band_is_the_rest_of_valid_frames():
    x, lengths = some()
    low_pass, mask = LowPass(16, rows=3), torch.arange(16) < some()[1][:, None]
    parts = [low_frequency_loss(x, lengths, low_pass, "mse", band) for band in ("low", "high")]
    assert_close(sum(parts), masked_error(x, mask), atol=1e-6, rtol=1e-6)
    slow = low_pass(x, lengths)
    assert float(low_frequency_loss(slow, lengths, low_pass, "l1", "high").max()) < 1e-6
    x, lengths = some()
    mask = torch.arange(16) < lengths[:, None]
    expected = torch.stack([row[:n].square().mean() for row, n in zip(x, lengths.tolist(), strict=True)])
    assert_close(masked_error(x, mask), expected)


def unit(cosine: float) -> torch.Tensor:
    """A vector at this cosine to the first axis."""
    return torch.tensor([[cosine, (1 - cosine**2) ** 0.5]], dtype=torch.float64)


@pytest.mark.parametrize("kind, expected", [
    ("reward", [0.0, -0.1, -0.4]), ("cos_text", [0.7, 0.4, 0.1]), ("hinge", [0.2, 0.0, 0.0]),
])  # fmt: skip
def test_worked_values_of_the_semantic_loss(kind, expected):
    axis = unit(1.0)
    found = [float(semantic_loss(unit(s), unit(-1.0), axis, kind, 0.5)) for s in (0.3, 0.6, 0.9)]
    assert found == pytest.approx(expected)


def test_the_semantic_loss_of_the_code_and_what_draws():
    assert float(semantic_loss(unit(0.3), unit(1.0), unit(-1.0))) == pytest.approx(0.7)
    for kind, draws in (("reward", False), ("hinge", True), ("cos_gt", True), ("cos_text", True)):
        motion = unit(0.3).requires_grad_()
        semantic_loss(motion, unit(1.0), unit(1.0), kind, 0.5).sum().backward()
        assert bool(motion.grad.abs().sum() > 1e-9) == draws, kind
    motion = unit(0.3).requires_grad_()
    assert not semantic_loss(motion, unit(1.0), unit(1.0), "detached").requires_grad
    with pytest.raises(ValueError, match="kind is 'cosine'; expected"):
        semantic_loss(motion, motion, motion, "cosine")


def stages(stage: str, steps: int, power=None):
    """At which t each loss counts."""
    low, semantic = stage_weights(stage, torch.arange(steps), alpha_bar("cosine", steps), power)
    return low.nonzero().flatten().tolist(), semantic.nonzero().flatten().tolist()


def test_stages_are_the_papers_readings_sample_by_sample():
    low, semantic = stages("mdm_code", 50)
    assert (low, semantic) == ([*range(30, 50)], [*range(21)])
    low, semantic = stages("eq16", 1000)
    assert (low, semantic) == ([*range(301)], [*range(301, 1000)])
    low, semantic = stages("prose", 50)
    assert (low, semantic) == ([*range(30, 50)], [*range(30)])
    assert stages("none", 50) == ([*range(50)], [*range(50)])
    with pytest.raises(ValueError, match="stage is 'late'; expected"):
        stages("late", 50)
    """The fork's batch-wide number gives 2.5 here."""
    low, _ = stage_weights("mdm_code", torch.tensor([40, 10]), alpha_bar("cosine", 50))
    assert float((low * torch.tensor([1.0, 9.0])).mean()) == 0.5


@pytest.mark.parametrize("t", [[0, 300, 301, 999, 700], [0, 1], [400, 999, 301]])
def test_the_code_for_stablemofusion_averages_over_the_samples_of_a_stage(t):
    """As its fork has it: the loss of a sub-batch, nothing where that is empty. Eq. 16 leaves the others in as zeros."""
    t, each = torch.tensor(t), torch.rand(2, len(t), generator=torch.Generator().manual_seed(1))
    readings = [stage_weights(stage, t, alpha_bar("linear", 1000)) for stage in ("smf_code", "eq16")]
    for inside, loss, smf, eq16 in zip((t <= 300, t > 300), each, *readings, strict=True):
        alone = loss[inside].mean() if inside.any() else torch.tensor(0.0)
        torch.testing.assert_close((smf * loss).mean(), alone)
        torch.testing.assert_close((eq16 * loss).mean(), alone * inside.float().mean())


def test_the_stage_by_signal_to_noise_is_the_share_that_noise_drowns():
    a = torch.tensor([0.9, 0.5, 0.1], dtype=torch.float64)
    low, semantic = stage_weights("snr", torch.arange(3), a, torch.tensor([2.0, 0.5, 0.05, 0.05]))
    assert low.tolist() == [0.5, 0.75, 1.0] and semantic.tolist() == [0.5, 0.25, 0.0]
    with pytest.raises(ValueError, match="stage is 'snr'; expected"):
        stage_weights("snr", torch.arange(3), a)
