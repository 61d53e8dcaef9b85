"""Turning a motion about the up-axis."""

from __future__ import annotations

import math

import torch

from mwlib.body.kinematics import turn_heading


def test_turn():
    x = torch.tensor([[1.0, 2.0, 3.0]])
    quarter = torch.tensor(math.pi / 2)
    torch.testing.assert_close(turn_heading(x, quarter), torch.tensor([[-2.0, 1.0, 3.0]]))
    torch.testing.assert_close(turn_heading(x, quarter, up="y"), torch.tensor([[-3.0, 2.0, 1.0]]))
