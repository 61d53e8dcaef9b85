"""A denoiser together with what reads the sentences for it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from mwlib.networks.clip_text import ClipText
from mwlib.networks.mdm import MDM
from mwlib.networks.text import EncodedText, HashedNgrams, TextEncoder, WordTransformer
from mwlib.networks.unet1d import ConditionalUNet
from mwlib.text_to_motion.config import ModelConfig

FORGET = 0.02  # share of the words that training hides, so that unknown ones mean something: own choice


class TextDenoiser(nn.Module):
    """(y_t, t, sentences) -> the clean motion.

    Args:
        cfg: sizes and kinds.
        features: D.
        steps: M, of the diffusion.
        vocabulary: words that the text encoder "words" learns.
    """

    def __init__(self, cfg: ModelConfig, features: int, steps: int, vocabulary: Sequence[str]) -> None:
        super().__init__()
        self.text = make_text(cfg, vocabulary)
        width = self.text.width
        if cfg.network == "mdm":
            self.body: nn.Module = MDM(
                features, steps, cfg.width, cfg.layers, cfg.heads, cfg.feedforward, cfg.dropout, text_width=width,
                mask_frames=cfg.mask_frames, frames_per_token=cfg.frames_per_token, attention_dropout=cfg.attention_dropout,
            )  # fmt: skip
        else:
            self.body = ConditionalUNet(
                features, steps, cfg.width, cfg.multipliers, width, dropout=cfg.dropout, mask_frames=cfg.mask_frames
            )

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return next(self.parameters()).device

    def encode(self, texts: Sequence[str]) -> EncodedText:
        """Sentences as the denoiser wants them."""
        return self.text.encode(texts)

    def forward(
        self,
        y_t: Float[Tensor, "B T D"],
        t: Int[Tensor, " B"],
        mask: Bool[Tensor, "B T"],
        text: EncodedText | Sequence[str],
        drop: Bool[Tensor, " B"] | None = None,
    ) -> Float[Tensor, "B T D"]:
        """The clean motion, normalised; samples with `drop` do not see their sentence."""
        encoded = text if isinstance(text, EncodedText) else self.encode(text)
        return self.body(y_t, t, mask, encoded, drop)


def make_text(cfg: ModelConfig, vocabulary: Sequence[str]) -> TextEncoder:
    """The untrained text encoder that a configuration names; CLIP's weights come from their file.

    CLIP reads 20 tokens for MDM and 75 for the U-Net, which sees the padding, too: as published for each of them.

    Raises:
        FileNotFoundError, ImportError: as `ClipText`.
    """
    if cfg.text == "clip":
        return ClipText(cfg.clip_folder, longest=75, padded=True) if cfg.network == "unet" else ClipText(cfg.clip_folder)
    if cfg.text == "ngrams":
        return HashedNgrams(width=cfg.text_width, layers=cfg.text_layers, heads=cfg.heads, dropout=cfg.dropout)
    return WordTransformer(vocabulary, cfg.text_width, cfg.text_layers, cfg.heads, cfg.dropout, forget=FORGET)
