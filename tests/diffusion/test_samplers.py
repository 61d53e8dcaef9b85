"""Samplers against diffusers and closed forms."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import alpha_bar, ddim, ddim_indices, dpm_solver, eps_of, noised, posterior_mean

A_BAR = alpha_bar("cosine", 1000)


def some_denoiser(y: torch.Tensor, t: int) -> torch.Tensor:
    return torch.tanh(y) * 0.5 + 0.001 * t / 1000


@pytest.mark.parametrize("eta", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("subset", [10, 100])
@pytest.mark.filterwarnings("ignore")  # importing diffusers warns of its own dependencies
def test_ddim_equals_diffusers(eta, subset, generator):
    from diffusers import DDIMScheduler

    beta = 1 - A_BAR / torch.cat([torch.ones(1, dtype=torch.float64), A_BAR[:-1]])
    theirs = DDIMScheduler(
        num_train_timesteps=1000, trained_betas=beta.numpy(), clip_sample=False, set_alpha_to_one=True, steps_offset=1
    )
    theirs.alphas_cumprod = A_BAR
    theirs.set_timesteps(subset)
    indices = ddim_indices(1000, subset)
    assert theirs.timesteps.tolist() == indices
    draws = torch.randn(subset, 3, 5, 4, generator=generator, dtype=torch.float64)
    y = start = torch.randn(3, 5, 4, generator=generator, dtype=torch.float64)
    for t, z in zip(indices, draws, strict=True):
        y = theirs.step(some_denoiser(y, t), t, y, eta=eta, variance_noise=z).prev_sample
    source = iter(draws)
    *_, last = ddim(some_denoiser, start, A_BAR, indices, eta=eta, noise=lambda: next(source))
    # the final variance is zero, so the last draw is never taken by ours
    torch.testing.assert_close(last.y, y, atol=1e-9, rtol=1e-9)


def test_ddim_recovers_a_known_clean_latent(generator):
    clean = torch.randn(4, 3, generator=generator, dtype=torch.float64)
    start = torch.randn(4, 3, generator=generator, dtype=torch.float64)
    steps = list(ddim(lambda y, t: eps_of(y, clean, A_BAR[t]), start, A_BAR, ddim_indices(1000, 20)))
    assert [s.t for s in steps] == ddim_indices(1000, 20)
    torch.testing.assert_close(steps[-1].y, clean, atol=1e-9, rtol=0)
    *_, last = posterior_mean(lambda y, t: eps_of(y, clean, A_BAR[t]), start, A_BAR, ddim_indices(1000, 20))
    torch.testing.assert_close(last.y, clean, atol=1e-9, rtol=0)


def test_ddpm_is_ddim_with_eta_one_over_all_steps(generator):
    a = alpha_bar("linear", 60)
    draws = torch.randn(60, 4, generator=generator, dtype=torch.float64)
    start = torch.randn(4, generator=generator, dtype=torch.float64)
    ends = []
    for sampler, options in ((ddim, {"eta": 1.0}), (posterior_mean, {})):
        source = iter(draws)
        *_, last = sampler(some_denoiser, start, a, list(range(59, -1, -1)), noise=lambda s=source: next(s), **options)
        ends.append(last.y)
    torch.testing.assert_close(*ends, atol=1e-8, rtol=1e-8)


def test_one_step_of_eq_6_by_hand(generator):
    """Over a skipped stretch: alpha is the ratio of the two alpha_bar; the last step has no noise left to add."""
    y, z = torch.randn(2, 5, generator=generator, dtype=torch.float64)
    a, before = float(A_BAR[700]), float(A_BAR[300])
    eps, alpha = some_denoiser(y, 700), a / before
    mean = (y - (1 - alpha) / (1 - a) ** 0.5 * eps) / alpha**0.5
    first = next(posterior_mean(some_denoiser, y, A_BAR, [700, 300]))
    torch.testing.assert_close(first.y, mean, atol=1e-12, rtol=0)
    noisy = next(posterior_mean(some_denoiser, y, A_BAR, [700, 300], noise=lambda: z))
    deviation = ((1 - before) / (1 - a) * (1 - alpha)) ** 0.5
    torch.testing.assert_close(noisy.y, mean + deviation * z, atol=1e-12, rtol=0)
    (last,) = posterior_mean(some_denoiser, y, A_BAR, [700], noise=lambda: pytest.fail("nothing is left to draw"))
    torch.testing.assert_close(last.y, last.y0_hat, atol=1e-12, rtol=0)


def test_after_a_bound_the_noise_is_what_leads_from_it_to_the_state(generator):
    y = torch.randn(5, generator=generator, dtype=torch.float64)
    for sampler in (ddim, dpm_solver, posterior_mean):
        first = next(sampler(some_denoiser, y, A_BAR, [500, 200], on_y0_hat=lambda y: y.clamp(-0.1, 0.1)))
        a, before = float(A_BAR[500]), float(A_BAR[200])
        torch.testing.assert_close(a**0.5 * first.y0_hat + (1 - a) ** 0.5 * first.eps, y, atol=1e-12, rtol=0)
        expected = before**0.5 * first.y0_hat + (1 - before) ** 0.5 * first.eps
        if sampler is not posterior_mean:
            torch.testing.assert_close(first.y, expected, atol=1e-12, rtol=0)


def test_sampling_a_gaussian_gives_the_gaussian():
    mean, deviation = 3.0, 0.5

    def exact(y, t):
        a = float(A_BAR[t])
        variance = a * deviation**2 + 1 - a
        return (1 - a) ** 0.5 * (y - a**0.5 * mean) / variance

    start = torch.randn(20_000, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    *_, last = ddim(exact, start, A_BAR, ddim_indices(1000, 250, "trailing"))
    assert abs(last.y.mean() - mean) < 0.03 and abs(last.y.std() - deviation) < 0.02


def test_hooks_see_every_step():
    seen = []
    after = lambda y, a: (seen.append(a), y * 0)[1]  # noqa: E731
    *_, last = ddim(some_denoiser, torch.ones(3), A_BAR, [500, 200, 1], on_y0_hat=lambda y: y.clamp(-1, 1), after_step=after)
    assert seen == [float(A_BAR[200]), float(A_BAR[1]), 1.0]
    assert last.y.abs().max() == 0 and last.y0_hat.abs().max() <= 1


def test_eta_needs_noise():
    with pytest.raises(ValueError, match="eta is 0.5"):
        next(ddim(some_denoiser, torch.ones(3), A_BAR, [500], eta=0.5))


@pytest.mark.parametrize("eta", [0.0, 0.7])
def test_a_step_taken_once_is_plain_ddim_to_the_bit(eta, generator):
    """Against the loop without repeats, and draw by draw: nothing is drawn beside what eta needs."""
    start, *draws = torch.randn(9, 6, generator=generator)
    indices, y, left = ddim_indices(1000, 8), start, iter(draws)
    after = lambda y, a: y.clamp(-2, 2) * a**0.1  # noqa: E731
    for t, following in zip(indices, [*indices[1:], None], strict=True):
        a, a_prev = float(A_BAR[t]), 1.0 if following is None else float(A_BAR[following])
        eps = some_denoiser(y, t)
        y0_hat = (y - torch.tensor((1 - a) ** 0.5) * eps) / torch.tensor(a**0.5)
        sigma = eta * ((1 - a_prev) / (1 - a) * (1 - a / a_prev)) ** 0.5
        y = (a_prev**0.5 * y0_hat).add_(max(1 - a_prev - sigma**2, 0.0) ** 0.5 * eps)
        y = after(y + sigma * next(left) if sigma > 0 else y, a_prev)
    for options in ({}, {"repeats": 1}):
        source = iter(draws)
        *_, last = ddim(
            some_denoiser, start, A_BAR, indices, eta=eta, noise=lambda s=source: next(s), after_step=after, **options
        )
        assert torch.equal(last.y, y)


def test_a_repeated_step_by_hand(generator):
    """Down, noised back up by the forward process, down again; what is imposed is imposed each time."""
    y, z = torch.randn(2, 4, 5, generator=generator, dtype=torch.float64)
    a, a_prev = float(A_BAR[500]), float(A_BAR[200])
    once = lambda y: next(ddim(some_denoiser, y, A_BAR, [500, 200], after_step=lambda y, level: y + level)).y  # noqa: E731
    up = (a / a_prev) ** 0.5 * once(y) + (1 - a / a_prev) ** 0.5 * z
    found = next(ddim(some_denoiser, y, A_BAR, [500, 200], repeats=2, noise=lambda: z, after_step=lambda y, level: y + level))
    torch.testing.assert_close(found.y, once(up), atol=1e-12, rtol=0)
    clean, eps = torch.randn(2, 4, 50_000, generator=generator)
    again = noised(noised(clean, eps, a_prev), torch.randn(4, 50_000, generator=generator), a / a_prev)
    assert abs(again.std() - 1) < 0.01 and abs((again * clean).mean() - a**0.5) < 0.01


def test_repeats_need_noise():
    for repeats, noise in ((2, None), (0, lambda: torch.ones(3))):
        with pytest.raises(ValueError, match=f"repeats is {repeats}; expected at least 1"):
            next(ddim(some_denoiser, torch.ones(3), A_BAR, [500], repeats=repeats, noise=noise))
