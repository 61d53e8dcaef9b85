"""Tensors and text in one safetensors file that knows its own SHA-256."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from mwlib.files import write_atomic


class DamagedFileError(ValueError):
    """A file that this library wrote does not hold what was written: truncated, flipped, or another kind of file."""


def save_tensors(file: Path, tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> None:
    """Tensors and text to one safetensors file, atomically. No code can hide in it, and the same content gives the same bytes."""
    whole = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in sorted(tensors.items())}
    text = json.dumps(dict(metadata), sort_keys=True)
    # one entry, as safetensors writes several in random order
    write_atomic(file, save(whole, {"mwlib": json.dumps([text, _sha256(whole, text)])}))


def load_tensors(file: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Inverse of `save_tensors`, onto the CPU.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is truncated or changed; or not written by this library, or by a version before 0.2.
    """
    try:
        with safe_open(file, framework="pt") as handle:
            tensors = {name: handle.get_tensor(name) for name in sorted(handle.keys())}
    except SafetensorError as error:
        raise DamagedFileError(f"{file} is damaged: {error}; expected a whole file as mwlib wrote it") from None
    text, expected = _said(file)
    found = _sha256(tensors, text)
    if found != expected:
        raise DamagedFileError(f"{file} is damaged: its content has SHA-256 {found[:12]}…; expected {expected[:12]}…")
    return tensors, json.loads(text)


def load_metadata(file: Path) -> dict[str, str]:
    """The text of a tensor file alone, unchecked.

    Raises:
        FileNotFoundError, DamagedFileError: as in `load_tensors`.
    """
    return json.loads(_said(file)[0])


def _said(file: Path) -> tuple[str, str]:
    """Text and SHA-256 in a file's head."""
    try:
        with safe_open(file, framework="pt") as handle:
            text, expected = json.loads((handle.metadata() or {})["mwlib"])
    except (SafetensorError, KeyError, ValueError, TypeError):
        raise DamagedFileError(
            f"{file} has no SHA-256 of mwlib's in its head; expected a file written by mwlib 0.2 or later"
        ) from None
    return text, expected


def _sha256(tensors: Mapping[str, Tensor], text: str) -> str:
    digest = hashlib.sha256(text.encode())
    for name, tensor in tensors.items():
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
