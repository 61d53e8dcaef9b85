"""What is trained: every option learns, the condition is dropped as asked, errors are weighed as asked."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.body.motion import Motion
from mwlib.data.sources import Split
from mwlib.data.windows import TrainingWindows, windows
from mwlib.diffusion import alpha_bar
from mwlib.prediction.objective import DenoisingLoss, PredictionObjective
from mwlib.training import train
from tests.sample_settings import small, two_people, untrained


class Spy(torch.nn.Module):
    """Answers with what it is asked about, and remembers."""

    def forward(self, y, t, condition, keep):
        self.y_t, self.t, self.condition, self.keep = y, t, condition, keep
        return y


def batch(count: int) -> torch.Tensor:
    """So many training windows, some of them several times."""
    return windows(two_people().train, 6, 14, 5).x.repeat(8, 1, 1)[:count]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.9])
def test_the_condition_is_dropped_as_often_as_asked(share):
    representation, spy = untrained().representation, Spy()
    loss = DenoisingLoss(representation, small().diffusion, small(drop_condition=share).objective)
    dropped = []
    for seed in range(4):
        loss(spy, batch(1000), torch.Generator().manual_seed(seed))
        dropped.append(~spy.keep)
    assert abs(float(torch.cat(dropped).double().mean()) - share) < 0.03


def test_the_condition_is_dropped_per_sample_or_per_batch():
    representation, spy = untrained().representation, Spy()
    for per, kinds in (("sample", {2}), ("batch", {1})):
        cfg = small(drop_per=per, drop_condition=0.5)
        loss, found = DenoisingLoss(representation, cfg.diffusion, cfg.objective), set()
        for seed in range(12):
            loss(spy, batch(64), torch.Generator().manual_seed(seed))
            found |= {len(spy.keep.unique())}
            assert spy.keep.shape == (64,)
        assert found == kinds


def test_coefficients_of_the_condition_are_blanked_in_training_alone():
    representation, spy, x = untrained().representation, Spy(), batch(400)
    cfg = small(blank_condition=0.3)
    loss, plain = (DenoisingLoss(representation, cfg.diffusion, c.objective) for c in (cfg, small()))
    plain(spy, x, torch.Generator().manual_seed(0))
    whole = spy.condition
    loss(spy.eval(), x, torch.Generator().manual_seed(0))
    assert torch.equal(spy.condition, whole)
    loss(spy.train(), x, torch.Generator().manual_seed(0))
    there = whole.abs() > 1e-6
    blank = spy.condition == 0
    assert abs(float(blank[there].double().mean()) - 0.3) < 0.01
    torch.testing.assert_close(spy.condition[~blank], whole[~blank] / 0.7)
    assert (blank.any(0) & ~blank.all(0))[there.any(0)].all(), "every coefficient of its own"


@pytest.mark.parametrize("level", ["uniform", "snr"])
@pytest.mark.parametrize("weight", ["uniform", "metric"])
@pytest.mark.parametrize("prediction", ["eps", "y0", "v"])
def test_the_loss_by_hand(weight, prediction, level):
    """Displacements, the condition of every fifth window dropped, every quantity from the formulas of the paper."""
    cfg = small(representation="displacement", drop_condition=0.2, loss_weight=weight, level_weight=level, prediction=prediction)
    representation, x, spy = untrained(representation="displacement").representation, batch(200), Spy()
    found = DenoisingLoss(representation, cfg.diffusion, cfg.objective)(spy, x, torch.Generator().manual_seed(0))

    draws, steps = torch.Generator().manual_seed(0), cfg.diffusion.steps
    t = torch.randint(1, steps, (200,), generator=draws)
    eps = torch.randn(200, *representation.motion.shape, generator=draws).double()
    assert torch.equal(spy.t, t) and torch.equal(spy.keep, torch.rand(200, generator=draws) >= 0.2)
    variance = torch.from_numpy(representation.motion.deviation).double() ** 2
    y = (representation.motion.base((x - x[:, 5:6]).double()) - torch.from_numpy(representation.motion.mean)) / variance.sqrt()
    a = alpha_bar(cfg.diffusion.schedule, steps)[t][:, None, None]
    y_t = a.sqrt() * y + (1 - a).sqrt() * eps
    torch.testing.assert_close(spy.y_t.double(), y_t, atol=1e-4, rtol=1e-4)
    target = {"eps": eps, "y0": y, "v": a.sqrt() * eps - (1 - a).sqrt() * y}[prediction]
    error = (y_t - target) ** 2 * (variance / variance.mean() if weight == "metric" else 1)
    if level == "snr":
        error = error * (a / (1 - a)).clamp(0.05, 5)
    assert float(found) == pytest.approx(float(error.mean()), rel=1e-5)


def test_noise_steps_are_drawn_from_one_to_the_last_but_never_zero():
    cfg, spy, seen = small(steps=8, ddim_steps=4), Spy(), set()
    loss = DenoisingLoss(untrained().representation, cfg.diffusion, cfg.objective)
    for seed in range(8):
        loss(spy, batch(100), torch.Generator().manual_seed(seed))
        seen |= set(spy.t.tolist())
    assert seen == set(range(1, 8))


def test_only_the_training_people_are_trained_on():
    people = two_people()
    objective = PredictionObjective(small(), people)
    assert len(objective.windows.clips.flat) == sum(len(m) for m in people.train)
    assert torch.equal(objective.held_out, windows(people.validation, 6, 14, small().windows.test_stride).x)
    alone = PredictionObjective(small(), Split(people.train, [], [])).learnt()
    assert all(torch.equal(tensor, alone[name]) for name, tensor in objective.learnt().items())


def test_validation_is_the_same_every_time_and_leaves_the_network_evaluating():
    cfg = small()
    objective = PredictionObjective(cfg, two_people())
    network = objective.network.train()
    torch.nn.init.normal_(network.leave.weight, std=0.1)  # it starts at zero, and dropout would not show
    first = objective.validate(network)
    assert first is not None and objective.validate(network.train()) == first and not network.training


@pytest.mark.parametrize(
    "changes",
    [
        dict(prediction="eps"),
        dict(prediction="y0", transform="dct", dct_rows=8),
        dict(prediction="v", representation="displacement", loss_weight="metric"),
    ],
)
def test_every_option_learns(changes):
    cfg = small(train_steps=80, lr=1e-2, lr_schedule="constant", dropout=0.0, attention_dropout=0.0, **changes)
    motions = [*two_people().train, *two_people().validation]
    losses = [s.loss for s in train(lambda learnt: PredictionObjective(cfg, Split(motions, [], []), learnt), cfg.training)]
    assert sum(losses[-10:]) < 0.95 * sum(losses[:10])


def test_scales_fit_what_the_network_sees_where_all_people_face_one_way():
    """Windows are turned in training: scales of unturned ones would leave coefficients many deviations wide."""
    cfg = small(coefficient_scale="coefficient")
    facing = [facing_x(motion) for motion in two_people().train]
    objective = PredictionObjective(cfg, Split(facing, [], []))
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
        PredictionObjective(cfg, Split([still.cut(0, 21)], [], []))


@pytest.mark.parametrize("scale, most", [("none", 1), ("coefficient", 2048)])
def test_scales_come_from_few_windows_whatever_the_data(monkeypatch, scale, most):
    """All windows of an hour of motion would not fit into memory one by one."""
    drawn, draw = [], TrainingWindows.draw
    monkeypatch.setattr(TrainingWindows, "draw", lambda self, batch, g: drawn.append(batch) or draw(self, batch, g))
    PredictionObjective(small(coefficient_scale=scale), Split(two_people().train, [], []))
    assert drawn == [most]
