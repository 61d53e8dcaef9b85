"""MDM: size, agreement with a plain transcription, and what padding may change."""

from __future__ import annotations

import math
import warnings

import pytest
import torch
from torch.nn import functional as F

from mwlib.networks import MDM, EncodedText
from mwlib.networks.layers import Encoder, sinusoids


def network(**kw) -> MDM:
    torch.manual_seed(0)
    net = MDM(**{**dict(features=5, steps=50, width=16, layers=2, heads=2, feedforward=24, text_width=6), **kw})
    for p in net.parameters():  # all that starts as zero or one
        torch.nn.init.normal_(p, std=0.3)
    return net.eval()


def sentences(generator, batch: int = 3, tokens: int = 4, width: int = 6) -> EncodedText:
    draw = lambda *shape: torch.randn(*shape, generator=generator)  # noqa: E731
    return EncodedText(draw(batch, tokens, width), torch.ones(batch, tokens, dtype=torch.bool), draw(batch, width))


def lengths(*valid: int, frames: int) -> torch.Tensor:
    return torch.arange(frames) < torch.tensor(valid)[:, None]


@pytest.mark.parametrize("features, count", [(263, 17_880_327), (251, 17_868_027)])
def test_parameter_count(features, count):
    """Counted by hand, layer by layer; the paper's network has 17.9 million without CLIP."""
    w, ff = 512, 1024
    linear = lambda i, o: i * o + o  # noqa: E731
    layer = linear(w, 3 * w) + linear(w, w) + linear(w, ff) + linear(ff, w) + 2 * 2 * w
    by_hand = 8 * layer + linear(features, w) + linear(w, features) + 2 * linear(w, w) + linear(512, w)
    with torch.device("meta"):
        found = sum(p.numel() for p in MDM(features, 1000).parameters())
    assert found == by_hand == count and abs(found - 17.9e6) < 0.05e6


