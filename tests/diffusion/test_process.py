"""The forward process, and the three ways of saying what noise there is."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import alpha_bar, eps_of, network_target, noised, snr_weights, to_eps, y0_hat_of

A_BAR = alpha_bar("cosine", 1000)


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


@pytest.mark.parametrize("say", [network_target, to_eps])
def test_unknown_prediction(say):
    with pytest.raises(ValueError, match="'x'"):
        say("x", torch.ones(1), torch.ones(1), 0.5)


def test_weights_by_signal_over_noise_are_bounded_at_both_ends():
    assert snr_weights(torch.tensor([0.99, 0.5, 0.001], dtype=torch.float64)).tolist() == pytest.approx([5.0, 1.0, 0.05])
