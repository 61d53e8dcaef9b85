"""Files that are whole or not there: write to a temporary name, flush, rename."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


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
            try:
                _write(parts[file], content if isinstance(content, bytes) else content.encode())
            except OSError as error:  # a full disk names no file
                raise OSError(error.errno, error.strerror or str(error), str(file)) from None
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
