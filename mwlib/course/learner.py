"""Copies of the notebooks: for learners, without solutions, and for services that open a chapter by one click."""

import os
import re
import tomllib
from pathlib import Path
from urllib.parse import quote

import nbformat
from nbformat import NotebookNode

from mwlib.course.notebooks import PACKAGE, WRONG, tags
from mwlib.files import write_atomic

BLANK = "# Your turn: write your answer here, then run the check below."
HOLE = re.compile(r"^( *)(return|[\w, .\[\]]+ =) (\S.*?)  # your turn: (\S.*)$", re.M)
FUNCTION = re.compile(r"^( *)(def \w+\(.*\):)  # your turn: (\S.*)\n((?:\1 +\S.*(?:\n|\Z)|\n(?=\1 ))+)", re.M)


def learner_copy(notebook: NotebookNode) -> NotebookNode:
    """A copy of a notebook with empty solution cells, open holes and no outputs; the self-checks stay.

    The committed notebook is the only source: a cell tagged `solution` keeps its place and loses its content. A line
    `name = expression  # your turn: hint`, or one with `return`, loses its expression; a function whose first line ends so loses
    its body. Run as it is, it stops there and says so: further down it would fail in the middle of the library.
    """
    copy = without(notebook, "mwlib")
    copy.cells = [_emptied(cell) for cell in notebook.cells]
    return copy


def without(node: NotebookNode, entry: str) -> NotebookNode:
    """A copy of a notebook, or of a cell, whose metadata lack an entry."""
    copy = NotebookNode(node)
    copy.metadata = NotebookNode(node.metadata)
    copy.metadata.pop(entry, None)
    return copy


def write_learner_copies(folder: Path, notebooks: list[Path]) -> list[Path]:
    """Write the copies that are not there yet; a learner's own work is never overwritten.

    Returns:
        The files written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = [path for path in notebooks if not (folder / path.name).exists()]
    for path in missing:
        write_atomic(folder / path.name, nbformat.writes(learner_copy(nbformat.read(path, as_version=4))))
    return [folder / path.name for path in missing]


def opened(source: str) -> str:
    """A cell's code with its holes left open.

    >>> print(opened("half = 4 / 2  # your turn: half of four"))
    half = ...  # your turn: half of four
    assert half is not ..., 'fill in the line half = ...: half of four'
    """
    lines_opened = HOLE.sub(lambda line: _open_line(*line.group(1, 2, 4)), source)
    return FUNCTION.sub(_without_body, lines_opened)


def _emptied(cell: NotebookNode) -> NotebookNode:
    cell = without(cell, WRONG)
    if cell.cell_type == "code":
        cell.outputs, cell.execution_count = [], None
        cell.source = opened(cell.source)
    if "solution" in tags(cell):
        cell.source = BLANK if cell.cell_type == "code" else "*Your turn.*"
        cell.metadata = NotebookNode(tags=["exercise"])
    return cell


def _without_body(function: re.Match[str]) -> str:
    indent, head, hint, _ = function.groups()
    return f"{indent}{head}\n{_open_line(f'{indent}    ', 'return', hint)}" + "\n" * function[0].endswith("\n")


def _open_line(indent: str, head: str, hint: str) -> str:
    target = head.removesuffix(" =")
    name = target if target.isidentifier() and target != "return" else "answer"
    lines = [f"{name} = ...  # your turn: {hint}", f"assert {name} is not ..., {f'fill in the line {name} = ...: {hint}'!r}"]
    if name != target:
        lines.append(f"{head} {name}")
    return "\n".join(indent + text for text in lines)


COPIES = "colab"  # folder of the site's sources, and branch of the repository, that hold the copies
WIDGETS = "anywidget>=0.9.13,<1"  # what a chapter needs beside the library in a Jupyter that is there already
INSTALL = """# Installs the course where it is missing: this copy of the chapter runs anywhere.
import importlib.util
import os
import subprocess
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # on busy processors more threads wait for each other: ten times as slow
if importlib.util.find_spec("mwlib") is None:
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", {source!r}, {widgets!r}], check=True)"""


def repository(root: Path) -> str:
    """The repository's address, ``https://github.com/OWNER/NAME``; empty while it has none. `pyproject.toml` is its one place.

    Args:
        root: a checkout.

    Raises:
        ValueError: it is no address on GitHub, which is what Colab, Binder and the workflows know.
    """
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    address = project.get("urls", {}).get("Repository", "").rstrip("/")
    if address and not (address.startswith("https://github.com/") and address.count("/") == 4):
        raise ValueError(f"pyproject.toml: Repository is {address!r}; expected https://github.com/OWNER/NAME")
    return address


def badges(address: str, notebook: str) -> str:
    """Links that open a chapter in Colab and in Binder, as Markdown; empty without an address.

    Args:
        address: as `repository` gives it.
        notebook: file name of the chapter.

    >>> print(badges("https://github.com/someone/course", "02_a.ipynb"))
    [Colab](https://colab.research.google.com/github/someone/course/blob/colab/02_a.ipynb) or
    [Binder](https://mybinder.org/v2/gh/someone/course/main?urlpath=lab%2Ftree%2Fnotebooks%2F02_a.ipynb)
    """
    if not address:
        return ""
    place, path = address.removeprefix("https://github.com/"), quote(f"lab/tree/notebooks/{notebook}", safe="")
    return (
        f"[Colab](https://colab.research.google.com/github/{place}/blob/{COPIES}/{notebook}) or\n"
        f"[Binder](https://mybinder.org/v2/gh/{place}/main?urlpath={path})"
    )


def launched_copy(notebook: NotebookNode, source: str) -> NotebookNode:
    """A chapter whose first code cell installs the course where it is missing.

    Args:
        notebook: as committed.
        source: what pip installs, such as `source_of` gives, or the path of a wheel.
    """
    copy = NotebookNode(notebook)
    cell = nbformat.v4.new_code_cell(INSTALL.format(source=source, widgets=WIDGETS), id="install", metadata={"tags": ["install"]})
    copy.cells = [notebook.cells[0], cell, *notebook.cells[1:]]
    return copy


def source_of(address: str) -> str:
    """What pip installs of a repository: the commit that a workflow runs on, else its main branch."""
    return f"{PACKAGE} @ git+{address}@{os.environ.get('GITHUB_SHA', 'main')}"
