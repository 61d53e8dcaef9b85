"""TransLinear: HumanMAC's transformer denoiser, which MotionWavelet takes over."""

from __future__ import annotations

import math

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from .dropout import Dropout


def _zero_linear(inputs: int, outputs: int) -> nn.Linear:
    layer = nn.Linear(inputs, outputs)
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


class Stylize(nn.Module):
    """Scale and shift a normalised stream by the time-and-condition embedding; starts as zero."""

    def __init__(self, latent: int, dropout: float) -> None:
        super().__init__()
        self.film = nn.Linear(latent, 2 * latent)
        self.norm = nn.LayerNorm(latent)
        self.dropout = Dropout(dropout)
        self.out = _zero_linear(latent, latent)

    def forward(self, h: Float[Tensor, "B K D"], emb: Float[Tensor, "B D"]) -> Float[Tensor, "B K D"]:
        scale, shift = self.film(F.silu(emb)).unsqueeze(-2).chunk(2, dim=-1)
        return self.out(self.dropout(F.silu(torch.addcmul(shift, self.norm(h), 1 + scale))))


class Block(nn.Module):
    """Self-attention and feed-forward, each added back through a `Stylize`."""

    def __init__(self, latent: int, heads: int, feedforward: int, dropout: float, attention_dropout: float) -> None:
        super().__init__()
        self.heads, self.attention_dropout, self.dropout = heads, attention_dropout, Dropout(dropout)
        self.norm = nn.LayerNorm(latent)
        self.qkv = nn.Linear(latent, 3 * latent, bias=False)  # one product for the three projections
        self.style_attention = Stylize(latent, dropout)
        self.up = nn.Linear(latent, feedforward)
        self.down = _zero_linear(feedforward, latent)
        self.style_feedforward = Stylize(latent, dropout)

    def forward(self, x: Float[Tensor, "B K D"], emb: Float[Tensor, "B D"], attention_rows: int) -> tuple[Tensor, Tensor | None]:
        q, k, v = self.qkv(self.norm(x)).unflatten(-1, (3, self.heads, -1)).permute(2, 0, 3, 1, 4)  # (B, heads, K, D/heads)
        p = self.attention_dropout if self.training else 0.0
        mixed = F.scaled_dot_product_attention(q, k, v, dropout_p=p).transpose(1, 2).flatten(-2)  # (B, K, D)
        x = x + self.style_attention(mixed, emb)
        x = x + self.style_feedforward(self.down(self.dropout(F.gelu(self.up(x)))), emb)
        if not attention_rows:
            return x, None
        q, k = q[:attention_rows], k[:attention_rows]
        return x, torch.softmax(q @ k.transpose(-1, -2) / math.sqrt(q.shape[-1]), dim=-1)


class TransLinear(nn.Module):
    """Predict the noise in a latent from the latent, the diffusion index and, optionally, a condition.

    Source: HumanMAC's MotionTransformer, as MotionWavelet's Appendix A sizes it. One token per latent row; the
    flattened condition is one linear layer added to the time embedding; no condition adds nothing.

    Args:
        frames: number of latent rows K.
        channels: number of latent columns (4D for one wavelet level).
        latent: width D of the network.
        layers: number of blocks, even: the first half is added back to the second half (long skips).
        heads: attention heads.
        feedforward: width of the hidden feed-forward layer.
        dropout: in feed-forward and Stylize.
        attention_dropout: on the attention weights; None = `dropout`. On the CPU anything but 0 forgoes fused attention.

    Raises:
        ValueError: odd `layers`, or `latent` not an even multiple of `heads`.
    """

    def __init__(
        self,
        frames: int,
        channels: int,
        latent: int,
        layers: int,
        heads: int,
        feedforward: int,
        dropout: float,
        attention_dropout: float | None = None,
    ) -> None:
        super().__init__()
        if layers % 2:
            raise ValueError(f"layers is {layers}; expected an even number (long skips pair the blocks)")
        if latent % heads or latent % 2:
            raise ValueError(f"latent is {latent}; expected an even multiple of heads ({heads})")
        self.frames, self.channels, self.latent = frames, channels, latent
        self.time = nn.Sequential(nn.Linear(latent, latent), nn.SiLU(), nn.Linear(latent, latent))
        self.condition = nn.Linear(channels * frames, latent)
        self.enter = nn.Linear(channels, latent)
        self.position = nn.Parameter(torch.randn(frames, latent))
        attention_dropout = dropout if attention_dropout is None else attention_dropout
        self.blocks = nn.ModuleList(Block(latent, heads, feedforward, dropout, attention_dropout) for _ in range(layers))
        self.leave = _zero_linear(latent, channels)

    def forward(
        self,
        y_t: Float[Tensor, "... K C"],
        t: Int[Tensor, ...] | int,
        condition: Float[Tensor, "... K C"] | None = None,
        return_attention: bool = False,
        keep: Bool[Tensor, ...] | None = None,
    ) -> Tensor | tuple[Tensor, Tensor]:
        """Network output for each latent.

        Args:
            y_t: noised latents; leading axes are free.
            t: diffusion index, one for all or one per latent.
            condition: latent of the padded history, same shape as y_t; None adds nothing.
            return_attention: also return the maps of the middle two blocks.
            keep: latents whose condition counts; the others are unconditional.

        Returns:
            eps, shape of y_t; with `return_attention` also attention (..., 2, heads, K, K), rows summing to 1 over keys.
        """
        lead = y_t.shape[:-2]
        rows = y_t.reshape(-1, *y_t.shape[-2:])
        t = t.reshape(-1) if isinstance(t, Tensor) else t
        added = None if condition is None else self.embed_condition(condition.reshape(rows.shape))
        if added is not None and keep is not None:
            added = added * keep.reshape(-1, 1)
        out, attention = self.evaluate(rows, t, added, attention_rows=len(rows) if return_attention else 0)
        out = out.reshape(y_t.shape)
        return (out, attention.reshape(*lead, *attention.shape[1:])) if return_attention else out

    def embed_condition(self, condition: Float[Tensor, "B K C"]) -> Float[Tensor, "B D"]:
        """The condition's share of the embedding; samples of one window can share it."""
        return self.condition(condition.flatten(-2))

    def embed_time(self, t: Int[Tensor, " B"] | int) -> Float[Tensor, "B D"]:
        """Sinusoids of the diffusion index, cosines first, through a two-layer network."""
        half = self.latent // 2
        weight = self.time[0].weight
        speed = torch.exp(torch.arange(half, device=weight.device) * (-math.log(10_000) / half))
        angle = torch.as_tensor(t, device=weight.device, dtype=torch.float32).reshape(-1, 1) * speed
        return self.time(torch.cat([angle.cos(), angle.sin()], dim=-1).to(weight.dtype))

    def evaluate(
        self, y_t: Float[Tensor, "B K C"], t: Int[Tensor, " B"] | int, added: Float[Tensor, "B D"] | None, attention_rows: int = 0
    ) -> tuple[Float[Tensor, "B K C"], Tensor | None]:
        """Forward pass with the condition already embedded (zeros = unconditional).

        Attention (attention_rows, 2, heads, K, K) of the middle two blocks is worked out for the first
        `attention_rows` latents only; everywhere else fused attention keeps it implicit.
        """
        emb = self.embed_time(t)
        emb = (emb if added is None else emb + added).expand(len(y_t), -1)
        h = self.enter(y_t) + self.position
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
