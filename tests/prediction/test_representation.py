"""Windows as coefficients: what they are relative to, how they are scaled, and that no frame of the future comes in."""

from __future__ import annotations

import math

import pytest
import torch

from mwlib.body.kinematics import turn_heading
from mwlib.body.skeleton import H36M17
from mwlib.data.windows import Bodies, windows
from mwlib.prediction.objective import PredictionObjective
from mwlib.prediction.representation import (
    Representation,
    fit_scales,
    make_transform,
    restored_representation,
    turned,
)
from tests.sample_settings import small, two_people

H, F, C = 6, 14, 48
KINDS = ["pose", "displacement", "relaxing"]


@pytest.fixture(scope="module")
def x() -> torch.Tensor:
    return windows(two_people().train, H, F, 5).x


def fitted(x: torch.Tensor, **changes) -> Representation:
    cfg = small(**changes)
    base = make_transform(cfg.model, H + F, C, cfg.data.fps)
    bodies = Bodies.of(two_people().train)
    x = turned(x, x[:, :H], bodies if cfg.model.heading == "body" else None, -1)
    return Representation(base, fit_scales(base, x, cfg, bodies), cfg, bodies)


def held(x: torch.Tensor) -> torch.Tensor:
    """History, then its last pose to the end."""
    return torch.cat([x[:, :H], x[:, H - 1 : H].repeat(1, F, 1)], dim=1)


def test_views_follow_frames_and_rate():
    """A sixth of the cosines, as the paper's 20 of 125, and one at least; windows of a phase are odd, and no longer than said."""
    dct = {frames: make_transform(small(transform="dct").model, frames, C, 10.0).shape[0] for frames in (125, 100, 20, 2)}
    assert dct == {125: 20, 100: 16, 20: 3, 2: 1}
    assert make_transform(small(transform="dct", dct_rows=7).model, 20, C, 10.0).shape[0] == 7
    phase = small(transform="phase", phase_seconds=1.0).model
    windows = {fps: make_transform(phase, 20, C, fps).window for fps in (10.0, 25.0, 50.0, 1.0)}
    assert windows == {10.0: 11, 25.0: 25, 50.0: 51, 1.0: 3}


@pytest.mark.parametrize("kind", ["pose", "displacement"])
def test_coefficients_by_hand(x, kind):
    """A displacement is the motion minus its last observed pose; its condition is a pose, with a scale of its own."""
    found = fitted(x, representation=kind)
    modelled = x - x[:, H - 1 : H] if kind == "displacement" else x
    seen = held(x) if kind == "displacement" else x  # what the condition's scale is fitted on
    for coefficients, source, fit in (
        (found.encode(x), modelled, modelled),
        (found.encode_history(x[:, :H]), held(x), seen),
    ):
        raw, of = found.motion.base(source), found.motion.base(fit)
        deviation = of.std(0).clamp_min(1e-3 * float(of.std(0).max()))
        torch.testing.assert_close(coefficients, (raw - of.mean(0)) / deviation, atol=1e-3, rtol=1e-4)


@pytest.mark.parametrize("heading", ["world", "body"])
@pytest.mark.parametrize("kind", KINDS)
def test_decoding_gives_the_motion_back(x, kind, heading):
    found = fitted(x, representation=kind, heading=heading)
    decoded = found.decode(found.encode(x[:9])[:, None], x[:9, :H])
    torch.testing.assert_close(decoded[:, 0], x[:9], atol=1e-5, rtol=1e-5)


def test_the_last_observed_pose_of_a_displacement_is_zero(x):
    found = fitted(x, representation="displacement", coefficient_scale="none")
    motion = found.motion.inverse(found.encode(x[:9]))
    assert motion[:, H - 1].abs().max() < 1e-5 and motion[:, H].abs().max() > 1e-3
    assert torch.equal(found.origin(x[:9, :H]), x[:9, H - 1 : H])