def reference(net: MDM, y, t, length: int, sentence):
    """The published network for one item of `length` frames, masked or not, with explicit attention and norms."""
    speed = [10_000 ** (-2 * (i // 2) / net.width) for i in range(net.width)]
    table = lambda n: torch.tensor([(math.cos if i % 2 else math.sin)(n * s) for i, s in enumerate(speed)])  # noqa: E731

    def norm(h, layer):
        h = h - h.mean(-1, keepdim=True)
        return h / (h.square().mean(-1, keepdim=True) + 1e-5).sqrt() * layer.weight + layer.bias

    time = net.time[2].weight @ F.silu(net.time[0].weight @ table(int(t)) + net.time[0].bias) + net.time[2].bias
    condition = time + net.text.weight @ sentence + net.text.bias
    x = torch.stack([condition, *(net.enter.weight @ row + net.enter.bias for row in y[:length])])
    x = x + torch.stack([table(n) for n in range(len(x))])
    for layer in net.encoder.stack.layers:
        a = layer.self_attn
        q, k, v = (x @ a.in_proj_weight.T + a.in_proj_bias).chunk(3, dim=-1)
        heads = []
        for q_h, k_h, v_h in zip(*(m.chunk(a.num_heads, dim=-1) for m in (q, k, v)), strict=True):
            heads.append(torch.softmax(q_h @ k_h.T / math.sqrt(q_h.shape[-1]), dim=-1) @ v_h)
        x = norm(x + torch.cat(heads, dim=-1) @ a.out_proj.weight.T + a.out_proj.bias, layer.norm1)
        hidden = x @ layer.linear1.weight.T + layer.linear1.bias
        hidden = 0.5 * hidden * (1 + torch.erf(hidden / math.sqrt(2)))
        x = norm(x + hidden @ layer.linear2.weight.T + layer.linear2.bias, layer.norm2)
    return x[1:] @ net.leave.weight.T + net.leave.bias


def test_equals_the_transcription(generator):
    net, text = network(), sentences(generator)
    y, t = torch.randn(3, 7, 5, generator=generator), torch.tensor([0, 49, 20])
    out = net(y, t, lengths(7, 5, 1, frames=7), text, torch.tensor([False, False, True]))
    whole = network(mask_frames=False)(y, t, lengths(7, 5, 1, frames=7), text)
    for i, length in enumerate((7, 5, 1)):
        said = text.pooled[i] * (i != 2)
        torch.testing.assert_close(out[i, :length], reference(net, y[i], t[i], length, said), atol=1e-4, rtol=1e-4)
        torch.testing.assert_close(whole[i], reference(net, y[i], t[i], 7, text.pooled[i]), atol=1e-4, rtol=1e-4)


def test_one_layer_is_torchs(generator):
    """With its weights, masked and not, trained without dropout and evaluated."""
    ours = Encoder(16, 2, 4, 24, 0.0)
    theirs = torch.nn.TransformerEncoder(
        torch.nn.TransformerEncoderLayer(16, 4, 24, 0.0, "gelu", batch_first=True), 2, enable_nested_tensor=False
    )
    theirs.load_state_dict(ours.stack.state_dict())
    x, mask = torch.randn(3, 6, 16, generator=generator), lengths(6, 4, 1, frames=6)
    for mode in (True, False):
        ours.train(mode), theirs.train(mode)
        for m in (mask, None):
            expected = theirs(x, src_key_padding_mask=None if m is None else ~m)
            torch.testing.assert_close(ours(x, m)[mask], expected[mask], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("size", [1, 4])
def test_padding_changes_nothing_where_frames_are_masked(size, generator):
    net, text, t = network(frames_per_token=size), sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 16, 5, generator=generator), lengths(16, 8, 7, frames=16)  # 7 ends within a token
    out = net(y, t, mask, text)
    other = torch.where(mask[..., None], y, torch.tensor(float("nan")))
    torch.testing.assert_close(net(other, t, mask, text)[mask], out[mask], atol=1e-6, rtol=1e-6)
    longer = F.pad(y, (0, 0, 0, 9), value=7.0)
    torch.testing.assert_close(net(longer, t, F.pad(mask, (0, 9)), text)[:, :16][mask], out[mask], atol=1e-5, rtol=1e-5)
    alone = net(y[1:2, :8], t[1:2], mask[1:2, :8], EncodedText(*(part[1:2] for part in text)))
    torch.testing.assert_close(alone[0], out[1, :8], atol=1e-5, rtol=1e-5)


def test_padding_counts_in_the_first_release(generator):
    net, text, t = network(mask_frames=False), sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 5, 5, frames=8)
    other = torch.where(mask[..., None], y, y + 1)
    assert (net(other, t, mask, text) - net(y, t, mask, text))[1:, :5].abs().amax(dim=(1, 2)).min() > 1e-3


def test_several_frames_make_a_token(generator):
    """Those of one frame beside each other: 3 frames of 5 numbers are one frame of 15, and 10 frames are 4 tokens."""
    by_three, text, t = network(frames_per_token=3), sentences(generator), torch.tensor([3, 30, 10])
    one = network(features=15)
    y, mask = torch.randn(3, 10, 5, generator=generator), lengths(10, 6, 9, frames=10)
    assert by_three.enter.weight.shape == one.enter.weight.shape
    out = by_three(y, t, mask, text)
    tokens = F.pad(y * mask[..., None], (0, 0, 0, 2)).reshape(3, 4, 15)
    expected = one(tokens, t, lengths(4, 2, 3, frames=4), text).reshape(3, 12, 5)[:, :10]
    torch.testing.assert_close(out[mask], expected[mask], atol=1e-6, rtol=1e-6)


def test_a_dropped_sentence_is_a_vector_of_zeros(generator):
    net, text, t = network(), sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    drop = torch.tensor([False, True, False])
    out, told = net(y, t, mask, text, drop), net(y, t, mask, text)
    silent = net(y, t, mask, text._replace(pooled=torch.zeros(3, 6)))
    torch.testing.assert_close(out[[0, 2]], told[[0, 2]])
    torch.testing.assert_close(out[1], silent[1])
    assert (out[1] - told[1]).abs().max() > 1e-3


def test_every_parameter_learns_and_nothing_warns(generator):
    net, text, t = network(frames_per_token=2).train(), sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 5, 2, frames=8)
    net(y, t, mask, text).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in net.parameters())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with torch.inference_mode():
            assert network()(y, t, mask, text).isfinite().all()


def test_dropout_of_attention_is_its_own(generator):
    """Without any, training and evaluation are the same; with that of attention alone they differ."""
    text, t = sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    for attention_dropout, same in ((None, True), (0.0, True), (0.5, False)):
        net = network(dropout=0.0, attention_dropout=attention_dropout)
        assert torch.allclose(net(y, t, mask, text), net.train()(y, t, mask, text), atol=1e-5) == same
    net = network(dropout=0.5, attention_dropout=0.0)
    assert not torch.allclose(net(y, t, mask, text), net.train()(y, t, mask, text), atol=1e-2)


def test_sinusoids_by_hand():
    found = sinusoids(torch.tensor([0, 3, 700]), 6)
    expected = [[f(n / 10_000 ** (2 * i / 6)) for i in range(3) for f in (math.sin, math.cos)] for n in (0, 3, 700)]
    torch.testing.assert_close(found, torch.tensor(expected), atol=1e-4, rtol=0)


@pytest.mark.parametrize(
    "change, message",
    [
        (dict(heads=3), "width is 16; expected an even multiple of heads \\(3\\)"),
        (dict(width=15, heads=5), "width is 15"),
        (dict(frames_per_token=0), "frames_per_token is 0"),
        (dict(steps=0), "steps 0"),
    ],
)
def test_bad_sizes(change, message):
    with pytest.raises(ValueError, match=message):
        network(**change)
