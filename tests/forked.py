"""Processes that start with torch, mwlib and Snakemake loaded, in place of new ones that import them for seconds."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path

LOADED = [
    "torch",
    "matplotlib.pyplot",
    "snakemake.cli",
    "papermill",
    "mwlib.__main__",
    "mwlib.course.execute",
    "mwlib.prediction",
]
PROCESSES = get_context("forkserver")


def started(act: Callable, *given: object, log: Path, cwd: Path, env: Mapping[str, str] | None = None) -> BaseProcess:
    """A process that does something in a folder and writes what it prints to a file.

    Args:
        act: a function of a module; what it passes to `sys.exit` is the exit code.
        given: its arguments.
        log: the file.
        cwd: the folder.
        env: what the environment has in addition.
    """
    PROCESSES.set_forkserver_preload(LOADED)
    process = PROCESSES.Process(target=_enter, args=(act, given, log, cwd, {**os.environ, **(env or {})}))
    process.start()
    return process


def done(act: Callable, *given: object, log: Path, cwd: Path, env: Mapping[str, str] | None = None) -> str:
    """What a function printed in such a process, which must come to a good end."""
    process = started(act, *given, log=log, cwd=cwd, env=env)
    process.join(300)
    told = log.read_text(encoding="utf-8")
    assert process.exitcode == 0, told
    return told


def _enter(act: Callable, given: tuple, log: Path, cwd: Path, env: dict[str, str]) -> None:
    for stream in (sys.stdout, sys.stderr):
        os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream.fileno())
    os.environ.clear()
    os.environ.update(env)
    os.chdir(cwd)
    act(*given)
