"""Standard errors of means over windows of the same clips."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.metrics import clustered_error


def drawn(clips: int, windows: int, seed: int) -> tuple[np.ndarray, list[int]]:
    """Values that share half of their variance within a clip."""
    random = np.random.default_rng(seed)
    return (random.normal(size=(clips, 1)) + random.normal(size=(clips, windows))).ravel(), [
        i for i in range(clips) for _ in range(windows)
    ]


def test_it_is_the_spread_of_the_mean_over_repetitions():
    means = [drawn(20, 10, seed)[0].mean() for seed in range(2000)]
    errors = [clustered_error(*drawn(20, 10, seed)) for seed in range(300)]
    assert np.mean(np.square(errors)) ** 0.5 == pytest.approx(np.std(means), rel=0.05)
    values, _ = drawn(20, 10, 0)
    assert clustered_error(values, range(200)) == pytest.approx(values.std(ddof=1) / 200**0.5)
    assert clustered_error(*drawn(20, 10, 0)) > 2 * clustered_error(values, range(200))


def test_it_agrees_with_a_bootstrap_over_clips_of_unequal_length():
    random = np.random.default_rng(0)
    clips = [random.normal() + random.normal(size=n) for n in random.integers(1, 12, 60)]
    names = [f"clip {i}" for i, clip in enumerate(clips) for _ in clip]
    draws = random.integers(0, 60, (4000, 60))
    means = [np.concatenate([clips[i] for i in draw]).mean() for draw in draws]
    assert clustered_error(np.concatenate(clips), names) == pytest.approx(np.std(means), rel=0.05)


def test_what_is_not_measured_does_not_count():
    values, clips = np.array([1.0, np.nan, 3.0, 4.0]), ["a", "b", "c", "c"]
    assert clustered_error(values, clips) == clustered_error(values[[0, 2, 3]], ["a", "c", "c"])
    assert clustered_error(np.where(np.isnan(values), np.inf, values), clips) == clustered_error(values, clips)
    assert np.isnan(clustered_error(values[2:], clips[2:])) and np.isnan(clustered_error(np.array([]), []))
    with pytest.raises(ValueError, match="4 values of 3 clusters"):
        clustered_error(values, clips[1:])
