"""How a configuration is scored: chunks change no window, baselines need no model, and the numbers are those of the metrics."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import torch

from mwlib import metrics, write_bvh
from mwlib.data.sources import Split, fingerprint
from mwlib.prediction.config import EvaluationConfig
from mwlib.prediction.predictor import Predictor
from mwlib.prediction.system import DETAILS, METRICS, _beside_still, baseline, evaluate, load_data, score, test_windows, trained
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_settings import small, two_people

BASELINES = ("zero_velocity", "constant_velocity", "nearest_history", "nearest_displacement", "truth")


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
    assert found["windows"] == 9 and p.shape[1] == (4 if method.startswith("nearest") else 1)
    assert found["mean"]["ade"] == pytest.approx(float(metrics.ade(p, test.x_future).mean()), rel=1e-5)
    sets = metrics.multimodal_futures(every.x_history[:, -1], every.x_future, 0.5)
    assert found["mean"]["mmade"] == pytest.approx(float(metrics.mmade(p, sets.take(ids)).mean()), rel=1e-5)


def test_every_column_is_measured_and_every_action_has_a_row(split):
    found = evaluate(small(method="zero_velocity"), never, split)
    assert set(METRICS) <= set(found["mean"]) and set(METRICS) <= set(found["standard_error"])
    assert set(found["actions"]) == {m.action for m in split.test}
    assert set(METRICS) <= set(found["actions"]["walk"])
    assert METRICS["bone_length_jitter"].scale == 1000 and {column.better for column in METRICS.values()} == {"", "lower"}


def test_the_truth_has_no_error_and_standing_still_is_the_measure_of_the_worst(split):
    truth, still = (evaluate(small(method=method), never, split) for method in ("truth", "zero_velocity"))
    assert truth["mean"]["ade"] == truth["mean"]["error_1s"] == truth["mean"]["worst"] == 0
    assert set(DETAILS) <= set(truth["mean"]) and truth["mean"]["speed"] > 0.1 and still["mean"]["speed"] == 0
    assert truth["mean"]["behind_still"] == still["mean"]["behind_still"] == 0
    assert truth["mean"]["seam_jerk"] > truth["mean"]["median_jerk"] / 2 and still["mean"]["seam_jerk"] > 0
    assert still["mean"]["worst"] == pytest.approx(1) and truth["mean"]["jerk"] > 0 == still["mean"]["jerk"]
    every = test_windows(split, small().windows).thin(small().windows.test_windows)
    clips = every.clip.tolist()
    assert truth["clips"] == clips and len(truth["values"]["jerk"]) == len(every)
    expected = metrics.clustered_error(np.array(still["values"]["ade"]), clips)
    assert still["standard_error"]["ade"] == expected
    sets = metrics.multimodal_futures(every.x_history[:, -1], every.x_future, 0.5)
    if len(every) == len(test_windows(split, small().windows)):
        assert truth["multimodal_apd"] == pytest.approx(float(metrics.multimodal_apd(sets).mean()))


def test_the_worst_of_those_who_hardly_move_is_in_units_of_five_centimetres(split):
    test = test_windows(split, small().windows).thin(2)
    x = torch.zeros_like(test.x)
    x[0, test.history :, 0], x[1, test.history :, 0] = 0.2, 0.01
    assert _beside_still(torch.tensor([0.1, 0.03]), replace(test, x=x)).tolist() == pytest.approx([0.5, 0.6])


def test_windows_that_are_skipped_do_not_stop_the_table(split):
    for option in ("skip_all", "skip_mm"):
        found = evaluate(small(method="zero_velocity", mm_singletons=option, mm_threshold=0.05), never, split)
        assert found["mean"]["worst"] == pytest.approx(1) and 0 < found["windows"]


class Known(Predictor):
    """A predictor that predicts as it is told."""

    def __init__(self, predict):
        self.predict = predict

    def chunk(self, samples):
        return 8


def by_hand(p, g, near) -> list[float]:
    """APD, ADE, FDE, MMADE, MMFDE of one window: samples (S, F, C), its future, the futures of its multimodal set."""
    pairs = [np.linalg.norm(a - b) for a, b in combinations(p, 2)]
    errors = [np.linalg.norm(p - future, axis=-1) for future in [g, *near]]  # (S, F) each
    ade, fde = [e.mean(1).min() for e in errors], [e[:, -1].min() for e in errors]
    return [np.mean(pairs), ade[0], fde[0], np.mean(ade[1:]), np.mean(fde[1:])]


def drawn(samples: int, seed: int, window: int) -> torch.Tensor:
    """Noise of one window."""
    return torch.randn(samples, 14, 48, generator=torch.Generator().manual_seed(10_000 * seed + window))


def test_evaluation_by_hand(split):
    """Everything from the configuration to the table, in NumPy: two futures a window, drawn by seed and window number."""
    cfg = small(test_windows=19, test_stride=11, samples=2, sampling_seed=5, mm_threshold=0.6)
    asked = []

    def predict(x_history, samples, seed, *, window_ids):
        asked.extend(window_ids)
        return x_history[:, None, -1:] + 0.1 * torch.stack([drawn(samples, seed, i) for i in window_ids])

    found = evaluate(cfg, lambda: Known(predict), split)

    clips = [m.root_relative().astype(np.float32) for m in split.test]
    every = [
        (clip[s : s + 20], m.action, m.name)
        for clip, m in zip(clips, split.test, strict=True)
        for s in range(0, len(clip) - 20, 11)
    ]
    ids = [round(i * (len(every) - 1) / 18) for i in range(19)]
    assert asked == ids
    rows = []
    for i in ids:
        x = every[i][0].astype(np.float64)
        near = [other[6:] for other, *_ in every if np.linalg.norm(other[5] - x[5]) < 0.6]
        rows.append(by_hand(x[5] + 0.1 * drawn(2, 5, i).numpy(), x[6:], near))
    table, names = np.array(rows), ["apd", "ade", "fde", "mmade", "mmfde"]
    assert (table[:, 1] != table[:, 3]).any(), "some windows have neighbours"
    np.testing.assert_allclose([found["mean"][name] for name in names], table.mean(0), rtol=1e-4)
    names_of = [every[i][2] for i in ids]
    totals = [sum(row - table.mean(0) for row, of in zip(table, names_of, strict=True) if of == name) for name in {*names_of}]
    expected = (len(totals) / (len(totals) - 1) * np.square(totals).sum(0)) ** 0.5 / 19
    np.testing.assert_allclose([found["standard_error"][name] for name in names], expected, rtol=1e-4)
    walk = [row for row, i in zip(rows, ids, strict=True) if every[i][1] == "walk"]
    np.testing.assert_allclose([found["actions"]["walk"][name] for name in names], np.mean(walk, axis=0), rtol=1e-4)
    still = [max(np.linalg.norm(every[i][0][5] - every[i][0][6:].astype(np.float64), axis=-1).mean(), 0.05) for i in ids]
    assert found["mean"]["worst"] == pytest.approx((table[:, 1] / still).max(), rel=1e-4)
    assert found["windows"] == 19


def test_a_trained_model_is_asked_with_the_settings_of_the_sampling():
    seen = {}
    predictor = Known(lambda x, samples, seed, **options: seen.update(samples=samples, seed=seed, **options))
    trained(predictor, small(samples=7, sampling_seed=4).sampling)(torch.zeros(2, 6, 48), [5, 9])
    assert seen == {"samples": 7, "seed": 4, "window_ids": [5, 9]}


def test_the_nearest_history_knows_the_training_people_alone(split):
    """Test clips that nobody trained on, moved far away: no future of theirs is ever answered."""
    far = [replace(m, positions=m.positions + np.arange(17)[:, None] * np.float32(100)) for m in split.test]
    planted = Split(split.train, far, far)
    cfg = small(method="nearest_history", samples=3)
    every = test_windows(planted, cfg.windows)
    answered = baseline(cfg, planted)(every.x_history[:4], [0, 1, 2, 3])
    assert every.x.abs().max() > 100 and answered.abs().max() < 3


def test_windows_close_to_no_other_count_as_asked(split):
    """0.5 m is the papers' threshold; at a millimetre every window is alone."""
    assert small().evaluation == EvaluationConfig(0.5, "keep")
    found = [
        evaluate(small(method="zero_velocity", mm_threshold=1e-3, mm_singletons=kind), never, split)
        for kind in ("keep", "skip_mm")
    ]
    assert found[0]["mean"]["mmade"] > 0 and not np.isfinite(found[1]["mean"]["mmade"])
    assert found[0]["mean"]["ade"] == found[1]["mean"]["ade"]


