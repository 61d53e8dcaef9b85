"""Control masks: what they hold, that constraints hold, and that they change nothing else by accident."""

from __future__ import annotations

from functools import partial

import pytest
import torch

from mwlib.body.skeleton import H36M17
from mwlib.data.windows import windows
from mwlib.prediction import predictor as predictor_module
from mwlib.prediction.control import constraint_error, controlled, feathered, frame_mask, joint_mask, seam
from mwlib.prediction.predictor import Predictor
from tests.sample_settings import two_people, untrained

T, C = 20, 48


@pytest.fixture(scope="module", params=[("pose", "world"), ("displacement", "world"), ("relaxing", "body")])
def model(request):
    """A predictor, and three windows to follow."""
    kind, heading = request.param
    return untrained(representation=kind, heading=heading), windows(two_people().train[:4], 6, 14, 5).x[:3]


def test_masks_hold_what_they_say():
    mask = joint_mask(H36M17, ["left_arm", "right_leg"], T)
    assert mask.shape == (T, C) and mask.sum() == T * 18 and torch.equal(mask[0], mask[-1])
    assert mask[0, :9].all() and mask[0, 30:39].all()
    assert frame_mask(T, C, 15).sum() == 5 * C and frame_mask(T, C, 3, 5).nonzero()[:, 0].unique().tolist() == [3, 4]
    arm = joint_mask(H36M17, ["left_shoulder", "left_elbow", "left_wrist"], T)  # joints count as parts of their own
    assert torch.equal(arm, joint_mask(H36M17, ["left_arm"], T)) and joint_mask(H36M17, ["spine"], T)[0].sum() == 12
    for name in ("tail", "hip"):  # the root has no channels
        with pytest.raises(ValueError, match=f"no part '{name}'"):
            joint_mask(H36M17, [name], T)
    with pytest.raises(ValueError, match="within 0 to 20"):
        frame_mask(T, C, 15, 25)


@pytest.mark.parametrize("space", ["y_t", "y0_hat"])
def test_the_constraint_holds_when_the_mask_acts_to_the_end(model, space):
    predictor, x = model
    for mask in (joint_mask(H36M17, ["left_leg"], T), frame_mask(T, C, 15)):
        exact = controlled(predictor, x, mask, 2, active=1.0, space=space)
        loose = controlled(predictor, x, mask, 2, active=0.4, space=space)
        assert exact.shape == (3, 2, T, C) and constraint_error(exact, x, mask).max() < 1e-5
        assert constraint_error(loose, x, mask).min() > 10 * constraint_error(exact, x, mask).max()
        assert not torch.allclose(exact[:, 0][:, ~mask], exact[:, 1][:, ~mask])  # the rest stays free


def test_a_model_that_turns_motions_takes_masks_of_whole_joints():
    x = windows(two_people().train[:4], 6, 14, 5).x[:1]
    heights = torch.zeros(T, C, dtype=torch.bool)
    heights[15:, 2::3] = True
    assert controlled(untrained(heading="world"), x, heights, 1).isfinite().all()
    with pytest.raises(ValueError, match="coordinates of a joint apart; expected whole joints"):
        controlled(untrained(heading="body"), x, heights, 1)


def test_a_feathered_mask_rises_as_half_a_cosine():
    hard = frame_mask(T, C, 12, 15)
    soft = feathered(hard, 3)
    rise = torch.tensor([0, 0.5 - 0.125**0.5, 0.5, 0.5 + 0.125**0.5, 1])
    torch.testing.assert_close(soft[8:13, 0], rise)
    torch.testing.assert_close(soft[14:19, 5], rise.flip(0))
    assert torch.equal(soft == 1, hard) and torch.equal(feathered(hard, 0), hard.float())
    assert feathered(frame_mask(T, C, 0), 4).min() == 1


def test_feathered_control_is_exact_where_it_is_one_and_a_mixture_in_between(model):
    predictor, x = model
    hard = frame_mask(T, C, 15)
    goal, soft = x.roll(1, 0), feathered(hard, 3)
    p = controlled(predictor, goal, soft, 2, x_history=x[:, :6], active=1.0, space="y0_hat")
    assert constraint_error(p, goal, soft).max() < 1e-5
    free = controlled(predictor, goal, hard, 2, x_history=x[:, :6], active=0.0)
    pasted = torch.where(hard, goal[:, None], free)
    assert seam(p, 15, 25, 3)["jump"].mean() < seam(pasted, 15, 25, 3)["jump"].mean()
    as_float = controlled(predictor, goal, hard.float(), 2)
    assert torch.equal(as_float, controlled(predictor, goal, hard, 2))
    with pytest.raises(ValueError, match="values from 0 to 2"):
        controlled(predictor, goal, 2 * soft, 2)


def test_without_a_mask_it_is_the_plain_prediction_on_the_manifold(model):
    predictor, x = model
    plain = predictor.with_sampling(wmsg="every_step").predict(x[:, :6], 2, 5)
    free = controlled(predictor, x, torch.zeros(T, C, dtype=torch.bool), 2, 5, active=1.0)
    torch.testing.assert_close(free[:, :, 6:], plain, atol=1e-4, rtol=1e-4)
    never = controlled(predictor, x, frame_mask(T, C, 0), 2, 5, active=0.0)
    assert torch.equal(never[:, :, 6:], predictor.predict(x[:, :6], 2, 5))


