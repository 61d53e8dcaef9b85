"""Randomness as a function of numbers."""

from __future__ import annotations

import torch

from mwlib.training import seeded


def test_every_step_and_process_draws_anew():
    draws = []
    for numbers in [(0, 1, 0), (0, 2, 0), (0, 1, 1), (1, 1, 0), (0, 2**20, 0)]:
        with seeded(*numbers) as generator:
            draws += [torch.rand(4, generator=generator), torch.rand(4)]
    assert len({tuple(d.tolist()) for d in draws}) == len(draws)


def test_the_same_numbers_give_the_same_draws():
    found = []
    for _ in range(2):
        with seeded(3, 5) as generator:
            found.append((torch.rand(4, generator=generator), torch.rand(4)))
    assert all(torch.equal(a, b) for a, b in zip(*found, strict=True))
