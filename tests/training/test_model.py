"""The base of trained models."""

from __future__ import annotations

import pytest
import torch

from mwlib.training import Objective, TrainedModel, chunks, identities, with_weights
from tests.sample_settings import small


@pytest.fixture
def model() -> TrainedModel:
    return TrainedModel(torch.nn.Linear(2, 2), small(samples=3, sampling_seed=5))


def test_a_copy_samples_in_another_way_with_the_same_network(model):
    model.extra = object()
    other = model.with_sampling(samples=7)
    assert (other.sampling.samples, model.sampling.samples) == (7, 3) and not model.net.training
    assert other.net is model.net and other.extra is model.extra and type(other) is type(model)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"sample": 3}, "did you mean 'samples'"),
        ({"samples": 0}, "samples is 0; expected at least 1"),
        ({"width": 32, "samples": 2}, "^width belongs to the trained model; expected settings of the sampling"),
    ],
)
def test_what_is_no_setting_of_the_sampling_is_refused(model, changes, message):
    with pytest.raises(ValueError, match=message):
        model.with_sampling(**changes)


def test_numbers_that_nobody_gave_are_those_of_the_settings(model):
    assert model.asked(None, None) == (3, 5) and model.asked(1, 0) == (1, 0)
    with pytest.raises(ValueError, match="samples is 0; expected at least 1"):
        model.asked(0, None)
    assert identities(None, 2) == [0, 1] and identities((4, 4), 2) == [4, 4]
    with pytest.raises(ValueError, match="window_ids has 1 entries for 2 windows; expected one each"):
        identities([3], 2)


def test_chunks_cover_everything_once_and_in_order():
    items = list(range(7))
    assert [items[part] for part in chunks(7, 3)] == [[0, 1, 2], [3, 4, 5], [6]] and not list(chunks(0, 3))


def test_the_model_is_where_it_was_moved(model):
    assert model.to("meta") is model and model.device.type == "meta"
    with pytest.raises(ValueError, match="the device meta, which holds no numbers; expected 'cpu' or"):
        model.finite(torch.ones(2, device="meta"))


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("device, shown", [("nonsense", "'nonsense'"), ("cpu:x", "'cpu:x'"), ("", "''"), (None, "None")])
def test_devices_that_are_none_are_refused(model, device, shown):
    with pytest.raises(ValueError, match=f"device is {shown}; expected 'cpu', or a graphics card such as 'cuda': "):
        model.to(device)
    assert model.device.type == "cpu"


def test_weights_are_taken_over_and_nothing_is_drawn():
    weights = torch.nn.Linear(2, 2).state_dict()
    torch.manual_seed(1)
    expected = torch.rand(1)
    torch.manual_seed(1)
    network = with_weights(lambda: torch.nn.Linear(2, 2), weights)
    assert torch.equal(torch.rand(1), expected) and torch.equal(network.weight, weights["weight"])


def test_a_loss_on_held_out_data_has_the_same_noise_every_time():
    class Held(Objective):
        draw = loss = None

        def held_out_loss(self, network, generator):
            assert not network.training and torch.is_inference_mode_enabled()
            return float(torch.rand((), generator=generator) + torch.rand(()))

    network = torch.nn.Linear(1, 1).train()
    assert Held().validate(network) == Held().validate(network)
    assert type("Nobody", (Held,), {"held_out_loss": Objective.held_out_loss})().validate(network) is None
