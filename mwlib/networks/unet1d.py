"""StableMoFusion's conditional U-Net: convolutions over time with cross-attention to the words of a sentence."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional as F

from mwlib.networks.layers import Dropout, Dropped, Encoder, Features, PerItem, Valid, sinusoids, zeroed
from mwlib.networks.text import EncodedText

GROUPS = 8  # of the group norms
Frames = Float[Tensor, "B C T"]
Time = Float[Tensor, "B E"]  # embedded
Kept = Float[Tensor, "B 1 T"]  # 1 where the frame, or one of those that it stands for, is valid


class FrameNorm(nn.GroupNorm):
    """Group norm of each frame by itself: statistics of other frames, padding included, do not enter."""

    def forward(self, input: Frames) -> Frames:
        """Groups of channels with mean 0 and variance 1, then torch's learned scale and shift per channel."""
        groups = input.transpose(1, 2).unflatten(-1, (self.num_groups, -1))
        normed = F.layer_norm(groups, groups.shape[-1:], eps=self.eps).flatten(-2)  # faster than torch's group norm
        normed = normed.transpose(1, 2).contiguous()  # else Mish's way back is slow
        return torch.addcmul(self.bias[:, None], normed, self.weight[:, None])


class ResBlock(nn.Module):
    """Two convolutions over 5 frames, the first scaled and shifted by the time; the second starts as zero.

    Args:
        inputs, outputs: channels.
        time_width: numbers of the embedded time.
        dropout: behind the convolutions.
    """

    def __init__(self, inputs: int, outputs: int, time_width: int, dropout: float) -> None:
        super().__init__()
        self.first = nn.Conv1d(inputs, outputs, 5, padding=2)
        self.first_norm = FrameNorm(GROUPS, outputs)
        self.second = zeroed(nn.Conv1d(outputs, outputs, 5, padding=2))
        self.second_norm = FrameNorm(GROUPS, outputs)
        self.film = zeroed(nn.Linear(time_width, 2 * outputs))
        self.dropout = Dropout(dropout)
        self.shortcut = nn.Conv1d(inputs, outputs, 1) if inputs != outputs else nn.Identity()

    def forward(self, x: Frames, time: Time, valid: Kept) -> Float[Tensor, "B C2 T"]:
        """Frames after the block; where `valid` is 0 the second convolution sees zeros."""
        scale, shift = self.film(F.mish(time))[..., None].chunk(2, dim=1)
        h = F.mish(torch.addcmul(shift, self.first_norm(self.first(x)), 1 + scale)) * valid
        return self.shortcut(x) + self.dropout(F.mish(self.second_norm(self.second(h))))


