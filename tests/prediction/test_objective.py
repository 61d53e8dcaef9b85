"""What is trained: every option learns, the condition is dropped as asked, errors are weighed as asked."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.body.motion import Motion
from mwlib.data.windowing import TrainingWindows, windows
from mwlib.diffusion import alpha_bar, noised
from mwlib.experiments import load_run
from mwlib.prediction.objective import DenoisingLoss, PredictionObjective
from mwlib.training import train
from tests.sample_settings import small, two_people


@pytest.mark.parametrize("prediction", ["eps", "y0", "v"])
@pytest.mark.parametrize(
    "changes", [dict(), dict(transform="dct", dct_rows=8), dict(representation="displacement", loss_weight="metric")]
)
def test_every_option_learns(prediction, changes):
    cfg = small(
        prediction=prediction, train_steps=80, lr=1e-2, lr_schedule="constant", dropout=0.0, attention_dropout=0.0, **changes
    )
    motions = [*two_people().train, *two_people().validation]
    losses = [s.loss for s in train(lambda learnt: PredictionObjective(cfg, motions, (), learnt), cfg.training)]
    assert sum(losses[-10:]) < 0.95 * sum(losses[:10])


class Spy(torch.nn.Module):
    """Answers with what it is asked about, and remembers."""

    def forward(self, y, t, condition, keep):
        self.y_t, self.t, self.keep = y, t, keep
        return y


def test_condition_is_dropped_per_sample_or_per_batch(finished):
    predictor, spy = load_run(finished), Spy()
    x = windows(two_people().train, 6, 14, 5).x[:64]
    for per, kinds in (("sample", {2}), ("batch", {1})):
        cfg = small(drop_per=per, drop_condition=0.5)
        loss = DenoisingLoss(predictor.representation, cfg.diffusion, cfg.objective)
        loss(spy, x, torch.Generator().manual_seed(0))
        assert {len(spy.keep.unique())} == kinds


@pytest.mark.parametrize("weight", ["uniform", "metric"])
def test_the_loss_by_hand(finished, weight):
    """Mean of squared errors, each times its coefficient's variance over the mean variance where errors count in metres."""
    predictor, spy = load_run(finished), Spy()
    cfg, x = small(loss_weight=weight), windows(two_people().train, 6, 14, 5).x[:16]
    found = DenoisingLoss(predictor.representation, cfg.diffusion, cfg.objective)(spy, x, torch.Generator().manual_seed(0))
    y, a = predictor.representation.encode(x), alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)[spy.t]
    eps = (spy.y_t - a.sqrt().float()[:, None, None] * y) / (1 - a).sqrt().float()[:, None, None]
    torch.testing.assert_close(noised(y, eps, a), spy.y_t)
    error = (spy.y_t - y) ** 2  # the tiny preset predicts y0
    if weight == "metric":
        variance = torch.from_numpy(predictor.representation.motion.deviation) ** 2
        error = error * variance / variance.mean()
    torch.testing.assert_close(found, error.mean(), rtol=1e-5, atol=0)
    assert spy.t.min() >= 1 and spy.t.max() < cfg.diffusion.steps


def test_validation_is_the_same_every_time_and_leaves_the_network_evaluating(finished):
    cfg = small()
    objective = PredictionObjective.of_split(cfg, two_people())
    network = objective.network.train()
    torch.nn.init.normal_(network.leave.weight, std=0.1)  # it starts at zero, and dropout would not show
    first = objective.validate(network)
    assert first is not None and objective.validate(network.train()) == first and not network.training


def test_scales_fit_what_the_network_sees_where_all_people_face_one_way():
    """Windows are turned in training: scales of unturned ones would leave coefficients many deviations wide."""
    cfg = small(coefficient_scale="coefficient")
    facing = [facing_x(motion) for motion in two_people().train]
    objective = PredictionObjective(cfg, facing)
    y = objective.representation.encode(objective.draw(2000, torch.Generator().manual_seed(1)))
    alive = torch.from_numpy(objective.representation.motion.deviation > 2e-3 * objective.representation.motion.deviation.max())
    assert (y.std(0)[alive] - 1).abs().max() < 0.5


def facing_x(motion: Motion) -> Motion:
    """The clip turned so that the hips lie along y in its first frame."""
    left, right = motion.skeleton.left[0], motion.skeleton.right[0]
    across = motion.positions[0, left] - motion.positions[0, right]
    return motion.turn(float(np.pi / 2 - np.arctan2(across[1], across[0])))


def test_one_window_has_no_scale():
    cfg = small(augment="none")
    still = two_people().train[0]
    with pytest.raises(ValueError, match="2048 windows, all alike; expected windows that differ"):
        PredictionObjective(cfg, [still.cut(0, 21)])


@pytest.mark.parametrize("scale, most", [("none", 1), ("coefficient", 2048)])
def test_scales_come_from_few_windows_whatever_the_data(monkeypatch, scale, most):
    """All windows of an hour of motion would not fit into memory one by one."""
    drawn, draw = [], TrainingWindows.draw
    monkeypatch.setattr(TrainingWindows, "draw", lambda self, batch, g: drawn.append(batch) or draw(self, batch, g))
    PredictionObjective(small(coefficient_scale=scale), two_people().train)
    assert drawn == [most]
