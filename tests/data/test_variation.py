"""Variations of training windows: what changes, how often, and what must not."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
import torch

from mwlib.body.kinematics import bones_of, heading
from mwlib.body.skeleton import H36M17, Skeleton
from mwlib.data.windows import Variation, other_arms, slowed

T = 12
ARMS = [joint - 1 for name in ("left_arm", "right_arm") for joint in H36M17.parts[name]]
TRUNK = H36M17.parents[H36M17.parts["left_arm"][0]] - 1


def draws(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def some(count: int) -> torch.Tensor:
    """Windows of bodies that turn and wave, every one another."""
    return torch.randn(count, T, 48, generator=draws(5)).cumsum(1)


def changed(variation: Variation, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The windows as varied, and which of them are."""
    varied = variation(x, H36M17, "z", draws())
    return varied, (varied != x).any(2).any(1)


def test_by_default_nothing_changes_and_nothing_is_drawn():
    x, generator = some(4), draws()
    assert Variation()(x, H36M17, "z", generator) is x
    assert torch.equal(generator.get_state(), draws().get_state())


@pytest.mark.parametrize("name", ["backwards", "slowed", "arms"])
def test_the_share_is_kept_and_the_other_windows_too(name):
    x = some(1000)
    varied, which = changed(Variation(**{name: 0.3}), x)
    assert abs(float(which.double().mean()) - 0.3) < 0.04
    assert torch.equal(varied[~which], x[~which])


def test_backwards_is_the_frames_in_the_other_order():
    x = some(40)
    varied, which = changed(Variation(backwards=0.5), x)
    assert which.any() and torch.equal(varied[which], x[which].flip(1))


@pytest.mark.parametrize("pivot", [0, 4, T - 1])
def test_slowed_windows_lie_between_frames_on_straight_lines(pivot):
    x, speed = some(6).double(), torch.linspace(0.1, 1, 6, dtype=torch.float64)[:, None]
    found = slowed(x, speed, pivot)
    for window, share, result in zip(x, speed, found, strict=True):
        place = pivot + (np.arange(T) - pivot) * float(share)
        expected = np.stack([np.interp(place, np.arange(T), channel) for channel in window.numpy().T], axis=1)
        np.testing.assert_allclose(result.numpy(), expected, atol=1e-9)
    torch.testing.assert_close(found[:, pivot], x[:, pivot])
    torch.testing.assert_close(found[-1], x[-1])


def test_speeds_come_from_a_tenth_to_the_whole():
    steady = torch.arange(float(T))[None, :, None].expand(2000, T, 48)
    varied, _ = changed(Variation(slowed=1.0, pivot=3), steady)
    speed = (varied[:, -1, 0] - varied[:, 0, 0]) / (T - 1)
    assert 0.1 <= speed.min() < 0.12 and 0.98 < speed.max() <= 1
    assert (np.histogram(speed, 4, (0.1, 1))[0] > 400).all()
    assert (varied[:, 3] - 3).abs().max() < 1e-5


@pytest.mark.parametrize("up", ["z", "y"])
def test_arms_of_another_hang_where_the_own_ones_did_and_face_the_same_way(up):
    x, donors, pivot = some(8).double(), some(16)[8:].double(), 4
    found = other_arms(x, donors, H36M17, up, pivot).unflatten(-1, (-1, 3))
    own, others = x.unflatten(-1, (-1, 3)), donors.unflatten(-1, (-1, 3))
    rest = [joint for joint in range(16) if joint not in ARMS]
    torch.testing.assert_close(found[:, :, rest], own[:, :, rest])
    # seen from above as complex numbers, the donors' arms are turned by one angle for each window
    a, b = (0, 1) if up == "z" else (0, 2)
    above = lambda p: torch.complex(p[..., a], p[..., b])  # noqa: E731
    hung, donated = (above(p[:, :, ARMS] - p[:, :, [TRUNK]]) for p in (found, others))
    angle = heading(x[:, pivot], H36M17, up) - heading(donors[:, pivot], H36M17, up)
    torch.testing.assert_close(hung, donated * torch.polar(torch.ones_like(angle), angle)[:, None, None])
    heights = ((p[:, :, ARMS] - p[:, :, [TRUNK]])[..., 2 if up == "z" else 1] for p in (found, others))
    torch.testing.assert_close(*heights)


def test_arms_come_from_other_windows_of_the_batch():
    """Everybody's arms are taken from somebody, each donor once; the bones of the arms tell whose they are."""
    x = some(64)
    varied, which = changed(Variation(arms=1.0, pivot=4), x)
    bones = [joint for joint in ARMS if joint not in (10, 13)]
    lengths, own = (bones_of(p[:, 0], H36M17).norm(dim=-1)[:, bones] for p in (varied, x))
    donor = torch.cdist(lengths, own).argmin(1)
    assert sorted(donor.tolist()) == list(range(64)) and which.double().mean() > 0.9


def test_arms_hung_at_the_root_stay_at_the_root():
    pair = Skeleton("pair", ("root", "left", "right"), (-1, 0, 0), (1,), (2,), {"left_arm": (1,), "right_arm": (2,)})
    x = torch.tensor([1.0, 0.0, 2.0, -1.0, 0.0, 2.0]).expand(1, 3, 6)
    donors = torch.tensor([0.0, 3.0, 1.0, 0.0, -3.0, 1.0]).expand(1, 3, 6)
    found = other_arms(x, donors, pair, "z", 0)
    torch.testing.assert_close(found[0, 0], torch.tensor([3.0, 0.0, 1.0, -3.0, 0.0, 1.0]))


def test_a_skeleton_without_arms_is_refused():
    bare = replace(H36M17, name="bare", parts={})
    with pytest.raises(ValueError, match="bare has no parts left_arm and right_arm"):
        Variation(arms=0.5)(some(4), bare, "z", draws())


def test_every_variation_is_a_setting():
    """What training draws follows from the settings alone, each under its own name."""
    from mwlib.prediction.representation import training_windows
    from tests.sample_settings import small, two_people

    cfg = small(other_speeds=0.11, other_bones=0.12, backwards=0.13, slowed=0.14, other_arms=0.15)
    found = training_windows(two_people().train, cfg.windows).variation
    assert [getattr(found, field.name) for field in fields(Variation)] == [0.11, 0.12, 0.13, 0.14, 0.15, cfg.windows.history - 1]
