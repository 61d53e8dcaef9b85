"""Copies of the notebooks for learners: the same course without its solutions."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from mwlib.course.parameters import tags
from mwlib.files import write_atomic

BLANK = "# Your turn: write your answer here, then run the check below."
HOLE = re.compile(r"^(\s*(?:return|[\w, .\[\]]+ =) )(\S.*?)(  # your turn: \S.*)$", re.M)


def learner_copy(notebook: NotebookNode) -> NotebookNode:
    """A copy of a notebook with empty solution cells, open holes and no outputs; the self-checks stay.

    The committed notebook is the only source: a cell tagged `solution` keeps its place and loses its content. A line
    `name = expression  # your turn: hint`, or one with `return`, loses its expression.
    """
    copy = NotebookNode(notebook.copy())
    copy.cells = [_emptied(cell) for cell in notebook.cells]
    copy.metadata = NotebookNode({key: value for key, value in notebook.metadata.items() if key != "mwlib"})
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


def _emptied(cell: NotebookNode) -> NotebookNode:
    cell = NotebookNode(cell.copy())
    if cell.cell_type == "code":
        cell.outputs, cell.execution_count = [], None
        cell.source = HOLE.sub(r"\1...\3", cell.source)
    if "solution" in tags(cell):
        cell.source = BLANK if cell.cell_type == "code" else "*Your turn.*"
        cell.metadata = NotebookNode(tags=["exercise"])
    return cell
