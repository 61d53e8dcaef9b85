"""A bridge keeps what it is given and does not look at the rest; its motions in the world, at any rate, with y or z up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from mwlib.body.motion import Motion
from mwlib.body.skeleton import CMU, Skeleton
from mwlib.diffusion import network_target
from mwlib.inbetweening import bridge as module
from mwlib.inbetweening.bridge import Bridge, filled, tempered, with_silence
from mwlib.inbetweening.windows import given
from tests.body.sample import animators_motion, apart
from tests.inbetweening.sample import PAPER, WINDOW, data_of, untrained, windows_for

KINDS = {
    "conditioned": {}, "paper": PAPER, "wiener": dict(output="wiener", tokens="sines", level_weight="unit"),
    "frames": dict(tokens="frames"), "rotations": dict(state="rotations"), "few": dict(PAPER, rows=4),
    "past": dict(past=4, coast=3.0, tokens="sines", output="wiener"), "window": WINDOW,
    "mean": dict(WINDOW, mean_width=8),
}  # fmt: skip
each_kind = pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS)
SCHEMES = {
    "none": {}, "replacement": dict(scheme="replacement"), "fixed": dict(scheme="replacement", keyframe_noise="fixed"),
    "paste": dict(scheme="paste"), "repaint": dict(scheme="replacement", repeats=2, eta=1.0),
}  # fmt: skip


@each_kind
def test_keyframes_are_there_to_the_bit_and_nothing_else_is_looked_at(changes):
    bridge = untrained(**changes)
    x, past, future = windows_for(bridge).x[:3], bridge.cfg.task.past, bridge.cfg.task.future
    found, mask = bridge.sample(x), given(past + 6 + future, past, future)
    assert found.shape == (3, 2, past + 6 + future, x.shape[-1]) and found.isfinite().all()
    assert torch.equal(found[:, :, mask], x[:, None, mask].expand(3, 2, past + future, -1))
    assert (found[:, 0, past:-future] - found[:, 1, past:-future]).abs().amax((-2, -1)).min() > 1e-3
    blind = torch.where(mask[:, None], x, torch.nan)
    assert torch.equal(bridge.sample(blind), found)
    torch.testing.assert_close(bridge.space.valid(found), found, atol=1e-4, rtol=1e-4)


@each_kind
def test_a_window_depends_on_seed_and_identity_alone(changes, monkeypatch):
    bridge = untrained(**changes)
    x = windows_for(bridge).x[:5]
    together = bridge.sample(x, seed=3)
    monkeypatch.setattr(module, "CHUNK", 4)
    torch.testing.assert_close(bridge.sample(x, seed=3), together, atol=1e-4, rtol=1e-4)
    alone = bridge.sample(x[4:], seed=3, window_ids=[4])
    torch.testing.assert_close(alone, together[4:], atol=1e-4, rtol=1e-4)
    assert torch.equal(bridge.sample(x[4:], seed=3, window_ids=[4]), alone)
    for other in (bridge.sample(x[4:], seed=4, window_ids=[4]), bridge.sample(x[4:], seed=3)):
        assert (other - alone).abs().max() > 1e-3
    defaults = bridge.with_sampling(samples=3, sampling_seed=3).sample(x[4:], window_ids=[4])
    assert defaults.shape[1] == 3


def test_samples_depart_from_the_mean():
    """By the same as without one: the mean comes once, whatever the noise."""
    bridge = untrained(**WINDOW, mean_width=8, bones="free")
    x, mean = windows_for(bridge).x[:3], bridge.net.mean_of
    found = bridge.sample(x)
    bridge.net.mean_of = None
    more = (found - bridge.sample(x))[:, :, 2:-2]
    torch.testing.assert_close(more[:, 0], more[:, 1], atol=1e-4, rtol=1e-3)
    form = bridge.representation
    gap = form.gap(x, given(10, 2, 2))
    line, tokens = gap.line, form.usual(8) * mean(form.ends(gap))
    expected = form.states(form.transform(8).inverse(tokens), gap) - line
    torch.testing.assert_close(more[:, 0], expected[:, 1:-1], atol=1e-4, rtol=1e-3)
    assert expected.abs().max() > 1e-3
    curve = bridge.mean(x)
    torch.testing.assert_close(curve[:, 2:-2], line[:, 1:-1], atol=1e-6, rtol=0)
    bridge.net.mean_of = mean
    torch.testing.assert_close((bridge.mean(x) - curve)[:, 2:-2], expected[:, 1:-1], atol=1e-5, rtol=0)
    assert torch.equal(curve[:, [0, 1, -2, -1]], x[:, [0, 1, -2, -1]])


def test_without_noise_a_sample_is_the_mean_that_a_network_says():
    """And where none says it, what the denoiser makes of no noise."""
    bridge, other = (untrained(**WINDOW, mean_width=width).with_sampling(temperature=1e-7) for width in (8, 0))
    x = windows_for(bridge).x[:3]
    torch.testing.assert_close(bridge.sample(x), bridge.mean(x)[:, None].expand(-1, 2, -1, -1), atol=1e-5, rtol=1e-4)
    assert (other.sample(x)[:, 0] - other.mean(x)).abs().max() > 1e-2


def test_the_silent_sample_is_the_last():
    noise = with_silence(lambda: torch.ones(2, 3, 4, 5))()
    assert noise.shape == (2, 4, 4, 5) and (noise[:, :3] == 1).all() and not noise[:, 3].any()


def test_what_is_fine_is_no_larger_than_usual_in_samples():
    bridge = untrained(**WINDOW, bones="free")
    x, last = windows_for(bridge).x[:2], bridge.net.log_factor[-1]
    torch.nn.init.zeros_(last.weight), torch.nn.init.zeros_(last.bias)
    usual = bridge.sample(x)
    torch.nn.init.constant_(last.bias, 0.7)
    bridge.net.fps = 1e4  # then every token is fine
    assert torch.equal(bridge.sample(x), usual)
    bridge.net.fps = 1e-3  # then none is
    assert not torch.equal(bridge.sample(x), usual)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("base", [PAPER, {}, dict(past=3, coast=4.0)], ids=["paper", "conditioned", "past"])
def test_who_knows_the_clip_gives_the_clip(scheme, base, monkeypatch):
    bridge = untrained(**{**base, **scheme})
    x, lead = windows_for(bridge).x[:2], bridge.cfg.task.past - 1
    clean = bridge.representation.tokens(bridge.representation.gap(x, given(8 + lead, 1 + lead))).repeat_interleave(2, dim=0)

    def knows(y_t, t, conditioning=None):
        a = bridge.alpha_bar[t]
        eps = (y_t - a.sqrt().float() * clean) / (1 - a).sqrt().float()
        return network_target(bridge.cfg.diffusion.prediction, clean, eps, a)

    monkeypatch.setattr(bridge.net, "forward", knows)
    torch.testing.assert_close(bridge.sample(x), x[:, None].expand(2, 2, 8 + lead, -1), atol=1e-3, rtol=0)


def test_more_keyframes_and_other_lengths():
    bridge = untrained(shortest=3, more_keyframes=2)
    for frames in (5, 8):
        x = windows_for(bridge, frames).x[:2]
        mask = given(frames)
        mask[2:4] = True
        found = bridge.sample(x, mask)
        assert found.shape[2] == frames and torch.equal(found[:, :, mask], x[:, None, mask].expand(2, 2, -1, -1))


@pytest.mark.parametrize("scale", ["longest", "each"])
def test_a_past_with_other_lengths_and_more_keyframes(scale):
    bridge = untrained(past=4, shortest=3, more_keyframes=2, coast=3.0, departure_scale=scale)
    for frames in (8, 11):
        x = windows_for(bridge, frames).x[:2]
        mask = given(frames, 4)
        mask[5] = True
        found = bridge.sample(x, mask)
        assert found.shape[2] == frames and torch.equal(found[:, :, mask], x[:, None, mask].expand(2, 2, -1, -1))


def test_the_past_is_looked_at():
    """All of it: another step of it changes the motion, and so does another pose of its last frame."""
    bridge = untrained(past=4)
    x = windows_for(bridge).x[:1]
    found = bridge.sample(x)
    for frame in range(4):
        other = x.clone()
        other[:, frame] += 0.1
        assert (bridge.sample(other) - found)[:, :, 4:-1].abs().max() > 1e-4, frame


@pytest.mark.parametrize(
    "changes, frames, more, message",
    [
        ({}, 7, [], "frames between is 5; expected 6 to 6, for which"),
        (PAPER, 9, [], "frames between is 7; expected 6 to 6, for which"),
        (dict(shortest=3), 4, [], "frames between is 2; expected 3 to 6, for which"),
        ({}, 8, [3], "3 keyframes; expected at most 2, as in the model's training"),
        (dict(more_keyframes=1), 8, [2, 3], "4 keyframes; expected at most 3"),
        (dict(past=4), 10, [], "frames between is 5; expected 6 to 6, for which"),
        (dict(past=4, shortest=3), 7, [], "frames between is 2; expected 3 to 6, for which"),
        (dict(past=4), 11, [1, 2, 3, 4], "3 keyframes; expected at most 2, as in the model's training"),
        (
            dict(past=4),
            11,
            [1, 3],
            "not all of the first 4 and last 1 frames are keyframes; expected all, as in the model's training",
        ),
    ],
)
def test_what_the_model_is_not_for_is_refused(changes, frames, more, message):
    bridge = untrained(**changes)
    mask = given(frames)
    mask[more] = True
    with pytest.raises(ValueError, match=message):
        bridge.sample(torch.zeros(1, frames, 51), mask)


def test_ends_that_are_no_keyframes_are_refused_where_the_network_sees_them_alone():
    mask = given(8)
    mask[-1] = False
    with pytest.raises(ValueError, match="not all of the first 1 and last 1 frames are keyframes; expected all"):
        untrained().sample(torch.zeros(1, 8, 51), mask)
    bridge = untrained(**PAPER)
    x = windows_for(bridge).x[:1]
    assert torch.equal(bridge.sample(x, mask)[0, :, 0], x[:, 0].expand(2, -1))
    with pytest.raises(ValueError, match="samples is 0; expected at least 1"):
        bridge.sample(x, samples=0)


@pytest.mark.parametrize(
    "count, ids, mask, message",
    [
        (0, None, given(8), "there are no windows; expected at least one"),
        (2, [5], given(8), "window_ids has 1 entries for 2 windows; expected one each"),
        (1, None, torch.zeros(8, dtype=torch.bool), "0 keyframes; expected"),
    ],
)
def test_windows_and_masks_that_do_not_fit_are_named(count, ids, mask, message):
    with pytest.raises(ValueError, match=message):
        untrained(**PAPER).sample(torch.zeros(count, 8, 51), mask, window_ids=ids)


def test_settings_of_the_sampling_and_no_others():
    bridge = untrained()
    other = bridge.with_sampling(scheme="paste", samples=5)
    assert other.cfg.imposing.scheme == "paste" and other.net is bridge.net and bridge.cfg.sampling.samples == 2
    for name, value in dict(width=32, between=4, steps=100, lr=1.0, data="x", length_weight=1.0, state="rotations").items():
        with pytest.raises(ValueError, match=f"{name} belongs to the trained model; expected settings of the sampling"):
            bridge.with_sampling(**{name: value})
    with pytest.raises(ValueError, match="did you mean 'samples'"):
        bridge.with_sampling(sampels=3)


def test_the_temperature_is_that_of_the_first_noise():
    noise = tempered(lambda: torch.ones(2), 0.5)
    assert [float(noise()[0]) for _ in range(3)] == [0.5, 1.0, 1.0]
    bridge = untrained()
    x = windows_for(bridge).x[:2]
    assert (bridge.with_sampling(temperature=0.1).sample(x) - bridge.sample(x)).abs().max() > 1e-3


@each_kind
def test_a_bridge_comes_back_from_tensors(changes):
    bridge = untrained(**changes)
    about = {"space": bridge.space.to_json()}
    torch.manual_seed(3)
    before = torch.get_rng_state()
    again = Bridge.from_tensors(bridge.cfg, bridge.net.state_dict(), bridge.representation.learnt(), about)
    assert torch.equal(torch.get_rng_state(), before) and not again.net.training
    x = windows_for(bridge).x[:2]
    assert torch.equal(again.to("cpu").sample(x), bridge.sample(x))


def pair(bridge: Bridge) -> tuple[Motion, Motion]:
    """Two poses of one body, the second a little later, turned and elsewhere."""
    motion = data_of(bridge.cfg).test[0].turn(0.9)
    return motion.cut(0, 5), motion.cut(12, 20)


@pytest.mark.parametrize("state", ["positions", "rotations"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_it_leaves_the_last_pose_and_arrives_at_the_first(state, up):
    bridge = untrained(state=state)
    start, end = (m.with_up(up) for m in pair(bridge))
    made = filled(bridge, start, end, samples=3)
    assert len(made) == 3 and all(isinstance(m, Motion) for m in made)
    for m in made:
        assert (len(m), m.up, m.fps, m.skeleton) == (8, up, 10.0, start.skeleton)
        np.testing.assert_allclose(m.positions[0], start.positions[-1], atol=1e-5)
        np.testing.assert_allclose(m.positions[-1], end.positions[0], atol=1e-5)
        assert (m.rig is not None) == (state == "rotations") and "in between" in m.name
    assert np.abs(made[0].positions - made[1].positions).max() > 1e-3


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_poses_turned_and_carried_elsewhere_give_the_same_motion_there(state):
    bridge = untrained(state=state)
    start, end = pair(bridge)
    here = filled(bridge, start, end, samples=1)[0]
    there = filled(bridge, start.turn(2.0), end.turn(2.0), samples=1)[0]
    np.testing.assert_allclose(there.positions, here.turn(2.0).positions, atol=1e-3)


def test_numbered_frames_of_a_motion():
    bridge = untrained(shortest=3, more_keyframes=1)
    motion = data_of(bridge.cfg).test[0]
    for numbers in ([4, 8, 11], (4, 11), range(6, 14, 7)):
        made = filled(bridge, motion, numbers, samples=1)[0]
        assert len(made) == numbers[-1] - numbers[0] + 1
        for n in numbers:
            np.testing.assert_allclose(made.positions[n - numbers[0]], motion.positions[n], atol=1e-5)
    assert len(filled(bridge, motion, [4, 9], frames=4, samples=1)[0]) == 6


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_a_past_is_what_was_before_the_first_keyframe(state):
    bridge = untrained(state=state, past=4, shortest=3)
    motion = data_of(bridge.cfg).test[0].turn(0.9)
    by_numbers = filled(bridge, motion, [6, 13], samples=1, seed=3)[0]
    by_poses = filled(bridge, motion.cut(0, 7), motion.cut(13, 20), 6, samples=1, seed=3)[0]
    assert len(by_numbers) == len(by_poses) == 11
    for made in (by_numbers, by_poses):
        np.testing.assert_allclose(made.positions[:4], motion.positions[3:7], atol=1e-5)
        np.testing.assert_allclose(made.positions[-1], motion.positions[13], atol=1e-5)
    np.testing.assert_allclose(by_poses.positions, by_numbers.positions, atol=1e-4)
    there = filled(bridge, motion.turn(2.0), [6, 13], samples=1, seed=3)[0]
    np.testing.assert_allclose(there.positions, by_numbers.turn(2.0).positions, atol=1e-3)


def test_a_past_at_another_rate_ends_with_the_last_frame():
    bridge = untrained(past=4)
    motion = data_of(bridge.cfg).test[0]
    fast = replace(motion, fps=20.0)
    made = filled(bridge, fast.cut(0, 12), fast.cut(20, 21), samples=1)[0]
    np.testing.assert_allclose(made.positions[:4], motion.positions[[5, 7, 9, 11]], atol=1e-5)


def test_a_past_that_is_too_short_is_refused():
    bridge = untrained(past=4)
    motion = data_of(bridge.cfg).test[0]
    for start, end, found in ((motion.cut(0, 3), motion.cut(9, 10), 3), (motion, [2, 9], 3)):
        with pytest.raises(
            ValueError,
            match=f"{found} frames at 10 Hz up to the first keyframe and 1 from the last; expected at least 4 and 1, the past",
        ):
            filled(bridge, start, end)


def test_what_lies_between_is_not_looked_at_and_seeds_are():
    bridge = untrained()
    motion = data_of(bridge.cfg).test[0]
    other = motion.positions.copy()
    other[5:10] += 1.0
    one, two = (filled(bridge, m, [4, 11], seed=5)[1] for m in (motion, replace(motion, positions=other)))
    np.testing.assert_array_equal(one.positions, two.positions)
    assert np.abs(filled(bridge, motion, [4, 11], seed=6)[1].positions - one.positions).max() > 1e-3


@pytest.mark.parametrize("state", ["positions", "rotations"])
@pytest.mark.parametrize("fps", [4.0, 24.0, 120.0])
def test_poses_at_another_rate_are_still_the_last_and_the_first(state, fps):
    """A motion's last frame does not fall on a frame of the model's rate; single frames have no rate at all."""
    bridge = untrained(state=state)
    start, end = (replace(m, fps=fps) for m in pair(bridge))
    made = filled(bridge, start, end, samples=1)[0]
    assert made.fps == 10.0 and len(made) == 8
    np.testing.assert_allclose(made.positions[0], start.positions[-1], atol=1e-5)
    np.testing.assert_allclose(made.positions[-1], end.positions[0], atol=1e-5)
    alone = filled(bridge, start.cut(4, 5), end.cut(0, 1), samples=1)[0]
    np.testing.assert_array_equal(alone.positions, made.positions)


def test_other_bodies_are_carried_over_or_refused():
    bridge = untrained()
    start, end = pair(bridge)
    rng = np.random.default_rng(0)
    cmu = Motion(rng.normal(size=(1, 31, 3), scale=0.15).astype(np.float32), 120.0, CMU, up="y")
    made = filled(bridge, cmu, cmu, samples=1)[0]
    assert made.skeleton == start.skeleton and made.up == "y"
    np.testing.assert_allclose(made.positions[0], cmu.retarget(start.skeleton).positions[0], atol=1e-5)
    other = Motion(np.zeros((1, 2, 3), np.float32), 10.0, Skeleton("arm", ("a", "b"), (-1, 0)))
    with pytest.raises(ValueError, match="the skeleton is arm .2 joints.; .*no way from one to the other is known"):
        filled(bridge, start, other)


@pytest.mark.parametrize(
    "end, frames, message",
    [
        ([3], None, "keyframes are .3. of a motion of 30 frames at 10 Hz; expected two or more, rising"),
        ([5, 3], None, "expected two or more, rising"),
        ([3, 3, 10], None, "expected two or more, rising"),
        ([-8, -1], None, "end.0. is -8; expected at least 0"),
        ([25, 32], None, "of a motion of 30 frames"),
        ([3, 10], 5, "frames is 5, but 6 lie between frames 3 and 10; expected None"),
        ([3, 12], None, "frames between is 8; expected 6 to 6"),
        ([3, 5, 12], None, "frames between is 1; expected 6 to 6"),
        (None, 0, "frames is 0; expected at least 1"),
        (None, 9, "frames between is 9; expected 6 to 6"),
    ],
)
def test_what_cannot_be_filled_is_refused(end, frames, message):
    bridge = untrained()
    motion = data_of(bridge.cfg).test[0].cut(0, 30)
    with pytest.raises(ValueError, match=message):
        filled(bridge, motion, motion if end is None else end, frames)


def test_a_model_of_rotations_needs_them():
    bridge = untrained(state="rotations")
    start, end = pair(bridge)
    with pytest.raises(ValueError, match="has positions only; expected rotations"):
        filled(bridge, start, replace(end, rig=None))


def animated(fps: float) -> Motion:
    """Three seconds of a rig with fingers, slow enough for anybody."""
    return animators_motion(round(3 * fps) + 1, fps)


@pytest.mark.parametrize("fps", [10.0, 24.0, 30.0, 120.0])
@pytest.mark.parametrize("past", [1, 4])
def test_on_the_users_own_rig_poses_stay_and_the_rest_follows(fps, past):
    bridge, motion = untrained(past=past), animated(fps)
    ratio = fps / 10
    keys = [round(n * ratio) for n in (8, 15)]
    (plain,), (made,) = (filled(bridge, motion, [8, 15], samples=1, own_rig=own) for own in (False, True))
    before = int((past - 1) * ratio)
    given_frames = [*range(keys[0] - before, keys[0] + 1), keys[1]]
    assert (made.fps, made.skeleton, made.up) == (fps, motion.skeleton, "y") and made.rig.channels == motion.rig.channels
    assert len(made) == keys[1] - keys[0] + before + 1 and plain.skeleton == bridge.space.bodies.skeleton
    at = [*range(before + 1), len(made) - 1]
    assert apart(made.rig.rotations[at], motion.rig.rotations[given_frames]).max() < 1e-4
    np.testing.assert_allclose(made.positions[at], motion.positions[given_frames], atol=1e-5)
    if fps == 30:
        model = plain.positions[past - 1 :, 0]
        np.testing.assert_allclose(made.positions[before::3, 0], model, atol=1e-5)  # the root is the model's


@pytest.mark.parametrize("fps", [24.0, 30.0])
def test_joined_a_motion_keeps_all_its_frames_but_those_between(fps):
    bridge, motion = untrained(), animated(fps)
    keys = [round(n * fps / 10) for n in (8, 15)]
    (made,) = filled(bridge, motion, [8, 15], samples=1, join=True)
    kept = [*range(keys[0] + 1), *range(keys[1], len(motion))]
    assert len(made) == len(motion)
    np.testing.assert_allclose(made.positions[kept], motion.positions[kept], atol=1e-5)
    assert np.abs(made.positions - motion.positions)[keys[0] + 1 : keys[1]].max() > 1e-3


def test_two_motions_joined_and_aligned():
    bridge, start, end = untrained(), animated(30.0).cut(0, 40), animated(60.0).turn(2.0)
    (made,) = filled(bridge, start, end, samples=1, align=True, join=True)
    assert made.fps == 30 and len(made) == 40 + 20 + 91
    np.testing.assert_allclose(made.positions[:40], start.positions, atol=1e-5)
    behind, ends = made.positions[60:], end.resample(30.0).positions
    np.testing.assert_allclose(behind[0, 0, [0, 2]], start.positions[-1, 0, [0, 2]], atol=1e-5)
    np.testing.assert_allclose(np.ptp(behind[..., 1], axis=0), np.ptp(ends[..., 1], axis=0), atol=1e-5)
    (alone,) = filled(bridge, start, end, samples=1, align=True, own_rig=True)
    np.testing.assert_allclose(alone.positions, made.positions[39:61], atol=1e-4)
    (plain,) = filled(bridge, start, end.with_up("z"), samples=1, align=True)
    np.testing.assert_allclose(plain.positions[-1, 0], behind[0, 0], atol=1e-4)


def test_a_rotation_model_answers_on_the_whole_rig():
    """Its own rotations are taken, with the rate and channels of the file."""
    bridge = untrained(state="rotations")
    start, end = pair(bridge)
    (plain,), (made,) = (filled(bridge, start, end, samples=1, own_rig=own) for own in (False, True))
    assert apart(made.rig.rotations, plain.rig.rotations).max() < 0.02
    np.testing.assert_allclose(made.positions, plain.positions, atol=1e-4)


def test_two_bodies_and_a_rig_that_is_not_there_are_refused():
    bridge, start = untrained(), animated(10.0)
    with pytest.raises(ValueError, match="start and end are of different bodies: from .* it is .* expected bones"):
        filled(bridge, start, animators_motion(5, 10.0, size=1.1), samples=1)
    small = animators_motion(5, 10.0, size=0.8).retarget(bridge.space.bodies.skeleton)
    with pytest.raises(ValueError, match="different bodies: from"):
        filled(bridge, start, small, samples=1)
    for asked in ("own_rig", "join"):
        with pytest.raises(ValueError, match="animated has positions only; expected rotations"):
            filled(bridge, replace(start, rig=None), [3, 10], samples=1, **{asked: True})


def test_where_velocities_are_known_samples_have_them_and_elsewhere_not():
    """However far they are from each other in the middle: the first step is the last one of the past, to second order."""
    bridge = untrained(**WINDOW, between=20, fps=10.0)
    x = windows_for(bridge).x[:2]
    blind = x.clone()
    blind[:, [0, -1]] = torch.nan
    known, unknown = bridge.sample(x), bridge.sample(blind)
    for one, other in ((known[:, 0], known[:, 1]), (known[:, 0].flip(1), known[:, 1].flip(1))):
        apart = (one - other).abs().mean((0, 2))
        assert apart[:2].max() == 0 and apart[2] < 0.3 * apart[7:15].mean()
    assert unknown.isfinite().all() and torch.equal(unknown[:, :, 0], unknown[:, :, 1])
    assert (unknown - known)[:, :, 2:-2].abs().max() > 1e-3


def test_a_model_that_may_do_without_gives_motions_from_keyframe_to_keyframe():
    bridge, motion = untrained(**WINDOW), data_of(untrained().cfg).test[0].turn(0.9)
    by_numbers = filled(bridge, motion, [6, 13], samples=1, seed=3, feet=False)[0]
    by_poses = filled(bridge, motion.cut(0, 7), motion.cut(13, 20), 6, samples=1, seed=3, feet=False)[0]
    alone = filled(bridge, motion.cut(6, 7), motion.cut(13, 14), 6, samples=1, seed=3, feet=False)[0]
    at_the_ends = filled(bridge, motion.cut(6, 14), [0, 7], samples=1, seed=3, feet=False)[0]
    np.testing.assert_allclose(by_poses.positions, by_numbers.positions, atol=1e-4)
    np.testing.assert_allclose(alone.positions, at_the_ends.positions, atol=1e-4)
    for made in (by_numbers, alone):
        np.testing.assert_allclose(made.positions[[0, -1]], motion.positions[[6, 13]], atol=1e-5)
    assert len(alone) == 8 and np.abs(alone.positions - by_numbers.positions).max() > 1e-3
    for ends in ((motion.cut(0, 7), motion.cut(13, 14)), (motion.cut(6, 7), motion.cut(13, 20))):  # one velocity less
        assert np.abs(filled(bridge, *ends, 6, samples=1, seed=3, feet=False)[0].positions - by_poses.positions).max() > 1e-3


def test_feet_that_stand_are_held_and_keyframes_met():
    bridge, motion = untrained(**WINDOW), data_of(untrained().cfg).test[0]
    free, held = (filled(bridge, motion, [6, 13], samples=1, seed=3, feet=feet)[0] for feet in (False, True))
    np.testing.assert_allclose(held.positions[[0, -1]], motion.positions[[6, 13]], atol=1e-5)
    below = [motion.skeleton.joints.index(f"{side}_foot") for side in ("right", "left")]
    others = [j for j, name in enumerate(motion.skeleton.joints) if not name.endswith(("knee", "foot"))]
    np.testing.assert_array_equal(held.positions[:, others], free.positions[:, others])
    floor = min(motion.positions[:7, below, 2].min(), motion.positions[13:, below, 2].min())
    assert held.positions[1:-1, below, 2].min() > floor - 0.02


def test_a_future_that_is_too_short_is_refused():
    bridge, motion = untrained(future=2), data_of(untrained().cfg).test[0]
    with pytest.raises(ValueError, match="first keyframe and 1 from the last; expected at least 1 and 2, the past and future"):
        filled(bridge, motion.cut(0, 7), motion.cut(13, 14))


def test_states_of_another_precision_and_keyframes_that_are_no_numbers():
    bridge = untrained(**WINDOW)
    x = windows_for(bridge).x[:2]
    torch.testing.assert_close(bridge.sample(x.double()), bridge.sample(x))
    for frame in (1, -2):  # the two keyframes; the frames beyond may be unknown
        broken = x.clone()
        broken[1, frame, 5] = torch.nan
        for ask in (bridge.sample, bridge.mean):
            with pytest.raises(ValueError, match="x is not finite at a keyframe; expected numbers"):
                ask(broken)


def test_many_keyframes_are_filled_one_gap_after_the_other():
    bridge = untrained(**WINDOW, shortest=3)
    motion, keys = data_of(bridge.cfg).test[0].cut(0, 30), [4, 9, 14, 19]
    made = filled(bridge, motion, keys, samples=2, seed=1, feet=False)
    ready = bridge.space.bodies.prepare([motion])[0]
    for each in made:
        assert len(each) == 16 and each.up == motion.up
        np.testing.assert_allclose(each.positions[[0, 5, 10, 15]], ready.positions[keys], atol=1e-5)
    assert np.abs(made[0].positions - made[1].positions).max() > 1e-3
    again = filled(bridge, motion, keys, samples=3, seed=1, feet=False)  # a sample does not depend on how many there are
    np.testing.assert_allclose(again[1].positions, made[1].positions, atol=1e-5)
    # between keyframes the motion is not looked at, and the second gap leaves as the first one arrives
    hidden = motion.positions.copy()
    hidden[[n for n in range(4, 20) if n not in keys]] = motion.positions[4]
    blind = filled(bridge, replace(motion, positions=hidden, rig=None), keys, samples=2, seed=1, feet=False)
    np.testing.assert_allclose(blind[1].positions, made[1].positions, atol=1e-5)
    moved = replace(made[0], positions=np.concatenate([made[0].positions[:6], ready.positions[10:15]]), rig=None)
    own = int(np.random.SeedSequence((1, 1)).generate_state(1)[0])
    other = module._filled(bridge, moved, [5, 10], None, 1, own, [0], False, False)
    np.testing.assert_allclose(other[0].positions, made[0].positions[5:11], atol=1e-5)
    with pytest.raises(ValueError, match="frames between is 1; expected 3 to 6"):
        filled(bridge, motion, [4, 9, 11, 16])
