"""Layers that several networks are built of: dropout, sinusoids, a transformer encoder; and the precision of their products."""

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from copy import deepcopy
from typing import Literal, TypeVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

Features = Float[Tensor, "B T D"]  # of T frames
Valid = Bool[Tensor, "B T"]  # which of them a motion has
PerItem = Int[Tensor, " B"]  # lengths, or diffusion indices
Dropped = Bool[Tensor, " B"]  # which motions are not told their sentence
Tokens = Float[Tensor, "B L width"]
Layer = TypeVar("Layer", bound=nn.Module)


class Dropout(nn.Module):
    """Drop elements with probability p and scale the rest by 1/(1-p).

    Own choice: torch draws one double for every element on the CPU, a quarter of a training step here; this draws
    one byte, so p is rounded to the next of 256ths there. On a GPU it is torch's own.

    Args:
        p: probability, 0 to below 1.
    """

    def __init__(self, p: float) -> None:
        super().__init__()
        self.p, self.dropped = p, round(256 * p)

    def forward(self, x: Tensor) -> Tensor:
        """The identity when not training."""
        if not self.training or self.dropped == 0:
            return x
        if x.device.type != "cpu":
            return F.dropout(x, self.p)
        words = torch.randint(-(2**63), 2**63 - 1, (x.numel() // 8 + 1,))
        kept = words.view(torch.uint8)[: x.numel()].reshape(x.shape) >= self.dropped
        return x * kept.to(x.dtype).mul_(256 / (256 - self.dropped))


def zeroed(layer: Layer) -> Layer:
    """A layer that says zero before it is trained."""
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer


def zero_linear(inputs: int, outputs: int) -> nn.Linear:
    """A linear layer that says zero before it is trained."""
    return zeroed(nn.Linear(inputs, outputs))


def check_width(width: int, heads: int, name: str = "width") -> None:
    """Refuse tokens of a width that cannot be shared among heads, or halved.

    Raises:
        ValueError: `width` is not an even multiple of `heads`.
    """
    if width % heads or width % 2:
        raise ValueError(f"{name} is {width}; expected an even multiple of heads ({heads})")


def attend(
    qkv: Float[Tensor, "B L three_widths"], heads: int, dropout: float, mask: Bool[Tensor, "B L"] | None = None
) -> tuple[Tokens, Tensor, Tensor]:
    """What fused attention makes of queries, keys and values side by side; and queries and keys, (B, heads, L, width/heads).

    Args:
        qkv: the three for each token.
        heads: among which each is shared.
        dropout: of the weights.
        mask: True = a token that others may look at; None = all of them.
    """
    q, k, v = qkv.unflatten(-1, (3, heads, -1)).permute(2, 0, 3, 1, 4)
    seen = None if mask is None else mask[:, None, None]
    return F.scaled_dot_product_attention(q, k, v, attn_mask=seen, dropout_p=dropout).transpose(1, 2).flatten(-2), q, k


Precision = Literal["float32", "tf32", "bf16"]


@contextmanager
def products_in(precision: Precision, device: torch.device) -> Iterator[None]:
    """Products of matrices in this precision, until the block ends.

    Args:
        precision: "float32" leaves everything as it is; "tf32" multiplies 10-bit mantissas on graphics cards that can;
            "bf16" is torch's autocast: 7-bit mantissas, faster on new cards and processors.
        device: where the network is.

    >>> with products_in("bf16", torch.device("cpu")):
    ...     (torch.ones(2, 2) @ torch.ones(2, 2)).dtype
    torch.bfloat16
    """
    before = torch.get_float32_matmul_precision()
    try:
        if precision == "tf32":
            torch.set_float32_matmul_precision("high")
        with torch.autocast(device.type, torch.bfloat16) if precision == "bf16" else nullcontext():
            yield
    finally:
        torch.set_float32_matmul_precision(before)


def sinusoids(index: Int[Tensor, " n"], width: int) -> Float[Tensor, "n width"]:
    """Embedding of whole numbers (a place in a sequence, a diffusion index): sines in even columns, cosines in odd ones.

    Source: Vaswani et al. 2017, Sec. 3.5; the code of MDM and StableMoFusion takes it for places and times.

    Args:
        index: the numbers.
        width: columns, even.

    >>> sinusoids(torch.tensor([0, 1]), 2)
    tensor([[0.0000, 1.0000],
            [0.8415, 0.5403]])
    """
    speed = torch.exp(torch.arange(0, width, 2, device=index.device) * (-math.log(10_000) / width))
    angle = index[:, None].float() * speed
    return torch.stack([angle.sin(), angle.cos()], dim=-1).flatten(-2)


def placed(x: Tokens) -> Tokens:
    """Tokens plus the sinusoids of their places."""
    return x + sinusoids(torch.arange(x.shape[1], device=x.device), x.shape[2]).to(x)


class _Layer(nn.TransformerEncoderLayer):
    """torch's layer, norm after each part, with fused attention and `Dropout`, both faster on the CPU; the weights are torch's.

    Args:
        width, heads, feedforward, dropout: as in `Encoder`.
        attention_dropout: on the attention weights.
    """

    def __init__(self, width: int, heads: int, feedforward: int, dropout: float, attention_dropout: float) -> None:
        super().__init__(width, heads, feedforward, attention_dropout, "gelu", batch_first=True)
        self.after = Dropout(dropout)

    def forward(  # pyright: ignore[reportIncompatibleMethodOverride]  (no mask but that of padding)
        self, x: Tokens, mask: Bool[Tensor, "B L"] | None
    ) -> Tokens:
        """Tokens after the layer; the mask is that of `attend`."""
        attention = self.self_attn
        qkv = F.linear(x, attention.in_proj_weight, attention.in_proj_bias)
        mixed, *_ = attend(qkv, attention.num_heads, attention.dropout if self.training else 0.0, mask)
        x = self.norm1(x + self.after(attention.out_proj(mixed)))
        return self.norm2(x + self.after(self.linear2(self.after(F.gelu(self.linear1(x))))))


class Encoder(nn.Module):
    """torch's TransformerEncoder as MDM and StableMoFusion set it up: norm after each part, GELU; with a mask of tokens.

    Args:
        width: numbers per token, an even multiple of `heads`.
        layers: number of layers; 0 gives the tokens back as they are.
        heads: attention heads.
        feedforward: width of the hidden feed-forward layer.
        dropout: behind every part.
        attention_dropout: on the attention weights; None = `dropout`. On the CPU anything but 0 forgoes fused attention.

    Raises:
        ValueError: `width` is not an even multiple of `heads`.
    """

    def __init__(
        self, width: int, layers: int, heads: int, feedforward: int, dropout: float, attention_dropout: float | None = None
    ) -> None:
        super().__init__()
        check_width(width, heads)
        layer = _Layer(width, heads, feedforward, dropout, dropout if attention_dropout is None else attention_dropout)
        self.stack = nn.ModuleDict({"layers": nn.ModuleList(deepcopy(layer) for _ in range(layers))})  # named as torch's

    def forward(self, x: Tokens, mask: Bool[Tensor, "B L"] | None) -> Tokens:
        """Tokens after all layers.

        Args:
            x: tokens.
            mask: True = a token that others may look at, at least one per row; None = all of them.
        """
        for layer in self.stack["layers"].children():
            x = layer(x, mask)
        return x
