"""The Gaussian process: its closed forms by other means, and what keyframe schemes do on it against earlier measurements."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.diffusion import KeyframeConfig, alpha_bar, ddim_indices, y0_hat_of
from mwlib.inbetweening.gaussian import (
    SCHEMES,
    GaussianBridge,
    Scheme,
    exact,
    measure,
    optimal_denoiser,
    sample,
    squared_exponential,
    table,
)  # fmt: skip
from mwlib.transforms import DCTTransform

T, ENDS = 32, np.array([-1.0, 1.5])
KERNEL = np.exp(-(np.subtract.outer(np.arange(T), np.arange(T)) ** 2) / 72) + 1e-4 * np.eye(T)
BRIDGE = GaussianBridge(squared_exponential(T), {0: -1.0, -1: 1.5})
A_BAR = alpha_bar("cosine", 1000)
SAMPLES = 300


def _seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def drawn(covariance: np.ndarray, samples: int) -> np.ndarray:
    """Samples of the process by Cholesky's root: that of NumPy's own draw, by singular vectors, has another sign elsewhere."""
    return np.random.default_rng(0).standard_normal((samples, len(covariance))) @ np.linalg.cholesky(covariance).T


def _law() -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the 30 frames in between, from the inverse of the whole covariance (precision matrix)."""
    precision = np.linalg.inv(KERNEL)
    covariance = np.linalg.inv(precision[1:-1, 1:-1])
    return -covariance @ precision[1:-1][:, [0, -1]] @ ENDS, covariance


def test_the_true_law_is_that_of_the_precision_matrix():
    np.testing.assert_allclose(squared_exponential(T), KERNEL, atol=1e-15)
    mean, covariance = BRIDGE.law()
    expected = _law()
    np.testing.assert_allclose(mean[1:-1], expected[0], atol=1e-7)
    np.testing.assert_allclose(covariance[1:-1, 1:-1], expected[1], atol=1e-7)
    assert mean[[0, -1]].tolist() == ENDS.tolist() and not covariance[[0, -1]].any() and not covariance[:, [0, -1]].any()


def test_the_true_law_is_what_draws_of_the_whole_process_say():
    """Regression of the middle on the ends over draws that know nothing of conditioning; three keyframes, in any order."""
    bridge = GaussianBridge(squared_exponential(8, 2.0, 0.01), {5: 0.7, 0: -0.4, -1: 0.2})
    x = drawn(bridge.covariance.numpy(), 200_000)
    gain, *_ = np.linalg.lstsq(x[:, [0, 5, 7]], x[:, [1, 2, 3, 4, 6]], rcond=None)
    mean, covariance = bridge.law()
    free = [1, 2, 3, 4, 6]
    np.testing.assert_allclose(mean[free], np.array([-0.4, 0.7, 0.2]) @ gain, atol=0.01)
    rest = x[:, free] - x[:, [0, 5, 7]] @ gain
    np.testing.assert_allclose(covariance[free][:, free], np.cov(rest.T), atol=0.01)


def test_draws_of_the_true_law_are_measured_as_exact():
    x = BRIDGE.draw(20_000, _seeded())
    found, truth = measure(BRIDGE, x), exact(BRIDGE)
    assert torch.equal(x[:, [0, -1]], torch.from_numpy(ENDS).expand(20_000, 2))
    assert found["mean_error"] < 0.02 and abs(found["spread"] - 1) < 0.02 and found["keyframe_error"] == 0
    assert abs(found["seam"] - truth["seam"]) < 0.01 and round(truth["seam"], 2) == 0.94


def test_measures_by_hand():
    bridge = GaussianBridge(torch.eye(4, dtype=torch.float64), {0: 1.0, -1: 0.0})  # frames in between: mean 0, variance 1
    x = torch.tensor([[1.0, 3.0, 2.0, 0.0], [1.0, 1.0, 0.0, 0.5]], dtype=torch.float64)
    found = measure(bridge, x)
    expected = {"mean_error": 1.5, "spread": 2**0.5, "seam": (1 + 1.25) / 2 / 1.0, "keyframe_error": 0.5 / 4}
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("rows", [T, 7])
@pytest.mark.parametrize("t", [20, 500, 990])
def test_the_denoiser_is_the_posterior_mean(rows, t):
    """By brute force: the law of clean coefficients beside noisy ones, conditioned by numpy's solve."""
    dct = np.sqrt(2 / T) * np.cos(np.pi * (2 * np.arange(T) + 1) * np.arange(T)[:, None] / (2 * T))
    dct[0] /= np.sqrt(2)
    dct, a = dct[:rows], float(A_BAR[t])
    clean = dct @ KERNEL @ dct.T
    y = np.random.default_rng(0).standard_normal((rows, 5))
    expected = a**0.5 * clean @ np.linalg.solve(a * clean + (1 - a) * np.eye(rows), y)
    eps = optimal_denoiser(BRIDGE.covariance, DCTTransform(T, 5, rows), A_BAR)(torch.from_numpy(y), t)
    np.testing.assert_allclose(y0_hat_of(torch.from_numpy(y), eps, a), expected, atol=1e-10 / a)


