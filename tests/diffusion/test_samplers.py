"""Samplers: what all of them promise, against diffusers, closed forms and steps by hand."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mwlib.diffusion import (
    WindowNoise,
    alpha_bar,
    ddim,
    ddim_indices,
    dpm_solver,
    eps_of,
    karras_levels,
    noised,
    posterior_mean,
    sde_dpm_solver,
    to_eps,
)

A_BAR, LINEAR = alpha_bar("cosine", 1000), alpha_bar("linear", 1000)
quiet = pytest.mark.filterwarnings("ignore")  # importing diffusers warns of its own dependencies
SAMPLERS = {
    "ddim": ddim,
    "ddim with noise": partial(ddim, eta=1.0),
    "repeated": partial(ddim, repeats=2),
    "dpm": dpm_solver,
    "eq. 6": posterior_mean,
    "karras": sde_dpm_solver,
}
CASES = [(name, noisy) for name in SAMPLERS for noisy in (True, False)]
for never in [("ddim with noise", False), ("repeated", False), ("ddim", True)]:
    CASES.remove(never)


def some_denoiser(y: torch.Tensor, t: int) -> torch.Tensor:
    return torch.tanh(y) * 0.5 + 0.001 * t / 1000


def clean_estimate(y: torch.Tensor, t: int) -> torch.Tensor:
    return torch.tanh(y) * 0.5 + t / 1000


def says_y0(y: torch.Tensor, t: int, a: torch.Tensor = LINEAR) -> torch.Tensor:
    """Like a network that says y0, told as noise."""
    return to_eps("y0", clean_estimate(y, t), y, a[t])


def exact(y: torch.Tensor, t: int, a_bar: torch.Tensor, mean: float, deviation: float) -> torch.Tensor:
    """The noise in samples of a Gaussian."""
    a = float(a_bar[t])
    return (1 - a) ** 0.5 * (y - a**0.5 * mean) / (a * deviation**2 + 1 - a)


def start(generator: torch.Generator, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


def sampled(name: str, denoise, y, a, indices, noise, **hooks) -> tuple[list, list[int], list[float]]:
    """The steps of a sampler; the indices that it should tell the network, and the levels of the states that it is in."""
    if name == "karras":
        told, levels = zip(*karras_levels(a, len(indices)), strict=True)
        return list(sde_dpm_solver(denoise, y, a, len(indices), noise=noise, **hooks)), list(told), list(levels)
    options = {} if noise is None else {"noise": noise}
    return list(SAMPLERS[name](denoise, y, a, indices, **options, **hooks)), indices, [float(a[t]) for t in indices]


cases = given(
    st.sampled_from(CASES),
    st.sampled_from(["linear", "cosine", "sigmoid", "sqrt"]),
    st.integers(12, 300),
    st.integers(1, 12),
    st.sampled_from(["leading", "trailing"]),
)


@cases
@settings(deadline=None, max_examples=80)
def test_who_knows_the_answer_ends_at_it_by_every_sampler(case, schedule, length, count, spacing):
    """Every index is visited; each step's clean estimate and noise give back the state that it left; the end has no noise."""
    (name, noisy), draws = case, torch.Generator().manual_seed(length)
    a, clean, y = alpha_bar(schedule, length), start(draws, 4, 3), start(draws, 4, 3)
    noise = (lambda: start(draws, 4, 3)) if noisy else None
    knows = lambda y, t: eps_of(y, clean, a[t])  # noqa: E731
    steps, told, levels = sampled(name, knows, y, a, ddim_indices(length, count, spacing), noise)
    assert [step.t for step in steps] == told
    torch.testing.assert_close(steps[-1].y, clean, atol=1e-7, rtol=0)
    if name != "repeated":
        for before, step, level in zip([y, *(step.y for step in steps)], steps, levels, strict=False):
            torch.testing.assert_close(step.y0_hat, clean, atol=1e-7 / level**0.5, rtol=0)
            torch.testing.assert_close(level**0.5 * step.y0_hat + (1 - level) ** 0.5 * step.eps, before, atol=1e-8, rtol=0)


