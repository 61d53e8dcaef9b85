"""Reading one file after another in a process of its own, which dies rather than take too much."""

from __future__ import annotations

import multiprocessing
import resource
import shutil
import time
import warnings
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

SECONDS, BYTES = 5.0, 2**30


@dataclass(frozen=True)
class Outcome:
    """How the reading of one file ended.

    Args:
        fault: "" if it was read or refused as it should be, else what went wrong.
        is_read: whether it was read.
        seconds: of wall clock.
        mebibytes: the process's greatest size so far.
    """

    fault: str
    is_read: bool
    seconds: float
    mebibytes: float


def read(file: Path) -> tuple[str, bool]:
    """Read a motion file; what is wrong with how that ended, and whether it was read."""
    from mwlib.data.load import CONTENT, motion_files, read_motion_file
    from mwlib.data.untrusted import MotionFormatError

    try:
        with warnings.catch_warnings(action="error"):
            motion_files(file.parent)
    except MotionFormatError:
        pass
    except Exception as error:
        return f"the folder: {type(error).__name__}: {error}", False
    try:
        with warnings.catch_warnings(action="error"):
            motions = read_motion_file(file)
    except MotionFormatError as error:
        return (str(error) if error.place == CONTENT else ""), False
    except Exception as error:
        return f"{type(error).__name__}: {error}", False
    fine = all(np.isfinite(motion.positions).all() for motion in motions)
    return "" if fine else "positions that are not finite", True


def _work(there: Connection) -> None:
    import mwlib.data.load  # noqa: F401

    there.send("ready")
    while True:
        file = there.recv()
        started = time.perf_counter()
        fault, is_read = read(file)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        fault = fault or (f"{grown / 2**20:.0f} MiB" if grown > BYTES else "")
        there.send(Outcome(fault, is_read, time.perf_counter() - started, grown / 2**20))


class Worker:
    """One process that reads files; a new one if it hung or died."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._here, there = context.Pipe()
        self._process = context.Process(target=_work, args=(there,), daemon=True)
        self._process.start()
        there.close()
        self._here.recv()

    def read(self, name: str, files: dict[str, bytes]) -> Outcome:
        """Write the files to an empty folder, and read the one of that name."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        for other, content in files.items():
            (self.folder / other).write_bytes(content)
        self._here.send(self.folder / name)
        try:
            if self._here.poll(SECONDS):
                return self._here.recv()
            outcome = Outcome(f"more than {SECONDS:g} s", False, SECONDS, 0.0)
        except (EOFError, ConnectionError):
            outcome = Outcome("the process died", False, 0.0, 0.0)
        self.close()
        self._start()
        return outcome

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._here.close()
