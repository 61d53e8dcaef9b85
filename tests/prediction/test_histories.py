"""A user's own motions come out as in training, or are refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib.body.skeleton import H36M17, Skeleton
from mwlib.data.sources import Split
from mwlib.data.windows import Bodies, prepare
from mwlib.experiments import load_run, train_run
from mwlib.prediction.config import Config
from mwlib.prediction.predictor import predicted_motions
from mwlib.synthetic import synthetic_motions

SMALL = dict(
    fps=10.0, history=6, future=14, width=16, layers=2, heads=2, feedforward=16, train_steps=4, batch=8, checkpoint_every=4,
    ema_start=1, steps=50, ddim_steps=5, samples=3, warmup=0,
)  # fmt: skip


@pytest.fixture(scope="module")
def originals():
    return synthetic_motions(subjects=1)[:3]


@pytest.fixture(scope="module")
def predictor(originals, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    list(train_run(Config.preset("tiny", **SMALL), Split(prepare(originals, 10.0), [], []), folder))
    return load_run(folder)


def test_motions_windows_and_arrays_agree(predictor, originals):
    ready = prepare(originals, 10.0)
    x = torch.stack([torch.from_numpy(m.root_relative()[-6:]) for m in ready]).float()
    expected = predictor.predict(x, 2, 1)
    torch.testing.assert_close(predictor.predict(originals, 2, 1), expected, rtol=0, atol=0)
    cut = [m.cut(len(m) - 21, len(m)) for m in ready]  # a clip of H + F + 1 frames has one window, which starts at 0
    windows = mw.windows(cut, 6, 14, 5)
    torch.testing.assert_close(predictor.predict(windows, 2, 1), predictor.predict(windows.x_history, 2, 1), rtol=0, atol=0)


def test_axis_and_rate_do_not_matter(predictor, originals):
    """The same recording with y up and at another rate gives the same history, so the same futures."""
    other = [m.with_up("y") for m in originals]
    torch.testing.assert_close(predictor.predict(other, 2, 1), predictor.predict(originals, 2, 1), rtol=0, atol=1e-4)
    assert predictor.bodies == Bodies(H36M17, 10.0, "z")


def test_what_cannot_fit_is_refused_with_the_way_out(predictor, originals):
    ready = prepare(originals, 10.0)
    with pytest.raises(ValueError, match=r"has 3 frames at 10 Hz; expected at least 6"):
        predictor.predict([replace(ready[0].cut(0, 3))], 1)
    foreign = Skeleton("snake", ("head", "tail"), (-1, 0))
    snake = mw.Motion(np.zeros((50, 2, 3), np.float32), 10.0, foreign, name="hiss")
    with pytest.raises(ValueError, match=r"hiss: the skeleton is snake \(2 joints\).*trained on H36M17 \(17 joints\)"):
        predictor.predict([snake], 1)
    with pytest.raises(ValueError, match=r"expected \(N, 6, 48\).*Give predict the motions"):
        predictor.predict(torch.zeros(2, 6, 63), 1)
    with pytest.raises(ValueError, match=r"windows are of H36M17 at 50 Hz, z up; the model was trained on H36M17 at 10 Hz"):
        predictor.predict(mw.windows(originals, 6, 14, 50), 1)
    bad = torch.zeros(2, 6, 48)
    bad[1, 2, 3] = torch.nan
    with pytest.raises(ValueError, match="window 1 is not finite"):
        predictor.predict(bad, 1)
    with pytest.raises(ValueError, match=r"the source holds nothing; expected Motions"):
        predictor.predict([], 1)


def test_continued_motions_begin_with_what_was_seen(predictor, originals):
    found = predicted_motions(predictor, originals, 2, 1)
    seen = prepare(originals, 10.0)
    assert [len(row) for row in found] == [2, 2, 2] and {len(m) for row in found for m in row} == {20}
    for m, row in zip(seen, found, strict=True):
        for future in row:
            np.testing.assert_array_equal(future.positions[:6], m.positions[-6:])
            assert (future.positions[6:, 0] == m.positions[-1, 0]).all() and future.fps == 10.0
    expected = predictor.predict(originals, 2, 1)
    np.testing.assert_allclose(found[1][0].cut(6, 20).root_relative(), expected[1, 0].numpy(), atol=1e-5)


def test_clips_of_one_training_share_a_form(originals):
    a, b = prepare(originals[:1], 10.0)[0], prepare(originals[1:2], 5.0)[0]
    with pytest.raises(ValueError, match=r"has fps 5.0, .* has 10.0; expected one and the same"):
        Bodies.of([a, b])
    bodies = Bodies.of([a])
    assert Bodies.from_json(bodies.to_json()) == bodies and bodies.skeleton.mirror.tolist() == H36M17.mirror.tolist()
    with pytest.raises(ValueError, match="there are no motions"):
        Bodies.of([])
