"""DPM-Solver++(2M) against diffusers, closed forms and DDIM."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import alpha_bar, ddim, ddim_indices, dpm_solver, eps_of

A_BAR = alpha_bar("cosine", 1000)


def some_denoiser(y: torch.Tensor, t: int) -> torch.Tensor:
    return torch.tanh(y) * 0.5 + 0.001 * t / 1000


def start(generator: torch.Generator, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


@pytest.mark.parametrize("subset", [3, 10, 20])
@pytest.mark.parametrize("schedule", ["linear", "cosine"])
@pytest.mark.filterwarnings("ignore")  # importing diffusers warns of its own dependencies
def test_equals_diffusers(subset, schedule, generator):
    from diffusers import DPMSolverMultistepScheduler

    a = alpha_bar(schedule, 1000)
    indices = ddim_indices(1000, subset)
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


def test_recovers_a_known_clean_latent_and_takes_every_step(generator):
    clean = start(generator, 4, 3)
    steps = list(dpm_solver(lambda y, t: eps_of(y, clean, A_BAR[t]), start(generator, 4, 3), A_BAR, ddim_indices(1000, 7)))
    assert [s.t for s in steps] == ddim_indices(1000, 7)
    for step in steps:
        torch.testing.assert_close(step.y0_hat, clean, atol=1e-7, rtol=0)
    torch.testing.assert_close(steps[-1].y, clean, atol=1e-9, rtol=0)


def test_one_step_is_ddim_and_the_end_is_the_clean_estimate(generator):
    y = start(generator, 6)
    (one,), (other,) = (list(sampler(some_denoiser, y, A_BAR, [500])) for sampler in (dpm_solver, ddim))
    torch.testing.assert_close(one.y, other.y, atol=1e-12, rtol=0)
    first, same = (next(sampler(some_denoiser, y, A_BAR, [500, 100])) for sampler in (dpm_solver, ddim))  # noise is left
    torch.testing.assert_close(first.y, same.y, atol=1e-12, rtol=0)
    *_, last = dpm_solver(some_denoiser, y, A_BAR, ddim_indices(1000, 5))
    torch.testing.assert_close(last.y, last.y0_hat, atol=0, rtol=0)


@pytest.mark.parametrize("subset", [10, 20, 40])
def test_closer_than_ddim_to_the_exact_path(subset, generator):
    deviation = 0.5

    def exact(y, t):  # of a Gaussian around zero
        a = float(A_BAR[t])
        return (1 - a) ** 0.5 * y / (a * deviation**2 + 1 - a)

    y, indices = start(generator, 200), ddim_indices(1000, subset, "trailing")
    a = A_BAR[indices[0]]
    truth = deviation * y / (a * deviation**2 + 1 - a).sqrt()  # the probability flow keeps every quantile
    errors = []
    for solver in (dpm_solver, ddim):
        *_, last = solver(exact, y, A_BAR, indices)
        errors.append((last.y - truth).norm())
    assert errors[0] < errors[1] / 1.5


def test_hooks_act_on_every_step(generator):
    seen = []

    def after(y, a):
        seen.append(a)
        return y * 0

    indices = ddim_indices(1000, 4)
    steps = list(
        dpm_solver(some_denoiser, start(generator, 5), A_BAR, indices, on_y0_hat=lambda y: y.clamp(-0.1, 0.1), after_step=after)
    )
    assert seen == [float(A_BAR[t]) for t in indices[1:]] + [1.0]
    assert all(s.y0_hat.abs().max() <= 0.1 and not s.y.any() for s in steps)
    a = float(A_BAR[indices[0]])  # eps belongs to the clean estimate after the bound: together they give the step's input back
    recovered = a**0.5 * steps[0].y0_hat + (1 - a) ** 0.5 * steps[0].eps
    torch.testing.assert_close(recovered, start(torch.Generator().manual_seed(0), 5), atol=1e-9, rtol=0)
