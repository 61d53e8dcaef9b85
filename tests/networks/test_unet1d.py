"""StableMoFusion's U-Net: size, agreement with plain transcriptions, and what padding may change."""

from __future__ import annotations

import math

import pytest
import torch
from torch.nn import functional as F

from mwlib.networks import ConditionalUNet, EncodedText
from mwlib.networks.unet1d import CrossAttention, FrameNorm, ResBlock
from tests.networks.test_mdm import lengths, sentences

SMALL = dict(
    features=5, steps=50, base=16, multipliers=(1, 2), text_width=6, time_width=12, text_features=8, text_layers=1, text_heads=2,
    text_feedforward=12, heads=4,
)  # fmt: skip


def shaken(net: torch.nn.Module) -> torch.nn.Module:
    """Evaluated, with weights that hide nothing: half of the network starts as zero."""
    torch.manual_seed(0)
    for p in net.parameters():
        torch.nn.init.normal_(p, std=0.3)
    return net.eval()


def network(**kw) -> ConditionalUNet:
    return shaken(ConditionalUNet(**{**SMALL, **kw}))


@pytest.mark.parametrize("base, count", [(512, 293_654_279), (64, 9_995_015), (32, 5_032_199)])
def test_parameter_count(base, count):
    """Of the U-Net alone, 294 million in the paper's size; the transformer of the tokens has 5.4 million in all sizes."""
    with torch.device("meta"):
        net = ConditionalUNet(263, 1000, base=base)
    text = sum(p.numel() for part in (net.text, net.text_encoder, net.text_norm) for p in part.parameters())
    assert sum(p.numel() for p in net.parameters()) - text == count and text == 5_392_128
    c, time, said = 2 * base, 512, 256
    conv = lambda i, o, k: i * o * k + o  # noqa: E731
    attention = 2 * c + 2 * said + conv(c, c, 1) + 2 * conv(said, c, 1)
    block = lambda i, o: (  # noqa: E731
        conv(i, o, 5) + conv(o, o, 5) + 4 * o + conv(time, 2 * o, 1) + (conv(i, o, 1) if i != o else 0) + attention
    )
    down = block(263, c) + 7 * block(c, c) + 4 * conv(c, c, 3)
    up = 4 * (conv(c, c, 4) + block(2 * c, c) + block(c, c))
    assert count == down + 2 * block(c, c) + up + conv(c, 263, 1) + conv(time, 4 * time, 1) + conv(4 * time, time, 1)


def norm_of_frames(h, norm: FrameNorm):
    """Frame by frame, group by group; h is (C, T)."""
    out, size = torch.empty_like(h), len(h) // 8
    for frame in range(h.shape[1]):
        for group in range(8):
            part = slice(group * size, (group + 1) * size)
            x = h[part, frame]
            x = (x - x.mean()) / ((x - x.mean()).square().mean() + 1e-5).sqrt()
            out[part, frame] = x * norm.weight[part] + norm.bias[part]
    return out


def convolved(h, layer):
    """Of (C, T), frame by frame, zeros beyond the ends."""
    padded, reach = F.pad(h, (2, 2)), 5
    frames = [(layer.weight * padded[None, :, t : t + reach]).sum(dim=(1, 2)) + layer.bias for t in range(h.shape[1])]
    return torch.stack(frames, dim=1)


def mish(x):
    return x * torch.tanh(torch.log(1 + torch.exp(x)))


@pytest.mark.parametrize("outputs", [32, 16])
def test_the_residual_block_equals_its_transcription(outputs, generator):
    block = shaken(ResBlock(16, outputs, 12, 0.1))
    x, time = torch.randn(2, 16, 6, generator=generator), torch.randn(2, 12, generator=generator)
    valid = torch.tensor([1.0, 1, 1, 1, 0, 0]).expand(2, 1, 6)
    for mask in (None, valid):
        out = block(x, time, mask)
        for i in range(2):
            scale, shift = (block.film.weight @ mish(time[i]) + block.film.bias)[:, None].chunk(2)
            h = mish(norm_of_frames(convolved(x[i], block.first), block.first_norm) * (1 + scale) + shift)
            h = h if mask is None else h * mask[i]
            h = mish(norm_of_frames(convolved(h, block.second), block.second_norm))
            short = x[i] if outputs == 16 else block.shortcut.weight[..., 0] @ x[i] + block.shortcut.bias[:, None]
            torch.testing.assert_close(out[i], h + short, atol=1e-4, rtol=1e-4)


