"""The site's pages about the library: the public names first, then one page a room, filled by Sphinx from the docstrings."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from types import ModuleType
from typing import Any

PACKAGE = "mwlib"
INTRODUCTION = """The library
===========

``import mwlib as mw`` gives the names that notebooks and scripts start from. Below them, one page for each room: rooms import
from those above them in the list, never from those below.

"""


def api_pages() -> dict[str, str]:
    """Pages in reStructuredText by their places in the site's sources."""
    package = importlib.import_module(PACKAGE)
    rooms: dict[str, list[str]] = {}
    for found in pkgutil.walk_packages(package.__path__, f"{PACKAGE}."):
        if not found.name.endswith("__main__"):
            rooms.setdefault(found.name.split(".")[1], []).append(found.name)
    pages = {f"api/{room}.rst": _room(room, modules) for room, modules in rooms.items()}
    listed = "\n".join(f"   {room}" for room in sorted(rooms))
    names = "\n".join(_name(name, getattr(package, name)) for name in package.__all__ if not name.startswith("_"))
    table = f".. list-table::\n   :widths: 30 70\n   :header-rows: 1\n\n   * - name\n     - what it is\n{names}\n"
    example = inspect.getdoc(package) or ""
    toctree = f"Rooms\n-----\n\n.. toctree::\n   :maxdepth: 1\n\n{listed}\n"
    pages["api/index.rst"] = "\n".join([INTRODUCTION, example, "", "Public names\n------------\n", table, "", toctree])
    return pages


def _room(room: str, modules: list[str]) -> str:
    parts = [_heading(f"{PACKAGE}.{room}", "=")]
    for name in sorted(modules):
        own = name.split(".")[2:]
        parts += [_heading(name, "-")] if own else []
        parts.append(f".. automodule:: {name}\n   :members:\n   :ignore-module-all:\n")
    return "\n".join(parts)


def _heading(text: str, line: str) -> str:
    return f"{text}\n{line * len(text)}\n"


def _name(name: str, thing: Any) -> str:
    """A row of the table of public names: where the thing is documented, and its first sentence."""
    place = thing.__name__ if isinstance(thing, ModuleType) else f"{thing.__module__}.{thing.__qualname__}"
    first = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
    return f"   * - :py:obj:`mw.{name} <{place}>`\n     - {first}"
