"""The forward process: published schedules, retained indices, and the three ways of saying what noise there is."""

from __future__ import annotations

import math

import pytest
import torch

from mwlib.diffusion import (
    alpha_bar,
    check_indices,
    ddim_indices,
    eps_of,
    network_target,
    noised,
    snr_weights,
    to_eps,
    y0_hat_of,
)

A_BAR = alpha_bar("cosine", 1000)
KINDS = ["linear", "cosine", "sigmoid", "sqrt"]


def test_noise_and_clean_estimate_are_inverse(generator):
    y_t, y0 = torch.randn(2, 5, 3, generator=generator, dtype=torch.float64)
    for a in (0.9, 0.01):
        torch.testing.assert_close(y0_hat_of(y_t, eps_of(y_t, y0, a), a), y0, atol=1e-9, rtol=0)
        torch.testing.assert_close(noised(y0, eps_of(y_t, y0, a), a), y_t, atol=1e-9, rtol=0)


@pytest.mark.parametrize("kind", ["eps", "y0", "v"])
def test_every_parametrisation_says_the_same(kind, generator):
    y, eps = torch.randn(2, 5, 3, 4, generator=generator, dtype=torch.float64)
    t = torch.tensor([0, 3, 500, 991, 998])
    y_t = noised(y, eps, A_BAR[t])
    output = network_target(kind, y, eps, A_BAR[t])
    found = to_eps(kind, output, y_t, A_BAR[t])
    torch.testing.assert_close(found, eps, atol=1e-7, rtol=1e-7)
    torch.testing.assert_close(y0_hat_of(y_t, found, A_BAR[t]), y, atol=1e-3, rtol=1e-3)


def test_values_of_the_published_table():
    cosine = alpha_bar("cosine", 1000)
    expected = torch.tensor([0.9999587, 0.9999126, 0.99918, 0.49229, 1.554e-4, 2.4e-9], dtype=torch.float64)
    torch.testing.assert_close(cosine[[0, 1, 11, 500, 991, 999]], expected, rtol=2e-2, atol=1e-6)
    assert alpha_bar("linear", 1000)[991].item() == pytest.approx(4.7e-5, rel=0.02)
    assert alpha_bar("sigmoid", 1000)[[991, 500]].tolist() == pytest.approx([9.8e-4, 0.498], rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("steps", [10, 200, 1000])
def test_falls_from_signal_to_noise(kind, steps):
    a = alpha_bar(kind, steps)
    assert a.shape == (steps,) and a.dtype == torch.float64
    assert (a.diff() < 0).all() and 0 <= a[-1] < 0.02 and a[0] < 1
    assert a[0] > 0.65


def test_schedules_by_hand():
    """The formulas of their papers at every step, one by one."""

    def logistic(v: float) -> float:
        return 1 / (1 + math.exp(-v))

    curves = {
        "cosine": lambda u: math.cos((u + 0.008) / 1.008 * math.pi / 2) ** 2,
        "sqrt": lambda u: 1 - (u + 1e-4) ** 0.5,
        "sigmoid": lambda u: (logistic(3 / 0.7) - logistic((6 * u - 3) / 0.7)) / (logistic(3 / 0.7) - logistic(-3 / 0.7)),
    }
    for kind in KINDS:
        left, expected = 1.0, []
        for i in range(1, 51):
            if kind == "linear":  # as many steps fewer, so many times the noise
                beta = (1e-4 + (0.02 - 1e-4) * (i - 1) / 49) * 1000 / 50
            else:
                beta = 1 - curves[kind](i / 50) / curves[kind]((i - 1) / 50)
            left *= 1 - min(max(beta, 0), 0.999)
            expected.append(left)
        torch.testing.assert_close(alpha_bar(kind, 50), torch.tensor(expected, dtype=torch.float64), rtol=1e-9, atol=1e-14)


def test_indices():
    assert ddim_indices(1000, 100)[:2] == [991, 981] and ddim_indices(1000, 100)[-2:] == [11, 1]
    assert ddim_indices(200, 10, "trailing")[0] == 199
    assert ddim_indices(1000, 3, "trailing") == [999, 666, 332] and ddim_indices(1000, 3) == [667, 334, 1]
    assert ddim_indices(50, 50) == list(range(49, -1, -1))
    for spacing in ("leading", "trailing"):
        for subset in (1, 7, 100, 199):
            found = ddim_indices(200, subset, spacing)
            assert len(found) == subset and found == sorted(set(found), reverse=True) and 0 <= found[-1] and found[0] < 200


STEPS = [  # of 1000 cosine steps: how many, spacing, the sentence
    (3, "leading", "start from noise at t = 667, where alpha_bar is 0.24, more than 0.15; expected 4 steps, or spacing=trailing"),
    (334, "leading", "ddim_steps is 334 of 1000, spacing leading: .* t = 667, .*; expected 333 steps, or spacing=trailing"),
    (372, "leading", "t = 743, where alpha_bar is 0.15, more than 0.15; expected 333 steps, or spacing=trailing"),
    (743, "leading", "t = 743, .*; expected 500 steps, or spacing=trailing"),
    (667, "trailing", "the last step would be at t = 0, for which no network is trained; expected 666 steps$"),
    (999, "trailing", "t = 0, for which no network is trained; expected 666 steps$"),
]


@pytest.mark.parametrize("count, spacing, message", STEPS)
def test_steps_that_begin_far_from_noise_or_end_where_nobody_trained_are_refused(count, spacing, message):
    with pytest.raises(ValueError, match=message):
        check_indices("ddim_steps", "cosine", 1000, count, spacing)


def test_steps_that_do_are_those_that_begin_in_noise_and_end_after_the_first_index():
    a = alpha_bar("cosine", 200)
    for spacing in ("leading", "trailing"):
        for count in range(1, 200):
            indices = ddim_indices(200, count, spacing)
            if a[indices[0]] <= 0.15 and indices[-1] >= 1:
                check_indices("ddim_steps", "cosine", 200, count, spacing)
            else:
                with pytest.raises(ValueError, match=f"ddim_steps is {count} of 200"):
                    check_indices("ddim_steps", "cosine", 200, count, spacing)
    check_indices("sampling_steps", "linear", 50, 50, "trailing", first=0)  # text to motion is trained at t = 0, too
    with pytest.raises(ValueError, match="t = 0, where alpha_bar is 0.90, .*; expected more steps, or another schedule$"):
        check_indices("sampling_steps", "linear", 1, 1, "trailing", first=0)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: alpha_bar("cos", 10), "expected"),
        (lambda: alpha_bar("cosine", 0), "expected"),
        (lambda: ddim_indices(10, 11), "expected"),
        (lambda: ddim_indices(10, 5, "middle"), "'middle'"),
        (lambda: network_target("x", torch.ones(1), torch.ones(1), 0.5), "'x'"),
        (lambda: to_eps("x", torch.ones(1), torch.ones(1), 0.5), "'x'"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_weights_by_signal_over_noise_are_bounded_at_both_ends():
    assert snr_weights(torch.tensor([0.99, 0.5, 0.001], dtype=torch.float64)).tolist() == pytest.approx([5.0, 1.0, 0.05])