def test_the_norm_is_torchs_group_norm_of_one_frame(generator):
    norm = shaken(FrameNorm(8, 32))
    x = torch.randn(3, 32, 5, generator=generator) + 4
    expected = torch.stack([torch.nn.GroupNorm.forward(norm, x[..., t]) for t in range(5)], dim=-1)
    torch.testing.assert_close(norm(x), expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("attention", ["linear", "ordinary"])
def test_attention_equals_its_transcription(attention, generator):
    layer = shaken(CrossAttention(8, 6, 2, 0.1, attention))
    x, tokens = torch.randn(2, 8, 5, generator=generator), torch.randn(2, 4, 6, generator=generator)
    mask = lengths(4, 2, frames=4)
    out = layer(x, tokens, mask)
    for i, length in enumerate((4, 2)):
        normed = lambda h, norm: F.layer_norm(h, h.shape[-1:]) * norm.weight + norm.bias  # noqa: E731
        said = normed(tokens[i, :length], layer.text_norm)
        q, k, v = layer.query(normed(x[i].T, layer.norm)), layer.key(said), layer.value(said)
        heads = []
        for q_h, k_h, v_h in zip(*(m.chunk(2, dim=-1) for m in (q, k, v)), strict=True):
            if attention == "linear":
                share = torch.exp(k_h) / torch.exp(k_h).sum(0)  # of each token, for each number
                context = sum(torch.outer(share[n], v_h[n]) for n in range(length))
                heads.append(torch.exp(q_h) / torch.exp(q_h).sum(1, keepdim=True) @ context)
            else:
                heads.append(torch.softmax(q_h @ k_h.T / math.sqrt(4), dim=1) @ v_h)
        torch.testing.assert_close(out[i], torch.cat(heads, dim=1).T, atol=1e-5, rtol=1e-5)


def reference(net: ConditionalUNet, y, t, text: EncodedText, told: bool):
    """How the parts are put together, for one item without masks."""
    time = net.time(net.times[t][None])
    tokens = net.text_norm(net.text_encoder(net.text(text.tokens), text.mask))

    def two(blocks, h):
        for block in blocks:
            h = block.convolutions(h, time, None)
            h = h + block.attention(h, tokens, text.mask) if told else h
        return h

    h = F.pad(y.T[None], (0, -len(y) % 4))
    first = two(net.downs[0], h)
    second = two(net.downs[1], F.conv1d(first, net.shrink[0].weight, net.shrink[0].bias, 2, 1))
    h = two(net.middle, F.conv1d(second, net.shrink[1].weight, net.shrink[1].bias, 2, 1))
    h = two(net.ups[0], torch.cat([F.conv_transpose1d(h, net.grow[0].weight, net.grow[0].bias, 2, 1), second], dim=1))
    h = two(net.ups[1], torch.cat([F.conv_transpose1d(h, net.grow[1].weight, net.grow[1].bias, 2, 1), first], dim=1))
    return F.conv1d(h, net.leave.weight, net.leave.bias)[0, :, : len(y)].T


@pytest.mark.parametrize("mask_frames", [True, False])
def test_the_parts_are_put_together_as_published(mask_frames, generator):
    """Of a length that needs no padding both kinds are the same; the last item is told nothing."""
    net, text, t = network(mask_frames=mask_frames), sentences(generator), torch.tensor([3, 49, 10])
    frames = 8 if mask_frames else 6
    y, mask = torch.randn(3, frames, 5, generator=generator), torch.ones(3, frames, dtype=torch.bool)
    out = net(y, t, mask, text, torch.tensor([False, False, True]))
    for i in range(3):
        own = EncodedText(*(part[i : i + 1] for part in text))
        torch.testing.assert_close(out[i], reference(net, y[i], t[i], own, i < 2), atol=1e-3, rtol=1e-4)


def test_padding_changes_nothing_where_frames_are_masked(generator):
    net, text, t = network(), sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 13, 5, generator=generator), lengths(13, 8, 5, frames=13)
    out = net(y, t, mask, text)
    other = torch.where(mask[..., None], y, torch.tensor(float("nan")))
    torch.testing.assert_close(net(other, t, mask, text)[mask], out[mask], atol=1e-6, rtol=1e-6)
    longer = net(F.pad(y, (0, 0, 0, 20), value=3.0), t, F.pad(mask, (0, 20)), text)
    torch.testing.assert_close(longer[:, :13][mask], out[mask], atol=1e-4, rtol=1e-4)
    alone = net(y[2:, :5], t[2:], mask[2:, :5], EncodedText(*(part[2:] for part in text)))
    torch.testing.assert_close(alone[0], out[2, :5], atol=1e-4, rtol=1e-4)


