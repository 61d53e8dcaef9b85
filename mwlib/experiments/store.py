"""Where results are kept and what proves that one is whole."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from filelock import FileLock, Timeout

from mwlib.files import write_json
from mwlib.hashing import digest
from mwlib.paths import home

RESULT = "metrics.json"
Status = Literal["ok", "finished"]


def runs_folder() -> Path:
    """Where training runs are kept: MWLIB_RUNS, else `runs` in the course or checkout around the working folder, else in it."""
    if "MWLIB_RUNS" in os.environ:
        return Path(os.environ["MWLIB_RUNS"])
    return home() / "runs"


def write_result(
    folder: Path, metrics: Mapping[str, Any], digest: str, depends: Mapping[str, Any], status: Status = "ok"
) -> Path:
    """Write what a run found: the last thing it does, atomic.

    Args:
        folder: the run's.
        metrics: what it found; JSON values.
        digest: hash of its parameters or settings, under which `read_result` knows it.
        depends: hashes of everything that the metrics depend on.
        status: "ok" declares it done; a notebook's page can only say "finished", as it does not see whether every cell ran.
    """
    tree = {"status": status, "hash": digest, "depends": dict(depends), "metrics": dict(metrics)}
    write_json(folder / RESULT, tree)
    return folder / RESULT


def read_result(folder: Path, digest: str, status: Status = "ok") -> dict[str, Any] | None:
    """The metrics of a run with this hash and status; None if they are missing, half-written or of other parameters."""
    result = result_of(folder)
    return result["metrics"] if (result.get("status"), result.get("hash")) == (status, digest) else None


def result_of(folder: Path) -> dict[str, Any]:
    """All that a result says: status, hash, depends, metrics; empty if it is missing, half-written or none."""
    try:
        result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return {}
    whole = isinstance(result, dict) and isinstance(result.get("metrics"), dict) and isinstance(result.get("depends"), dict)
    return result if whole else {}


def parameters_hash(parameters: Mapping[str, Any]) -> str:
    """Eight hex digits over a notebook's parameters; `out`, the place of the results, does not count."""
    return digest({name: value for name, value in parameters.items() if name != "out"})


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
