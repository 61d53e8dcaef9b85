"""The moving average of weights against its recurrence, computed by hand."""

from __future__ import annotations

import torch

from mwlib.training import MovingAverage


def walk(network: torch.nn.Linear, average: MovingAverage, steps: range, generator: torch.Generator) -> list[float]:
    """Move the first weight about; give its values."""
    seen = []
    for step in steps:
        with torch.no_grad():
            network.weight.add_(torch.randn(network.weight.shape, generator=generator, dtype=torch.float64))
        average.update(step)
        seen.append(float(network.weight.detach()[0, 0]))
    return seen


def test_it_is_a_copy_until_the_start_and_decays_after_it(generator):
    network = torch.nn.Linear(3, 2, dtype=torch.float64)
    average = MovingAverage(network, decay=0.9, start=3)
    seen = walk(network, average, range(1, 4), generator)
    assert float(average.weights["weight"][0, 0]) == seen[2]
    expected = seen[2]
    for value in walk(network, average, range(4, 9), generator):
        expected = 0.9 * expected + 0.1 * value
    torch.testing.assert_close(float(average.weights["weight"][0, 0]), expected, rtol=1e-14, atol=0)


def test_what_it_gives_is_a_network_of_its_own_in_evaluation_mode(generator):
    network = torch.nn.Sequential(torch.nn.Linear(3, 2, dtype=torch.float64), torch.nn.Dropout(0.5)).train()
    average = MovingAverage(network, decay=0.5, start=0)
    before = network[0].weight.detach().clone()
    with torch.no_grad():
        network[0].weight.add_(1)
    average.update(1)
    found = average.averaged()
    torch.testing.assert_close(found[0].weight.detach(), before + 0.5, rtol=1e-14, atol=0)
    assert not found.training and network.training and torch.equal(network[0].weight, before + 1)


def test_it_goes_on_from_what_it_gave(generator):
    network = torch.nn.Linear(3, 2, dtype=torch.float64)
    average = MovingAverage(network, 0.8, 1)
    walk(network, average, range(1, 5), generator)
    again = MovingAverage(network, 0.8, 1)
    for name, tensor in average.weights.items():
        again.weights[name].copy_(tensor)
    walk(network, average, range(5, 6), generator)
    again.update(5)
    assert all(torch.equal(a, b) for a, b in zip(average.weights.values(), again.weights.values(), strict=True))
