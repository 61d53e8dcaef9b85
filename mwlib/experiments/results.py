"""Result files: what a run found and what that depends on, proof that it is whole, its lock, and pages about results."""

import csv
import json
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal

from filelock import FileLock, Timeout

from mwlib.files import write_json
from mwlib.hashing import digest, file_hash
from mwlib.paths import course_folder, home

log = logging.getLogger(__name__)

RESULT = "metrics.json"
Status = Literal["ok", "finished", "refused", "failed"]
REFUSED = "Refused"  # the error by which a notebook refuses its data, as a kernel names it

# What this process has taken from runs and results, which a notebook's page names, as a notebook is a process of its own:
models_used: dict[str, str] = {}  # name of a run -> SHA-256 of its model
older_code: set[str] = set()  # modules that were others when something of this was made


def runs_folder() -> Path:
    """Where training runs are kept: MWLIB_RUNS, else `runs` in the course or checkout around the working folder, else in it."""
    return Path(os.environ["MWLIB_RUNS"]) if "MWLIB_RUNS" in os.environ else home() / "runs"


def accepts_older_code() -> bool:
    """Whether runs and results of other code are taken: MWLIB_ACCEPT_OLDER_CODE, which ``--accept-older-code`` sets to 1."""
    return os.environ.get("MWLIB_ACCEPT_OLDER_CODE", "") not in ("", "0")


def of_older_code() -> dict[str, list[str]]:
    """What to say beside whatever this process makes: the modules that are others now, if it took anything of older code."""
    return {"older_code": sorted(older_code)} if older_code else {}


def write_result(
    folder: Path,
    metrics: Mapping[str, Any],
    key: str,
    depends: Mapping[str, Any],
    status: Status = "ok",
    told: Mapping[str, Any] | None = None,
) -> None:
    """Write what a run found: the last thing it does, atomic.

    Args:
        folder: the run's.
        metrics: what it found; JSON values.
        key: hash of its parameters or settings, under which `read_result` knows it.
        depends: hashes of everything that the metrics depend on.
        status: "ok" declares it done; a notebook's page can only say "finished", as it does not see whether every cell ran.
            "refused" and "failed" say that it is not done.
        told: what else it says, by name, such as a chapter's claims; JSON values.
    """
    write_json(folder / RESULT, {"status": status, "hash": key, "depends": depends, "metrics": metrics, **(told or {})})


def read_result(folder: Path, key: str, status: Status = "ok") -> dict[str, Any] | None:
    """The metrics of a run with this hash and status; None if they are missing, half-written or of other parameters."""
    result = result_of(folder)
    return result["metrics"] if (result.get("status"), result.get("hash")) == (status, key) else None


def result_of(folder: Path) -> dict[str, Any]:
    """All that a result says: status, hash, depends, metrics; empty if it is missing, half-written or none."""
    return read_tree(folder / RESULT, metrics=dict, depends=dict)


def read_tree(file: Path, **needed: type) -> dict[str, Any]:
    """A mapping from a JSON file; empty if it is missing, half-written or lacks an entry of the kinds that are needed."""
    try:
        tree = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return {}
    return tree if isinstance(tree, dict) and all(isinstance(tree.get(name), kind) for name, kind in needed.items()) else {}


def committed_folder() -> Path:
    """`figures/cmu` of the course: tables and pictures as measured on real people."""
    return course_folder() / "figures" / "cmu"


def read_table(file: Path) -> list[dict[str, str]]:
    """The lines of a CSV file, texts by the heads of their columns.

    Raises:
        FileNotFoundError: there is no such table in the folder.
    """
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


@cache
def _templates() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # takes a while to import

    return Environment(loader=PackageLoader("mwlib", ""), trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)


def rendered(template: str, **told: Any) -> str:
    """A page made of a template of this package, `room/name.jinja`, and what it is told; it ends in one line end."""
    return _templates().get_template(template).render(told).rstrip() + "\n"


def parameters_hash(parameters: Mapping[str, Any]) -> str:
    """Eight hex digits over a notebook's parameters but `out`; where `preset` is a file of settings, over what the file says."""
    kept = {name: value for name, value in parameters.items() if name != "out"}
    if (file := Path(str(kept.get("preset")))).suffix == ".yaml" and file.is_file():
        kept["preset"] = file_hash(file)
    return digest(kept)


@cache
def _say_waiting(file: Path) -> None:
    """Once a process and lock, however often it is asked for."""
    log.warning("another process holds %s; waiting for its end", file)


@contextmanager
def locked(file: Path, patience: float = -1) -> Iterator[bool]:
    """One process at a time, the others say so and wait; the lock dies with its holder, however it dies.

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
        lock.acquire(timeout=0)
    except Timeout:
        _say_waiting(file)
        with suppress(Timeout):
            lock.acquire(timeout=patience)
    try:
        yield lock.is_locked
    finally:
        lock.release()
