"""Encoders of sentences and motions into one space, as Guo et al. 2022 built them, at any width.

A movement encoder makes one code of every 4 frames; a motion encoder reads the codes; a sentence encoder reads words. Their
embeddings are not normalised. Modules and parameters are named as in the published code, so that its weights fit.
"""

from pathlib import Path
from pickle import UnpicklingError
from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.rnn import pack_padded_sequence

from mwlib.networks.layers import Features, PerItem
from mwlib.settings import shown

UNIT = 4  # frames of a movement
CONTACTS = 4  # last features of a frame, which no movement encoder sees
WINDOW = 196  # frames to which Guo et al. pad every clip, of HumanML3D and of KIT-ML, before it is embedded
SLOPE = 0.2  # of the leaky rectifiers below zero

Codes = Float[Tensor, "B U C"]  # of U movements
Embeddings = Float[Tensor, "B E"]


class MovementEncoder(nn.Module):
    """One code for every 4 frames: two convolutions that halve the time, and a linear layer.

    Source: Guo et al. 2022 and its code (`MovementConvEncoder`).

    Args:
        features: D, of a frame; the last 4, contacts, are not looked at.
        hidden: channels between the convolutions.
        codes: numbers of a code.
        dropout: after each convolution.
    """

    def __init__(self, features: int, hidden: int = 512, codes: int = 512, dropout: float = 0.2) -> None:
        super().__init__()
        self.features = features
        self.main = nn.Sequential(
            nn.Conv1d(features - CONTACTS, hidden, 4, 2, 1), nn.Dropout(dropout), nn.LeakyReLU(SLOPE),
            nn.Conv1d(hidden, codes, 4, 2, 1), nn.Dropout(dropout), nn.LeakyReLU(SLOPE),
        )  # fmt: skip
        self.out_net = nn.Linear(codes, codes)
        self.apply(_xavier)

    def forward(self, x: Features) -> Codes:
        """Codes of T // 4 movements, all frames taken as they are; see `codes` for clips of unequal length."""
        return self.out_net(self.main(x[..., :-CONTACTS].transpose(1, 2)).transpose(1, 2))

    def codes(self, x: Features, lengths: PerItem, window: int = 0) -> tuple[Codes, PerItem]:
        """Codes of clips of unequal length, and how many each has: lengths // 4.

        What stands after a clip's last whole movement is taken as zeros, the mean pose. Its last movement sees two such frames.
        So neither the content of the padding nor its length changes a code. Own choice: a clip never ends without zeros after it.

        The published code pads to 196 frames. There a clip of all 196 has no zeros after it: the second convolution's own
        padding follows, not what the first one makes of zeros. `window` does so, too.

        Args:
            x: normalised features.
            lengths: frames of each.
            window: frames to which all clips are padded, a multiple of 4; 0: more than the longest has.

        Raises:
            ValueError: a clip has more whole movements than the window.
        """
        units = lengths.to(x.device) // UNIT
        if window and int(units.max()) * UNIT > window:
            raise ValueError(f"a clip has {int(lengths.max())} frames; expected at most {window} in whole movements")
        kept = torch.arange(x.shape[1], device=x.device) < UNIT * units[:, None]
        frames = window or x.shape[1] + UNIT + -x.shape[1] % UNIT
        return self(F.pad(torch.where(kept[..., None], x, 0.0), (0, 0, 0, frames - x.shape[1]))), units


class MovementDecoder(nn.Module):
    """Frames of codes, contacts included: the mirror image of `MovementEncoder`.

    Source: Guo et al. 2022 and its code (`MovementConvDecoder`).

    Args:
        features: D, of a frame.
        hidden: channels between the convolutions.
        codes: numbers of a code.
    """

    def __init__(self, features: int, hidden: int = 512, codes: int = 512) -> None:
        super().__init__()
        self.main = nn.Sequential(
            nn.ConvTranspose1d(codes, hidden, 4, 2, 1), nn.LeakyReLU(SLOPE),
            nn.ConvTranspose1d(hidden, features, 4, 2, 1), nn.LeakyReLU(SLOPE),
        )  # fmt: skip
        self.out_net = nn.Linear(features, features)
        self.apply(_xavier)

    def forward(self, codes: Codes) -> Features:
        """4 frames of each code."""
        return self.out_net(self.main(codes.transpose(1, 2)).transpose(1, 2))


class _GRU(nn.GRU):
    """A GRU that stays in training mode, which changes nothing where it has no dropout.

    cuDNN refuses to go backwards through one in evaluation mode, and a frozen critic must pass gradients to the motion.
    """

    def train(self, mode: bool = True) -> "_GRU":
        """The net, in training mode whatever is asked: see the class."""
        return super().train(True)


