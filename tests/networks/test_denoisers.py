"""MDM and StableMoFusion's U-Net: size, agreement with plain transcriptions, and what padding may change."""

from __future__ import annotations

import math
import warnings

import pytest
import torch
from torch.nn import functional as F

from mwlib.networks import MDM, ConditionalUNet, EncodedText
from mwlib.networks.layers import Encoder, sinusoids
from mwlib.networks.mdm import FrameDetail
from mwlib.networks.unet1d import CrossAttention, FrameNorm, ResBlock

SMALL_MDM = dict(features=5, steps=50, width=16, layers=2, heads=2, feedforward=24, text_width=6)
SMALL_UNET = dict(
    features=5, steps=50, base=16, multipliers=(1, 2), text_width=6, time_width=12, text_features=8, text_layers=1, text_heads=2,
    text_feedforward=12, heads=4,
)  # fmt: skip
T = torch.tensor([3, 30, 10])


def shaken(net: torch.nn.Module) -> torch.nn.Module:
    """Evaluated, with weights that hide nothing: much of a network starts as zero or one."""
    torch.manual_seed(0)
    for p in net.parameters():
        torch.nn.init.normal_(p, std=0.3)
    return net.eval()


def mdm(**changes) -> MDM:
    return shaken(MDM(**{**SMALL_MDM, **changes}))


def unet(**changes) -> ConditionalUNet:
    return shaken(ConditionalUNet(**{**SMALL_UNET, **changes}))


def sentences(generator, batch: int = 3, tokens: int = 4, width: int = 6) -> EncodedText:
    draw = lambda *shape: torch.randn(*shape, generator=generator)  # noqa: E731
    return EncodedText(draw(batch, tokens, width), torch.ones(batch, tokens, dtype=torch.bool), draw(batch, width))


def lengths(*valid: int, frames: int) -> torch.Tensor:
    return torch.arange(frames) < torch.tensor(valid)[:, None]


def linear(inputs: int, outputs: int, frames: int = 1) -> int:
    """Weights of a linear layer or a convolution."""
    return inputs * outputs * frames + outputs


def count(*parts: torch.nn.Module) -> int:
    return sum(p.numel() for part in parts for p in part.parameters())


@pytest.mark.parametrize("features, expected", [(263, 17_880_327), (251, 17_868_027)])
def test_parameters_of_mdm(features, expected):
    """Counted by hand, layer by layer; the paper's network has 17.9 million without CLIP."""
    w, ff = 512, 1024
    layer = linear(w, 3 * w) + linear(w, w) + linear(w, ff) + linear(ff, w) + 2 * 2 * w
    by_hand = 8 * layer + linear(features, w) + linear(w, features) + 2 * linear(w, w) + linear(512, w)
    with torch.device("meta"):
        assert count(MDM(features, 1000)) == by_hand == expected and abs(expected - 17.9e6) < 0.05e6


@pytest.mark.parametrize("base, expected", [(512, 293_654_279), (64, 9_995_015), (32, 5_032_199)])
def test_parameters_of_the_unet(base, expected):
    """Of the U-Net alone, 294 million in the paper's size; the transformer of the tokens has 5.4 million in all sizes."""
    with torch.device("meta"):
        net = ConditionalUNet(263, 1000, base=base)
    text = count(net.text, net.text_encoder, net.text_norm)
    assert count(net) - text == expected and text == 5_392_128
    c, time, said = 2 * base, 512, 256
    attention = 2 * c + 2 * said + linear(c, c) + 2 * linear(said, c)
    block = lambda i, o: (  # noqa: E731
        linear(i, o, 5) + linear(o, o, 5) + 4 * o + linear(time, 2 * o) + (linear(i, o) if i != o else 0) + attention
    )
    down = block(263, c) + 7 * block(c, c) + 4 * linear(c, c, 3)
    up = 4 * (linear(c, c, 4) + block(2 * c, c) + block(c, c))
    assert expected == down + 2 * block(c, c) + up + linear(c, 263) + linear(time, 4 * time) + linear(4 * time, time)


