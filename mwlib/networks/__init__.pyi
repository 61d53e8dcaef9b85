from .mdm import MDM
from .text import ClipText, EncodedText, HashedNgrams, TextEncoder, WordTransformer, vocabulary_of, words_of
from .translinear import TransLinear
from .unet1d import ConditionalUNet

__all__ = [
    "ClipText", "ConditionalUNet", "EncodedText", "HashedNgrams", "MDM", "TextEncoder", "TransLinear", "WordTransformer",
    "vocabulary_of", "words_of",
]  # fmt: skip
