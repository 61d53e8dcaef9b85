"""How an evaluator is trained: losses by hand, it learns, it resumes to the bit, its halves are apart."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from mwlib.data.captioned import Parts
from mwlib.matching.config import Config

from mwlib.matching.objective import (  # isort: skip
    MatchingObjective, Pairs, contrastive_loss, infonce_loss, movement_loss, of_half, train_movements,
)  # fmt: skip
from mwlib.training import CHECKPOINT, MODEL, train
from mwlib.training.checkpoint import load_tensors
from tests.matching.sample import objective, parts, small, toy_clips

TEXT, MOTION = torch.tensor([[0.0, 0.0], [3.0, 4.0]]), torch.tensor([[0.0, 1.0], [3.0, 0.0]])
each_loss = pytest.mark.parametrize("loss", ["contrastive", "infonce"])


def test_the_contrastive_loss_by_hand():
    positives, negatives = contrastive_loss(TEXT, MOTION, 1, margin=10.0)
    assert float(positives) == pytest.approx(8.5) and float(negatives) == pytest.approx(41.0736, abs=5e-5)
    _, near = contrastive_loss(TEXT, MOTION, 1, margin=4.0)
    assert float(near) == pytest.approx(0.5), "the second is beyond the margin"
    three = torch.tensor([[0.0], [1.0], [5.0]])
    assert float(contrastive_loss(three, three, 2)[1]) == pytest.approx((5**2 + 9**2 + 6**2) / 3)


def test_every_other_shift_is_drawn(monkeypatch):
    made, seen = objective(), set()
    given = made.draw(4, torch.Generator().manual_seed(0))
    monkeypatch.setattr(
        "mwlib.matching.objective.contrastive_loss",
        lambda text, motion, shift, margin: (seen.add(shift), contrastive_loss(text, motion, shift, margin))[1],
    )
    for seed in range(40):
        made.loss(made.network, given, torch.Generator().manual_seed(seed))
    assert seen == {1, 2, 3}


def test_infonce_by_a_loop(generator):
    text, motion = torch.randn(2, 5, 3, generator=generator)
    same = torch.eye(5, dtype=torch.bool)
    same[1, 4] = same[4, 1] = True
    total = 0.0
    for i in range(5):
        others = [j for j in range(5) if j == i or not same[i, j]]
        rows = torch.stack([-((text[i] - motion[j]) ** 2).sum() / 2 for j in others])
        columns = torch.stack([-((text[j] - motion[i]) ** 2).sum() / 2 for j in others])
        total -= float(F.log_softmax(rows, 0)[others.index(i)] + F.log_softmax(columns, 0)[others.index(i)])
    assert float(infonce_loss(text, motion, same, 2.0)) == pytest.approx(total / 10, rel=1e-5)


def test_movements_are_learnt_by_their_loss_and_then_frozen():
    x, codes = torch.zeros(1, 8, 2), torch.tensor([[[1.0, -2.0], [3.0, 2.0]]])
    assert float(movement_loss(x + 0.5, x, codes, 0.1, 0.01)) == pytest.approx(0.5 + 0.1 * 2 + 0.01 * 3)
    made = objective()
    encoder, curve = train_movements(made.clips, small(movement_steps=80, movement_lr=3e-3), 263)
    assert np.mean(curve[-5:]) < 0.8 * np.mean(curve[:5]) and len(curve) == 80
    assert not encoder.training and not any(p.requires_grad for p in encoder.parameters())


@each_loss
def test_it_learns(loss):
    """Pairs that are held out. A network that has learnt nothing puts all at half the margin from each other: 2 (margin / 2)²."""
    cfg = small(loss=loss, movement_steps=30, train_steps=60, batch=16, lr=1e-2, ema=0.0, checkpoint_every=60)
    made = MatchingObjective(cfg, parts())
    before = made.validate(made.network)
    steps = [*train(lambda learnt: made, cfg.training)]
    assert before is not None and steps[-1].validation is not None
    assert steps[-1].validation < {"contrastive": 46.0, "infonce": 0.6 * before}[loss]


@each_loss
def test_every_weight_learns_and_the_movements_do_not(loss):
    made = objective(loss=loss)
    made.loss(made.network.train(), made.draw(6, torch.Generator().manual_seed(0)), torch.Generator().manual_seed(0)).backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in made.network.parameters())
    assert all(p.grad is None for p in made.movement.parameters()) and not made.movement.training


def test_copies_of_a_caption_are_no_negatives():
    """With two captions in all, a network that says the same of all motions with one caption has nothing to lose."""
    made = objective(loss="infonce")
    words, counts, x, lengths = made.draw(6, torch.Generator().manual_seed(0))
    one = Pairs(words[:1].expand(6, -1), counts[:1].expand(6), x, lengths)
    assert float(made.loss(made.network.eval(), one, torch.Generator()).detach()) == pytest.approx(0, abs=1e-6)


def test_words_are_lost_in_training_only_and_never_the_marks(monkeypatch):
    made = objective(word_dropout=0.5)
    given, seen = made.draw(6, torch.Generator().manual_seed(0)), []
    forward = made.network.forward
    monkeypatch.setattr(made.network, "forward", lambda words, *rest: (seen.append(words), forward(words, *rest))[1])
    for mode in (True, False):
        made.loss(made.network.train(mode), given, torch.Generator().manual_seed(0))
    lost, kept = seen
    assert torch.equal(kept, given.words)
    real = given.words >= 3
    assert torch.equal(lost[~real], given.words[~real])
    assert (
        set(lost[real & (lost != given.words)].tolist()) == {0} and 0.2 < float((lost != given.words)[real].float().mean()) < 0.8
    )


def test_resuming_is_as_if_never_stopped_to_the_bit(tmp_path):
    cfg = small(half="evaluator", word_dropout=0.1, dropout=0.1)
    for folder, stop in ((tmp_path / "whole", 99), (tmp_path / "stopped", 4)):
        for step in train(lambda learnt: MatchingObjective(cfg, parts(), learnt), cfg.training, folder, "key"):
            if step.step == stop:
                break
    rest = train(lambda learnt: MatchingObjective(cfg, parts(), learnt), cfg.training, tmp_path / "stopped", "key")
    assert [step.step for step in rest] == [4, 5, 6]
    for name in (CHECKPOINT, MODEL):
        found, expected = (load_tensors(tmp_path / run / name)[0] for run in ("stopped", "whole"))
        assert found.keys() == expected.keys() and all(torch.equal(found[k], expected[k]) for k in expected)


def test_what_was_learnt_goes_on_with_the_training(monkeypatch):
    made = objective()
    other = Parts([*toy_clips(24, "other", seed=3)], [], [])
    again = MatchingObjective(small(), other, made.learnt())
    assert all(torch.equal(again.learnt()[name], tensor) for name, tensor in made.learnt().items())
    assert again.validate(again.network) is None
    assert {"mean", "deviation"} < set(made.learnt()) and "movement.main.0.weight" in made.learnt()


def test_evaluator_and_critic_learn_from_their_own_clips():
    for half in ("evaluator", "critic"):
        chosen = of_half(parts().train, half)
        made = objective(half=half)
        assert torch.equal(made.clips.frames.lengths, torch.tensor([len(clip.features) for clip in chosen]))
        frames = np.concatenate([clip.features for clip in chosen])
        torch.testing.assert_close(made.statistics.mean, torch.from_numpy(frames.mean(0)), atol=1e-5, rtol=1e-4)


def test_root_and_contacts_weigh_more_where_asked_and_validation_repeats():
    plain, heavy = (objective(statistics=kind).clips.frames.flat for kind in ("mdm", "evaluator"))
    ratio = heavy.std(0) / plain.std(0)
    torch.testing.assert_close(ratio[[0, 3, 4, 100, 258, 259, 262]], torch.tensor([25.0, 25, 1, 1, 1, 25, 25]))
    made = objective(word_dropout=0.5)
    first = made.validate(made.network.train())
    assert first is not None and made.validate(made.network.train()) == first and not made.network.training


def test_settings_that_do_not_fit_are_refused():
    for changes, message in ((dict(movement_frames=10), "expected a multiple of 4"), (dict(batch=1), "expected at least 2")):
        with pytest.raises(ValueError, match=message):
            small(**changes)
    assert {"tiny", "laptop", "humanml3d"} <= {*Config.presets} and all(Config.preset(name) for name in Config.presets)
