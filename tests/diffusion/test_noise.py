"""Noise that belongs to a window, however windows are grouped."""

from __future__ import annotations

import torch

from mwlib.diffusion import WindowNoise


def test_noise_belongs_to_the_window():
    whole = WindowNoise(3, range(5), (2, 4, 3))
    first, second = whole(), whole()
    part = WindowNoise(3, [3, 4], (2, 4, 3))
    assert torch.equal(part(), first[3:]) and torch.equal(part(), second[3:])
    assert not torch.equal(WindowNoise(4, [3], (2, 4, 3))(), first[3:4])