class CrossAttention(nn.Module):
    """Linear attention of frames to the tokens of a sentence.

    Softmax of each query over its own numbers and of the keys over the tokens, then q (k^T v): one matrix per head, whatever the
    number of frames. Source: Shen et al. 2021, Efficient Attention.

    Args:
        width: channels of a frame.
        text_width: numbers of a token.
        heads: attention heads.
        dropout: on what the tokens say.
    """

    def __init__(self, width: int, text_width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads, self.dropout = heads, Dropout(dropout)
        self.norm, self.text_norm = nn.LayerNorm(width), nn.LayerNorm(text_width)
        self.query, self.key, self.value = nn.Linear(width, width), nn.Linear(text_width, width), nn.Linear(text_width, width)

    def forward(self, x: Frames, tokens: Float[Tensor, "B L E"], mask: Bool[Tensor, "B L"]) -> Frames:
        """What is added to the frames."""
        said = self.text_norm(tokens)
        projected = self.query(self.norm(x.transpose(1, 2))), self.key(said), self.value(said)
        q, k, v = (p.unflatten(-1, (self.heads, -1)).transpose(1, 2) for p in projected)  # (B, heads, T or L, C/heads)
        k = k.masked_fill(~mask[:, None, :, None], float("-inf")).softmax(dim=2)
        y = q.softmax(dim=-1) @ self.dropout(k.transpose(-1, -2) @ v)
        return y.transpose(1, 2).flatten(-2).transpose(1, 2)


class _Conditioning(NamedTuple):
    """Tokens of the samples that have a sentence; rows = which samples of the batch those are."""

    rows: Tensor
    tokens: Tensor
    mask: Tensor


class ConditionalBlock(nn.Module):
    """`ResBlock`, then what `CrossAttention` adds; samples without a sentence skip it.

    Args:
        inputs, outputs, time_width, dropout: as in `ResBlock`.
        text_width, heads: as in `CrossAttention`.
    """

    def __init__(self, inputs: int, outputs: int, time_width: int, text_width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.convolutions = ResBlock(inputs, outputs, time_width, dropout)
        self.attention = CrossAttention(outputs, text_width, heads, dropout)

    def forward(self, x: Frames, time: Time, valid: Kept, said: _Conditioning | None) -> Float[Tensor, "B C2 T"]:
        """Frames after the block, zero where `valid` is."""
        x = self.convolutions(x, time, valid)
        if said is not None:
            added = self.attention(x[said.rows], said.tokens, said.mask)
            x = x.index_add(0, said.rows, added.to(x.dtype))
        return x * valid


class ConditionalUNet(nn.Module):
    """Clean motion features from noised ones, the diffusion index and the words of a sentence.

    Source: Huang et al. 2024, StableMoFusion, and its code (CondUNet1D): on each level two blocks, then every second frame; two
    blocks in the middle; on the way back what the level held is put beside. The tokens pass a transformer of their own first. The
    output starts as zero, and so does the second half of every block. Dropped sentences skip cross-attention: nothing stands in
    for them.

    Frames are padded with zeros to a multiple of 2 per level (16). What padding changes: with `mask_frames` nothing, as every
    convolution sees zeros there. Without, as the code of StableMoFusion, frames after the end enter through the convolutions, the
    last valid frames change with them, and farther ones on lower levels; only the norms are safe, as they take each frame by
    itself.

    Args:
        features: numbers per frame, D.
        steps: length of the diffusion schedule; t is below it.
        base: channels, times `multipliers` on each level; 32 has 5 million weights, 64 has 10 million, 512 has 294 million, and
            the transformer of the tokens has 5 million more.
        multipliers: one for each level.
        text_width: numbers of a token as it comes in.
        time_width: numbers of the embedded time, even.
        text_features, text_layers, text_heads, text_feedforward: of the transformer of the tokens.
        heads: of cross-attention.
        dropout: everywhere.
        mask_frames: keep frames that are not valid at zero. Own choice; False is as published.

    Raises:
        ValueError: channels that are no multiple of 8 and of `heads` or below 16, or no level.
    """

    def __init__(
        self,
        features: int,
        steps: int,
        base: int = 512,
        multipliers: Sequence[int] = (2, 2, 2, 2),
        text_width: int = 512,
        time_width: int = 512,
        text_features: int = 256,
        text_layers: int = 4,
        text_heads: int = 4,
        text_feedforward: int = 2048,
        heads: int = 8,
        dropout: float = 0.1,
        mask_frames: bool = True,
    ) -> None:
        super().__init__()
        widths = check_channels(base, multipliers, heads)
        self.mask_frames, self.multiple = mask_frames, 2 ** len(widths)
        self.time = nn.Sequential(nn.Linear(time_width, 4 * time_width), nn.Mish(), nn.Linear(4 * time_width, time_width))
        self.times: Tensor
        self.register_buffer("times", sinusoids(torch.arange(steps), time_width), persistent=False)
        self.text = nn.Linear(text_width, text_features)
        self.text_encoder = Encoder(text_features, text_layers, text_heads, text_feedforward, dropout)
        self.text_norm = nn.LayerNorm(text_features)

        def two(inputs: int, outputs: int) -> nn.ModuleList:
            """The two blocks of one level."""
            sizes = (time_width, text_features, heads, dropout)
            return nn.ModuleList(ConditionalBlock(i, outputs, *sizes) for i in (inputs, outputs))

        self.downs = nn.ModuleList(two(i, o) for i, o in zip([features, *widths], widths, strict=False))
        self.shrink = nn.ModuleList(nn.Conv1d(w, w, 3, stride=2, padding=1) for w in widths)
        self.middle = two(widths[-1], widths[-1])
        back = [widths[-1], *reversed(widths)]
        self.grow = nn.ModuleList(nn.ConvTranspose1d(i, o, 4, stride=2, padding=1) for i, o in zip(back, back[1:], strict=False))
        self.ups = nn.ModuleList(two(2 * w, w) for w in reversed(widths))
        self.leave = zeroed(nn.Conv1d(widths[0], features, 1))

    def forward(self, y_t: Features, t: PerItem, mask: Valid, text: EncodedText, drop: Dropped | None = None) -> Features:
        """Clean estimate; what it says of frames that are not valid means nothing.

        Args:
            y_t: noised features.
            t: diffusion index, 0 <= t < steps.
            mask: True = a valid frame; these come first in each row.
            text: sentences; `tokens` and `mask` are read.
            drop: samples that are told no sentence; None = none of them.
        """
        frames, all_count = y_t.shape[1], not self.mask_frames
        missing = -frames % self.multiple
        mask = F.pad(mask | all_count, (0, missing), value=all_count)[:, None]
        x = F.pad(y_t.transpose(1, 2), (0, missing)).masked_fill(~mask, 0.0)
        valid = [mask[..., :: 2**level].to(x) for level in range(len(self.downs) + 1)]
        time, conditioning = self.time(self.times[t]), self._conditioning(text, drop)
        held = []
        for level, (blocks, shrink) in enumerate(zip(self.downs, self.shrink, strict=True)):
            x = _through(blocks, x, time, valid[level], conditioning)
            held.append(x)
            x = shrink(x) * valid[level + 1]
        x = _through(self.middle, x, time, valid[-1], conditioning)
        for level, grow, blocks in zip(reversed(range(len(held))), self.grow, self.ups, strict=True):
            x = torch.cat([grow(x) * valid[level], held[level]], dim=1)
            x = _through(blocks, x, time, valid[level], conditioning)
        return self.leave(x)[..., :frames].transpose(1, 2)

    def _conditioning(self, text: EncodedText, drop: Dropped | None) -> _Conditioning | None:
        told = torch.ones_like(text.mask[:, 0]) if drop is None else ~drop
        rows = told.nonzero()[:, 0]
        if len(rows) == 0:
            return None
        mask = text.mask[rows]
        return _Conditioning(rows, self.text_norm(self.text_encoder(self.text(text.tokens[rows]), mask)), mask)


def _through(blocks: nn.Module, x: Tensor, *given: object) -> Tensor:
    for block in blocks.children():
        x = block(x, *given)
    return x


def check_channels(base: int, multipliers: Sequence[int], heads: int = 8) -> list[int]:
    """The channels of each level, if `ConditionalUNet` can have them.

    Raises:
        ValueError: no level, or channels that are no multiple of 8 and of `heads`, or below 16.
    """
    widths = [base * m for m in multipliers]
    if not widths or any(w < 2 * GROUPS or w % GROUPS or w % heads for w in widths):  # alone in its group a channel is 0
        wanted = f"multiples of {GROUPS} from {2 * GROUPS} on, and of heads ({heads})"
        raise ValueError(f"channels are {widths}; expected one number per level, {wanted}")
    return widths
