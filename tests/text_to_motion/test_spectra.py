"""The spectral theory against draws, the samplers, SciPy, and values of an independent computation; bands bound or not."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from scipy.optimize import brentq

from mwlib.diffusion import alpha_bar, ddim, ddim_indices, eps_of
from mwlib.text_to_motion import spectra
from mwlib.transforms import DCTTransform

FRAMES, DRAWS = 128, 4000
POWER = spectra.power_law(FRAMES)
A_BAR = alpha_bar("cosine", 1000)
LATE = 4 * math.sqrt(2 / DRAWS)  # four deviations of the mean of as many squared normal numbers


@pytest.fixture
def clean(generator) -> torch.Tensor:
    """Coefficients of Gaussian motions, (draws, frames)."""
    return spectra.gaussian_motions(POWER, DRAWS, generator)


def last_above(power: torch.Tensor, curve: torch.Tensor) -> torch.Tensor:
    """The largest index at which the SNR is at least 1."""
    return (curve[:, None] >= 1 / (1 + power)).sum(0) - 1


def slope(power: torch.Tensor, first: int, last: int) -> float:
    """Of log P_k over log k, k = first ... last: -a where the power falls as k^-a; drift has a k^-4 of its own, a jump k^-2."""
    return float(np.polyfit(np.log(np.arange(first, last + 1)), power[first : last + 1].log().numpy(), 1)[0])


def _noise(generator, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


def test_a_power_law_falls_as_it_says_and_drift_has_one_of_its_own():
    assert float(POWER.mean()) == pytest.approx(1) and POWER[0] == POWER[1]
    assert (POWER[2:] * torch.arange(2, FRAMES) ** 2).numpy() == pytest.approx(float(POWER[1]))
    assert spectra.power_law(5, 0.0).tolist() == [1.0] * 5
    assert slope(spectra.power_law(FRAMES, 3.5), 3, 85) == pytest.approx(-3.5)
    """Who walks straight on at one speed holds no frequency, and has the spectrum k^-4 (odd k; the even ones are 0)."""
    ramp = spectra.power_of(torch.arange(400.0, dtype=torch.float64)[:, None])
    k = torch.arange(1, 40, 2)
    assert float(ramp[2:40:2].max()) < 1e-15 * float(ramp[1])
    assert (ramp[k] / ramp[1] * k**4).numpy() == pytest.approx(1, abs=0.02)


def test_the_spectrum_of_motions_is_that_of_the_orthonormal_transform(generator):
    x = _noise(generator, 5, 3, 24, 4)
    c = DCTTransform(24, 4)(x)
    np.testing.assert_allclose(spectra.power_of(x), c.square().mean((0, 1, 3)), rtol=1e-10)
    np.testing.assert_allclose(spectra.power_of(x).sum(), x.square().sum(-2).mean(), rtol=1e-10)  # Parseval
    share = spectra.energy_share(spectra.power_of(x))
    assert share[-1] == pytest.approx(1) and share[2] == pytest.approx(float(c[..., :3, :].square().sum() / c.square().sum()))


@pytest.mark.parametrize("t", [100, 500, 900])
def test_s1_power_under_noise_is_what_draws_have(clean, generator, t):
    a = A_BAR[t]
    noisy = a.sqrt() * clean + (1 - a).sqrt() * _noise(generator, *clean.shape)
    expected = spectra.forward_power(POWER, a)
    assert float((noisy.square().mean(0) / expected - 1).abs().max()) < LATE


def test_s2_s3_one_draw_has_a_cross_term_and_noise_is_flat(clean, generator):
    a, eps = A_BAR[500], _noise(generator, FRAMES)
    one = (a.sqrt() * clean[0] + (1 - a).sqrt() * eps).square()
    cross = 2 * (a * (1 - a)).sqrt() * clean[0] * eps
    sides = a * clean[0].square() + (1 - a) * eps.square()
    torch.testing.assert_close(one, sides + cross)
    assert float((one / spectra.forward_power(POWER, a)).max()) > 4
    eps = _noise(generator, DRAWS, FRAMES)
    assert spectra.power_of(eps[..., None]).mean().item() == pytest.approx(1, abs=0.006)
    assert (spectra.power_of(eps[..., None]) - 1).abs().max() < LATE
    assert torch.fft.fft(eps).abs().square().mean().item() == pytest.approx(FRAMES, rel=0.006)


def test_s4_s5_ratios_stay_and_recovery_has_its_time():
    ratio = spectra.snr(POWER, A_BAR[[10, 300, 900]])
    assert (ratio[:, 2] / ratio[:, 32]).tolist() == pytest.approx([256.0] * 3)
    assert ratio[1, 2] == pytest.approx(float(A_BAR[300] * POWER[2] / (1 - A_BAR[300])))
    k = [1, 2, 4, 8, 16, 32, 64, 127]
    assert spectra.recovery_time(POWER, 1000)[k].round().tolist() == [909, 821, 666, 452, 256, 130, 62, 27]
    assert last_above(POWER, A_BAR)[k].tolist() == [907, 819, 664, 450, 254, 128, 61, 27]
    without_mean = torch.arange(1, 60, dtype=torch.float64) ** -2
    few = last_above(without_mean / without_mean.mean(), A_BAR)[[0, 1, 4, 9, 29, 58]]
    assert few.tolist() == pytest.approx([893, 793, 554, 339, 118, 57], abs=1)


@pytest.mark.parametrize("gamma", [0.1, 1.0, 9.0])
def test_the_closed_form_solves_the_schedule(gamma):
    def excess(t: float, power: float) -> float:
        a = math.cos((t / 1000 + 0.008) / 1.008 * math.pi / 2) ** 2
        return a * power - gamma * (1 - a)

    expected = [brentq(excess, -7.9, 999.9, args=(power,)) for power in POWER.tolist()]
    np.testing.assert_allclose(spectra.recovery_time(POWER, 1000, gamma), expected, atol=1e-6)


def test_s6_a_spectrum_that_does_not_fall_has_another_order():
    white = torch.ones(FRAMES, dtype=torch.float64)
    assert last_above(white, A_BAR).unique().tolist() == [495]
    gait = POWER.clone()
    gait[16] = 5.0
    times = last_above(gait, A_BAR)
    assert times[[16, 4]].tolist() == [729, 664]
    assert not (times.diff() <= 0).all() and (last_above(POWER, A_BAR).diff() <= 0).all()


def test_s7_s8_the_best_estimate_its_error_and_where_it_has_half_of_the_power(clean, generator):
    share = spectra.unknown_share(POWER, A_BAR[500])
    assert share[[1, 4, 16, 64]].tolist() == pytest.approx([0.021, 0.254, 0.845, 0.989], abs=5e-4)
    a, gain = A_BAR[500], spectra.wiener_gain(POWER, A_BAR[500])
    noisy = a.sqrt() * clean + (1 - a).sqrt() * _noise(generator, *clean.shape)
    error = {factor: (factor * gain * noisy - clean).square().mean(0) / POWER for factor in (1.0, 0.9, 1.1)}
    np.testing.assert_allclose(error[1.0], share, rtol=LATE)
    assert error[1.0].sum() < min(error[0.9].sum(), error[1.1].sum())  # no other gain is better
    ratio = spectra.snr(POWER, A_BAR[[7, 500]])
    torch.testing.assert_close(A_BAR[[7, 500], None].sqrt() * spectra.wiener_gain(POWER, A_BAR[[7, 500]]), ratio / (1 + ratio))
    torch.testing.assert_close(spectra.unknown_share(POWER, A_BAR[[7, 500]]), 1 / (1 + ratio))
    every = ddim_indices(1000, 1000)
    estimate = spectra.reverse_power(POWER, A_BAR, every).estimate
    half = {k: every[int((estimate[:, k] >= POWER[k] / 2).nonzero()[0])] for k in (1, 4, 16, 64)}
    assert half == pytest.approx({1: 900, 4: 650, 16: 250, 64: 50}, abs=15)
    assert list(half.values()) == pytest.approx(last_above(POWER, A_BAR)[[*half]].tolist(), abs=2)


@pytest.mark.parametrize(
    "rule, steps, expected",
    [
        ("ddpm", 50, [0.84, 0.92, 0.86, 0.65, 0.49]),
        ("ddpm", 1000, [0.991, 0.996, 0.991, 0.964, 0.931]),
        ("eq36", 1000, [0.50, 0.50, 0.49, 0.48, 0.47]),
        ("eq36", 50, [0.48, 0.48, 0.45, 0.39, 0.34]),
    ],
)
def test_s9_s10_power_that_finite_steps_leave(rule, steps, expected):
    found = spectra.reverse_power(POWER, alpha_bar("cosine", steps), ddim_indices(steps, steps), rule).state[-1]
    assert (found / POWER)[[1, 4, 16, 64, 120]].tolist() == pytest.approx(expected, abs=0.006)


@pytest.mark.parametrize("indices", [ddim_indices(60, 60), [59, 40, 17, 3]])
@pytest.mark.parametrize("rule, eta", [("ddpm", 1.0), ("ddim", 0.0)])
def test_the_recursion_is_the_librarys_sampler(rule, eta, indices):
    """Each source of noise in a row of its own: a linear sampler leaves its weights there, and their squares are the variance."""
    curve, power = alpha_bar("cosine", 60), spectra.power_law(12)
    rows = torch.eye(len(indices) + 1, dtype=torch.float64)[..., None].expand(-1, -1, len(power))
    draws = iter(rows[1:])

    def denoise(y, t):
        return eps_of(y, spectra.wiener_gain(power, curve[t]) * y, curve[t])

    walk = list(ddim(denoise, rows[0].clone(), curve, indices, eta=eta, noise=lambda: next(draws)))
    found = spectra.reverse_power(power, curve, indices, rule)
    torch.testing.assert_close(found.state, torch.stack([step.y.square().sum(0) for step in walk]))
    torch.testing.assert_close(found.estimate, torch.stack([step.y0_hat.square().sum(0) for step in walk]))


def test_eq36_is_what_the_paper_prints_and_keeps_half_in_the_limit(generator):
    """A transcription, drawn: m_t-1 = sqrt(a_t-1) (m_t - sqrt(1-a_t) eps) / sqrt(a_t) + sqrt(1-a_t-1) z."""
    curve, power = alpha_bar("cosine", 20), spectra.power_law(8)
    m = _noise(generator, 40_000, 8)
    for t in range(19, -1, -1):
        a, after = float(curve[t]), float(curve[t - 1]) if t else 1.0
        eps = (m - a**0.5 * (a**0.5 * power / (a * power + 1 - a)) * m) / (1 - a) ** 0.5
        m = after**0.5 * (m - (1 - a) ** 0.5 * eps) / a**0.5 + (1 - after) ** 0.5 * _noise(generator, *m.shape)
    expected = spectra.reverse_power(power, curve, ddim_indices(20, 20), "eq36").state[-1]
    np.testing.assert_allclose(m.square().mean(0), expected, rtol=4 * math.sqrt(2 / 40_000))
    """With P' the estimate's power: P' = g² (a P' + 1 - a), so P' = P SNR / (1 + 2 SNR), half of P where there is no noise."""
    steps = 10_000
    found = spectra.reverse_power(POWER[:40], alpha_bar("cosine", steps), ddim_indices(steps, steps), "eq36")
    assert (found.state[-1] / POWER[:40]).numpy() == pytest.approx(0.5, abs=5e-3)
    ratio = spectra.snr(POWER[:40], alpha_bar("cosine", steps)[4000])
    assert (found.estimate[-4001] / POWER[:40]).numpy() == pytest.approx((ratio / (1 + 2 * ratio)).numpy(), rel=0.01)


