"""Where results are kept and what proves that one is whole."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from mwlib.files import write_json
from mwlib.material import home

RESULT = "metrics.json"


def runs_folder() -> Path:
    """Where training runs are kept: MWLIB_RUNS, else `runs` in the course or checkout around the working folder, else in it."""
    if "MWLIB_RUNS" in os.environ:
        return Path(os.environ["MWLIB_RUNS"])
    return home() / "runs"


def write_result(folder: Path, metrics: Mapping[str, Any], digest: str) -> Path:
    """Declare a run done: the last thing it does, atomic."""
    write_json(folder / RESULT, {"status": "ok", "hash": digest, "metrics": dict(metrics)})
    return folder / RESULT


def read_result(folder: Path, digest: str) -> dict[str, Any] | None:
    """The metrics of a finished run with this hash; None if it is missing, half-written or of other parameters."""
    try:
        result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    if not isinstance(result, dict) or result.get("status") != "ok" or result.get("hash") != digest:
        return None
    return result["metrics"]


def parameters_hash(parameters: Mapping[str, Any]) -> str:
    """Eight hex digits over a notebook's parameters; `out`, the place of the results, does not count."""
    kept = {k: v for k, v in parameters.items() if k != "out"}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()[:8]


@contextmanager
def locked(file: Path, patience: float = -1) -> Iterator[bool]:
    """One process at a time, the others wait; the lock dies with its holder, however it dies.

    It is for making something: whoever finds it finished reads it without the lock, and needs no leave to write.

    Args:
        file: the lock.
        patience: seconds to wait; -1 = for ever.

    Returns:
        Whether the lock is held; False only when patience ran out.

    Raises:
        PermissionError: the folder cannot be written to.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(file)
    try:
        lock.acquire(timeout=patience)
    except Timeout:
        yield False
        return
    try:
        yield True
    finally:
        lock.release()
