"""SDE-DPM-Solver++ on Karras' levels, and ancestral DDPM, against diffusers and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.diffusion import (
    alpha_bar,
    ddim_indices,
    dpm_solver,
    eps_of,
    karras_levels,
    posterior_mean,
    sde_dpm_solver,
    to_eps,
)  # fmt: skip

A_BAR = alpha_bar("linear", 1000)


def clean_estimate(y: torch.Tensor, t: int) -> torch.Tensor:
    return torch.tanh(y) * 0.5 + t / 1000


def says_y0(y: torch.Tensor, t: int, a: torch.Tensor = A_BAR) -> torch.Tensor:
    """Like a network that says y0, told as noise."""
    return to_eps("y0", clean_estimate(y, t), y, a[t])


def start(generator: torch.Generator, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


def their_solver(a: torch.Tensor, steps: int, prediction: str, algorithm: str):
    """diffusers' with our schedule."""
    from diffusers import DPMSolverMultistepScheduler

    theirs = DPMSolverMultistepScheduler(
        num_train_timesteps=len(a), algorithm_type=algorithm, use_karras_sigmas=True, prediction_type=prediction
    )
    theirs.alphas_cumprod = a
    theirs.set_timesteps(steps)
    theirs.set_begin_index(0)  # else it starts at the second step where the first two have the same index
    return theirs


@pytest.mark.parametrize("steps", [1, 2, 10, 25])
@pytest.mark.parametrize("schedule, length", [("linear", 1000), ("cosine", 50)])
@pytest.mark.parametrize("algorithm", ["sde-dpmsolver++", "dpmsolver++"])
@pytest.mark.parametrize("prediction", ["sample", "epsilon"])
@pytest.mark.filterwarnings("ignore")  # importing diffusers warns of its own dependencies
def test_equals_diffusers(steps, schedule, length, algorithm, prediction, generator):
    a = alpha_bar(schedule, length)
    theirs = their_solver(a, steps, prediction, algorithm)
    levels = karras_levels(a, steps)
    assert [t for t, _ in levels] == theirs.timesteps.tolist()
    sigmas = np.sqrt([(1 - level) / level for _, level in levels])
    np.testing.assert_allclose(theirs.sigmas[:-1], sigmas, rtol=1e-6)
    theirs.sigmas = torch.cat([torch.tensor(sigmas), torch.zeros(1, dtype=torch.float64)])  # theirs are single precision
    draws = start(generator, steps, 3, 5, 4)
    y = first = start(generator, 3, 5, 4)
    for t, z in zip(theirs.timesteps, draws, strict=True):
        out = clean_estimate(y, int(t)) if prediction == "sample" else 0.1 * clean_estimate(y, int(t))
        y = theirs.step(out, t, y, variance_noise=z).prev_sample
    source = iter(draws) if algorithm == "sde-dpmsolver++" else None
    noise = None if source is None else lambda: next(source)
    if prediction == "sample":
        *_, last = sde_dpm_solver(lambda y, t: says_y0(y, t, a), first, a, steps, noise=noise)
    else:
        says_eps = lambda y, t: 0.1 * clean_estimate(y, t)  # noqa: E731
        *_, last = sde_dpm_solver(says_eps, first, a, steps, noise=noise, read_at="level")
    torch.testing.assert_close(last.y, y, atol=1e-5, rtol=1e-5)
    assert source is None or len(list(source)) == 1  # the last step draws nothing


def test_levels_by_hand():
    """Ends are the schedule's; in between, sigma^(1/7) is even, and the index is the nearest in log sigma."""
    levels = karras_levels(A_BAR, 4)
    sigma = [((1 - a) / a) ** 0.5 for _, a in levels]
    of_index = ((1 - A_BAR) / A_BAR).sqrt()
    assert abs(sigma[0] / of_index[-1] - 1) < 1e-9 and abs(sigma[-1] / of_index[0] - 1) < 1e-9
    roots = [s ** (1 / 7) for s in sigma]
    np.testing.assert_allclose(np.diff(roots), (roots[3] - roots[0]) / 3)
    assert [t for t, _ in levels] == [int((of_index.log() - np.log(s)).abs().argmin()) for s in sigma]
    assert karras_levels(A_BAR, 1)[0][0] == 999
    many = [t for t, _ in karras_levels(alpha_bar("cosine", 50), 200)]
    assert len(many) == 200 and many == sorted(many, reverse=True) and many[0] == 49 and many[-1] == 0
    with pytest.raises(ValueError, match="steps is 0; expected at least 1"):
        karras_levels(A_BAR, 0)


