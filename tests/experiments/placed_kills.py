"""Kill a run before and amid everything that it writes; what is left must go on to the same bits. After one is before the next.

    python -m tests.experiments.placed_kills FOLDER

Every run is a forked process that leaves by ``os._exit`` at its n-th place: no cleanup runs, as under ``kill -9``. Prints the
number of places, and of those from which the run did not come back.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import torch

from mwlib import files
from mwlib.experiments import get_run
from mwlib.training import CHECKPOINT, MODEL
from mwlib.training.checkpoint import load_tensors
from tests.sample_settings import small, two_people

CFG = small(train_steps=3, checkpoint_every=1, ema_start=1)


class Places:
    """Counts places, and ends the process at one of them."""

    def __init__(self, deadly: int) -> None:
        self.deadly, self.passed = deadly, 0

    def __call__(self) -> None:
        if self.passed == self.deadly:
            os._exit(9)
        self.passed += 1

    def before(self, action: Callable) -> Callable:
        """The action after a place."""

        def watched(*arguments, **options):
            self()
            action(*arguments, **options)

        return watched

    def writing(self, file: Path, content: bytes) -> None:
        """In place of `files._write`: half of the content reaches the disk, then all."""
        self()
        file.write_bytes(content[: len(content) // 2])
        self()
        file.write_bytes(content)


def run(folder: Path, deadly: int) -> int:
    """Train in this process with places set; the number of those passed."""
    os.environ["MWLIB_RUNS"] = str(folder)
    places = Places(deadly)
    files._write = places.writing
    os.replace, Path.unlink = places.before(os.replace), places.before(Path.unlink)
    get_run(CFG, two_people())
    return places.passed


def forked(folder: Path, deadly: int = -1) -> int:
    """`run` in a process of its own; the number of places passed, -1 if it was killed."""
    reader, writer = os.pipe()
    if (child := os.fork()) == 0:
        os.write(writer, str(run(folder, deadly)).encode())
        os._exit(0)
    os.close(writer)
    os.waitpid(child, 0)
    return int(os.read(reader, 99) or -1)


def same(found: Path, expected: Path) -> bool:
    """Whether two folders hold one run with the same tensors, and nothing that a kill left."""
    (here,), (there,) = found.iterdir(), expected.iterdir()
    if {f.name for f in here.iterdir()} != {f.name for f in there.iterdir()}:
        return False
    pairs = [(load_tensors(here / name)[0], load_tensors(there / name)[0]) for name in (MODEL, CHECKPOINT)]
    return all(mine.keys() == its.keys() and all(torch.equal(mine[k], its[k]) for k in its) for mine, its in pairs)


def main(folder: Path) -> None:
    """Kill at every place in turn, and let each run go on to its end; prints places passed and those lost."""
    torch.set_num_threads(1)
    os.environ["MWLIB_RUNS"] = str(folder / "first")  # what a first training imports need not be imported in each fork
    get_run(CFG, two_people())
    places, lost = forked(folder / "whole"), []
    for place in range(places):
        killed = forked(folder / str(place), place) == -1
        if not killed or forked(folder / str(place)) == -1 or not same(folder / str(place), folder / "whole"):
            lost.append(place)
    print(places, lost)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