def mdm_by_hand(net: MDM, y, t, length: int, sentence):
    """The published network for one item of `length` frames, masked or not, with explicit attention and norms."""
    width = SMALL_MDM["width"]
    speed = [10_000 ** (-2 * (i // 2) / width) for i in range(width)]
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


def test_mdm_equals_its_transcription(generator):
    text, y, t = sentences(generator), torch.randn(3, 7, 5, generator=generator), torch.tensor([0, 49, 20])
    mask, net = lengths(7, 5, 1, frames=7), mdm()
    out = net(y, t, mask, text, torch.tensor([False, False, True]))
    whole = mdm(mask_frames=False)(y, t, mask, text)
    for i, length in enumerate((7, 5, 1)):
        said = text.pooled[i] * (i != 2)
        torch.testing.assert_close(out[i, :length], mdm_by_hand(net, y[i], t[i], length, said), atol=1e-4, rtol=1e-4)
        torch.testing.assert_close(whole[i], mdm_by_hand(net, y[i], t[i], 7, text.pooled[i]), atol=1e-4, rtol=1e-4)


def test_one_layer_is_torchs(generator):
    """With its weights, masked and not, trained without dropout and evaluated."""
    ours = Encoder(16, 2, 4, 24, 0.0)
    layer = torch.nn.TransformerEncoderLayer(16, 4, 24, 0.0, "gelu", batch_first=True)
    theirs = torch.nn.TransformerEncoder(layer, 2, enable_nested_tensor=False)
    theirs.load_state_dict(ours.stack.state_dict())
    x, mask = torch.randn(3, 6, 16, generator=generator), lengths(6, 4, 1, frames=6)
    for mode in (True, False):
        ours.train(mode), theirs.train(mode)
        for m in (mask, None):
            expected = theirs(x, src_key_padding_mask=None if m is None else ~m)
            torch.testing.assert_close(ours(x, m)[mask], expected[mask], atol=1e-5, rtol=1e-5)


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
    padded = F.pad(h, (2, 2))
    frames = [(layer.weight * padded[None, :, t : t + 5]).sum(dim=(1, 2)) + layer.bias for t in range(h.shape[1])]
    return torch.stack(frames, dim=1)


def mish(x):
    return x * torch.tanh(torch.log(1 + torch.exp(x)))


@pytest.mark.parametrize("outputs", [32, 16])
def test_the_residual_block_equals_its_transcription(outputs, generator):
    block = shaken(ResBlock(16, outputs, 12, 0.1))
    x, time = torch.randn(2, 16, 6, generator=generator), torch.randn(2, 12, generator=generator)
    for mask in (torch.ones(2, 1, 6), torch.tensor([1.0, 1, 1, 1, 0, 0]).expand(2, 1, 6)):
        out = block(x, time, mask)
        for i in range(2):
            scale, shift = (block.film.weight @ mish(time[i]) + block.film.bias)[:, None].chunk(2)
            h = mish(norm_of_frames(convolved(x[i], block.first), block.first_norm) * (1 + scale) + shift)
            h = h * mask[i]
            h = mish(norm_of_frames(convolved(h, block.second), block.second_norm))
            short = x[i] if outputs == 16 else block.shortcut.weight[..., 0] @ x[i] + block.shortcut.bias[:, None]
            torch.testing.assert_close(out[i], h + short, atol=1e-4, rtol=1e-4)


def test_the_norm_is_torchs_group_norm_of_one_frame(generator):
    norm = shaken(FrameNorm(8, 32))
    x = torch.randn(3, 32, 5, generator=generator) + 4
    expected = torch.stack([torch.nn.GroupNorm.forward(norm, x[..., t]) for t in range(5)], dim=-1)
    torch.testing.assert_close(norm(x), expected, atol=1e-5, rtol=1e-5)


def test_attention_equals_its_transcription(generator):
    layer = shaken(CrossAttention(8, 6, 2, 0.1))
    x, tokens = torch.randn(2, 8, 5, generator=generator), torch.randn(2, 4, 6, generator=generator)
    out = layer(x, tokens, lengths(4, 2, frames=4))
    for i, length in enumerate((4, 2)):
        normed = lambda h, norm: F.layer_norm(h, h.shape[-1:]) * norm.weight + norm.bias  # noqa: E731
        said = normed(tokens[i, :length], layer.text_norm)
        q, k, v = layer.query(normed(x[i].T, layer.norm)), layer.key(said), layer.value(said)
        heads = []
        for q_h, k_h, v_h in zip(*(m.chunk(2, dim=-1) for m in (q, k, v)), strict=True):
            share = torch.exp(k_h) / torch.exp(k_h).sum(0)  # of each token, for each number
            context = sum(torch.outer(share[n], v_h[n]) for n in range(length))
            heads.append(torch.exp(q_h) / torch.exp(q_h).sum(1, keepdim=True) @ context)
        torch.testing.assert_close(out[i], torch.cat(heads, dim=1).T, atol=1e-5, rtol=1e-5)


def unet_by_hand(net: ConditionalUNet, y, t, text: EncodedText, with_text: bool):
    """How the parts are put together, for one item without masks."""
    time = net.time(net.times[t][None])
    tokens = net.text_norm(net.text_encoder(net.text(text.tokens), text.mask))

    def two(blocks, h):
        for block in blocks:
            h = block.convolutions(h, time, torch.ones_like(h[:, :1]))
            h = h + block.attention(h, tokens, text.mask) if with_text else h
        return h

    h = F.pad(y.T[None], (0, -len(y) % 4))
    first = two(net.downs[0], h)
    second = two(net.downs[1], F.conv1d(first, net.shrink[0].weight, net.shrink[0].bias, 2, 1))
    h = two(net.middle, F.conv1d(second, net.shrink[1].weight, net.shrink[1].bias, 2, 1))
    h = two(net.ups[0], torch.cat([F.conv_transpose1d(h, net.grow[0].weight, net.grow[0].bias, 2, 1), second], dim=1))
    h = two(net.ups[1], torch.cat([F.conv_transpose1d(h, net.grow[1].weight, net.grow[1].bias, 2, 1), first], dim=1))
    return F.conv1d(h, net.leave.weight, net.leave.bias)[0, :, : len(y)].T


@pytest.mark.parametrize("mask_frames", [True, False])
def test_the_parts_of_the_unet_are_put_together_as_published(mask_frames, generator):
    """Of a length that needs no padding both kinds are the same; the last item has no sentence."""
    net, text, t = unet(mask_frames=mask_frames), sentences(generator), torch.tensor([3, 49, 10])
    frames = 8 if mask_frames else 6
    y, mask = torch.randn(3, frames, 5, generator=generator), torch.ones(3, frames, dtype=torch.bool)
    out = net(y, t, mask, text, torch.tensor([False, False, True]))
    for i in range(3):
        own = EncodedText(*(part[i : i + 1] for part in text))
        torch.testing.assert_close(out[i], unet_by_hand(net, y[i], t[i], own, i < 2), atol=1e-3, rtol=1e-4)


@pytest.mark.parametrize(
    "make, valid, atol",
    [
        (mdm, (16, 8, 7), 1e-5),
        (lambda: mdm(frames_per_token=4), (16, 8, 7), 1e-5),
        (lambda: mdm(frames_per_token=4, detail=6), (16, 8, 7), 1e-5),
        (unet, (13, 8, 5), 1e-4),
    ],
    ids=["mdm", "four frames a token", "corrected frames", "unet"],
)
def test_padding_changes_nothing_where_frames_are_masked(make, valid, atol, generator):
    """7 frames end within a token of four."""
    net, text, frames = make(), sentences(generator), valid[0]
    y, mask = torch.randn(3, frames, 5, generator=generator), lengths(*valid, frames=frames)
    out = net(y, T, mask, text)
    other = torch.where(mask[..., None], y, torch.tensor(float("nan")))
    torch.testing.assert_close(net(other, T, mask, text)[mask], out[mask], atol=1e-6, rtol=1e-6)
    for more, value in ((9, 7.0), (20, 3.0)):
        longer = net(F.pad(y, (0, 0, 0, more), value=value), T, F.pad(mask, (0, more)), text)
        torch.testing.assert_close(longer[:, :frames][mask], out[mask], atol=atol, rtol=atol)
    for i in (1, 2):
        n = valid[i]
        alone = net(y[i : i + 1, :n], T[i : i + 1], mask[i : i + 1, :n], EncodedText(*(part[i : i + 1] for part in text)))
        torch.testing.assert_close(alone[0], out[i, :n], atol=atol, rtol=atol)


def test_padding_counts_in_the_first_release_of_mdm(generator):
    net, text = mdm(mask_frames=False), sentences(generator)
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 5, 5, frames=8)
    other = torch.where(mask[..., None], y, y + 1)
    assert (net(other, T, mask, text) - net(y, T, mask, text))[1:, :5].abs().amax(dim=(1, 2)).min() > 1e-3


def test_what_padding_changes_in_the_unet_as_published(generator):
    """Frames after the end reach back through the convolutions, even zeros; frames far from the end are what they were."""
    net, text, t = unet(mask_frames=False, multipliers=(1,)), sentences(generator, 1), torch.tensor([3])
    y, mask = torch.randn(1, 100, 5, generator=generator), lengths(60, frames=100)
    out, other = net(y, t, mask, text), net(torch.where(mask[..., None], y, y + 1), t, mask, text)
    moved = (out - other).abs().amax(dim=-1)[0, :60]
    assert moved[-1] > 1e-3 and moved[:20].max() == 0
    zeros, longer = (net(F.pad(y[:, :60], (0, 0, 0, n)), t, lengths(60, frames=60 + n), text)[0, :60] for n in (0, 20))
    assert (zeros - longer)[-1].abs().max() > 1e-3
    torch.testing.assert_close(zeros[:20], longer[:20], atol=1e-4, rtol=1e-4)


def test_padded_tokens_change_nothing(generator):
    text = sentences(generator)._replace(mask=lengths(4, 2, 1, frames=4))
    other = text._replace(tokens=torch.where(text.mask[..., None], text.tokens, text.tokens + 9))
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    net = unet()
    torch.testing.assert_close(net(y, T, mask, text), net(y, T, mask, other), atol=1e-5, rtol=1e-5)


def test_several_frames_make_a_token(generator):
    """Those of one frame beside each other: 3 frames of 5 numbers are one frame of 15, and 10 frames are 4 tokens."""
    by_three, one, text = mdm(frames_per_token=3), mdm(features=15), sentences(generator)
    y, mask = torch.randn(3, 10, 5, generator=generator), lengths(10, 6, 9, frames=10)
    assert by_three.enter.weight.shape == one.enter.weight.shape
    tokens = F.pad(y * mask[..., None], (0, 0, 0, 2)).reshape(3, 4, 15)
    expected = one(tokens, T, lengths(4, 2, 3, frames=4), text).reshape(3, 12, 5)[:, :10]
    torch.testing.assert_close(by_three(y, T, mask, text)[mask], expected[mask], atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("make", [mdm, unet])
def test_a_dropped_sentence_changes_its_own_motion_alone(make, generator):
    """Of MDM it is a vector of zeros; in the U-Net it skips attention, whatever was said, even what is no number."""
    net, text, drop = make(), sentences(generator), torch.tensor([False, True, False])
    y, mask = torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    out, with_all = net(y, T, mask, text, drop), net(y, T, mask, text)
    torch.testing.assert_close(out[[0, 2]], with_all[[0, 2]], atol=1e-5, rtol=1e-5)
    assert (out[1] - with_all[1]).abs().max() > 1e-3
    if make is mdm:
        torch.testing.assert_close(out[1], net(y, T, mask, text._replace(pooled=torch.zeros(3, 6)))[1])
    else:
        broken = text._replace(tokens=text.tokens.masked_fill(drop[:, None, None], float("nan")))
        torch.testing.assert_close(net(y, T, mask, broken, drop), out)
        nobody = net(y, T, mask, broken, torch.ones(3, dtype=torch.bool))
        torch.testing.assert_close(nobody[1], out[1], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("make, change", [(mdm, dict(frames_per_token=2, detail=6)), (unet, {})])
def test_every_parameter_learns_and_nothing_warns(make, change, generator):
    net, text = make(**change).train(), sentences(generator)
    y, mask = torch.randn(3, 9, 5, generator=generator), lengths(9, 5, 2, frames=9)
    net(y, T, mask, text, torch.tensor([False, True, False])).square().sum().backward()
    assert all(p.grad is not None and p.grad.isfinite().all() and p.grad.abs().sum() > 0 for p in net.parameters())
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("error")
        assert net.eval()(y, T, mask, text).isfinite().all()


def test_a_correction_starts_at_zero_and_looks_three_frames_around(generator):
    torch.manual_seed(0)
    fresh, text = MDM(**SMALL_MDM, frames_per_token=4, detail=6).eval(), sentences(generator)
    y, mask = torch.randn(3, 16, 5, generator=generator), lengths(16, 16, 16, frames=16)
    with torch.no_grad():
        corrected, fresh.detail = fresh.detail, None
        y0_hat = fresh(y, T, mask, text)
        fresh.detail = corrected
        assert torch.equal(fresh(y, T, mask, text), y0_hat)
        detail = shaken(corrected)
        other = y.clone()
        other[:, 8] += 1.0
        apart = (detail(other, y0_hat, T, mask) - detail(y, y0_hat, T, mask)).abs().amax((0, 2))
    assert (apart > 0).nonzero()[:, 0].tolist() == [*range(5, 12)]


def test_a_correction_equals_its_transcription(generator):
    """Frame by frame; frames that are not valid count as zeros among the neighbours."""
    net, valid = shaken(FrameDetail(5, 50, 6)), (9, 6, 2)
    y, y0_hat = torch.randn(2, 3, 9, 5, generator=generator)
    w = dict(net.named_parameters())
    with torch.no_grad():
        out = net(y, y0_hat, T, lengths(*valid, frames=9))
        for i, n in enumerate(valid):
            h = [
                F.silu(w["enter.weight"] @ torch.cat([y[i, k], y0_hat[i, k]]) + w["enter.bias"] + w["time.weight"][T[i]])
                for k in range(n)
            ]
            for k in range(n):
                near = sum(w["around.weight"][:, 0, 3 + d] * h[k + d] for d in range(-3, 4) if 0 <= k + d < n) + w["around.bias"]
                corrected = h[k] + F.silu(w["mix.weight"] @ near + w["mix.bias"])
                by_hand = y0_hat[i, k] + w["leave.weight"] @ corrected + w["leave.bias"]
                torch.testing.assert_close(out[i, k], by_hand, atol=1e-5, rtol=1e-5)


def test_the_unet_starts_at_zero(generator):
    torch.manual_seed(0)
    fresh = ConditionalUNet(**SMALL_UNET)
    assert fresh(torch.randn(3, 9, 5), T, lengths(9, 8, 4, frames=9), sentences(generator)).abs().max() == 0
    for block in fresh.middle:
        assert not any(p.abs().sum() for part in (block.convolutions.film, block.convolutions.second) for p in part.parameters())


def test_dropout_of_attention_is_its_own(generator):
    """Without any, training and evaluation are the same; with that of attention alone they differ."""
    text, y, mask = sentences(generator), torch.randn(3, 8, 5, generator=generator), lengths(8, 8, 8, frames=8)
    for attention_dropout, same in ((None, True), (0.0, True), (0.5, False)):
        net = mdm(dropout=0.0, attention_dropout=attention_dropout)
        assert torch.allclose(net(y, T, mask, text), net.train()(y, T, mask, text), atol=1e-5) == same
    net = mdm(dropout=0.5, attention_dropout=0.0)
    assert not torch.allclose(net(y, T, mask, text), net.train()(y, T, mask, text), atol=1e-2)


def test_sinusoids_by_hand():
    found = sinusoids(torch.tensor([0, 3, 700]), 6)
    expected = [[f(n / 10_000 ** (2 * i / 6)) for i in range(3) for f in (math.sin, math.cos)] for n in (0, 3, 700)]
    torch.testing.assert_close(found, torch.tensor(expected), atol=1e-4, rtol=0)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    "make, change, message",
    [
        (mdm, dict(heads=3), "width is 16; expected an even multiple of heads \\(3\\)"),
        (mdm, dict(width=15, heads=5), "width is 15"),
        (unet, dict(base=12), "channels are \\[12, 24\\]; expected one number per level, multiples of 8 from 16 on"),
        (unet, dict(base=8), "channels are \\[8, 16\\]"),
        (unet, dict(heads=3), "of heads \\(3\\)"),
        (unet, dict(multipliers=()), "channels are \\[\\]"),
        (unet, dict(text_heads=3), "width is 8; expected an even multiple of heads"),
    ],
)
def test_bad_sizes(make, change, message):
    with pytest.raises(ValueError, match=message):
        make(**change)