class MotionEncoder(nn.Module):
    """An embedding of a row of movement codes: a GRU in both directions from a learned state, and two linear layers.

    Source: Guo et al. 2022 and its code (`MotionEncoderBiGRUCo`).

    Args:
        codes: numbers of a code.
        hidden: width of the GRU.
        embedding: numbers of an embedding.
    """

    def __init__(self, codes: int = 512, hidden: int = 1024, embedding: int = 512) -> None:
        super().__init__()
        self.input_emb = nn.Linear(codes, hidden)
        self.gru = _GRU(hidden, hidden, batch_first=True, bidirectional=True)
        self.output_net = nn.Sequential(
            nn.Linear(2 * hidden, hidden), nn.LayerNorm(hidden), nn.LeakyReLU(SLOPE), nn.Linear(hidden, embedding)
        )
        self.hidden = nn.Parameter(torch.randn(2, 1, hidden))
        self.input_emb.apply(_xavier)
        self.output_net.apply(_xavier)

    def forward(self, x: Codes, lengths: PerItem) -> Embeddings:
        """Embeddings in the order given: the last states of both directions, each at its own end of a sequence's own length.

        Lengths are from 1 to L.
        """
        packed = pack_padded_sequence(self.input_emb(x), lengths.cpu(), batch_first=True, enforce_sorted=False)
        self.gru.flatten_parameters()
        _, last = self.gru(packed, self.hidden.expand(-1, len(x), -1).contiguous())
        return self.output_net(torch.cat([last[0], last[1]], dim=-1))


class SentenceEncoder(MotionEncoder):
    """An embedding of a row of word vectors, read as `MotionEncoder` reads codes.

    Source: Guo et al. 2022 and its code (`TextEncoderBiGRUCo`).

    Args:
        words: numbers of a word's vector.
        hidden: width of the GRU.
        embedding: numbers of an embedding.
        parts_of_speech: kinds of words that are read beside the vectors; 0: none.
    """

    def __init__(self, words: int = 300, hidden: int = 512, embedding: int = 512, parts_of_speech: int = 0) -> None:
        super().__init__(words, hidden, embedding)
        self.parts_of_speech = parts_of_speech
        self.pos_emb = nn.Linear(parts_of_speech, words).apply(_xavier) if parts_of_speech else None

    def forward(self, words: Float[Tensor, "B L W"], lengths: PerItem, parts: Float[Tensor, "B L P"] | None = None) -> Embeddings:
        """Embeddings in the order given; words after a sentence's own length do not matter.

        A published evaluation took the padded length for all, and scored real motions .1 too low in R-precision
        (motion-diffusion-model, issue 182).

        Args:
            words: vectors.
            lengths: words of each sentence, marks of start and end included.
            parts: one 1 among zeros for each word, where the encoder reads them.

        Raises:
            ValueError: parts of speech are missing, or not asked for.
        """
        if (parts is None) != (self.pos_emb is None):
            raise ValueError(f"parts of speech {'missing' if parts is None else 'given'}; expected the opposite of this encoder")
        vectors = words if parts is None or self.pos_emb is None else words + self.pos_emb(parts)
        return super().forward(vectors, lengths)


class PublishedEvaluator(NamedTuple):
    """Guo et al.'s networks with their weights, frozen."""

    text: SentenceEncoder
    motion: MotionEncoder
    movement: MovementEncoder


def published_weights(file: str | Path) -> PublishedEvaluator:
    """The networks of a published evaluator (``text_mot_match/model/finest.tar``), whatever their width.

    The file is a checkpoint with the state dictionaries "text_encoder", "motion_encoder" and "movement_encoder". It is read
    without running code in it. Words are 300 numbers of GloVe and one of 15 parts of speech; motions are normalised by the
    evaluator's own mean and deviation, which come beside it.

    Args:
        file: on this machine.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it does not hold these three networks.
    """
    tree = checkpoint(Path(file))
    try:
        text, motion, movement = states = [tree[f"{part}_encoder"] for part in PublishedEvaluator._fields]
        codes, features, _ = movement["main.0.weight"].shape
        made = PublishedEvaluator(
            SentenceEncoder(*_sizes(text), parts_of_speech=text["pos_emb.weight"].shape[1]),
            MotionEncoder(*_sizes(motion)),
            MovementEncoder(features + CONTACTS, codes, len(movement["out_net.weight"])),
        )
        for network, state in zip(made, states, strict=True):
            network.load_state_dict(state)
            network.eval().requires_grad_(False)
    except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:  # whatever stands there instead
        wanted = "text_encoder, motion_encoder and movement_encoder of Guo et al."
        raise ValueError(f"{file} holds {shown(tree)}, where {error} is amiss; expected {wanted}") from None
    return made


def checkpoint(file: Path) -> Any:
    """What torch's checkpoint holds, if that is tensors, numbers and texts alone; nothing in it is run.

    Raises:
        ValueError: it holds something else, or is no checkpoint.
    """
    try:
        return torch.load(file, map_location="cpu", weights_only=True)
    except (UnpicklingError, RuntimeError, EOFError) as error:
        found = f"{file} is refused ({str(error).partition(chr(10))[0][:120]})"
        raise ValueError(f"{found}; expected a checkpoint of tensors and numbers alone") from None


def _sizes(state: dict[str, Tensor]) -> tuple[int, int, int]:
    """Inputs, width and embedding of a reader."""
    hidden, inputs = state["input_emb.weight"].shape
    return inputs, hidden, len(state["output_net.3.weight"])


def _xavier(module: nn.Module) -> None:
    """First weights of linear layers and convolutions as in the published code."""
    if isinstance(module, nn.Conv1d | nn.Linear | nn.ConvTranspose1d):
        nn.init.xavier_normal_(module.weight)
        nn.init.zeros_(module.bias)  # pyright: ignore[reportArgumentType]  (all have one)
