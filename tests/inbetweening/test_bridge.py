"""A bridge keeps what it is given, does not look at the rest, and treats every window by itself."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import network_target
from mwlib.inbetweening import bridge as module
from mwlib.inbetweening.bridge import Bridge, tempered
from mwlib.inbetweening.windows import given
from tests.inbetweening.sample import PAPER, untrained, windows_for

KINDS = {
    "conditioned": {}, "paper": PAPER, "wiener": dict(output="wiener", tokens="sines", level_weight="unit"),
    "frames": dict(tokens="frames"), "rotations": dict(state="rotations"), "few": dict(PAPER, rows=4),
    "past": dict(past=4, coast=3.0, tokens="sines", output="wiener"),
}  # fmt: skip
each_kind = pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS)
SCHEMES = {
    "none": {}, "replacement": dict(scheme="replacement"), "fixed": dict(scheme="replacement", keyframe_noise="fixed"),
    "paste": dict(scheme="paste"), "repaint": dict(scheme="replacement", repeats=2, eta=1.0),
}  # fmt: skip


@each_kind
def test_keyframes_are_there_to_the_bit_and_nothing_else_is_looked_at(changes):
    bridge = untrained(**changes)
    x, past = windows_for(bridge).x[:3], bridge.cfg.task.past
    found, mask = bridge.sample(x), given(past + 7, past)
    assert found.shape == (3, 2, past + 7, x.shape[-1]) and found.isfinite().all()
    assert torch.equal(found[:, :, mask], x[:, None, mask].expand(3, 2, past + 1, -1))
    assert (found[:, 0, past:-1] - found[:, 1, past:-1]).abs().amax((-2, -1)).min() > 1e-3
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


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("base", [PAPER, {}, dict(past=3, coast=4.0)], ids=["paper", "conditioned", "past"])
def test_who_knows_the_clip_gives_the_clip(scheme, base, monkeypatch):
    bridge = untrained(**{**base, **scheme})
    x, lead = windows_for(bridge).x[:2], bridge.cfg.task.past - 1
    tf, inner = bridge.representation.transform(8), x[:, lead:]
    line = bridge.representation.interpolation(inner, x[:, :lead], given(8))
    clean = tf(bridge.representation.modelled(inner, line)).repeat_interleave(2, dim=0)

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
        ({}, 7, [], "frames between is 5; expected 6, for which"),
        (PAPER, 9, [], "frames between is 7; expected 6, for which"),
        (dict(shortest=3), 4, [], "frames between is 2; expected 3 to 6, for which"),
        ({}, 8, [3], "3 keyframes; expected at most 2, as in the model's training"),
        (dict(more_keyframes=1), 8, [2, 3], "4 keyframes; expected at most 3"),
        (dict(past=4), 10, [], "frames between is 5; expected 6, for which"),
        (dict(past=4, shortest=3), 7, [], "frames between is 2; expected 3 to 6, for which"),
        (dict(past=4), 11, [1, 2, 3, 4], "6 keyframes; expected at most 5, as in the model's training"),
        (dict(past=4), 11, [1, 3], "the 4 first or last frame is no keyframe; expected all, as in the model's training"),
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
    with pytest.raises(ValueError, match="the first or last frame is no keyframe; expected both"):
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
