"""What is diffused: there and back for all tokens and targets, of unit size, and what the network sees of it."""

from __future__ import annotations

import pytest
import torch

from mwlib.inbetweening.representation import LEAST, Representation
from mwlib.inbetweening.windows import Clips, coasting, interpolated, make_space
from mwlib.transforms import DCTTransform
from tests.inbetweening.sample import PAPER, data_of, small, untrained

KINDS = {"cosines": {}, "sines": dict(tokens="sines"), "frames": dict(tokens="frames"), "paper": PAPER}
each_kind = pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS)


def clips(cfg, frames: int = 8) -> torch.Tensor:
    return Clips(data_of(cfg).train, make_space(data_of(cfg).train, cfg.task.state)).windows(frames, 3).x


def ends(x: torch.Tensor) -> torch.Tensor:
    mask = torch.zeros(x.shape[-2], dtype=torch.bool)
    mask[[0, -1]] = True
    return mask


@each_kind
@pytest.mark.parametrize("frames", [8, 6])
def test_there_and_back_through_tokens(changes, frames):
    made = untrained(**changes).representation
    x = clips(small(**changes), frames)
    line = interpolated(x, ends(x))
    tf = made.transform(frames)
    y = tf(made.modelled(x, line))
    assert y.shape[1:] == tf.shape == (frames - 2 * (changes.get("tokens") == "sines"), 51)
    torch.testing.assert_close(made.states(tf.inverse(y), line), x, atol=1e-4, rtol=0)
    torch.testing.assert_close(tf.join(tf.split(y)), y)
    torch.testing.assert_close(tf.project(y), y)


@each_kind
def test_what_is_diffused_is_of_unit_size(changes):
    cfg = small(**changes)
    x = clips(cfg)
    made = Representation.fit(cfg.model, 8, x)
    z = made.modelled(x, interpolated(x, ends(x)))
    inner = z[:, 1:-1] if cfg.model.target == "departure" else z
    size = inner.flatten(0, 1).square().mean(0).sqrt()
    alive = (made.departure if cfg.model.target == "departure" else made.deviation) > LEAST
    torch.testing.assert_close(size[alive], torch.ones(int(alive.sum())), atol=0.02, rtol=0)
    assert (size <= 1.02).all()
    y = made.transform(8)(z)
    torch.testing.assert_close(made.power, y.square().mean(0).sqrt().clamp_min(1e-4))


def test_a_departure_vanishes_at_keyframes():
    cfg = small()
    made, x = untrained().representation, clips(cfg)
    mask = torch.tensor([1, 0, 0, 1, 0, 0, 0, 1]).bool()
    z = made.modelled(x, interpolated(x, mask))
    assert z[:, mask].abs().max() == 0 and z[:, ~mask].abs().max() > 1


@each_kind
def test_what_was_learnt_comes_back(changes):
    made = untrained(**changes).representation
    again = Representation.restore(small(**changes).model, 8, made.learnt())
    assert set(made.learnt()) == {"mean", "deviation", "departure", "power"}
    assert all(torch.equal(again.learnt()[name], tensor) for name, tensor in made.learnt().items())
    x = clips(small(**changes))
    assert torch.equal(again.modelled(x, x), made.modelled(x, x)) and again.transform(8) is again.transform(8)


def test_the_network_sees_lines_mask_frequency_and_length():
    made, x = untrained().representation, clips(small(), 6)
    mask = torch.tensor([1, 0, 1, 0, 0, 1]).bool().expand(len(x), 6)
    line = interpolated(x, mask)
    seen = made.conditioning(line, x[:, :0], mask)
    assert seen.shape == (len(x), 6, 51 + 3)
    tf = DCTTransform(6, 51)
    torch.testing.assert_close(seen[..., :51], tf((line - made.mean) / made.deviation))
    torch.testing.assert_close(seen[..., 51:52], DCTTransform(6, 1)(mask[..., None].float()))
    torch.testing.assert_close(seen[0, :, 52], torch.arange(6) / 6.0)
    assert (seen[..., 53] == 6 / 8).all()
    other = x.clone()
    other[~mask] = 9.0
    assert torch.equal(made.conditioning(interpolated(other, mask), x[:, :0], mask), seen)


def test_a_past_is_seen_in_steps_in_every_token():
    cfg = small(past=4)
    x = Clips(data_of(cfg).train, make_space(data_of(cfg).train, "positions")).windows(11, 3, 4).x
    made = Representation.fit(cfg.model, 8, x, 4)
    assert set(made.learnt()) == {"mean", "deviation", "departure", "power", "velocity"}
    alone = Representation.fit(cfg.model, 8, x[:, 3:])
    assert alone.velocity is None and torch.equal(made.departure, alone.departure) and torch.equal(made.mean, alone.mean)
    steps = x[:, :4].diff(dim=1)
    torch.testing.assert_close(made.velocity, steps.flatten(0, 1).square().mean(0).sqrt().clamp_min(1e-3))
    before, mask = x[:, :3], ends(x[:, 3:]).expand(len(x), 8)
    line = made.interpolation(x[:, 3:], before, mask)
    seen = made.conditioning(line, before, mask)
    assert seen.shape == (len(x), 8, 51 + 3 + 3 * 51)
    for token in (0, 7):
        torch.testing.assert_close(seen[:, token, 54:].unflatten(-1, (3, 51)), steps / made.velocity)
    torch.testing.assert_close(seen[..., :54], alone.conditioning(line, before, mask))
    again = Representation.restore(cfg.model, 8, made.learnt())
    assert torch.equal(again.conditioning(line, before, mask), seen)


@pytest.mark.parametrize("coast", [0.0, 3.0])
def test_tokens_of_short_windows_are_as_large_as_those_of_long_ones(coast):
    cfg = small(tokens="sines", shortest=3, departure_scale="each", past=3, coast=coast)
    x = Clips(data_of(cfg).train, make_space(data_of(cfg).train, "positions")).windows(10, 1, 3).x
    made = Representation.fit(cfg.model, 8, x, 3, 5)
    assert made.departure.shape == (4, 51)
    for frames in (5, 6, 8):
        part = x[:, 2 : 2 + frames]
        line = made.interpolation(part, x[:, :2], ends(part))
        z = made.modelled(part, line)
        energy = made.transform(frames)(z)[:1000].square().sum(1).mean(0)
        alive = (part - line)[:1000].square().mean((0, 1)).sqrt() > 2e-3
        torch.testing.assert_close(energy[alive], torch.full((int(alive.sum()),), 6.0), rtol=0.01, atol=0)
        torch.testing.assert_close(made.states(z, line), part, atol=1e-5, rtol=0)
    again = Representation.restore(cfg.model, 8, made.learnt())
    assert torch.equal(again.modelled(part, line), z)


def test_the_interpolation_coasts_where_it_should():
    cfg = small(past=3, coast=4.0)
    x = clips(cfg, 10)
    made = Representation.fit(cfg.model, 8, x, 3)
    assert torch.equal(made.interpolation(x[:, 2:], x[:, :2], ends(x[:, 2:])), coasting(x[:, 2:], x[:, :2], ends(x[:, 2:]), 4.0))


def test_fewer_cosines_are_the_slow_part():
    made = untrained(rows=3).representation
    x = clips(small())
    assert made.transform(8).shape == made.power.shape == (3, 51)
    torch.testing.assert_close(made.transform(8)(x), DCTTransform(8, 51)(x)[:, :3])
