"""How a configuration is scored: chunks change no window, baselines need no model, and the numbers are those of the metrics."""

from __future__ import annotations

import pytest
import torch

from mwlib import metrics
from mwlib.data.sources import Split
from mwlib.prediction.config import EvaluationConfig
from mwlib.prediction.evaluation import METRICS, baseline, evaluate, score, test_windows
from tests.sample_settings import small, two_people

BASELINES = ("zero_velocity", "constant_velocity", "nearest_history")


def never():
    raise AssertionError("a model was asked for")


@pytest.fixture(scope="module")
def split() -> Split:
    return Split(two_people().train, [], two_people().validation)


def test_chunks_and_subsets_do_not_change_a_window(split):
    """The window numbers that a predictor is told are those of the whole test set."""
    every = test_windows(split, small().windows)
    few, seen = every.thin(11), []

    def predict(x_history, ids):
        seen.extend(ids)
        return every.x_future[ids][:, None]

    found = score(predict, few, every, EvaluationConfig())
    assert found["windows"]["ade"] == len(few) == len(seen) == 11 and found["mean"]["ade"] == found["mean"]["fde"] == 0
    assert seen == [i for i in range(len(every)) if any(torch.equal(every.x[i], x) for x in few.x)]


@pytest.mark.parametrize("method", BASELINES)
def test_baselines_are_scored_without_a_model(split, method):
    cfg = small(method=method, test_windows=9, samples=4)
    found = evaluate(cfg, never, split)
    every = test_windows(split, cfg.windows)
    test = every.thin(9)
    ids = [i for i in range(len(every)) if any(torch.equal(every.x[i], x) for x in test.x)]
    p = baseline(cfg, split)(test.x_history, ids)
    assert found["windows"] == 9 and p.shape[1] == (4 if method == "nearest_history" else 1)
    assert found["mean"]["ade"] == pytest.approx(float(metrics.ade(p, test.x_future).mean()), rel=1e-5)
    sets = metrics.multimodal_futures(every.x_history[:, -1], every.x_future, 0.5)
    assert found["mean"]["mmade"] == pytest.approx(float(metrics.mmade(p, sets.take(ids)).mean()), rel=1e-5)


def test_every_column_is_measured_and_every_action_has_a_row(split):
    found = evaluate(small(method="zero_velocity"), never, split)
    assert set(METRICS) <= set(found["mean"]) and set(METRICS) <= set(found["standard_error"])
    assert set(found["actions"]) == {m.action for m in split.test}
    assert set(METRICS) <= set(found["actions"]["walk"])
    assert METRICS["bone_length_jitter"].scale == 1000 and {column.better for column in METRICS.values()} == {"", "lower"}