@pytest.mark.parametrize("space", ["y_t", "y0_hat"])
def test_the_mask_acts_in_the_first_steps_and_no_longer(model, space, monkeypatch):
    """Of five steps, 0.6 are three; the target of each is seen where it is imposed."""
    predictor, x = model
    seen = []
    steps = Predictor.steps

    def watched(self, *args, after_step=None, on_y0_hat=None, **options):
        def counted(function, y, *others):
            out = function(y, *others)
            seen.append(out is not y)
            return out

        hooks = {
            "after_step": after_step and partial(counted, after_step),
            "on_y0_hat": on_y0_hat and partial(counted, on_y0_hat),
        }
        yield from steps(self, *args, **hooks, **options)

    monkeypatch.setattr(Predictor, "steps", watched)
    controlled(predictor, x, frame_mask(T, C, 15), 2, active=0.6, space=space)
    assert seen == [True, True, True, False, False]


def test_the_masks_noise_is_not_the_samplers(model, monkeypatch):
    predictor, x = model
    seeds = []
    noise = Predictor.noise

    def watched(self, seed, *others):
        seeds.append(seed)
        return noise(self, seed, *others)

    monkeypatch.setattr(Predictor, "noise", watched)
    controlled(predictor, x, frame_mask(T, C, 15), 2, seed=3)
    assert len(seeds) == len(set(seeds)) == 2 and 3 in seeds


def test_what_is_imposed_is_not_bounded_again(model):
    """A target outside of the bound is reached all the same."""
    predictor, x = model
    mask = frame_mask(T, C, 15)
    target = x + 2 * mask
    p = controlled(predictor.with_sampling(bound=0.5), target, mask, 2, x_history=x[:, :6], active=1.0, space="y0_hat")
    assert constraint_error(p, target, mask).max() < 1e-4


def test_the_constraint_error_counts_what_is_prescribed_alone():
    x, mask = torch.zeros(1, T, C), frame_mask(T, C, 15)
    p = x[:, None] + 3 * ~mask
    p[:, :, 15:] += 0.2
    soft = feathered(mask, 3)
    for m in (mask, soft):
        torch.testing.assert_close(constraint_error(p, x, m), torch.tensor([[0.2]]))


def test_chunks_change_nothing(model, monkeypatch):
    predictor, x = model
    mask = frame_mask(T, C, 15)
    together = controlled(predictor, x, mask, 2)
    monkeypatch.setattr(predictor_module, "CHUNK", 1)
    torch.testing.assert_close(together, controlled(predictor, x, mask, 2), atol=1e-5, rtol=1e-4)


def test_other_histories_and_bad_shapes(model, unchecked):
    predictor, x = model
    mask = frame_mask(T, C, 15)
    other = controlled(predictor, x, mask, 1, x_history=x.flip(0)[:, :6], active=1.0)
    assert constraint_error(other, x, mask).max() < 1e-5
    with pytest.raises(ValueError, match="mask has shape"):
        controlled(predictor, x, mask[:5], 1)
    with pytest.raises(ValueError, match="space is 'both'"):
        controlled(predictor, x, mask, 1, space="both")
    with pytest.raises(ValueError, match="active is 2"):
        controlled(predictor, x, mask, 1, active=2.0)


def test_seam_measures_a_known_motion():
    """x = t³ m on every coordinate: third difference 6 fps⁻³ each, so jerk is 6 sqrt(3) m/s³."""
    fps = 10.0
    t = torch.arange(T, dtype=torch.float64) / fps
    x = (t**3)[:, None].expand(T, C)
    found = seam(x, 10, fps)
    assert abs(float(found["jerk"]) - 6 * 3**0.5) < 1e-6
    assert abs(float(found["jump"]) - 3**0.5 * float(t[10] ** 3 - t[9] ** 3)) < 1e-9
    step = torch.zeros(T, C)
    step[10:] = 0.2
    assert abs(float(seam(step, 10, fps)["jump"]) - 0.2 * 3**0.5) < 1e-6 and float(seam(step, 5, fps)["jerk"]) == 0
    late = seam(step, 13, fps, ramp=4)
    assert abs(float(late["jump"]) - 0.2 * 3**0.5) < 1e-6 and float(seam(step, 13, fps, ramp=1)["jump"]) == 0
    with pytest.raises(ValueError, match="from 2 to 18"):
        seam(x, 19, fps)
    with pytest.raises(ValueError, match="from 6 to 18"):
        seam(x, 5, fps, ramp=4)


def test_what_the_mask_leaves_free_may_be_unknown(model):
    predictor, x = model
    mask = frame_mask(T, C, 15)
    unknown = x.clone()
    unknown[:, ~mask] = torch.nan
    found, expected = (controlled(predictor, target, mask, 2, 3, x_history=x[:, :6]) for target in (unknown, x))
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=0)
    with pytest.raises(ValueError, match="not finite where the mask holds"):
        controlled(predictor, torch.full_like(x, torch.nan), mask, 2, 3, x_history=x[:, :6])
