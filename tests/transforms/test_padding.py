"""A history held over the future."""

from __future__ import annotations

import pytest
import torch

from mwlib.transforms import pad_history


def test_the_last_pose_is_held(generator):
    x = torch.randn(2, 3, 4, generator=generator)
    padded, before = pad_history(x, 5), x.clone()
    assert torch.equal(padded[:, :3], x) and torch.equal(padded[:, 2:], x[:, 2:].expand(-1, 3, -1))
    padded.add_(1)
    assert torch.equal(x, before)
    assert torch.equal(pad_history(x[0], 3), x[0])


def test_a_history_longer_than_the_motion_is_refused():
    with pytest.raises(ValueError, match="5 frames; expected at most 4"):
        pad_history(torch.zeros(5, 3), 4)
