"""A training may begin with the weights of another."""

from __future__ import annotations

import pytest
import torch

from mwlib.text_to_motion.objective import TextObjective
from mwlib.training.checkpoint import save_tensors
from tests.text_to_motion.sample import small, toy


def written(folder, cfg):
    """A finished run's folder, of an objective with weights of its own."""
    one = TextObjective(cfg, toy())
    with torch.no_grad():
        for weights in one.network.parameters():
            weights.add_(1.0)
    tensors = {f"net.{name}": t for name, t in one.network.state_dict().items()}
    save_tensors(folder / "model.safetensors", tensors | {f"objective.{n}": 2 * t for n, t in one.learnt().items()}, {})
    (folder / "config.yaml").write_text(cfg.to_yaml())
    return one


def test_weights_words_and_statistics_are_those_of_the_run_that_it_starts_from(tmp_path):
    before = written(tmp_path, small())
    fewer = toy()._replace(train=toy().train[:4:2])  # of which all go up: "down" would not be a word
    after = TextObjective(small(start=str(tmp_path)), fewer)
    state = after.network.state_dict()
    assert all(torch.equal(t, state[name]) for name, t in before.network.state_dict().items())
    assert torch.equal(after.statistics.mean, 2 * before.statistics.mean)
    plain = TextObjective(small(), toy())
    assert not torch.equal(plain.network.body.enter.weight, after.network.body.enter.weight)


def test_what_cannot_be_started_from_is_refused(tmp_path):
    written(tmp_path, small())
    with pytest.raises(
        FileNotFoundError, match="nowhere/config.yaml is missing: no finished run there; name a run of text_to_motion"
    ):
        TextObjective(small(start="nowhere"), toy())
    with pytest.raises(ValueError, match="start is .*has the shape .*; expected .*: a run of the same sizes"):
        TextObjective(small(start=str(tmp_path), width=32), toy())