def test_what_padding_changes_as_published(generator):
    """Frames after the end reach back through the convolutions, even zeros; frames far from the end are what they were."""
    net, text, t = network(mask_frames=False, multipliers=(1,)), sentences(generator, 1), torch.tensor([3])
    y, mask = torch.randn(1, 100, 5, generator=generator), lengths(60, frames=100)
    out, other = net(y, t, mask, text), net(torch.where(mask[..., None], y, y + 1), t, mask, text)
    moved = (out - other).abs().amax(dim=-1)[0, :60]
    assert moved[-1] > 1e-3 and moved[:20].max() == 0
    zeros, longer = (net(F.pad(y[:, :60], (0, 0, 0, n)), t, lengths(60, frames=60 + n), text)[0, :60] for n in (0, 20))
    assert (zeros - longer)[-1].abs().max() > 1e-3
    torch.testing.assert_close(zeros[:20], longer[:20], atol=1e-4, rtol=1e-4)


def test_padded_tokens_change_nothing(generator):
    text, t = sentences(generator), torch.tensor([3, 30, 10])
    text = text._replace(mask=lengths(4, 2, 1, frames=4))
    other = text._replace(tokens=torch.where(text.mask[..., None], text.tokens, text.tokens + 9))
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    for attention in ("linear", "ordinary"):
        net = network(attention=attention)
        torch.testing.assert_close(net(y, t, mask, text), net(y, t, mask, other), atol=1e-5, rtol=1e-5)


def test_dropped_sentences_skip_attention(generator):
    """Whatever was said, even what is no number; nothing else changes."""
    net, text, t = network(), sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    drop = torch.tensor([False, True, False])
    out, told = net(y, t, mask, text, drop), net(y, t, mask, text)
    broken = text._replace(tokens=text.tokens.masked_fill(drop[:, None, None], float("nan")))
    torch.testing.assert_close(net(y, t, mask, broken, drop), out)
    torch.testing.assert_close(out[[0, 2]], told[[0, 2]], atol=1e-5, rtol=1e-5)
    assert (out[1] - told[1]).abs().max() > 1e-3
    torch.testing.assert_close(net(y, t, mask, broken, torch.ones(3, dtype=torch.bool))[1], out[1], atol=1e-5, rtol=1e-5)


def test_starts_at_zero_and_every_parameter_learns(generator):
    text, t = sentences(generator), torch.tensor([3, 30, 10])
    y, mask = torch.randn(3, 9, 5, generator=generator), lengths(9, 8, 4, frames=9)
    torch.manual_seed(0)
    fresh = ConditionalUNet(**SMALL)
    assert fresh(y, t, mask, text).abs().max() == 0
    for block in fresh.middle:
        assert not any(p.abs().sum() for part in (block.convolutions.film, block.convolutions.second) for p in part.parameters())
    for attention in ("linear", "ordinary"):
        net = network(attention=attention).train()
        net(y, t, mask, text, torch.tensor([False, True, False])).square().sum().backward()
        assert all(p.grad is not None and p.grad.isfinite().all() and p.grad.abs().sum() > 0 for p in net.parameters())


@pytest.mark.parametrize(
    "change, message",
    [
        (
            dict(base=12),
            "channels are \\[12, 24\\]; expected one number per level, multiples of 8 from 16 on",
        ),
        (dict(base=8), "channels are \\[8, 16\\]"),
        (dict(heads=3), "of heads \\(3\\)"),
        (dict(multipliers=()), "channels are \\[\\]"),
        (dict(time_width=11), "time_width is 11"),
        (dict(steps=0), "steps 0"),
        (dict(attention="square"), "attention is 'square'; expected 'linear' or 'ordinary'"),
        (dict(text_heads=3), "width is 8; expected an even multiple of heads"),
    ],
)
def test_bad_sizes(change, message, unchecked):
    with pytest.raises(ValueError, match=message):
        network(**change)
