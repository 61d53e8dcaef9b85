"""Turning a motion about the up-axis."""

from __future__ import annotations

import math

import pytest
import torch

from mwlib.body.kinematics import heading, scale_bones, turn_heading
from mwlib.body.skeleton import H36M17, Skeleton


def test_turn():
    x = torch.tensor([[1.0, 2.0, 3.0]])
    quarter = torch.tensor(math.pi / 2)
    torch.testing.assert_close(turn_heading(x, quarter), torch.tensor([[-2.0, 1.0, 3.0]]))
    torch.testing.assert_close(turn_heading(x, quarter, up="y"), torch.tensor([[-3.0, 2.0, 1.0]]))


@pytest.mark.parametrize("up", ["z", "y"])
def test_the_heading_turns_with_the_body(up):
    """It is that of the hips, the sides nearest the root, and no other joint's."""
    generator = torch.Generator().manual_seed(0)
    pose, angle = torch.randn(40, 48, generator=generator), torch.linspace(-3, 3, 40)
    turned = turn_heading(pose[:, None], angle, up)[:, 0]
    found = heading(turned, H36M17, up) - heading(pose, H36M17, up) - angle
    assert ((found + math.pi) % (2 * math.pi) - math.pi).abs().max() < 1e-4
    ahead = turn_heading(pose[:, None], -heading(pose, H36M17, up), up)[:, 0].unflatten(-1, (-1, 3))
    hips = ahead[:, H36M17.joints.index("left_hip") - 1] - ahead[:, H36M17.joints.index("right_hip") - 1]
    assert hips[:, 0].min() > 0 and hips[:, {"z": 1, "y": 2}[up]].abs().max() < 1e-4
    with pytest.raises(ValueError, match="stick has no left and right joints"):
        heading(torch.zeros(3), Skeleton("stick", ("root", "tip"), (-1, 0)))


def test_scaled_bones_by_hand():
    """A joint comes to lie where its own bone and all those above it put it."""
    x = torch.randn(5, 48, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    factor = torch.rand(16, generator=torch.Generator().manual_seed(1), dtype=torch.float64) + 0.5
    joints = torch.cat([torch.zeros(5, 1, 3, dtype=torch.float64), x.unflatten(-1, (-1, 3))], dim=1)
    expected = torch.zeros_like(joints)
    for joint, parent in enumerate(H36M17.parents):
        if parent >= 0:
            expected[:, joint] = expected[:, parent] + factor[joint - 1] * (joints[:, joint] - joints[:, parent])
    torch.testing.assert_close(scale_bones(x, factor[None], H36M17), expected[:, 1:].flatten(1))
    torch.testing.assert_close(scale_bones(x, torch.ones(1, 16, dtype=torch.float64), H36M17), x)
