"""Plants mutants in copies of the repository and runs the tests that must notice them.

A verdict is kept under `build/mutants`, by the hash of the mutant, of its file and of its tests, so that a run that was stopped
goes on. The tests pass without any mutant first; the seconds that each takes then are kept too, and the quick ones come first.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory

import pytest
from tqdm import tqdm

from mwlib.files import write_atomic
from mwlib.hashing import digest, file_hash
from tests.mutants.mutant import Mutant

PRELOADED = ["torch", "accelerate", "scipy.signal", "matplotlib.pyplot", "pywt", "beartype", "jaxtyping", "pytest"]
TEXTS = ("README.md", "RESULTS.md", "REPRODUCTION.md", "CONTRIBUTING.md")
COPIED = ("mwlib", "tests", "figures", "notebooks", "docs", "results", "Snakefile", "pyproject.toml", *TEXTS)
TESTS_FAILED = 1  # pytest's exit code; others mean that no test was run
KEPT = Path("build") / "mutants"
KILLED, SURVIVED, GONE, BROKEN = "killed", "SURVIVED", "NO LONGER APPLIES", "TESTS DO NOT RUN"
PATIENCE = (
    60.0  # seconds for one mutant, beside ten times what its tests take without it: a mutant that makes them hang is killed
)
TOGETHER = 20  # files of tests in one process
TOOK = "seconds.json"  # what each test of a process took, in a copy


def copied(root: Path, folder: Path) -> Path:
    """A copy of what the tests need."""
    folder.mkdir()
    for name in COPIED:
        if (root / name).is_dir():
            shutil.copytree(root / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "_material", "node_modules"))
        elif (root / name).exists():
            shutil.copy(root / name, folder / name)
    return folder


def run_tests(folder: Path, tests: Sequence[str], known: Mapping[str, float], whole: bool = False) -> int | None:
    """Exit code of the named tests in a copy, the quick ones first, stopped at the first failure; None if they hang.

    Args:
        folder: the copy.
        tests: files or ids.
        known: seconds by test, as far as known.
        whole: there is no mutant: bytecode is kept, and the seconds are written to the copy.
    """
    processes = get_context("forkserver")  # libraries are loaded once, mwlib and the tests for every mutant
    processes.set_forkserver_preload(PRELOADED)
    process = processes.Process(target=enter, args=(folder, list(tests), dict(known), whole))
    process.start()
    process.join(None if whole else PATIENCE + 10 * sum(known.values()))
    code = process.exitcode
    process.kill()
    return code


class Clock:
    """For pytest: the quick tests first, and what each took."""

    def __init__(self, known: Mapping[str, float]) -> None:
        self.known, self.took = known, {}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """New tests first, then by seconds."""
        items.sort(key=lambda item: self.known.get(item.nodeid, 0.0))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count set-up, test and what is done after it."""
        self.took[report.nodeid] = self.took.get(report.nodeid, 0.0) + report.duration


def enter(folder: Path, tests: list[str], known: dict[str, float], whole: bool) -> None:
    """Run tests, in a process of their own that knows nothing yet of library and tests."""
    for stream in (sys.stdout, sys.stderr):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    for name in [name for name in sys.modules if name.split(".")[0] in ("mwlib", "tests")]:
        del sys.modules[name]
    sys.dont_write_bytecode = not whole  # never of mutants
    os.environ |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(folder), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    clock = Clock(known)
    code = pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests], plugins=[clock])
    if whole:
        (folder / TOOK).write_text(json.dumps(clock.took))
    sys.exit(code)


def attempt(mutant: Mutant, folder: Path, known: Mapping[str, float]) -> str:
    """What becomes of one mutant in a copy, which is left as it was."""
    file = folder / mutant.file
    whole = file.read_text(encoding="utf-8")
    if not mutant.applies(whole):
        return GONE
    file.write_text(whole.replace(mutant.old, mutant.new), encoding="utf-8")
    os.utime(file, (1, 1))  # Python takes a file of the same length and second for the one whose bytecode it has
    try:
        return {0: SURVIVED, TESTS_FAILED: KILLED, None: KILLED}.get(run_tests(folder, mutant.tests, known), BROKEN)
    finally:
        file.write_text(whole, encoding="utf-8")


def verdict_of(mutant: Mutant, root: Path) -> Path:
    """The file that says what became of a mutant, while neither it nor its file nor its tests have changed."""
    files = {test.partition("::")[0] for test in mutant.tests} | {mutant.file}
    return root / KEPT / digest([*mutant, *(file_hash(root / file) for file in sorted(files))])


def passed(tests: Sequence[str], root: Path, copy: Path) -> dict[str, float]:
    """Seconds of every test that is named; they must pass, and are not run again while library and tests stay the same.

    Args:
        tests: files or ids; some files share a process, as loading mwlib takes longer than most of their tests.
        root, copy: the repository, and a copy of it.

    Raises:
        SystemExit: they do not.
    """
    files = [file for folder in ("mwlib", "tests") for file in sorted((root / folder).rglob("*.py"))]
    sources = [
        file_hash(file)
        for file in files
        if not file.is_relative_to(root / "tests" / "mutants") and not file.name.startswith("test_")
    ]
    named = {file: [test for test in tests if test.partition("::")[0] == file] for file in {t.partition("::")[0] for t in tests}}
    named = {file: [file] if file in names else names for file, names in sorted(named.items())}
    stamps = {f: root / KEPT / f"passed-{digest([*names, file_hash(root / f), *sources])}.json" for f, names in named.items()}
    left = [file for file in named if not stamps[file].exists()]
    for some in tqdm([left[i : i + TOGETHER] for i in range(0, len(left), TOGETHER)], desc="tests without a mutant"):
        code = run_tests(copy, [name for file in some for name in named[file]], {}, whole=True)
        took = json.loads((copy / TOOK).read_text())
        if code != 0:
            raise SystemExit(f"{[some[0], *took][-1]} fails without any mutant; mend it first")
        for file in some:
            of_file = {test: seconds for test, seconds in took.items() if test.partition("::")[0] == file}
            write_atomic(stamps[file], json.dumps(of_file))
    return {test: seconds for stamp in stamps.values() for test, seconds in json.loads(stamp.read_text()).items()}


def attempt_all(mutants: Sequence[Mutant], root: Path, jobs: int) -> list[str]:
    """What becomes of each mutant; the tests must pass without any.

    Raises:
        SystemExit: they do not.
    """
    verdicts = [verdict_of(mutant, root) for mutant in mutants]
    left = [mutant for mutant, verdict in zip(mutants, verdicts, strict=True) if not verdict.exists()]
    with TemporaryDirectory() as temporary:
        first = copied(root, Path(temporary) / "0")
        seconds = passed(sorted({test for mutant in left for test in mutant.tests}), root, first)
        free: Queue[Path] = Queue()
        free.put(first)
        for job in range(1, jobs):
            free.put(Path(shutil.copytree(first, Path(temporary) / str(job))))

        def one(mutant: Mutant, verdict: Path) -> str:
            if verdict.exists():
                return verdict.read_text(encoding="utf-8")
            folder = free.get()
            try:
                fate = attempt(mutant, folder, {name: took for name, took in seconds.items() if name.startswith(mutant.tests)})
            finally:
                free.put(folder)
            if fate != KILLED:
                tqdm.write(f"{mutant.name}: {fate}", file=sys.stderr)
            if fate in (KILLED, SURVIVED):
                write_atomic(verdict, fate)
            return fate

        with ThreadPoolExecutor(jobs) as pool:
            return list(tqdm(pool.map(one, mutants, verdicts), total=len(mutants), desc="mutants", unit="mutant"))
