"""Where a download is at work: one process at a time, beside the folder that it fills."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout
from tqdm import tqdm


@contextmanager
def workplace(to: Path, name: str) -> Iterator[Path]:
    """A folder for what is not whole yet, hidden, on the same disk; others wait until it is free.

    It is removed at a good end. What a broken end leaves there is never read as data.

    Raises:
        PermissionError: nothing can be written there.
    """
    to.mkdir(parents=True, exist_ok=True)
    lock = FileLock(to / f".fetch-{name}.lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        print(f"another mwlib fetch {name} is at work in {to}; waiting for it", file=sys.stderr)
        lock.acquire()
    try:
        folder = to / f".fetch-{name}"
        folder.mkdir(exist_ok=True)
        yield folder
        shutil.rmtree(folder)
    finally:
        lock.release()


def progress(what: str, total: int, unit: str = "clip", many: int = 1) -> tqdm:
    """A progress bar, unless nobody watches."""
    return tqdm(desc=what, total=total, unit=unit, unit_scale=unit == "B", disable=not sys.stderr.isatty() or total < many)


def in_turn(items: Sequence, what: str) -> Iterator:
    """The items, with a progress bar where there are many."""
    with progress(what, len(items), many=20) as bar:
        for item in items:
            yield item
            bar.update()