def test_no_linear_denoiser_does_better():
    """Least squares over draws of the process: the noise that the optimal denoiser tells has the smallest error."""
    t, n = 400, 100_000
    tf, a = DCTTransform(8, 1), float(A_BAR[400])
    covariance = squared_exponential(8, 2.0, 0.01)
    y = drawn(covariance.numpy(), n) @ tf.analysis_time.T
    eps = np.random.default_rng(1).standard_normal(y.shape)
    y_t = a**0.5 * y + (1 - a) ** 0.5 * eps
    best, *_ = np.linalg.lstsq(y_t, eps, rcond=None)
    found = optimal_denoiser(covariance, tf, A_BAR)(torch.eye(8, dtype=torch.float64), t)
    np.testing.assert_allclose(found.mT, best, atol=0.02)


# Measured once by other code, with 1000 to 2000 samples: mean error, spread, seam. Its mean errors scatter by 0.03.
BEFORE = {
    "unconditional": (0.57, None, None),
    "replacement (paper)": (0.46, 1.30, 3.2),
    "replacement, 1000 steps": (0.47, 1.31, 3.2),
    "replacement, η = 1": (0.35, 1.20, 2.2),
    "replacement, DDPM": (None, 1.20, 2.2),
    "paste": (0.46, 1.33, 3.4),
    "replacement, fixed noise": (0.46, 1.30, 3.4),
    "RePaint, r = 5": (0.29, 1.10, 1.4),
    "RePaint, r = 10": (0.22, 1.05, 1.15),
    "RePaint, r = 20": (0.16, 1.00, 1.02),
    "RePaint, r = 10, η = 1": (0.16, 1.00, 1.01),
    "replacement, L = 20": (0.43, 1.30, 2.7),
    "replacement, L = 10": (0.39, 1.12, 1.2),
    "replacement, L = 6": (0.33, 0.97, 0.6),
}


@pytest.mark.parametrize("name", BEFORE)
def test_the_table_is_found_again(name, monkeypatch):
    """Deviations and steps of 300 samples; the mean error of endless ones, which two more samples have that get no noise."""
    draw = torch.randn
    monkeypatch.setattr(torch, "randn", lambda shape, **how: draw(shape, **how).index_fill_(1, torch.arange(2), 0.0))
    x, (mean_error, spread, seam) = sample(BRIDGE, SCHEMES[name], 2 + SAMPLES, _seeded()), BEFORE[name]
    if mean_error is not None:
        assert abs(measure(BRIDGE, x[:2])["mean_error"] - mean_error) < 0.06
    if spread is not None:
        found = measure(BRIDGE, x[2:])
        assert found["spread"] == pytest.approx(spread, abs=0.09)
        assert found["seam"] == pytest.approx(seam, rel=0.09)


def test_the_mean_of_samples_without_noise_is_the_mean_of_samples():
    for name in ("replacement (paper)", "paste", "gradient, w = 5"):
        x, limit = sample(BRIDGE, SCHEMES[name], 2000, _seeded()), sample(BRIDGE, SCHEMES[name], 2, None)[0]
        assert ((x.mean(0) - limit)[1:-1].abs() / (x.std(0) / 2000**0.5)[1:-1]).max() < 4.5


def _gradient_with_noise_kept(weight: float, eta: float) -> np.ndarray:
    """The gradient moves the clean estimate, and the step goes on with the noise of the estimate as it was."""
    rng, indices, ends = np.random.default_rng(0), ddim_indices(1000, 100), np.zeros(T)
    variances, axes = np.linalg.eigh(KERNEL)
    mask = np.zeros(T)
    mask[[0, -1]], ends[[0, -1]] = 1, ENDS
    x = rng.standard_normal((1000, T))
    for number, t in enumerate(indices):
        a, a_prev = float(A_BAR[t]), float(A_BAR[indices[number + 1]]) if number < 99 else 1.0
        gain = (axes * (a**0.5 * variances / (a * variances + 1 - a))) @ axes.T
        x0 = x @ gain
        eps = (x - a**0.5 * x0) / (1 - a) ** 0.5
        x0 = x0 - weight * a**0.5 / 2 * (2 * mask * (x0 - ends)) @ gain
        sigma = eta * ((1 - a_prev) / (1 - a) * (1 - a / a_prev)) ** 0.5
        x = a_prev**0.5 * x0 + max(1 - a_prev - sigma**2, 0) ** 0.5 * eps + sigma * rng.standard_normal(x.shape)
    return x


