"""Denoisers of all systems, and encoders of sentences."""

from mwlib.networks.mdm import MDM
from mwlib.networks.text import ClipText, EncodedText, HashedNgrams, TextEncoder, WordTransformer, vocabulary_of, words_of
from mwlib.networks.translinear import TransLinear
from mwlib.networks.unet1d import ConditionalUNet

__all__ = [
    "MDM", "ClipText", "ConditionalUNet", "EncodedText", "HashedNgrams", "TextEncoder", "TransLinear", "WordTransformer",
    "vocabulary_of", "words_of",
]  # fmt: skip
