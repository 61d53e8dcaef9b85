"""What a result depends on, as hashes: the files of its data, the sources of the library, the models that were used."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from pathlib import Path

import torch

from mwlib.data.collections import named_source
from mwlib.data.load import READERS, find_source
from mwlib.data.meaning import LEVELS_UP
from mwlib.data.untrusted import bare_suffix
from mwlib.hashing import file_hash, sha256

HINTS = ("clips.csv", "skeleton.json")  # read along with motions that lie beside or below them

# Name of the run -> SHA-256 of its model: every one that this process has asked for. A notebook is a process of its own, so
# its page can say which models stand behind its numbers.
models_used: dict[str, str] = {}


def data_fingerprint(source: str) -> str:
    """Sixteen hex digits over the files behind a data source: their names, sizes and contents.

    They change with every file that `load_motions` may read: added, removed, renamed or edited; not with one that is touched.
    Data that are no files, like the built-in motions, have the hash of none: they come from the library's own sources.

    Args:
        source: as `load_motions` takes it.
    """
    files = _files(named_source(source)[0])
    return sha256(f"{name}\0{file.stat().st_size}\0{file_hash(file)}\n" for name, file in files)[:16]


def _files(source: str | Path) -> Iterator[tuple[str, Path]]:
    """The files that reading a source may open, by their place relative to it."""
    try:
        path = find_source(source) if source != "synthetic" else None
    except FileNotFoundError:
        return
    if path is None:
        return
    if path.is_dir():
        inside = [Path(folder, name) for folder, _, names in os.walk(path) for name in names if not name.startswith(".")]
        found = [file for file in inside if bare_suffix(file) in (*READERS, ".asf") or file.name in HINTS]
    else:
        found = [path, *(file for file in path.parent.iterdir() if bare_suffix(file) == ".asf")]
    found += [folder / name for folder in path.absolute().parents[:LEVELS_UP] for name in HINTS]
    yield from sorted((os.path.relpath(file, path), file) for file in found if file.is_file())


def machine() -> dict[str, str]:
    """What numbers are computed on: processor or graphics card, and torch's version."""
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else f"{platform.machine()} CPU"
    return {"device": device, "torch": torch.__version__.split("+")[0]}