def test_the_gradient_is_about_twenty_times_as_strong_where_the_noise_is_not_derived_anew():
    """Ours derives it anew, as DDPM and every sampler here do, so that w means the same for any number of steps.

    The earlier measurement did not: w = 1: 0.08, 0.94, 0.73, and w = 20 diverged, as w = 5 did with η = 1.
    """
    kept = measure(BRIDGE, torch.from_numpy(_gradient_with_noise_kept(1, 0)))
    assert kept["mean_error"] < 0.13 and kept["spread"] == pytest.approx(0.94, abs=0.03)
    assert kept["seam"] == pytest.approx(0.73, abs=0.04)
    ours = measure(BRIDGE, sample(BRIDGE, SCHEMES["gradient, w = 20"], 1000, _seeded()))
    assert ours["mean_error"] == pytest.approx(kept["mean_error"], abs=0.04)
    assert ours["spread"] == pytest.approx(kept["spread"], abs=0.04) and ours["seam"] == pytest.approx(kept["seam"], abs=0.05)
    for weight, eta in ((20, 0), (5, 1)):
        assert measure(BRIDGE, torch.from_numpy(_gradient_with_noise_kept(weight, eta)))["spread"] > 10
    errors = [measure(BRIDGE, sample(BRIDGE, SCHEMES[f"gradient, w = {w}"], 2, None))["mean_error"] for w in (1, 5, 20)]
    assert errors == pytest.approx([0.452, 0.283, 0.071], abs=0.002)


def test_a_weight_means_the_same_for_any_number_of_steps():
    schemes = [Scheme(KeyframeConfig("none", reconstruction_weight=10), steps) for steps in (50, 100, 200)]
    found = [measure(BRIDGE, sample(BRIDGE, scheme, 2, None))["mean_error"] for scheme in schemes]
    assert max(found) - min(found) < 0.03


def test_too_strong_a_gradient_diverges_unless_the_keyframes_are_imposed_too():
    rows = table(BRIDGE, 100, 0, ["gradient, w = 200", "gradient, w = 20, η = 1"])
    assert [row["diverged"] for row in rows] == [False, True, True]
    held = measure(BRIDGE, sample(BRIDGE, Scheme(KeyframeConfig(eta=1, reconstruction_weight=20)), SAMPLES, _seeded()))
    assert held["mean_error"] < 0.15 and abs(held["spread"] - 0.92) < 0.08


def test_for_as_many_evaluations_few_steps_repeated_beat_many_steps():
    once, often = SCHEMES["replacement (paper)"], Scheme(KeyframeConfig(repeats=4), 25)
    assert once.evaluations == often.evaluations == 100
    a, b = (measure(BRIDGE, sample(BRIDGE, scheme, 2, None))["mean_error"] for scheme in (once, often))
    assert b < 0.75 * a
    a, b = (measure(BRIDGE, sample(BRIDGE, scheme, SAMPLES, _seeded())) for scheme in (once, often))
    assert b["seam"] < 0.6 * a["seam"] and abs(b["spread"] - 1) < 0.5 * abs(a["spread"] - 1)


def test_five_frames_at_each_end_are_no_cure():
    """Mean of three random cases: without keyframes, with the paper's scheme, with ten repeats."""
    errors = []
    for x in drawn(KERNEL, 3):
        bridge = GaussianBridge(squared_exponential(T), {k: float(x[k]) for k in [*range(5), *range(-5, 0)]})
        names = ("unconditional", "replacement (paper)", "RePaint, r = 10")
        errors.append([measure(bridge, sample(bridge, SCHEMES[name], 2, None))["mean_error"] for name in names])
    assert errors[0] == pytest.approx([0.795, 0.759, 0.678], abs=0.002)
    assert np.mean(errors, axis=0) == pytest.approx([0.980, 0.885, 0.718], abs=0.002)


def test_the_table_has_a_plain_row_for_the_truth_and_each_scheme():
    names = ["replacement (paper)", "paste"]
    rows = table(BRIDGE, 50, 1, names)
    assert [row["scheme"] for row in rows] == ["true law", *names]
    assert all(row.keys() == rows[0].keys() for row in rows)
    assert all(type(value) in (str, int, float, bool) for row in rows for value in row.values())
    assert rows[1]["keyframe_error"] == 0 and rows[1]["evaluations"] == 100
    assert table(BRIDGE, 50, 1, names) == rows and table(BRIDGE, 50, 2, names) != rows
