"""The text tower of CLIP ViT-B/32, frozen, from files that the user has fetched."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Int
from torch import Tensor, nn

from mwlib.networks.text import EncodedText, TextEncoder

CONTEXT = 77  # tokens of CLIP, start and end included
SOURCE = "https://huggingface.co/openai/clip-vit-base-patch32"
FILES = (("config.json",), ("model.safetensors", "pytorch_model.bin"), ("tokenizer.json", "vocab.json"))  # one of each


class _Tower:
    """Weights that many copies of an encoder share, and that no optimiser, average or checkpoint meets."""

    def __init__(self, network: Any, tokenizer: Any) -> None:
        self.network, self.tokenizer = network, tokenizer
        self.known: dict[str, tuple[Tensor, Tensor]] = {}  # sentence -> its tokens and vector, on the CPU

    def __deepcopy__(self, memo: dict[int, Any]) -> _Tower:
        return self


class ClipText(TextEncoder):
    """Sentences by the text tower of CLIP ViT-B/32, which does not learn and is no part of a checkpoint: the folder is needed.

    `pooled` is the projected output at the end token, as MDM takes it; `tokens` are the outputs after the last norm, before the
    projection, as StableMoFusion takes them. A token of CLIP sees those before it only, so that padding changes neither.

    Source: Radford et al. 2021; the code of MDM (20 tokens between start and end) and of StableMoFusion (75, and its denoiser
    attends to the padding, too). Own choice: padding is masked unless asked for.

    Args:
        folder: holds the files of https://huggingface.co/openai/clip-vit-base-patch32.
        longest: tokens between start and end that are kept; 20 as MDM, 75 as StableMoFusion.
        padded: give all 77 places as tokens, padding as CLIP encodes it, as StableMoFusion does.
        keep: sentences whose vectors are held, as the tower is slow on a CPU (12 layers) and never changes.

    Raises:
        ImportError: the library is missing; the message says how to install it.
        FileNotFoundError: a file is missing; the message says where to get it and where to put it.
        ValueError: `longest` is not 1 to 75, or the folder holds another tower or lacks weights.
    """

    def __init__(self, folder: str | Path, longest: int = 20, padded: bool = False, keep: int = 10_000) -> None:
        super().__init__()
        if not 1 <= longest <= CONTEXT - 2:
            raise ValueError(f"longest is {longest}; expected 1 to {CONTEXT - 2} tokens between start and end")
        self.longest, self.padded, self.keep = longest, padded, keep
        self._tower = _opened(_library(), _complete(Path(folder)))
        config = self._tower.network.config
        self.width = int(config.hidden_size)
        if config.projection_dim != self.width:
            found = f"{self.width} numbers per token and {config.projection_dim} per sentence"
            raise ValueError(f"{folder} holds a tower of {found}; expected that of ViT-B/32, 512 and 512")

    def _apply(self, fn: Any, recurse: bool = True) -> ClipText:
        self._tower.network._apply(fn, recurse)  # .to(device) moves the tower
        return super()._apply(fn, recurse)

    def ids(self, texts: Sequence[str]) -> list[list[int]]:
        """Numbers of CLIP's tokens: start, at most `longest` others, end."""
        return self._tower.tokenizer(list(texts), truncation=True, max_length=self.longest + 2)["input_ids"]

    def encode(self, texts: Sequence[str]) -> EncodedText:
        """Vectors of sentences, on the device of the tower.

        Raises:
            ValueError: a single string instead of several, or none.
        """
        if isinstance(texts, str) or not texts:
            raise ValueError(f"texts is {texts!r}; expected a sequence of at least one sentence")
        known = self._tower.known
        found = {text: known[text] for text in texts if text in known}
        if new := list(dict.fromkeys(text for text in texts if text not in found)):
            found |= self._encode_new(new)
        for text in new:
            if len(known) >= self.keep > 0:
                del known[next(iter(known))]  # the one that came first
            if self.keep:
                known[text] = found[text]
        tokens = nn.utils.rnn.pad_sequence([found[text][0] for text in texts], batch_first=True)
        lengths = torch.tensor([len(found[text][0]) for text in texts])
        mask = torch.arange(tokens.shape[1]) < lengths[:, None]
        device = next(self._tower.network.parameters()).device
        return EncodedText(tokens.to(device), mask.to(device), torch.stack([found[text][1] for text in texts]).to(device))

    @torch.no_grad()
    def _encode_new(self, texts: Sequence[str]) -> dict[str, tuple[Tensor, Tensor]]:
        rows = self.ids(texts)
        length = CONTEXT if self.padded else max(map(len, rows))
        numbers: Int[Tensor, "B L"] = torch.tensor([row + [0] * (length - len(row)) for row in rows])  # padded as by OpenAI
        out = self._tower.network(input_ids=numbers.to(next(self._tower.network.parameters()).device))
        tokens, pooled = out.last_hidden_state.cpu(), out.text_embeds.cpu()
        kept = [length if self.padded else len(row) for row in rows]
        return {text: (tokens[i, :n].clone(), pooled[i].clone()) for i, (text, n) in enumerate(zip(texts, kept, strict=True))}


def _library() -> Any:
    try:
        return importlib.import_module("transformers")
    except ImportError as error:
        raise ImportError(
            "CLIP's text tower needs the library transformers, which is not installed; "
            "install it with: pip install 'motion-wavelet-notebooks[clip]'"
        ) from error


def _opened(library: Any, folder: Path) -> _Tower:
    """Tower and tokenizer, from files alone, without the library's bar and its list of weights that are CLIP's other half."""
    logging = library.utils.logging
    level, had_bar = logging.get_verbosity(), logging.is_progress_bar_enabled()
    logging.set_verbosity_error()
    logging.disable_progress_bar()
    try:
        network, about = library.CLIPTextModelWithProjection.from_pretrained(
            folder, local_files_only=True, output_loading_info=True
        )
        tokenizer = library.CLIPTokenizer.from_pretrained(folder, local_files_only=True)
    finally:
        logging.set_verbosity(level)
        if had_bar:
            logging.enable_progress_bar()
    if missing := sorted(about["missing_keys"]):
        raise ValueError(f"{folder} has no weights for {missing[0]}, one of {len(missing)}; expected CLIP ViT-B/32 from {SOURCE}")
    return _Tower(network.float().eval().requires_grad_(False), tokenizer)


def _complete(folder: Path) -> Path:
    """The folder, which has all files."""
    missing = [" or ".join(names) for names in FILES if not any((folder / name).is_file() for name in names)]
    if missing:
        raise FileNotFoundError(
            f"{folder} has no {', no '.join(missing)}; expected CLIP ViT-B/32: fetch config.json, model.safetensors (or "
            f"pytorch_model.bin), vocab.json, merges.txt and tokenizer.json from {SOURCE} into that folder"
        )
    return folder
