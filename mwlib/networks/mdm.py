"""MDM: the transformer encoder of the Motion Diffusion Model, which estimates the clean motion from a sentence."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from mwlib.networks.layers import Dropout, Dropped, Encoder, Features, PerItem, Valid, placed, sinusoids, zero_linear, zeroed
from mwlib.networks.text import EncodedText


class FrameDetail(nn.Module):
    """A clean estimate, corrected frame by frame by what the frame and its neighbours looked like before.

    Own choice: where several frames share a token the estimate loses detail even at hardly any noise, when the frames themselves
    still show it. Zero before it is trained.

    Args:
        features: numbers per frame.
        steps: length of the diffusion schedule.
        width: channels.
    """

    def __init__(self, features: int, steps: int, width: int) -> None:
        super().__init__()
        self.enter, self.time = nn.Linear(2 * features, width), zeroed(nn.Embedding(steps, width))
        self.around = nn.Conv1d(width, width, 7, padding=3, groups=width)
        self.mix, self.leave = nn.Linear(width, width), zero_linear(width, features)

    def forward(self, y_t: Features, y0_hat: Features, t: PerItem, seen: Valid) -> Features:
        """The estimate and its correction; `seen` says which frames neighbours look at."""
        h = F.silu(self.enter(torch.cat([y_t, y0_hat], -1)) + self.time(t)[:, None]) * seen[..., None]
        h = h + F.silu(self.mix(self.around(h.mT).mT))
        return y0_hat + self.leave(h)


class MDM(nn.Module):
    """Clean motion features from noised ones, the diffusion index and a sentence.

    Source: Tevet et al. 2022, Human Motion Diffusion Model, and its code ("trans_enc"). One token per frame, and in front of them
    one token that is the embedded time plus the embedded sentence; sinusoidal places; norm after each part; the network says y0.
    Only the sentence's vector is read, not its tokens. A dropped sentence is a vector of zeros (classifier-free guidance).

    Args:
        features: numbers per frame, D (HumanML3D 263, KIT 251).
        steps: length of the diffusion schedule; t is below it.
        width: numbers per token inside the network.
        layers, heads, feedforward: of the transformer.
        dropout: everywhere in it, and behind the places.
        text_width: numbers of a sentence's vector.
        mask_frames: whether frames look at valid frames only. False is the code as first released, where they look at padding,
            too; its later flag of this name improves the scores.
        frames_per_token: neighbouring frames that make one token together. Own choice, for teaching: attention over a quarter of
            the tokens trains several times faster. Where frames are masked, a last token that is valid in part has zeros in the
            rest.
        attention_dropout: on the attention weights; None = `dropout`, as published. Own choice for the CPU: 0, without which
            training forgoes fused attention.
        detail: channels of a `FrameDetail` behind it all; 0 = none, as published.

    Raises:
        ValueError: `width` is not an even multiple of `heads`.
    """

    def __init__(
        self,
        features: int,
        steps: int,
        width: int = 512,
        layers: int = 8,
        heads: int = 4,
        feedforward: int = 1024,
        dropout: float = 0.1,
        text_width: int = 512,
        mask_frames: bool = True,
        frames_per_token: int = 1,
        attention_dropout: float | None = None,
        detail: int = 0,
    ) -> None:
        super().__init__()
        self.frames_per_token, self.mask_frames = frames_per_token, mask_frames
        self.enter = nn.Linear(frames_per_token * features, width)
        self.time = nn.Sequential(nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width))
        self.text = nn.Linear(text_width, width)
        self.dropout = Dropout(dropout)
        self.encoder = Encoder(width, layers, heads, feedforward, dropout, attention_dropout)
        self.leave = nn.Linear(width, frames_per_token * features)
        self.detail = FrameDetail(features, steps, detail) if detail else None
        self.times: Tensor
        self.register_buffer("times", sinusoids(torch.arange(steps), width), persistent=False)

    def forward(self, y_t: Features, t: PerItem, mask: Valid, text: EncodedText, drop: Dropped | None = None) -> Features:
        """Clean estimate; what it says of frames that are not valid means nothing.

        Args:
            y_t: noised features.
            t: diffusion index, 0 <= t < steps.
            mask: True = a valid frame; these come first in each row, and there is at least one.
            text: sentences; `pooled` is read.
            drop: samples that are told no sentence; None = none of them.
        """
        frames, size = y_t.shape[1], self.frames_per_token
        if self.mask_frames:
            y_t = y_t.masked_fill(~mask[..., None], 0.0)
        missing = -frames % size
        tokens = F.pad(y_t, (0, 0, 0, missing)).unflatten(1, (-1, size)).flatten(-2)
        valid = F.pad(mask, (0, missing)).unflatten(1, (-1, size)).any(-1)
        condition = self.condition(t, text, drop)[:, None]
        x = torch.cat([condition, self.enter(tokens)], dim=1)
        x = self.dropout(placed(x))
        seen = F.pad(valid, (1, 0), value=True) if self.mask_frames else None  # the condition is always seen
        y0_hat = self.leave(self.encoder(x, seen)[:, 1:]).unflatten(-1, (size, -1)).flatten(1, 2)[:, :frames]
        return y0_hat if self.detail is None else self.detail(y_t, y0_hat, t, mask | (not self.mask_frames))

    def condition(self, t: PerItem, text: EncodedText, drop: Dropped | None = None) -> Float[Tensor, "B width"]:
        """The token in front of the frames: time plus sentence."""
        pooled = text.pooled if drop is None else text.pooled.masked_fill(drop[:, None], 0.0)
        return self.time(self.times[t]) + self.text(pooled)
