"""Reading one file after another in a process of its own, which dies rather than take too much."""

from __future__ import annotations

import multiprocessing
import resource
import shutil
import signal
import time
import warnings
from dataclasses import dataclass
from math import ceil
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

SECONDS, BYTES = 5.0, 2**30  # of the processor, and of memory
BUSY = 20  # times these seconds of wall clock: the machine may have other things to do


@dataclass(frozen=True)
class Outcome:
    """How the reading of one file ended.

    Args:
        fault: "" if it was read or refused as it should be, else what went wrong.
        is_read: whether it was read.
        seconds: of the processor.
        mebibytes: the process's greatest size so far.
    """

    fault: str
    is_read: bool
    seconds: float
    mebibytes: float


def read(file: Path) -> tuple[str, bool]:
    """Read motions, grids, a configuration or a folder of captions; what is wrong with how it ended, and whether it was read."""
    if file.suffix == ".yaml" or file.is_dir():
        return read_text(file)
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


def read_text(file: Path) -> tuple[str, bool]:
    """Grids, a run's configuration, or a folder of clips with captions; as `read`."""
    from mwlib.data.formats.humanml import folder_contents
    from mwlib.experiments.grids import read_config, read_grids

    readers = {"grids.yaml": read_grids, "config.yaml": read_config}
    try:
        with warnings.catch_warnings(action="error"):
            found = readers.get(file.name, folder_contents)(file)
    except ValueError as error:
        return ("" if str(file) in str(error) else f"without its place: {error}"), False
    except Exception as error:
        return f"{type(error).__name__}: {error}", False
    fine = not file.is_dir() or all(np.isfinite(clip.features).all() for clip in found.clips)
    return "" if fine else "features that are not finite", True


def _work(there: Connection) -> None:
    import mwlib.data.load
    import mwlib.experiments.grids  # noqa: F401
    from mwlib.experiments.grids import MODULES, system

    for name in MODULES:
        system(name)

    there.send("ready")
    while True:
        file = there.recv()
        used = time.process_time()
        resource.setrlimit(resource.RLIMIT_CPU, (ceil(used + SECONDS), resource.getrlimit(resource.RLIMIT_CPU)[1]))
        fault, is_read = read(file)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        fault = fault or (f"{grown / 2**20:.0f} MiB" if grown > BYTES else "")
        there.send(Outcome(fault, is_read, time.process_time() - used, grown / 2**20))


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
            (self.folder / other).parent.mkdir(exist_ok=True)
            (self.folder / other).write_bytes(content)
        self._here.send(self.folder / name)
        try:
            if self._here.poll(BUSY * SECONDS):
                return self._here.recv()
            outcome = Outcome(f"more than {SECONDS:g} s", False, SECONDS, 0.0)
        except (EOFError, ConnectionError):
            self._process.join()
            slow = self._process.exitcode == -signal.SIGXCPU
            outcome = Outcome(f"more than {SECONDS:g} s" if slow else "the process died", False, SECONDS * slow, 0.0)
        self.close()
        self._start()
        return outcome

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._here.close()