def test_another_rule_or_threshold_is_refused(unchecked):
    with pytest.raises(ValueError, match="rule is 'euler'.*expected one of ddpm, ddim, eq36"):
        spectra.reverse_power(POWER, A_BAR, [5], "euler")
    with pytest.raises(ValueError, match="gamma is 0"):
        spectra.recovery_time(POWER, 1000, 0)


BLOCKS = {
    "yaw rate": (slice(0, 1), 0.51),
    "root velocity": (slice(1, 3), 0.83),
    "height": (slice(3, 4), 0.81),
    "positions": (slice(4, 67), 0.72),
    "rotations": (slice(67, 193), 0.91),
    "velocities": (slice(193, 259), 0.51),
    "contacts": (slice(259, 263), 0.39),
}


def test_energy_of_a_published_clip(data_folder):
    """Clip 012314 of HumanML3D: features in the dataset's deviations, by coefficients and by block, and joints in metres."""
    folder = data_folder / "humanml3d"
    raw = np.load(folder / "new_joint_vecs" / "012314.npy").astype(np.float64)
    z = torch.from_numpy((raw - np.load(folder / "Mean.npy")) / np.load(folder / "Std.npy"))
    power = spectra.power_of(z)
    share = spectra.energy_share(power)
    assert share[[0, 1, 4, 9, 19, 39]].tolist() == pytest.approx([0.217, 0.312, 0.585, 0.717, 0.860, 0.961], abs=5e-4)
    assert slope(power, 3, 85) == pytest.approx(-2.0, abs=0.05)
    for name, (columns, expected) in BLOCKS.items():
        found = spectra.energy_share(spectra.power_of(z[:, columns]))[9]
        assert float(found) == pytest.approx(expected, abs=6e-3), name
    joints = spectra.power_of(torch.from_numpy(np.load(folder / "new_joints" / "012314.npy").astype(np.float64)).flatten(1))
    assert float(spectra.energy_share(joints)[4]) == pytest.approx(0.990, abs=1e-3)
    assert float(spectra.energy_share(joints[1:])[3]) == pytest.approx(0.974, abs=1e-3)
    assert slope(joints, 3, 85) == pytest.approx(-3.5, abs=0.1)


