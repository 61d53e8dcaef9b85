"""Files that are whole or not there: write to a temporary name, flush, rename."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor


def write_atomic(file: Path, content: bytes | str) -> None:
    """Write a file so that a crash at any moment leaves the old one or the new one."""
    content = content if isinstance(content, bytes) else content.encode()
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    with open(part, "wb") as handle:
        handle.write(content)
        handle.flush()
        os.fsync(handle.fileno())
    os.replace(part, file)


def write_json(file: Path, tree: Any) -> None:
    """`write_atomic` for JSON."""
    write_atomic(file, json.dumps(tree, indent=1))


def save_tensors(file: Path, tensors: dict[str, Tensor], metadata: dict[str, str]) -> None:
    """Tensors and text to one safetensors file, atomically. No code can hide in it."""
    whole = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    write_atomic(file, save(whole, metadata))


def load_tensors(file: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Inverse of `save_tensors`, onto the CPU."""
    with safe_open(file, framework="pt") as handle:
        return {name: handle.get_tensor(name) for name in handle.keys()}, handle.metadata() or {}
