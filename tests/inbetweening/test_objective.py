"""What is trained: it learns, every weight counts and none explodes, it resumes to the bit."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from mwlib.data.sources import Split
from mwlib.inbetweening import losses
from mwlib.inbetweening.losses import bone_angles
from mwlib.inbetweening.objective import Batch, InbetweeningObjective
from mwlib.inbetweening.space import PositionSpace, space_from_json
from mwlib.training import CHECKPOINT, MODEL, train
from mwlib.training.checkpoint import load_tensors
from tests.inbetweening.sample import PAPER, WINDOW, data_of, objective, people, shaken, small

KINDS = {
    "conditioned": {},
    "paper": PAPER,
    "wiener": dict(output="wiener", level_weight="unit", tokens="sines", between=6, shortest=4, more_keyframes=1),
    "frames": dict(tokens="frames", prediction="v"),
    "rotations": dict(state="rotations", mirror=True),
    "window": dict(WINDOW, shortest=4),
    "mean": dict(WINDOW, shortest=4, mean_width=8),
    "past": dict(past=4, coast=3.0, departure_scale="each", tokens="sines", output="wiener", shortest=4, more_keyframes=1),
}
each_kind = pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS)
WEIGHTS = {
    "diversity_weight": dict(diversity="exponential"), "smoothness_weight": dict(smoothness="velocity"), "length_weight": {},
    "angle_weight": {}, "contact_weight": {},
}  # fmt: skip


def batch(made: InbetweeningObjective, count: int = 16) -> Batch:
    return made.draw(count, torch.Generator().manual_seed(5))


def loss(made: InbetweeningObjective, given: Batch, seed: int = 0) -> torch.Tensor:
    return made.loss(made.network.eval(), given, torch.Generator().manual_seed(seed))


@each_kind
def test_it_learns(changes):
    """The loss of one batch, with the same noise, before and after."""
    made = objective(**changes, train_steps=120, batch=16, lr=3e-3, dropout=0.0, checkpoint_every=120)
    given = batch(made, 64)
    before = float(loss(made, given).detach())
    list(train(lambda learnt: made, made.cfg.training))
    assert float(loss(made, given).detach()) < 0.97 * before


@each_kind
def test_batches_are_windows_of_one_length_with_their_keyframes(changes):
    made, lengths, more, shares = objective(**changes), set(), set(), []
    for seed in range(30):
        windows, mask = made.draw(4, torch.Generator().manual_seed(seed))
        past, future = made.task.past, made.task.future
        assert windows.x.shape[:2] == mask.shape and mask[:, :past].all() and mask[:, -future:].all()
        assert windows.x[:, past - 1, :2].abs().max() < 1e-6  # as seen from there
        lengths.add(windows.x.shape[1] - past - future + 2)
        more |= set(mask[:, past:-future].sum(1).tolist())
        hidden = windows.x.isnan().all(-1)
        assert not hidden[:, past - 1 : windows.x.shape[1] - future + 1].any() and not windows.x[~hidden].isnan().any()
        shares.append(hidden.sum(1))
    shares = torch.cat(shares)
    assert {*shares.tolist()} == ({0, 1, 2} if made.cfg.model.hide else {0})
    assert lengths == set(range(changes.get("shortest", 6) + 2, 9))
    assert more == set(range(changes.get("more_keyframes", 0) + 1))


def test_the_paper_loss_by_hand():
    """The simple loss of DDPM on cosines of normalised states."""
    made = objective(**PAPER)
    shaken(made.network)
    given = batch(made)
    draws = torch.Generator().manual_seed(0)
    t = torch.randint(1, 50, (16,), generator=draws)
    z = (given.windows.x - made.representation.mean) / made.representation.deviation
    y = made.representation.transform(8)(z)
    eps = torch.randn(y.shape, generator=draws)
    a = made.alpha_bar[t][:, None, None].float()
    output = made.network.eval()(a.sqrt() * y + (1 - a).sqrt() * eps, t)
    assert float(loss(made, given).detach()) == pytest.approx(float((output - eps).square().mean().detach()), rel=1e-4)


@pytest.mark.parametrize("weight", WEIGHTS)
@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_every_weight_has_an_effect(weight, state, monkeypatch):
    """But that bones of forward kinematics have their lengths whatever the network says."""
    plain = objective(state=state)
    made = objective(state=state, **{weight: 3.0}, **WEIGHTS[weight])
    made.limits = 0.3 * made.limits
    monkeypatch.setattr(losses, "STANDING", math.inf)  # of the bodies with rotations no foot ever stands
    for each in (plain, made):
        shaken(each.network)
    given = batch(plain)
    one, other = loss(plain, given), loss(made, given)
    assert other.isfinite()
    (gradient,) = torch.autograd.grad(other, made.network.net.leave.weight)
    assert gradient.isfinite().all()
    nothing = weight == "length_weight" and state == "rotations"
    if weight != "diversity_weight":  # which draws other noise
        assert (abs(float((other - one).detach())) < 1e-6) == nothing
    else:
        less = replace(made.cfg.objective, diversity_weight=1.0)
        made.cfg = replace(made.cfg, objective=less)
        assert abs(float((loss(made, given) - other).detach())) > 1e-3


def gradient_norm(made: InbetweeningObjective, given: Batch) -> float:
    made.network.zero_grad()
    loss(made, given).backward()
    return float(sum(p.grad.square().sum() for p in made.network.parameters() if p.grad is not None) ** 0.5)


@pytest.mark.parametrize("weight", ["smoothness_weight", "length_weight", "angle_weight", "contact_weight"])
def test_where_all_is_noise_the_losses_on_bodies_hardly_count(weight, monkeypatch):
    """Doubling a weight at the last steps changes the gradient little, though errors in eps are blown up there."""
    made = [objective(**PAPER, steps=1000, **{weight: w}) for w in (0.002, 0.004)]
    for each in made:
        shaken(each.network)
    given, randint = batch(made[0]), torch.randint
    late = lambda low, high, size, generator: randint(990, 1000, size, generator=generator)  # noqa: E731
    monkeypatch.setattr(torch, "randint", late)
    one, two = (gradient_norm(each, given) for each in made)
    assert two == pytest.approx(one, rel=0.3)


def test_the_estimate_of_one_clip_is_compared_with_its_own_noise_draws():
    """Two draws of one clip, not two clips: of a network that knows the clip nothing is left."""
    made = objective(diversity_weight=1.0, draws=3)
    given = batch(made)
    gap = made.representation.gap(given.windows.x, torch.ones_like(given.mask))
    assert made.representation.tokens(gap).abs().max() == 0  # the interpolation is the clip: a network that says zero is right

    class Zero(torch.nn.Module):
        def forward(self, y_t, t, conditioning):
            return torch.zeros_like(y_t)

    everywhere = Batch(given.windows, torch.ones_like(given.mask))
    assert float(made.loss(Zero(), everywhere, torch.Generator().manual_seed(0))) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("kind", ["conditioned", "wiener", "rotations", "past", "window"])
def test_resuming_is_as_if_never_stopped_to_the_bit(kind, tmp_path):
    cfg = small(**KINDS[kind], length_weight=0.1, train_steps=6, checkpoint_every=3)
    for folder, stop in ((tmp_path / "whole", 99), (tmp_path / "stopped", 4)):
        for step in train(lambda learnt: InbetweeningObjective(cfg, data_of(cfg), learnt), cfg.training, folder, "key"):
            if step.step == stop:
                break
    rest = train(lambda learnt: InbetweeningObjective(cfg, data_of(cfg), learnt), cfg.training, tmp_path / "stopped", "key")
    assert [step.step for step in rest] == [4, 5, 6]
    for name in (CHECKPOINT, MODEL):
        found, expected = (load_tensors(tmp_path / run / name)[0] for run in ("stopped", "whole"))
        assert found.keys() == expected.keys() and all(torch.equal(found[k], expected[k]) for k in expected)


def test_the_loss_is_of_the_frames_between():
    """Of who knows them nothing is left, whatever the past was; and with a past the network is shown it."""
    made = objective(past=4, length_weight=0.1, smoothness_weight=0.1, smoothness="velocity")
    given = batch(made)
    everywhere, seen = Batch(given.windows, torch.ones_like(given.mask)), []

    class Zero(torch.nn.Module):
        def forward(self, y_t, t, conditioning):
            seen.append((y_t.shape, conditioning.shape))
            return torch.zeros_like(y_t)

    assert float(made.loss(Zero(), everywhere, torch.Generator().manual_seed(0))) == pytest.approx(0, abs=1e-6)
    assert seen == [((16, 8, 51), (16, 8, 4 * 51 + 3))]


def test_what_was_learnt_goes_on_with_the_training():
    made = objective()
    other = Split([people().train[1]], people().validation, [])
    again = InbetweeningObjective(small(), other, made.learnt())
    assert all(torch.equal(again.learnt()[name], tensor) for name, tensor in made.learnt().items())
    assert set(made.learnt()) == {"mean", "deviation", "departure", "power", "limits"}
    assert isinstance(space_from_json(made.about()["space"]), PositionSpace)
    parents = made.space.bodies.skeleton.parents
    assert [*made.about()] == ["space"] and made.limits.shape == (sum(parent > 0 for parent in parents),)


def test_contacts_of_a_body_without_feet_are_refused():
    motions = [replace(m, skeleton=replace(m.skeleton, joints=tuple("abcdefghijklmnopq"))) for m in people().train]
    with pytest.raises(ValueError, match="contact_weight is 0.5, but joints are a, b, .*expected toes, feet or ankles"):
        InbetweeningObjective(small(contact_weight=0.5), Split(motions, [], []))
    InbetweeningObjective(small(), Split(motions, [], []))


def test_validation_is_the_same_every_time_and_leaves_the_network_evaluating():
    made = objective(dropout=0.5)
    network = shaken(made.network).train()
    first = made.validate(network)
    assert first is not None and made.validate(network.train()) == first and not network.training
    alone = InbetweeningObjective(small(), Split(people().train, [], []))
    assert alone.validate(alone.network) is None


@pytest.mark.parametrize("part", ["train", "validation"])
def test_clips_that_are_too_short_are_refused_before_the_training(part):
    short = [m.cut(0, 8) for m in people().train]
    split = people()._replace(test=[], **{part: short})
    with pytest.raises(ValueError, match="no clip is longer than 8 frames"):
        InbetweeningObjective(small(), split)


def test_the_limits_are_those_of_the_training_people():
    made = objective()
    windows = made.clips.windows(8, 3)
    angles = bone_angles(made.space.positions(windows.x, windows.offsets), made.space.bodies.skeleton).flatten(0, 1)
    beyond = (angles > made.limits).double().mean(0)
    assert 0 < float(beyond.mean()) < 0.03


def test_the_sizes_that_are_learnt_are_those_of_the_windows():
    """Windows ten times as large as usual: the factor that costs least is ten."""
    made = objective(**WINDOW, between=6)
    made.representation.power = made.representation.power / 10
    last = made.network.log_factor[-1]
    given = batch(made, 64)
    costs = []
    for factor in (1.0, 5.0, 10.0, 20.0):
        torch.nn.init.constant_(last.bias, math.log(factor))
        costs.append(float(loss(made, given).detach()))
    assert min(costs) == costs[2]


class Knows(torch.nn.Module):
    """Says the mean that it is given, times a number that is learnt."""

    def __init__(self, mean: torch.Tensor) -> None:
        super().__init__()
        self.mean, self.number = mean, torch.nn.Parameter(torch.ones(()))

    def forward(self, ends: torch.Tensor) -> torch.Tensor:
        return self.number * self.mean


def test_the_mean_is_asked_for_in_metres_and_nothing_is_left_of_a_truth_that_it_says():
    """A mean of zero leaves the whole of the interpolation's error, the truth nothing, half of the truth about half."""
    made = objective(**WINDOW | dict(hide=0.0), mean_width=8)
    given, form = batch(made), made.representation
    gap = form.gap(given.windows.x, given.mask)
    usual = form.usual(gap.frames)
    truth = form.tokens(gap) / usual
    left, costs, nothing = [], [], made.network.mean_of
    for mean in (nothing, Knows(truth), Knows(truth / 2)):
        made.network.mean_of = mean
        costs.append(float(loss(made, given).detach()))
        tokens = usual * made.network.mean(form.ends(gap), 6)
        guess = form.states(form.transform(gap.frames).inverse(tokens), gap)
        left.append(float(made._share_left(guess, gap.line, given.windows._replace(x=gap.x)).detach()))
    assert left[0] == 1.0 and left[1] < 1e-3 and left[2] == pytest.approx(0.5, abs=0.01)
    assert costs[1] < costs[0] - 1.5 and costs[1] < costs[2] < costs[0]  # nothing is left to be diffused


def test_what_is_diffused_does_not_teach_the_mean():
    """Its gradient is that of the error in metres, whatever the noise."""
    made = objective(**WINDOW, mean_width=8)
    shaken(made.network)
    given, last = batch(made), made.network.mean_of.leave[1].weight
    first, other = (torch.autograd.grad(loss(made, given, seed), last)[0] for seed in (0, 1))
    assert first.abs().max() > 1e-6 and torch.allclose(first, other, rtol=1e-4, atol=1e-8)


def test_clips_at_other_speeds_are_trained_on():
    plain, varied = objective(), objective(other_speeds=0.2)
    assert len(varied.clips.motions) == 5 * len(plain.clips.motions)
    lengths = [len(m) for m in varied.clips.motions[:: len(plain.clips.motions)]]
    assert lengths[0] == len(plain.clips.motions[0]) and min(lengths) < lengths[0] < max(lengths)