WALK = synthetic_motions(subjects=1, seconds=4.0)[0].resample(10.0)


@cache
def bvh(frames: int) -> str:
    with TemporaryDirectory() as folder:
        write_bvh(WALK.cut(0, frames), Path(folder, "walk.bvh"))
        return Path(folder, "walk.bvh").read_text()


def folder_of(tmp_path, **frames: int):
    for name, count in frames.items():
        (tmp_path / f"{name}.bvh").write_text(bvh(count))
    return small(data=str(tmp_path))


def test_short_clips_are_left_out_and_named(tmp_path):
    cfg = folder_of(tmp_path, a=40, b=20, c=21, d=10, e=40)
    expected = r"2 of 4 train clips are left out, no longer than 20 frames \(history \+ future\) at 10 Hz: b, d"
    with pytest.warns(UserWarning, match=expected) as caught:
        split = load_data(cfg)
    assert len(caught) == 1 and [m.name for m in split.test] == ["e"]


@pytest.mark.parametrize(
    ("clips", "message"),
    [
        ({"a": 40, "b": 10}, "no test clip .* than 20 frames .* the longest, 'b', has 10. Longer clips, a smaller history"),
        ({"a": 10, "b": 40}, "no train clip is longer .*'a', has 10"),
        ({"a": 40}, "no test clip is longer than 20 frames .* the longest, 'a', has 10"),
    ],
)
def test_what_cannot_be_trained_on_says_what_would_help(tmp_path, clips, message):
    with pytest.raises(ValueError, match=message):
        load_data(folder_of(tmp_path, **clips))


def test_people_of_more_data_are_trained_on_but_for_those_who_are_held_out(tmp_path):
    cfg = folder_of(tmp_path, **{"01_01": 40, "02_01": 40, "03_01": 40})  # named as CMU's
    plain, more = (load_data(cfg.override(more_data=sources)) for sources in ((), (str(tmp_path),) * 2))
    held_out = {m.subject for m in (*plain.validation, *plain.test)}
    assert fingerprint(more.validation + more.test) == fingerprint(plain.validation + plain.test)
    assert len(more.train) == 3 * len(plain.train) and not held_out & {m.subject for m in more.train}
