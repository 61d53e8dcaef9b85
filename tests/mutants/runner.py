"""Plants mutants in copies of the repository and runs the tests that must notice them."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory

import pytest
from tqdm import tqdm

from tests.mutants.mutant import Mutant

PRELOADED = ["torch", "accelerate", "scipy.signal", "matplotlib.pyplot", "pywt", "beartype", "jaxtyping", "pytest"]
TEXTS = ("README.md", "RESULTS.md", "REPRODUCTION.md", "CONTRIBUTING.md")
COPIED = ("mwlib", "tests", "figures", "notebooks", "docs", "Snakefile", "pyproject.toml", *TEXTS)
TESTS_FAILED = 1  # pytest's exit code; others mean that no test was run
KILLED, SURVIVED, GONE, BROKEN = "killed", "SURVIVED", "NO LONGER APPLIES", "TESTS DO NOT RUN"
SECONDS = 600  # for one mutant: then its tests hang


def copied(root: Path, folder: Path) -> Path:
    """A copy of what the tests need."""
    folder.mkdir()
    for name in COPIED:
        if (root / name).is_dir():
            shutil.copytree(root / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "_material", "node_modules"))
        elif (root / name).exists():
            shutil.copy(root / name, folder / name)
    return folder


def run_tests(folder: Path, tests: Sequence[str], keep_bytecode: bool = False) -> int | None:
    """Exit code of the named tests in a copy, stopped at the first failure; None if they hang."""
    processes = get_context("forkserver")  # libraries are loaded once, mwlib and the tests for every mutant
    processes.set_forkserver_preload(PRELOADED)
    process = processes.Process(target=enter, args=(folder, list(tests), keep_bytecode))
    process.start()
    process.join(SECONDS)
    code = process.exitcode
    process.kill()
    return code


def enter(folder: Path, tests: list[str], keep_bytecode: bool) -> None:
    """Run tests, in a process of their own that knows nothing yet of library and tests."""
    for stream in (sys.stdout, sys.stderr):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    for name in [name for name in sys.modules if name.split(".")[0] in ("mwlib", "tests")]:
        del sys.modules[name]
    sys.dont_write_bytecode = not keep_bytecode  # never of mutants
    os.environ |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(folder), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    sys.exit(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests]))


def attempt(mutant: Mutant, folder: Path) -> str:
    """What becomes of one mutant in a copy, which is left as it was."""
    file = folder / mutant.file
    whole = file.read_text(encoding="utf-8")
    if not mutant.applies(whole):
        return GONE
    file.write_text(whole.replace(mutant.old, mutant.new), encoding="utf-8")
    os.utime(file, (1, 1))  # Python takes a file of the same length and second for the one whose bytecode it has
    try:
        return {0: SURVIVED, TESTS_FAILED: KILLED}.get(run_tests(folder, mutant.tests), BROKEN)
    finally:
        file.write_text(whole, encoding="utf-8")


def attempt_all(mutants: Sequence[Mutant], root: Path, jobs: int) -> list[str]:
    """What becomes of each mutant; the tests must pass without any.

    Raises:
        SystemExit: they do not.
    """
    with TemporaryDirectory() as temporary:
        first = copied(root, Path(temporary) / "0")
        if run_tests(first, sorted({test for mutant in mutants for test in mutant.tests}), keep_bytecode=True) != 0:
            raise SystemExit("tests named in the catalogue fail without any mutant; mend them first")
        free: Queue[Path] = Queue()
        free.put(first)
        for job in range(1, jobs):
            free.put(Path(shutil.copytree(first, Path(temporary) / str(job))))

        def one(mutant: Mutant) -> str:
            folder = free.get()
            try:
                fate = attempt(mutant, folder)
            finally:
                free.put(folder)
            if fate != KILLED:
                tqdm.write(f"{mutant.name}: {fate}", file=sys.stderr)
            return fate

        with ThreadPoolExecutor(jobs) as pool:
            return list(tqdm(pool.map(one, mutants), total=len(mutants), desc="mutants", unit="mutant"))
