"""TransLinear: size, start, and agreement with a plain transcription."""

from __future__ import annotations

import math

import pytest
import torch
from torch.nn import functional as F

from mwlib.networks import TransLinear
from mwlib.networks.layers import Dropout


def network(dropout: float = 0.0, **kw) -> TransLinear:
    torch.manual_seed(0)
    net = TransLinear(**{**dict(rows=7, columns=6, width=16, layers=4, heads=2, feedforward=24, dropout=dropout), **kw})
    for p in net.parameters():  # the zero layers would hide everything
        torch.nn.init.normal_(p, std=0.3)
    return net


@pytest.mark.parametrize(
    "arguments, count",
    [
        ((71, 128, 768, 12, 8, 1536, 0.2), 100_564_352),
        ((46, 116, 768, 6, 8, 1024, 0.2), 46_848_116),
        ((20, 48, 512, 8, 8, 1024, 0.2), 28_401_712),
        ((10, 42, 512, 4, 8, 1024, 0.2), 14_451_754),
    ],
)
def test_parameter_counts_of_the_papers(arguments, count):
    with torch.device("meta"):
        assert sum(p.numel() for p in TransLinear(*arguments).parameters()) == count


def reference(net: TransLinear, y, t, condition):
    """HumanMAC's network, written out for one item with separate q, k, v and explicit attention."""
    half = net.width // 2
    angle = t * torch.exp(-math.log(10_000) * torch.arange(half) / half)
    emb = net.time(torch.cat([angle.cos(), angle.sin()]))
    if condition is not None:
        emb = emb + net.condition(condition.reshape(-1))
    h, stack, maps, n = net.enter(y) + net.position, [], [], len(net.blocks)

    def stylize(m, h):
        scale, shift = m.film(F.silu(emb)).chunk(2)
        return m.out(F.silu(m.norm(h) * (1 + scale) + shift))

    for i, b in enumerate(net.blocks):
        if i < n // 2:
            stack.append(h)
        q, k, v = (b.norm(h) @ w.T for w in b.qkv.weight.chunk(3))
        heads = []
        for q_h, k_h, v_h in zip(*(m.chunk(b.heads, dim=-1) for m in (q, k, v)), strict=True):
            a = torch.softmax(q_h @ k_h.T / math.sqrt(net.width / b.heads), dim=-1)
            heads.append((a, a @ v_h))
        if i in (n // 2 - 1, n // 2):
            maps.append(torch.stack([a for a, _ in heads]))
        h = h + stylize(b.style_attention, torch.cat([o for _, o in heads], dim=-1))
        h = h + stylize(b.style_feedforward, b.down(F.gelu(b.up(h))))
        if i >= n // 2:
            h = h + stack.pop()
    return net.leave(h), torch.stack(maps)


def test_equals_the_transcription(generator):
    net = network().eval()
    y, c = torch.randn(2, 3, 7, 6, generator=generator), torch.randn(2, 3, 7, 6, generator=generator)
    t = torch.randint(0, 1000, (2, 3), generator=generator)
    out, attention = net(y, t, c, return_attention=True)
    free = net(y, t)
    assert attention.shape == (2, 3, 2, 2, 7, 7)
    for i in range(2):
        for j in range(3):
            expected, maps = reference(net, y[i, j], t[i, j], c[i, j])
            torch.testing.assert_close(out[i, j], expected, atol=1e-3, rtol=1e-4)
            torch.testing.assert_close(attention[i, j], maps, atol=1e-4, rtol=1e-4)
            torch.testing.assert_close(free[i, j], reference(net, y[i, j], t[i, j], None)[0], atol=1e-3, rtol=1e-4)


def test_keep_makes_single_items_unconditional(generator):
    net = network().eval()
    y, c = torch.randn(2, 7, 6, generator=generator), torch.randn(2, 7, 6, generator=generator)
    out = net(y, 5, c, keep=torch.tensor([True, False]))
    torch.testing.assert_close(out[0], net(y, 5, c)[0], atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(out[1], net(y, 5)[1], atol=1e-4, rtol=1e-4)


def test_starts_at_zero_and_every_parameter_learns(generator):
    net = TransLinear(7, 6, 16, 4, 2, 24, 0.1)
    y = torch.randn(3, 7, 6, generator=generator)
    assert net(y, 3).abs().max() == 0
    net = network(dropout=0.1)
    net(y, 3, y).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in net.parameters())


def test_dropout_keeps_the_mean_and_only_when_training():
    drop = Dropout(0.25)
    x = torch.ones(100_000)
    with torch.random.fork_rng():
        torch.manual_seed(1)
        y = drop(x)
    assert abs((y == 0).float().mean() - 0.25) < 0.01 and abs(y.mean() - 1) < 0.01
    assert drop.eval()(x) is x


@pytest.mark.parametrize("change, message", [(dict(layers=3), "layers is 3"), (dict(heads=3), "width is 16")])
def test_bad_sizes(change, message):
    with pytest.raises(ValueError, match=message):
        network(**change)


SIZES = dict(rows=7, columns=6, width=16, layers=4, heads=2, feedforward=24, dropout=0.0)


def test_a_default_network_is_as_before_to_the_bit(generator):
    """Weights and outputs of trained models must not change because a network may see more."""
    default, said = network(), network(extra_columns=0, conditioned=True)
    assert [*default.state_dict()] == [*said.state_dict()] and "condition.weight" in default.state_dict()
    assert all(torch.equal(a, b) for a, b in zip(default.parameters(), said.parameters(), strict=True))
    torch.manual_seed(0)
    fresh = TransLinear(**SIZES)
    torch.manual_seed(0)
    time = torch.nn.Sequential(torch.nn.Linear(16, 16), torch.nn.SiLU(), torch.nn.Linear(16, 16))
    condition, enter = torch.nn.Linear(42, 16), torch.nn.Linear(6, 16)
    for made, drawn in ((fresh.time[0], time[0]), (fresh.time[2], time[2]), (fresh.condition, condition), (fresh.enter, enter)):
        assert torch.equal(made.weight, drawn.weight) and torch.equal(made.bias, drawn.bias)
    assert torch.equal(fresh.position, torch.randn(7, 16))
    y = torch.randn(3, 7, 6, generator=generator)
    assert torch.equal(default(y, 5, y), said(y, 5, y)) and torch.equal(default.evaluate(y, 5, None)[0], default(y, 5))


def test_extra_columns_enter_and_are_not_predicted(generator):
    net = network(extra_columns=4, conditioned=False).eval()
    y, more = torch.randn(3, 7, 6, generator=generator), torch.randn(3, 7, 4, generator=generator)
    out, _ = net.evaluate(torch.cat([y, more], dim=-1), 5, None)
    assert out.shape == y.shape and net.enter.weight.shape == (16, 10)
    blank, _ = net.evaluate(torch.cat([y, torch.zeros_like(more)], dim=-1), 5, None)
    assert (out - blank).abs().max() > 1e-3
    plain = network(conditioned=False).eval()
    own = {name: w[:, :6] if name == "enter.weight" else w for name, w in net.state_dict().items()}
    plain.load_state_dict(own)
    torch.testing.assert_close(plain(y, 5), blank, atol=1e-4, rtol=1e-4)


def test_a_network_without_a_condition_refuses_one(generator):
    net, y = network(conditioned=False), torch.randn(2, 7, 6, generator=generator)
    assert not [name for name, _ in net.named_parameters() if name.startswith("condition")]
    with pytest.raises(ValueError, match="built without a layer for a condition; expected none"):
        net(y, 3, y)
    torch.testing.assert_close(net(y, 3), net.evaluate(y, 3, None)[0])
