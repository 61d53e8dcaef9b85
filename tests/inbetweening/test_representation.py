"""What is diffused: there and back for all tokens and targets, of unit size, and what the network sees of it."""

from __future__ import annotations

import pytest
import torch

from mwlib.inbetweening.representation import LEAST, Representation
from mwlib.inbetweening.windows import Clips, coasting, given, interpolated, make_space
from mwlib.transforms import DCTTransform
from tests.inbetweening.sample import PAPER, data_of, small, untrained

KINDS = {"cosines": {}, "sines": dict(tokens="sines"), "frames": dict(tokens="frames"), "paper": PAPER}
each_kind = pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS)


def clips(cfg, frames: int | None = None, stride: int = 3) -> torch.Tensor:
    train, task = data_of(cfg).train, cfg.task
    return Clips(train, make_space(train, task.state)).windows(frames or task.frames, stride, task.past).x


def gap_of(made: Representation, x: torch.Tensor):
    return made.gap(x, given(x.shape[1], made.cfg.task.past, made.cfg.task.future))


@each_kind
@pytest.mark.parametrize("frames", [8, 6])
def test_there_and_back_through_tokens(changes, frames):
    made = untrained(**changes).representation
    gap, tf = gap_of(made, clips(small(**changes), frames)), made.transform(frames)
    y = made.tokens(gap)
    assert y.shape[1:] == tf.shape == (frames - 2 * (changes.get("tokens") == "sines"), 51)
    torch.testing.assert_close(made.states(tf.inverse(y), gap), gap.x, atol=1e-4, rtol=0)
    torch.testing.assert_close(tf.join(tf.split(y)), y)
    torch.testing.assert_close(tf.project(y), y)


@each_kind
def test_what_is_diffused_is_of_unit_size(changes):
    cfg = small(**changes)
    made = Representation.fit(cfg, clips(cfg))
    z = made.modelled(gap_of(made, clips(cfg)))
    inner = z[:, 1:-1] if cfg.model.target == "departure" else z
    size = inner.flatten(0, 1).square().mean(0).sqrt()
    alive = (made.departure if cfg.model.target == "departure" else made.deviation) > LEAST
    torch.testing.assert_close(size[alive], torch.ones(int(alive.sum())), atol=0.02, rtol=0)
    assert (size <= 1.02).all()
    y = made.transform(8)(z)
    torch.testing.assert_close(made.power, y.square().mean(0).sqrt().clamp_min(1e-4))


def test_a_departure_vanishes_at_keyframes():
    made = untrained().representation
    mask = torch.tensor([1, 0, 0, 1, 0, 0, 0, 1]).bool()
    z = made.modelled(made.gap(clips(small()), mask))
    assert z[:, mask].abs().max() == 0 and z[:, ~mask].abs().max() > 1


@each_kind
def test_what_was_learnt_comes_back(changes):
    made = untrained(**changes).representation
    again = Representation.restore(small(**changes), made.learnt())
    assert set(made.learnt()) == {"mean", "deviation", "departure", "power"}
    assert all(torch.equal(again.learnt()[name], tensor) for name, tensor in made.learnt().items())
    gap = gap_of(made, clips(small(**changes)))
    assert torch.equal(again.modelled(gap), made.modelled(gap)) and again.transform(8) is again.transform(8)


def test_the_network_sees_lines_mask_frequency_and_length():
    made, x = untrained().representation, clips(small(), 6)
    mask = torch.tensor([1, 0, 1, 0, 0, 1]).bool().expand(len(x), 6)
    line = interpolated(x, mask)
    seen = made.conditioning(made.gap(x, mask))
    assert seen.shape == (len(x), 6, 51 + 3)
    tf = DCTTransform(6, 51)
    torch.testing.assert_close(seen[..., :51], tf((line - made.mean) / made.deviation))
    torch.testing.assert_close(seen[..., 51:52], DCTTransform(6, 1)(mask[..., None].float()))
    torch.testing.assert_close(seen[0, :, 52], torch.arange(6) / 6.0)
    assert (seen[..., 53] == 6 / 8).all()
    assert torch.equal(made.conditioning(made.gap(torch.where(mask[..., None], x, 9.0), mask)), seen)


def test_a_past_is_seen_in_steps_in_every_token():
    cfg = small(past=4)
    x = clips(cfg)
    made, alone = Representation.fit(cfg, x), Representation.fit(small(), x[:, 3:])
    assert set(made.learnt()) == {"mean", "deviation", "departure", "power", "velocity"}
    assert alone.velocity is None and torch.equal(made.departure, alone.departure) and torch.equal(made.mean, alone.mean)
    steps = x[:, :4].diff(dim=1)
    torch.testing.assert_close(made.velocity, steps.flatten(0, 1).square().mean(0).sqrt().clamp_min(1e-3))
    gap = gap_of(made, x)
    seen = made.conditioning(gap)
    assert seen.shape == (len(x), 8, 51 + 3 + 3 * 51)
    for token in (0, 7):
        torch.testing.assert_close(seen[:, token, 54:].unflatten(-1, (3, 51)), steps / made.velocity)
    torch.testing.assert_close(seen[..., :54], alone.conditioning(gap))
    assert torch.equal(Representation.restore(cfg, made.learnt()).conditioning(gap), seen)


@pytest.mark.parametrize("coast", [0.0, 3.0])
def test_tokens_of_short_windows_are_as_large_as_those_of_long_ones(coast):
    cfg = small(tokens="sines", shortest=3, departure_scale="each", past=3, coast=coast)
    x = clips(cfg, stride=1)
    made = Representation.fit(cfg, x)
    assert made.departure.shape == (4, 51)
    for frames in (5, 6, 8):
        gap = gap_of(made, x[:, : 2 + frames])
        energy = made.tokens(gap)[:1000].square().sum(1).mean(0)
        alive = (gap.x - gap.line)[:1000].square().mean((0, 1)).sqrt() > 2e-3
        torch.testing.assert_close(energy[alive], torch.full((int(alive.sum()),), 6.0), rtol=0.01, atol=0)
        torch.testing.assert_close(made.states(made.modelled(gap), gap), gap.x, atol=1e-5, rtol=0)
    again = Representation.restore(cfg, made.learnt())
    assert torch.equal(again.modelled(gap), made.modelled(gap))


def test_the_interpolation_coasts_where_it_should():
    cfg = small(past=3, coast=4.0)
    x = clips(cfg)
    found = gap_of(Representation.fit(cfg, x), x)
    assert torch.equal(found.line, coasting(x[:, 2:], x[:, :2], found.mask, 4.0))


def test_fewer_cosines_are_the_slow_part():
    made = untrained(rows=3).representation
    x = clips(small())
    assert made.transform(8).shape == made.power.shape == (3, 51)
    torch.testing.assert_close(made.transform(8)(x), DCTTransform(8, 51)(x)[:, :3])
