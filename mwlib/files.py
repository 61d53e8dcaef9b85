"""Files that are whole or not there: write to a temporary name, flush, rename. Tensor files know their own SHA-256."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor


class DamagedFileError(ValueError):
    """A file that this library wrote does not hold what was written: truncated, flipped, or another kind of file."""


def write_atomic(file: Path, content: bytes | str) -> None:
    """Write a file so that a crash at any moment leaves the old one or the new one."""
    write_together({file: content})


def write_together(contents: Mapping[Path, bytes | str]) -> None:
    """Write several files that belong together; the last one is the proof that the others are there.

    All contents reach the disk under temporary names before the first old file changes; then the old proof is removed, and the
    new files take their names in order. A failure before that, such as a full disk, leaves every old file, and no temporary one.
    """
    parts: dict[Path, Path] = {}
    try:
        for file, content in contents.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            parts[file] = file.with_name(f".{file.name}.{os.getpid()}.part")
            _write(parts[file], content if isinstance(content, bytes) else content.encode())
        *others, proof = contents
        if others:
            proof.unlink(missing_ok=True)
        for file in contents:
            os.replace(parts[file], file)
            del parts[file]
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)


def _write(file: Path, content: bytes) -> None:
    with open(file, "wb") as handle:
        handle.write(content)
        handle.flush()
        os.fsync(handle.fileno())


def sweep(folder: Path) -> None:
    """Remove temporary files that killed processes left in a folder; for whoever holds the folder's lock, or owns it."""
    for part in folder.glob(".*.part"):
        part.unlink(missing_ok=True)


def write_json(file: Path, tree: Any) -> None:
    """`write_atomic` for JSON."""
    write_atomic(file, json.dumps(tree, indent=1))


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