def test_a_relaxing_pose_by_hand(x):
    """History as it is; then from the last pose to the mean one, a share 1/e of the way being left after half a second."""
    found = fitted(x, representation="relaxing", fade_seconds=0.5, coefficient_scale="none")  # 10 frames a second
    origin, rest = found.origin(x[:3, :H]), x.mean((0, 1))
    torch.testing.assert_close(origin[:, :H], x[:3, :H], atol=0, rtol=0)
    for k in (1, 5, F):
        expected = rest + (x[:3, H - 1] - rest) * math.exp(-k / 5)
        torch.testing.assert_close(origin[:, H - 1 + k], expected, atol=1e-5, rtol=0)
    modelled = found.motion.inverse(found.encode(x[:3]))
    torch.testing.assert_close(modelled, x[:3] - origin, atol=1e-4, rtol=0)
    again = restored_representation(small(representation="relaxing"), found.learnt(), Bodies.of(two_people().train))
    torch.testing.assert_close(again.origin(x[:3, :H]), origin)


@pytest.mark.parametrize("kind", KINDS)
def test_a_turned_body_has_the_same_coefficients(x, kind):
    """The last observed pose faces one way, whichever way it was recorded; its hips lie along the first axis."""
    found = fitted(x, representation=kind, heading="body", coefficient_scale="none")
    turned = turn_heading(x[:9], torch.linspace(0, 6, 9))
    torch.testing.assert_close(found.encode(turned), found.encode(x[:9]), atol=1e-4, rtol=0)
    torch.testing.assert_close(found.encode_history(turned[:, :H]), found.encode_history(x[:9, :H]), atol=1e-4, rtol=0)
    seen = found.condition.inverse(found.encode_history(x[:9, :H]))[:, H - 1].unflatten(-1, (-1, 3))
    across = seen[:, H36M17.joints.index("left_hip") - 1] - seen[:, H36M17.joints.index("right_hip") - 1]
    assert across[:, 0].min() > 0.1 and across[:, 1].abs().max() < 1e-4


class Spy(torch.nn.Module):
    """Answers nothing, and remembers the condition."""

    def forward(self, y, t, condition, keep):
        self.condition = condition
        return torch.zeros_like(y)


@pytest.mark.parametrize("kind", KINDS)
def test_the_condition_sees_no_future_frame(x, kind):
    objective, spy = PredictionObjective(small(representation=kind), two_people()), Spy()
    seen = []
    for change in (0.0, 1.0):
        batch = x[:32].clone()
        batch[:, H:] += change
        objective.loss(spy, batch, torch.Generator().manual_seed(0))
        seen.append(spy.condition)
    assert torch.equal(*seen)
    before = x[:32].clone()
    before[:, H - 1] += 1.0
    objective.loss(spy, before, torch.Generator().manual_seed(0))
    assert (spy.condition - seen[0]).abs().flatten(1).amax(1).min() > 0.1, "the last observed frame is seen"


def test_a_condition_can_have_a_scale_of_its_own():
    """How people move counts for as much as where they stand, and what does not vary stays small."""
    plain, own = (
        PredictionObjective(small(coefficient_scale="none", transform="time_wavelet", condition_scale=kind), two_people())
        for kind in ("as_motion", "coefficient")
    )
    drawn = own.draw(2000, torch.Generator().manual_seed(1))
    x, seen = plain.representation, own.representation
    assert torch.equal(x.encode(drawn), seen.encode(drawn))
    of = seen.encode_history(drawn[:, :6])
    raw = x.encode_history(drawn[:, :6])
    varies = raw.std(0) > 0.05
    assert (of.std(0)[varies] - 1).abs().max() < 0.3 and of.mean(0).abs().max() < 0.3
    still = (raw.std(0) > 1e-4) & (raw.std(0) < 0.015)
    assert still.any() and (of.std(0)[still] / raw.std(0)[still] - 1 / 0.02).abs().max() < 0.1
