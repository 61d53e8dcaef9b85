"""Two bands whose phases are bound or not: the closed forms against draws, and S11, independence of Gaussian bands."""

from __future__ import annotations

import math

import pytest
import torch

from mwlib.text_to_motion import spectra

SIGMAS = torch.tensor([0.2, 0.4, 0.8], dtype=torch.float64)
DRAWS = 200_000


def test_s11_gaussian_bands_know_nothing_of_each_other(generator):
    c = spectra.gaussian_motions(spectra.power_law(128), 2000, generator)
    correlation = torch.corrcoef(torch.stack([c[:, 2], c[:, 64]]))[0, 1]
    assert abs(float(correlation)) < 4 / math.sqrt(2000)
    assert c.square().mean(0).numpy() == pytest.approx(spectra.power_law(128).numpy(), rel=4 * math.sqrt(2 / 2000))


@pytest.mark.parametrize("bound", [True, False])
def test_bands_are_what_they_say(generator, bound):
    seen = spectra.two_bands(1000, 0.0, bound, generator)
    torch.testing.assert_close(seen.noisy_high, seen.high)
    assert seen.noisy_low.abs().numpy() == pytest.approx(1) and seen.high.abs().numpy() == pytest.approx(0.3)
    follows = (seen.high - 0.3 * spectra.squared_phase(2.5 * seen.noisy_low)).abs().max()
    assert (float(follows) < 1e-12) == bound
    noisy = spectra.two_bands(20_000, 0.5, bound, generator)
    assert float((noisy.noisy_high - noisy.high).abs().square().mean()) == pytest.approx(0.25, rel=0.03)


@pytest.mark.parametrize("bound, expected", [(True, [0.066, 0.252, 0.684]), (False, [0.307, 0.641, 0.880])])
def test_s12_the_low_band_helps_only_if_phases_are_bound(generator, bound, expected):
    alone, both = spectra.relative_errors(SIGMAS, bound)
    assert alone.tolist() == pytest.approx([0.307, 0.641, 0.880], abs=0.005)
    assert both.tolist() == pytest.approx(expected, abs=0.005)
    for sigma, less, more in zip(SIGMAS.tolist(), alone.tolist(), both.tolist(), strict=True):
        seen = spectra.two_bands(DRAWS, sigma, bound, generator)
        phase = spectra.squared_phase(seen.noisy_low)
        assert spectra.regression_error(seen.noisy_high[:, None], seen.high) == pytest.approx(less, rel=0.02)
        inputs = torch.stack([seen.noisy_high, phase], dim=1)
        assert spectra.regression_error(inputs, seen.high) == pytest.approx(more, rel=0.02)


def test_an_error_is_measured_on_samples_that_were_not_fitted(generator):
    """Inputs that say nothing: fitted to as many numbers as they are, they would have no error at all."""
    target = torch.randn(40, generator=generator, dtype=torch.complex128)
    inputs = torch.randn(40, 19, generator=generator, dtype=torch.complex128)
    assert spectra.regression_error(inputs, target) > 1
    with pytest.raises(ValueError, match="40 samples; expected more than twice the 20 inputs"):
        spectra.regression_error(torch.cat([inputs, inputs[:, :1]], dim=1), target)
