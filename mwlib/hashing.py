"""Hashes of data, files and code; nothing else in the library makes any."""

import ast
import hashlib
import json
import sys
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent
# Rooms that compute nothing that a result holds.
BESIDE_RESULTS = tuple(f"mwlib.{room}" for room in ("cli", "course", "experiments", "plots"))


def sha256(parts: Iterable[bytes | str]) -> str:
    """SHA-256 of all parts one after the other, in hex; texts as UTF-8."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part.encode(errors="surrogateescape") if isinstance(part, str) else part)
    return found.hexdigest()


def digest(tree: Any) -> str:
    """Eight hex digits over anything that JSON can write."""
    return sha256([json.dumps(tree, sort_keys=True)])[:8]


def file_hash(file: Path) -> str:
    """SHA-256 of a file, in hex."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def code_hash(file: Path) -> str:
    """Eight hex digits over the code of a Python file, as this process met it; comments, docstrings and layout do not count."""
    return sha256(_words(_parsed(file)))[:8]


def package_hash(package: Path = PACKAGE, modules: Collection[str] | None = None) -> str:
    """SHA-256 of the library's code and its other files.

    Args:
        package: the library's folder.
        modules: names of the modules whose code counts; None = all but the command line and the course's tooling, which
            change no result.
    """
    parts: list[bytes | str] = []
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package)
        if not path.is_file() or inside.parts[0] in ("cli", "course", "_material") or "__pycache__" in inside.parts:
            continue
        name = ".".join([PACKAGE.name, *inside.with_suffix("").parts]).removesuffix(".__init__")
        if path.suffix != ".py" or modules is None or name in modules:
            parts += [f"{inside.as_posix()}\0", code_hash(path) if path.suffix == ".py" else path.read_bytes(), "\0"]
    return sha256(parts)


@cache
def code_behind(module: str) -> dict[str, str]:
    """`code_hash` of a module and of all that it imports, at first or second hand, from mwlib or from its own package.

    Rooms that only draw, run or tell are left out (`BESIDE_RESULTS`). A name imported from a package counts as imported from
    the module that the package has it from.
    """
    own = getattr(sys.modules.get(module), "__file__", None)  # a notebook has none
    roots = {PACKAGE.name: PACKAGE.parent}
    if own is not None:
        roots.setdefault(module.partition(".")[0], Path(own).parents[module.count(".") + (Path(own).stem == "__init__")])
    found: dict[str, str] = {}
    ahead = [module]
    while ahead:
        name = ahead.pop()
        file = _file(name, roots)
        if file is not None and name not in found and not name.startswith(BESIDE_RESULTS):
            found[name] = code_hash(file)
            ahead += [_origin(source, imported, roots) for source, imported, _ in _imports(name, file)]
    return dict(sorted(found.items()))


def _file(module: str, roots: dict[str, Path]) -> Path | None:
    """The source of a module below one of the roots; of a package, its __init__.py."""
    root = roots.get(module.partition(".")[0])
    path = (root or Path()).joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if root and file.is_file()), None)


def _imports(module: str, file: Path) -> Iterator[tuple[str, str, str]]:
    """What a file imports, wherever in it: the module, the name (none for a whole module), and what it is called here."""
    package = module if file.stem == "__init__" else module.rpartition(".")[0]
    for node in ast.walk(_parsed(file)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "", "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = resolve_name("." * node.level + (node.module or ""), package)
            yield from ((source, alias.name, alias.asname or alias.name) for alias in node.names)
        elif isinstance(node, ast.Attribute) and node.attr == "iter_modules":  # a package of whatever lies in its folder
            yield from ((f"{package}.{other.stem}", "", "") for other in sorted(file.parent.glob("*.py")) if other != file)


def _origin(source: str, name: str, roots: dict[str, Path]) -> str:
    """The module that has a name which is imported from a module or package."""
    file = _file(source, roots)
    if not name or file is None or file.stem != "__init__":
        return source
    if _file(f"{source}.{name}", roots):
        return f"{source}.{name}"
    stub = file.with_suffix(".pyi")  # of a package that imports at first use
    for other, imported, called in _imports(source, stub if stub.is_file() else file):
        if called == name:
            return _origin(other, imported, roots)
    return source


@cache
def _parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def _words(node: Any) -> Iterator[str]:
    """A syntax tree as text, without line numbers, docstrings and empty fields, so that versions of Python agree."""
    if isinstance(node, ast.AST):
        yield f"({type(node).__name__}"
        for name in node._fields:
            value = getattr(node, name, None)
            if name == "body" and isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                value = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
            if value is not None and value != []:
                yield f" {name}="
                yield from _words(value)
        yield ")"
    elif isinstance(node, list):
        yield "["
        for item in node:
            yield from _words(item)
        yield "]"
    else:
        yield f" {node!r}"