@cases
@settings(deadline=None, max_examples=60)
def test_hooks_act_on_every_step_of_every_sampler(case, schedule, length, count, spacing):
    """The clean estimate is bounded, and the noise is what leads from its bound to the state; then comes `after_step`."""
    (name, noisy), draws, seen = case, torch.Generator().manual_seed(length), []
    a, y = alpha_bar(schedule, length), start(draws, 2, 5)
    after = lambda y, a: (seen.append((a, y)), 0 * y)[1]  # noqa: E731
    hooks = {"on_y0_hat": lambda y: y.clamp(-0.1, 0.1), "after_step": after}
    noise = (lambda: start(draws, 2, 5)) if noisy else None
    steps, _, levels = sampled(name, some_denoiser, y, a, ddim_indices(length, count, spacing), noise, **hooks)
    assert [level for level, _ in seen][:: 2 if name == "repeated" else 1] == [*levels[1:], 1.0]
    assert all(step.y0_hat.abs().max() <= 0.1 and not step.y.any() for step in steps)
    if name != "repeated":
        back = levels[0] ** 0.5 * steps[0].y0_hat + (1 - levels[0]) ** 0.5 * steps[0].eps
        torch.testing.assert_close(back, y, atol=1e-8, rtol=0)
    if name in ("ddim", "dpm") and noise is None:  # the first step is DDIM's, with what the bound left
        onward = seen[0][0] ** 0.5 * steps[0].y0_hat + (1 - seen[0][0]) ** 0.5 * steps[0].eps
        torch.testing.assert_close(seen[0][1], onward, atol=1e-12, rtol=0)


def test_noise_belongs_to_the_window():
    whole = WindowNoise(3, range(5), (2, 4, 3))
    first, second = whole(), whole()
    part = WindowNoise(3, [3, 4], (2, 4, 3))
    assert torch.equal(part(), first[3:]) and torch.equal(part(), second[3:])
    assert not torch.equal(WindowNoise(4, [3], (2, 4, 3))(), first[3:4])


