"""TransLinear: HumanMAC's transformer denoiser, which MotionWavelet takes over."""

from __future__ import annotations

import math

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from mwlib.networks.layers import Dropout, attend, check_width, sinusoids, zero_linear

Rows = Float[Tensor, "B rows width"]
Embedding = Float[Tensor, "B width"]  # of the time, and of the condition


class Stylize(nn.Module):
    """Scale and shift a normalised stream by the time-and-condition embedding; starts as zero."""

    def __init__(self, width: int, dropout: float) -> None:
        super().__init__()
        self.film = nn.Linear(width, 2 * width)
        self.norm = nn.LayerNorm(width)
        self.dropout = Dropout(dropout)
        self.out = zero_linear(width, width)

    def forward(self, h: Rows, emb: Embedding) -> Rows:
        """What is added to the stream."""
        scale, shift = self.film(F.silu(emb)).unsqueeze(-2).chunk(2, dim=-1)
        return self.out(self.dropout(F.silu(torch.addcmul(shift, self.norm(h), 1 + scale))))


class Block(nn.Module):
    """Self-attention and feed-forward, each added back through a `Stylize`."""

    def __init__(self, width: int, heads: int, feedforward: int, dropout: float, attention_dropout: float) -> None:
        super().__init__()
        self.heads, self.attention_dropout, self.dropout = heads, attention_dropout, Dropout(dropout)
        self.norm = nn.LayerNorm(width)
        self.qkv = nn.Linear(width, 3 * width, bias=False)  # one product for the three projections
        self.style_attention = Stylize(width, dropout)
        self.up = nn.Linear(width, feedforward)
        self.down = zero_linear(feedforward, width)
        self.style_feedforward = Stylize(width, dropout)

    def forward(self, x: Rows, emb: Embedding, attention_rows: int) -> tuple[Tensor, Tensor | None]:
        """The stream after both layers; attention (attention_rows, heads, rows, rows) of the first items on request."""
        mixed, q, k = attend(self.qkv(self.norm(x)), self.heads, self.attention_dropout if self.training else 0.0)
        x = x + self.style_attention(mixed, emb)
        x = x + self.style_feedforward(self.down(self.dropout(F.gelu(self.up(x)))), emb)
        if not attention_rows:
            return x, None
        q, k = q[:attention_rows], k[:attention_rows]
        return x, torch.softmax(q @ k.transpose(-1, -2) / math.sqrt(q.shape[-1]), dim=-1)


def check_sizes(width: int, heads: int, layers: int) -> None:
    """Refuse sizes that `TransLinear` cannot have.

    Raises:
        ValueError: odd `layers`, or `width` not an even multiple of `heads`.
    """
    check_width(width, heads)
    if layers % 2:
        raise ValueError(f"layers is {layers}; expected an even number (long skips pair the blocks)")


