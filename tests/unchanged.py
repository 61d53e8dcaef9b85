"""Test files that need not run again: their code, what it may read, and the surroundings are as when all their tests passed.

What a file depends on is read from its imports, at first and second hand, and rather too much than too little: a package that
imports at first use counts whole, a module's name in quotes counts as an import, and a file that starts processes or looks into
the checkout depends on all that lies there.
"""

from __future__ import annotations

import ast
import os
import platform
import re
from collections.abc import Iterable
from functools import cache
from importlib.metadata import distributions
from importlib.util import resolve_name
from pathlib import Path

from mwlib.files import write_atomic
from mwlib.hashing import digest, file_hash

ROOT = Path(__file__).parents[1]
CONFTEST = ROOT / "tests" / "conftest.py"
PASSED = ROOT / "build" / "passed"  # a stamp for each test file
ALWAYS = "tests/test_figures.py"  # looks itself which chapters must be executed
FOLDERS = ("mwlib", "tests", "figures", "notebooks", "docs", "results", "benchmarks")
LOOKS_AROUND = re.compile(
    r"\b(subprocess|multiprocessing|forked|os\.fork|__file__|course_folder|CHECKOUT|walk_packages|import_module)\b"
)
SETTINGS = ("MWLIB_DATA", "MW_", "OMP_", "MKL_", "OPENBLAS_", "ATEN_")


@cache
def modules() -> dict[str, Path]:
    """Files of mwlib and of the tests by their modules' names."""
    files = [file for folder in ("mwlib", "tests") for file in (ROOT / folder).rglob("*.py") if "_material" not in file.parts]
    return {".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file for file in files}


@cache
def named(file: Path) -> frozenset[str]:
    """Modules that a file names: in imports, wherever they stand, in the stub of a package, and in quotes."""
    found, name = set(), next((name for name, one in modules().items() if one == file), "")
    package = name if file.stem == "__init__" else name.rpartition(".")[0]
    for source in (file, file.with_suffix(".pyi")):
        if not source.is_file():
            continue
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                start = resolve_name("." * node.level + (node.module or ""), package)
                found |= {f"{start}.{alias.name}" for alias in node.names} | {start}
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return frozenset(name for name in found if name in modules())


@cache
def looks_around(file: Path) -> bool:
    """Whether a file of the tests starts processes or looks into the checkout."""
    return file.is_relative_to(ROOT / "tests") and bool(LOOKS_AROUND.search(file.read_text(encoding="utf-8")))


hashed = cache(file_hash)


def behind(file: Path) -> set[Path]:
    """A test file and all modules that it names, at first or second hand; those of the fixture `finished` for who asks for it."""
    seen: set[Path] = set()
    ahead = [file, *([CONFTEST] if re.search(r"\bfinished\b", file.read_text(encoding="utf-8")) else [])]
    while ahead:
        if (now := ahead.pop()) not in seen:
            seen.add(now)
            ahead += [modules()[name] for name in named(now)]
    return seen


@cache
def others(folder: str) -> str:
    """Hash of the files of a folder of the checkout that are no Python; "" = those beside the folders."""
    top = ROOT / folder
    files = sorted(file for file in (top.rglob("*") if folder else top.glob("*")) if file.is_file())
    kept = [file for file in files if file.suffix not in (".py", ".pyc") and not {"node_modules", "_material"} & {*file.parts}]
    return digest({file.relative_to(ROOT).as_posix(): file_hash(file) for file in kept})


@cache
def surroundings() -> str:
    """Hash of versions, settings and measured data."""
    data = Path(os.environ.get("MWLIB_DATA", ROOT / "none"))
    listed = sorted((str(file), file.stat().st_size, file.stat().st_mtime_ns) for file in data.rglob("*") if file.is_file())
    settings = {name: value for name, value in os.environ.items() if name.startswith(SETTINGS)}
    versions = sorted(f"{found.name} {found.version}" for found in distributions())
    return digest([platform.python_version(), platform.machine(), versions, settings, listed])


def key(file: Path) -> str:
    """Hash of all that a test file's outcome may depend on."""
    code = behind(file)
    if any(map(looks_around, code - {CONFTEST})):
        code = {*modules().values(), *ROOT.glob("*.py"), *(ROOT / "benchmarks").rglob("*.py")}
        folders: Iterable[str] = ("", *FOLDERS)
    else:
        folders = ("mwlib", "tests", "figures", "notebooks")  # what the library itself reads
    hashes = {one.relative_to(ROOT).as_posix(): hashed(one) for one in {*code, CONFTEST}}
    return digest([hashes, [others(folder) for folder in folders], surroundings()])


def keys() -> dict[str, str]:
    """The key of every test file, by its place in the checkout."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    return {place: key(file) for file in files if (place := file.relative_to(ROOT).as_posix()) != ALWAYS}


def stamp(place: str) -> Path:
    """Where the key of a test file is kept with which it passed."""
    return PASSED / f"{place}.key"


def unchanged(now: dict[str, str]) -> list[str]:
    """The test files that passed with the keys of today."""
    return [place for place, key in now.items() if stamp(place).is_file() and stamp(place).read_text(encoding="utf-8") == key]


def keep(now: dict[str, str], passed: Iterable[str]) -> None:
    """Stamp the files whose tests all passed."""
    for place in set(passed) & now.keys():
        write_atomic(stamp(place), now[place])
