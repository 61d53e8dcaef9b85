"""The rules of the house: imports point one way, rooms stay small, everything public says what it is."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# From the ground up: a module imports its own room and those named before it.
# Systems stand side by side and do not know each other.
LEAVES = ("hashing", "files", "paths", "version")
SYSTEMS = ("prediction", "inbetweening", "text_to_motion")
ROOMS = (
    LEAVES, ("settings",), ("arguments",), ("body",), ("transforms",), ("networks",), ("synthetic",), ("data",),
    ("diffusion",), ("metrics",), ("training",), ("matching",),
    SYSTEMS, ("plots",), ("experiments",), ("course",), ("cli",), ("__main__", "__init__"),
)  # fmt: skip
FLOOR = {room: floor for floor, rooms in enumerate(ROOMS) for room in rooms}
MOST_LINES, MOST_LINES_OF_A_FUNCTION, MOST_MODULES_OF_A_SYSTEM = 500, 45, 66
A_QUESTION = re.compile(r"(What|Who|How|Which|Whether)\b")
CATCH_ALL = {"utils", "util", "helpers", "helper", "common", "misc", "tools"}


def name_of(file: Path, root: Path) -> str:
    """Dotted name of a module; a package goes by its own name."""
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module: str) -> str:
    """The first word below mwlib."""
    return module.split(".")[1] if "." in module else "__init__"


parsed = cache(ast.parse)  # most files of a copy are those of the original


def trees(root: Path) -> dict[str, ast.Module]:
    """Syntax tree of every module under root/mwlib."""
    files = sorted((root / "mwlib").rglob("*.py"))
    return {name_of(file, root): parsed(file.read_text(encoding="utf-8")) for file in files if "_material" not in file.parts}


def _for_checkers(node: ast.If) -> bool:
    return isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


@cache
def statements(tree: ast.Module) -> list[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Every import of a module, and whether it happens at once: not in a function, nor for type checkers alone."""
    blocks = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) or isinstance(n, ast.If) and _for_checkers(n)]
    late = {inner for node in blocks for inner in ast.walk(node)}
    return [(node, node not in late) for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(tree: ast.Module, known: set[str]) -> Iterator[tuple[str, bool]]:
    """Modules of mwlib that a module imports, and whether at once."""
    for node, at_once in statements(tree):
        names = [alias.name for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module is not None, f"relative import, line {node.lineno}"
            full = [f"{node.module}.{name}" for name in names]
            names = [name if name in known else node.module for name in full]
        yield from ((name, at_once) for name in names if name.split(".")[0] == "mwlib")


def offences(root: Path) -> list[str]:
    """Imports that point up, or from one system to another."""
    known, found = trees(root), []
    for module, tree in known.items():
        here = room_of(module)
        if here not in FLOOR:
            found.append(f"{module}: the room {here} is not in the plan")
            continue
        for other, _ in imports(tree, set(known)):
            there = room_of(other)
            if there == here and here not in LEAVES:
                continue
            if FLOOR.get(there, len(ROOMS)) > FLOOR[here]:
                found.append(f"{module} imports {other}, which lies above it")
            elif FLOOR[there] == FLOOR[here]:
                found.append(f"{module} imports {other}, which stands beside it")
    return found


def cycle(root: Path) -> list[str]:
    """Modules that import each other in a ring; a package counts as a module, its __init__."""
    known = trees(root)
    graph = {name: {other for other, at_once in imports(tree, set(known)) if at_once} - {name} for name, tree in known.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_imports_point_one_way():
    assert offences(ROOT) == []


def test_no_modules_import_each_other():
    assert cycle(ROOT) == []


def test_the_plan_names_rooms_that_exist():
    there = {room_of(module) for module in trees(ROOT)}
    assert there == set(FLOOR)


OPEN_EACH = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(f"mwlib.{name}.system")
    opened = [module for module in sys.modules if module.partition(".")[0] == "mwlib"]
    print(name, len(opened))
    for module in opened:
        del sys.modules[module]
"""


def test_a_system_opens_a_small_part_of_the_house():
    """One after the other in a new process, each without what the others opened; torch is imported once for all."""
    names = [*SYSTEMS, "matching"]
    told = subprocess.check_output([sys.executable, "-c", OPEN_EACH, *names], cwd=ROOT, text=True)
    opened = {name: int(count) for name, count in map(str.split, told.splitlines())}
    assert [*opened] == names and {name: n for name, n in opened.items() if n > MOST_MODULES_OF_A_SYSTEM} == {}


@pytest.fixture
def copy(tmp_path) -> Path:
    shutil.copytree(ROOT / "mwlib", tmp_path / "mwlib", ignore=shutil.ignore_patterns("__pycache__", "_material"))
    return tmp_path


@pytest.mark.parametrize(
    "file, line, expected",
    [
        ("transforms/dwt.py", "from mwlib.diffusion import ddim", "transforms.dwt imports mwlib.diffusion, which lies above it"),
        ("files.py", "import mwlib.paths", "files imports mwlib.paths, which stands beside it"),
        ("inbetweening/bridge.py", "from mwlib.prediction import config", "mwlib.prediction.config, which stands beside it"),
        ("metrics/prediction.py", "def f():\n    from mwlib import plots", "metrics.prediction imports mwlib.plots"),
        ("plots/saving.py", "from mwlib import Motion", "plots.saving imports mwlib, which lies above it"),
        ("utils/short.py", "import math", "the room utils is not in the plan"),
    ],
)  # fmt: skip
def test_an_offending_file_is_found(copy, file, line, expected):
    planted = copy / "mwlib" / file
    planted.parent.mkdir(exist_ok=True)
    before = planted.read_text(encoding="utf-8") if planted.exists() else ""
    planted.write_text(f"{before}\n\n{line}\n", encoding="utf-8")
    (found,) = offences(copy)
    assert expected in found


def test_a_ring_is_found(copy):
    with (copy / "mwlib" / "diffusion" / "process.py").open("a", encoding="utf-8") as process:
        process.write("\nfrom mwlib.diffusion.samplers import ddim\n")
    assert {"mwlib.diffusion.process", "mwlib.diffusion.samplers"} <= set(cycle(copy))
    assert offences(copy) == []


def test_modules_and_functions_are_short():
    found = []
    for file in sorted((ROOT / "mwlib").rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if (lines := text.count("\n")) > MOST_LINES:
            found.append(f"{name_of(file, ROOT)}: {lines} lines")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                says = node.body[0].end_lineno - node.body[0].lineno + 1 if ast.get_docstring(node) else 0  # type: ignore[operator]
                if (lines := node.end_lineno - node.lineno + 1 - says) > MOST_LINES_OF_A_FUNCTION:  # type: ignore[operator]
                    found.append(f"{name_of(file, ROOT)}.{node.name}: {lines} lines without its docstring")
    assert found == []


def test_everything_public_says_what_it_is():
    found = []
    for module, tree in trees(ROOT).items():
        if not ast.get_docstring(tree):
            found.append(module)
        public = [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name[0] != "_"]
        for node in [*public]:
            if isinstance(node, ast.ClassDef):
                public += [inner for inner in node.body if isinstance(inner, ast.FunctionDef) and inner.name[0] != "_"]
        found += [f"{module}.{node.name}" for node in public if not ast.get_docstring(node)]
    assert found == []


def test_there_is_no_catch_all():
    assert [module for module in trees(ROOT) if CATCH_ALL & set(module.split("."))] == []


def test_a_module_says_in_a_noun_phrase_what_it_holds():
    found = {module for module, tree in trees(ROOT).items() if A_QUESTION.match(ast.get_docstring(tree) or "")}
    assert found == set()