SIGMAS = torch.tensor([0.2, 0.4, 0.8], dtype=torch.float64)
PAIRS = 200_000


def test_s11_gaussian_bands_know_nothing_and_errors_are_of_samples_not_fitted(generator):
    c = spectra.gaussian_motions(spectra.power_law(128), 2000, generator)
    correlation = torch.corrcoef(torch.stack([c[:, 2], c[:, 64]]))[0, 1]
    assert abs(float(correlation)) < 4 / math.sqrt(2000)
    assert c.square().mean(0).numpy() == pytest.approx(spectra.power_law(128).numpy(), rel=4 * math.sqrt(2 / 2000))
    """Inputs that say nothing: fitted to as many numbers as they are, they would have no error at all."""
    target = torch.randn(40, generator=generator, dtype=torch.complex128)
    inputs = torch.randn(40, 19, generator=generator, dtype=torch.complex128)
    assert spectra.regression_error(inputs, target) > 1
    with pytest.raises(ValueError, match="40 samples; expected more than twice the 20 inputs"):
        spectra.regression_error(torch.cat([inputs, inputs[:, :1]], dim=1), target)


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
        seen = spectra.two_bands(PAIRS, sigma, bound, generator)
        phase = spectra.squared_phase(seen.noisy_low)
        assert spectra.regression_error(seen.noisy_high[:, None], seen.high) == pytest.approx(less, rel=0.02)
        inputs = torch.stack([seen.noisy_high, phase], dim=1)
        assert spectra.regression_error(inputs, seen.high) == pytest.approx(more, rel=0.02)