@pytest.mark.parametrize("eta", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("subset", [10, 100])
@quiet
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
    draws = start(generator, subset, 3, 5, 4)
    y = first = start(generator, 3, 5, 4)
    for t, z in zip(indices, draws, strict=True):
        y = theirs.step(some_denoiser(y, t), t, y, eta=eta, variance_noise=z).prev_sample
    source = iter(draws)  # the final variance is zero, so the last draw is never taken by ours
    *_, last = ddim(some_denoiser, first, A_BAR, indices, eta=eta, noise=lambda: next(source))
    torch.testing.assert_close(last.y, y, atol=1e-9, rtol=1e-9)


@pytest.mark.parametrize("subset", [3, 10, 20])
@pytest.mark.parametrize("schedule", ["linear", "cosine"])
@quiet
def test_dpm_solver_equals_diffusers(subset, schedule, generator):
    from diffusers import DPMSolverMultistepScheduler

    a, indices = alpha_bar(schedule, 1000), ddim_indices(1000, subset)
    theirs = DPMSolverMultistepScheduler(num_train_timesteps=1000, final_sigmas_type="zero")
    theirs.set_timesteps(subset)
    theirs.timesteps = torch.tensor(indices)
    # their schedule as sigma / alpha, one entry a step and the noiseless end, in float64
    theirs.sigmas = torch.cat([((1 - a) / a).sqrt()[indices], torch.zeros(1, dtype=torch.float64)])
    y = first = start(generator, 3, 5, 4)
    for t in indices:
        y = theirs.step(some_denoiser(y, t), t, y).prev_sample
    *_, last = dpm_solver(some_denoiser, first, a, indices)
    torch.testing.assert_close(last.y, y, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("steps", [1, 2, 10, 25])
@pytest.mark.parametrize("schedule, length", [("linear", 1000), ("cosine", 50)])
@pytest.mark.parametrize("algorithm", ["sde-dpmsolver++", "dpmsolver++"])
@quiet
def test_karras_levels_and_noise_equal_diffusers(steps, schedule, length, algorithm, generator):
    from diffusers import DPMSolverMultistepScheduler

    a = alpha_bar(schedule, length)
    theirs = DPMSolverMultistepScheduler(length, algorithm_type=algorithm, use_karras_sigmas=True, prediction_type="sample")
    theirs.alphas_cumprod = a
    theirs.set_timesteps(steps)
    theirs.set_begin_index(0)  # else it starts at the second step where the first two have the same index
    levels = karras_levels(a, steps)
    assert [t for t, _ in levels] == theirs.timesteps.tolist()
    sigmas = np.sqrt([(1 - level) / level for _, level in levels])
    np.testing.assert_allclose(theirs.sigmas[:-1], sigmas, rtol=1e-6)
    theirs.sigmas = torch.cat([torch.tensor(sigmas), torch.zeros(1, dtype=torch.float64)])  # theirs are single precision
    draws = start(generator, steps, 3, 5, 4)
    y = first = start(generator, 3, 5, 4)
    for t, z in zip(theirs.timesteps, draws, strict=True):
        y = theirs.step(clean_estimate(y, int(t)), t, y, variance_noise=z).prev_sample
    source = iter(draws) if algorithm == "sde-dpmsolver++" else None
    noise = None if source is None else lambda: next(source)
    *_, last = sde_dpm_solver(lambda y, t: says_y0(y, t, a), first, a, steps, noise=noise)
    torch.testing.assert_close(last.y, y, atol=1e-5, rtol=1e-5)
    assert source is None or len(list(source)) == 1  # the last step draws nothing


@pytest.mark.parametrize("schedule, length", [("cosine", 50), ("linear", 100)])
@quiet
def test_posterior_mean_with_noise_over_all_indices_is_ancestral_ddpm(schedule, length, generator):
    """MDM's sampler: the network says y0, the variance is that of the posterior ("fixed small"), nothing is clipped."""
    from diffusers import DDPMScheduler

    a = alpha_bar(schedule, length)
    beta = 1 - a / torch.cat([torch.ones(1, dtype=torch.float64), a[:-1]])
    theirs = DDPMScheduler(
        length, trained_betas=beta.numpy(), variance_type="fixed_small", prediction_type="sample", clip_sample=False
    )
    theirs.alphas_cumprod, theirs.betas, theirs.alphas = a, beta, 1 - beta
    y = first = start(generator, 3, 5, 4)
    draws, states = start(generator, length, 3, 5, 4), []
    for t, z in zip(range(length - 1, -1, -1), draws, strict=True):
        mean = theirs.step(clean_estimate(y, t), t, y, generator=torch.Generator().manual_seed(0)).prev_sample
        if t > 0:  # they draw their own noise: what they add is taken off, and ours put in its place
            variance = theirs._get_variance(t)
            theirs_drawn = torch.randn(y.shape, generator=torch.Generator().manual_seed(0), dtype=y.dtype)
            mean = mean + variance**0.5 * (z - theirs_drawn)
        y = mean
        states.append(y)
    source, indices = iter(draws), ddim_indices(length, length)
    ours = list(posterior_mean(lambda y, t: says_y0(y, t, a), first, a, indices, noise=lambda: next(source)))
    for mine, state in zip(ours, states, strict=True):
        torch.testing.assert_close(mine.y, state, atol=1e-8, rtol=1e-8)
    assert len(list(source)) == 1  # the last step draws nothing
    source = iter(draws.float())
    *_, last = posterior_mean(lambda y, t: says_y0(y, t, a), first.float(), a, indices, noise=lambda: next(source))
    torch.testing.assert_close(last.y.double(), states[-1], atol=1e-3, rtol=0)


def test_levels_by_hand():
    """Ends are the schedule's; in between, sigma^(1/7) is even, and the index is the nearest in log sigma."""
    levels = karras_levels(LINEAR, 4)
    sigma = [((1 - a) / a) ** 0.5 for _, a in levels]
    of_index = ((1 - LINEAR) / LINEAR).sqrt()
    assert abs(sigma[0] / of_index[-1] - 1) < 1e-9 and abs(sigma[-1] / of_index[0] - 1) < 1e-9
    roots = [s ** (1 / 7) for s in sigma]
    np.testing.assert_allclose(np.diff(roots), (roots[3] - roots[0]) / 3)
    assert [t for t, _ in levels] == [int((of_index.log() - np.log(s)).abs().argmin()) for s in sigma]
    assert karras_levels(LINEAR, 1)[0][0] == 999
    many = [t for t, _ in karras_levels(alpha_bar("cosine", 50), 200)]
    assert len(many) == 200 and many == sorted(many, reverse=True) and many[0] == 49 and many[-1] == 0


def test_without_noise_karras_levels_are_plain_where_they_are_those_of_indices(generator):
    """Two steps and one are."""
    y = start(generator, 3, 4)
    for steps, indices in ((1, [999]), (2, [999, 0])):
        ours, other = sde_dpm_solver(says_y0, y, LINEAR, steps, noise=None), dpm_solver(says_y0, y, LINEAR, indices)
        for mine, theirs in zip(ours, other, strict=True):
            torch.testing.assert_close((mine.y, mine.eps), (theirs.y, theirs.eps), atol=1e-8, rtol=0)


def test_ddpm_is_ddim_with_eta_one_over_all_steps(generator):
    a, draws, y = alpha_bar("linear", 60), start(generator, 60, 4), start(generator, 4)
    ends = []
    for sampler in (partial(ddim, eta=1.0), posterior_mean):
        source = iter(draws)
        *_, last = sampler(some_denoiser, y, a, list(range(59, -1, -1)), noise=lambda s=source: next(s))
        ends.append(last.y)
    torch.testing.assert_close(*ends, atol=1e-8, rtol=1e-8)


def test_one_step_of_eq_6_by_hand(generator):
    """Over a skipped stretch: alpha is the ratio of the two alpha_bar; the last step has no noise left to add."""
    y, z = start(generator, 2, 5)
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


def test_one_step_of_dpm_solver_is_ddim_and_its_end_is_the_clean_estimate(generator):
    y = start(generator, 6)
    for indices in ([500], [500, 100]):  # with the last, and with noise left
        one, other = (next(sampler(some_denoiser, y, A_BAR, indices)) for sampler in (dpm_solver, ddim))
        torch.testing.assert_close(one.y, other.y, atol=1e-12, rtol=0)
    *_, last = dpm_solver(some_denoiser, y, A_BAR, ddim_indices(1000, 5))
    torch.testing.assert_close(last.y, last.y0_hat, atol=0, rtol=0)


@pytest.mark.parametrize("subset", [10, 20, 40])
def test_dpm_solver_is_closer_than_ddim_to_the_exact_path(subset, generator):
    deviation, indices, y = 0.5, ddim_indices(1000, subset, "trailing"), start(generator, 200)
    a = A_BAR[indices[0]]
    truth = deviation * y / (a * deviation**2 + 1 - a).sqrt()  # the probability flow keeps every quantile
    errors = []
    for solver in (dpm_solver, ddim):
        *_, last = solver(lambda y, t: exact(y, t, A_BAR, 0.0, deviation), y, A_BAR, indices)
        errors.append((last.y - truth).norm())
    assert errors[0] < errors[1] / 1.5


def test_sampling_a_gaussian_gives_the_gaussian():
    source = torch.Generator().manual_seed(0)
    draw = lambda: torch.randn(20_000, generator=source, dtype=torch.float64)  # noqa: E731
    of = lambda a: lambda y, t: exact(y, t, a, 3.0, 0.5)  # noqa: E731
    for run in (
        ddim(of(A_BAR), draw(), A_BAR, ddim_indices(1000, 250, "trailing")),
        sde_dpm_solver(of(LINEAR), draw(), LINEAR, 60, noise=draw),
        sde_dpm_solver(of(LINEAR), draw(), LINEAR, 60, noise=None),
    ):
        *_, last = run
        assert abs(last.y.mean() - 3) < 0.03 and abs(last.y.std() - 0.5) < 0.02


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: next(ddim(some_denoiser, torch.ones(3), A_BAR, [500], eta=0.5)), "eta is 0.5"),
        (lambda: next(ddim(some_denoiser, torch.ones(3), A_BAR, [500], repeats=2)), "repeats is 2; expected at least 1"),
        (lambda: next(ddim(some_denoiser, torch.ones(3), A_BAR, [500], repeats=0, noise=lambda: torch.ones(3))), "repeats is 0"),
        (lambda: karras_levels(LINEAR, 0), "steps is 0; expected at least 1"),
    ],
)  # fmt: skip
def test_mistakes_are_told(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("eta", [0.0, 0.7])
def test_a_step_taken_once_is_plain_ddim_to_the_bit(eta, generator):
    """Against the loop without repeats, and draw by draw: nothing is drawn beside what eta needs."""
    first, *draws = torch.randn(9, 6, generator=generator)
    indices, y, left = ddim_indices(1000, 8), first, iter(draws)
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
            some_denoiser, first, A_BAR, indices, eta=eta, noise=lambda s=source: next(s), after_step=after, **options
        )
        assert torch.equal(last.y, y)


def test_a_repeated_step_by_hand(generator):
    """Down, noised back up by the forward process, down again; what is imposed is imposed each time."""
    y, z = start(generator, 2, 4, 5)
    a, a_prev = float(A_BAR[500]), float(A_BAR[200])
    once = lambda y: next(ddim(some_denoiser, y, A_BAR, [500, 200], after_step=lambda y, level: y + level)).y  # noqa: E731
    up = (a / a_prev) ** 0.5 * once(y) + (1 - a / a_prev) ** 0.5 * z
    found = next(ddim(some_denoiser, y, A_BAR, [500, 200], repeats=2, noise=lambda: z, after_step=lambda y, level: y + level))
    torch.testing.assert_close(found.y, once(up), atol=1e-12, rtol=0)
    clean, eps = torch.randn(2, 4, 50_000, generator=generator)
    again = noised(noised(clean, eps, a_prev), torch.randn(4, 50_000, generator=generator), a / a_prev)
    assert abs(again.std() - 1) < 0.01 and abs((again * clean).mean() - a**0.5) < 0.01