class TransLinear(nn.Module):
    """Predict the noise in coefficients from them, the diffusion index and, optionally, a condition.

    Source: HumanMAC's MotionTransformer, as MotionWavelet's Appendix A sizes it. One token per row of coefficients; the
    flattened condition is one linear layer added to the time embedding; no condition adds nothing.

    Args:
        rows: number of coefficient rows K.
        columns: number of coefficient columns (4D for one wavelet level).
        width: numbers per token inside the network.
        layers: number of blocks, even: the first half is added back to the second half (long skips).
        heads: attention heads.
        feedforward: width of the hidden feed-forward layer.
        dropout: in feed-forward and Stylize.
        attention_dropout: on the attention weights; None = `dropout`. On the CPU anything but 0 forgoes fused attention.
        extra_columns: of what enters beside the coefficients and is not predicted, such as what is known of a motion. Own
            choice; no paper here has them.
        conditioned: whether there is a layer for a condition at all.

    Raises:
        ValueError: as in `check_sizes`.
    """

    def __init__(
        self,
        rows: int,
        columns: int,
        width: int,
        layers: int,
        heads: int,
        feedforward: int,
        dropout: float,
        attention_dropout: float | None = None,
        extra_columns: int = 0,
        conditioned: bool = True,
    ) -> None:
        super().__init__()
        check_sizes(width, heads, layers)
        self.rows, self.columns, self.width = rows, columns, width
        self.time = nn.Sequential(nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width))
        self.condition = nn.Linear(columns * rows, width) if conditioned else None
        self.enter = nn.Linear(columns + extra_columns, width)
        self.position = nn.Parameter(torch.randn(rows, width))
        attention_dropout = dropout if attention_dropout is None else attention_dropout
        self.blocks = nn.ModuleList(Block(width, heads, feedforward, dropout, attention_dropout) for _ in range(layers))
        self.sizes = (heads, feedforward)
        self.leave = zero_linear(width, columns)

    def forward(
        self,
        y_t: Float[Tensor, "... rows columns"],
        t: Int[Tensor, ...] | int,
        condition: Float[Tensor, "... rows columns"] | None = None,
        return_attention: bool = False,
        keep: Bool[Tensor, ...] | None = None,
    ) -> Tensor | tuple[Tensor, Tensor]:
        """Network output for each item.

        Args:
            y_t: noised coefficients; leading axes are free.
            t: diffusion index, one for all or one per item.
            condition: coefficients of the padded history, same shape as y_t; None adds nothing.
            return_attention: also return the maps of the middle two blocks.
            keep: items whose condition counts; the others are unconditional.

        Returns:
            eps, shape of y_t; with `return_attention` also attention (..., 2, heads, rows, rows), each row summing to 1.
        """
        items = y_t.reshape(-1, *y_t.shape[-2:])
        added = None if condition is None else self.embed_condition(condition.reshape(items.shape))
        if added is not None and keep is not None:
            added = added * keep.reshape(-1, 1)
        out, attention = self.evaluate(items, t, added, attention_rows=len(items) if return_attention else 0)
        out = out.reshape(y_t.shape)
        return out if attention is None else (out, attention.reshape(*y_t.shape[:-2], *attention.shape[1:]))

    def embed_condition(self, condition: Float[Tensor, "B rows columns"]) -> Embedding:
        """The condition's share of the embedding; samples of one window can share it."""
        if self.condition is None:
            raise ValueError("the network was built without a layer for a condition; expected none")
        return self.condition(condition.flatten(-2))

    def embed_time(self, t: Int[Tensor, ...] | int) -> Embedding:
        """Sinusoids of the diffusion index, cosines first, through a two-layer network."""
        waves = sinusoids(torch.as_tensor(t, device=self.position.device).reshape(-1), self.width).to(self.position)
        return self.time(torch.cat([waves[:, 1::2], waves[:, ::2]], dim=-1))

    def evaluate(
        self, y_t: Float[Tensor, "B rows entering"], t: Int[Tensor, ...] | int, added: Embedding | None, attention_rows: int = 0
    ) -> tuple[Float[Tensor, "B rows columns"], Tensor | None]:
        """Forward pass with the condition embedded already (zeros = unconditional), and extra columns beside the coefficients.

        Fewer rows than the network's own are its first.

        Attention (attention_rows, 2, heads, rows, rows) of the middle two blocks is worked out for the first
        `attention_rows` items only; everywhere else fused attention keeps it implicit.
        """
        emb = self.embed_time(t)
        emb = (emb if added is None else emb + added).expand(len(y_t), -1)
        h = self.enter(y_t) + self.position[: y_t.shape[-2]]
        half, skips, maps = len(self.blocks) // 2, [], []
        for i, block in enumerate(self.blocks):
            if i < half:
                skips.append(h)
            h, attention = block(h, emb, attention_rows if i in (half - 1, half) else 0)
            if attention is not None:
                maps.append(attention)
            if i >= half:
                h = h + skips.pop()
        return self.leave(h), torch.stack(maps, dim=1) if maps else None

    def numbers_per_token(self) -> int:
        """Most numbers that sampling holds for one token, counted generously: skips, a block's inside, attention maps."""
        heads, feedforward = self.sizes
        return self.width * (len(self.blocks) // 2 + 12) + 2 * feedforward + 4 * heads * self.rows
