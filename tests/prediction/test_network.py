"""The two branches of guidance against the network itself, called once with the condition and once without."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import to_eps
from mwlib.prediction.predictor import Predictor
from tests.sample_settings import two_people, untrained

T, SAMPLES = 30, 3


@pytest.fixture(scope="module", params=["pose", "displacement"])
def predictor(request) -> Predictor:
    return untrained(representation=request.param, prediction="v")


@pytest.fixture(scope="module")
def past() -> torch.Tensor:
    x = torch.from_numpy(two_people().train[0].root_relative()).float()
    return torch.stack([x[start : start + 6] for start in (0, 9, 20, 31)])


def close(found, expected):
    torch.testing.assert_close(found, expected, atol=2e-5, rtol=1e-4)


def test_both_is_the_network_with_the_condition_and_without(predictor, past):
    branches, y = predictor.branches(past), predictor.noise(0, range(4), SAMPLES)()
    conditions = predictor.representation.encode_history(past)[:, None].expand(y.shape)
    with torch.no_grad():
        told, (blind, maps) = predictor.net(y, T, conditions), predictor.net(y, T, return_attention=True)
        conditional, unconditional, attention = branches.both(y, T, with_attention=True)
        alone = branches.conditional(y, T), branches.unconditional(y, T)
        assert branches.both(y, T, with_attention=False)[2] is None
    expected = [to_eps("v", output, y, predictor.alpha_bar[T]) for output in (told, blind)]
    for found, other, truth in zip((conditional, unconditional), alone, expected, strict=True):
        close(found, truth)
        close(other, truth)
    close(attention, maps)
    assert (expected[0] - expected[1]).abs().max() > 0.01, "else nothing tells them apart"


def test_another_history_changes_its_own_window_and_the_conditional_branch_alone(predictor, past):
    y = predictor.noise(0, range(4), SAMPLES)()
    other = past.clone()
    other[2] += 0.3
    with torch.no_grad():
        before, after = (predictor.branches(x).both(y, T, with_attention=True) for x in (past, other))
    moved = (after[0] - before[0]).abs().flatten(1).amax(1)
    assert moved[2] > 1e-3 and moved[[0, 1, 3]].max() < 1e-5
    close(after[1], before[1])
    close(after[2], before[2])