def test_recovers_a_known_clean_latent(generator):
    clean, draw = start(generator, 4, 3), lambda: start(generator, 4, 3)
    steps = list(sde_dpm_solver(lambda y, t: eps_of(y, clean, A_BAR[t]), draw(), A_BAR, 7, noise=draw))
    assert [s.t for s in steps] == [t for t, _ in karras_levels(A_BAR, 7)]
    torch.testing.assert_close(steps[-1].y, clean, atol=1e-9, rtol=0)
    states = [step.y for step in steps]
    for (_, a), before, step in zip(karras_levels(A_BAR, 7)[1:], states, steps[1:], strict=False):
        torch.testing.assert_close(a**0.5 * step.y0_hat + (1 - a) ** 0.5 * step.eps, before, atol=1e-9, rtol=0)


def test_without_noise_it_is_the_other_solver_on_its_levels(generator):
    """Where levels are those of whole indices; two steps and one are."""
    y = start(generator, 3, 4)
    for steps, indices in ((1, [999]), (2, [999, 0])):
        ours = list(sde_dpm_solver(says_y0, y, A_BAR, steps, noise=None))
        other = list(dpm_solver(says_y0, y, A_BAR, indices))
        for mine, theirs in zip(ours, other, strict=True):
            torch.testing.assert_close(mine.y, theirs.y, atol=1e-8, rtol=0)
            torch.testing.assert_close(mine.eps, theirs.eps, atol=1e-8, rtol=0)


def test_sampling_a_gaussian_gives_the_gaussian():
    mean, deviation, source = 3.0, 0.5, torch.Generator().manual_seed(0)
    draw = lambda: torch.randn(20_000, generator=source, dtype=torch.float64)  # noqa: E731

    def exact(y, t):
        a = float(A_BAR[t])
        return (1 - a) ** 0.5 * (y - a**0.5 * mean) / (a * deviation**2 + 1 - a)

    for noise in (draw, None):
        *_, last = sde_dpm_solver(exact, draw(), A_BAR, 60, noise=noise)
        assert abs(last.y.mean() - mean) < 0.03 and abs(last.y.std() - deviation) < 0.03


def test_hooks_act_on_every_step(generator, unchecked):
    seen, y = [], start(generator, 5)
    after = lambda y, a: (seen.append(a), y * 0)[1]  # noqa: E731
    bound = lambda y: y.clamp(-0.1, 0.1)  # noqa: E731
    steps = list(sde_dpm_solver(says_y0, y, A_BAR, 4, noise=lambda: y, on_y0_hat=bound, after_step=after))
    assert seen == [*(a for _, a in karras_levels(A_BAR, 4)[1:]), 1.0]
    assert all(step.y.abs().max() == 0 and step.y0_hat.abs().max() <= 0.1 for step in steps)
    with pytest.raises(ValueError, match="read_at is 'there'; expected 'index' or 'level'"):
        next(sde_dpm_solver(says_y0, y, A_BAR, 4, noise=None, read_at="there"))


@pytest.mark.parametrize("schedule, length", [("cosine", 50), ("linear", 100)])
@pytest.mark.filterwarnings("ignore")  # importing diffusers warns of its own dependencies
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
    assert indices == list(range(length - 1, -1, -1))
    ours = list(posterior_mean(lambda y, t: says_y0(y, t, a), first, a, indices, noise=lambda: next(source)))
    for mine, state in zip(ours, states, strict=True):
        torch.testing.assert_close(mine.y, state, atol=1e-8, rtol=1e-8)
    assert len(list(source)) == 1  # the last step draws nothing
    source = iter(draws.float())
    *_, last = posterior_mean(lambda y, t: says_y0(y, t, a), first.float(), a, indices, noise=lambda: next(source))
    torch.testing.assert_close(last.y.double(), states[-1], atol=1e-3, rtol=0)
