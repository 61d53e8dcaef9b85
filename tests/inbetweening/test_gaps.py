"""Scores by gap: who gives the truth has no error and the truth's speed, jerk and feet; and the table that a card shows."""

from __future__ import annotations

import torch

from mwlib.inbetweening import gaps
from mwlib.inbetweening.gaps import by_gap, card_of_gaps, rows_by_gap, scores
from tests.inbetweening.sample import WINDOW, data_of, untrained


def walk(bridge, count: int = 3):
    motion = data_of(bridge.cfg).test[0]
    return torch.from_numpy(motion.positions).float()[None, :14].repeat(count, 1, 1, 1)


def test_the_truth_has_no_error_and_is_its_own_measure():
    bridge = untrained(**WINDOW)
    truth = walk(bridge)
    line = truth[:, 1:-1] + 0.1
    found = scores(truth[:, None, 1:-1].repeat(1, 2, 1, 1, 1), truth, line, bridge)
    for name in ("mean", "single", "best", "spread", "sunk"):
        assert found[name].abs().max() < 1e-5, name
    for name in ("jerk", "speed", "jump", "slide"):
        torch.testing.assert_close(found[name], found[f"true_{name}"].to(found[name]), equal_nan=True)
    torch.testing.assert_close(found["straight"], torch.full((3,), 0.1 * 3**0.5), atol=1e-5, rtol=0)


def test_two_samples_on_either_side_by_hand():
    bridge = untrained(**WINDOW)
    truth = walk(bridge)
    off = torch.tensor([0.3, -0.1])[None, :, None, None, None] * torch.tensor([0.0, 0.0, 1.0])
    found = scores(truth[:, None, 1:-1] + off, truth, truth[:, 1:-1], bridge)
    for name, expected in (("single", 0.2), ("mean", 0.1), ("best", 0.1), ("spread", 0.2), ("sunk", 0.05)):
        torch.testing.assert_close(found[name], torch.full((3,), expected), atol=1e-5, rtol=0, msg=name)
    assert (found["jump"] > found["true_jump"]).all()  # the keyframe is not where it was


def test_a_row_for_each_gap_that_the_model_is_for(monkeypatch):
    bridge = untrained(**WINDOW, shortest=4)
    monkeypatch.setattr(gaps, "GAPS", (4, 6, 9))
    rows = rows_by_gap(bridge, data_of(bridge.cfg).test, {})
    assert [row["gap"] for row in rows["known"]] == [4, 6] and [*rows] == ["known", "not known"]
    assert rows["known"][0]["mean"]["single"] != rows["not known"][0]["mean"]["single"]
    text = "\n".join(card_of_gaps(rows))
    assert "| 4 |" in text and "velocities at both keyframes not known" in text
    assert rows_by_gap(untrained(), data_of(bridge.cfg).test, {}) == {}
    [row] = by_gap(
        bridge, data_of(bridge.cfg).test, True, 5, lambda clip, first, last: walk(bridge)[0, : last - first + 1].numpy()
    )[:1]
    assert row["windows"] == 5 and row["mean"]["straight"] > rows["known"][0]["mean"]["straight"]
