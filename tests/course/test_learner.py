"""A learner's copy, run as it is: it stops at each open line in turn, in the learner's own cell, with the hint."""

from __future__ import annotations

import ast

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_notebook

from mwlib.course.execute import QUIET
from mwlib.course.learner import HOLE, learner_copy
from mwlib.course.notebooks import NOTEBOOKS, course, find_notebook


def opened(source: str) -> str:
    """A cell as the learner's copy has it."""
    return learner_copy(new_notebook(cells=[new_code_cell(source)])).cells[0].source


@pytest.mark.parametrize(
    "line, name, last",
    [
        ("half = 4 / 2", "half", None),
        ("    return a + b", "answer", "    return answer"),
        ("x[ends] = 4 / 2", "answer", "x[ends] = answer"),
        ("left, right = 1, 2", "answer", "left, right = answer"),
    ],
)
def test_an_open_line_is_followed_by_one_that_says_so(line, name, last):
    indent = " " * (len(line) - len(line.lstrip()))
    lines = opened(f'{line}  # your turn: it\'s "half"').split("\n")
    assert lines[0] == f'{indent}{name} = ...  # your turn: it\'s "half"'
    assert lines[1].startswith(f"{indent}assert {name} is not ..., ") and lines[2:] == ([last] if last else [])
    message = ast.literal_eval(lines[1].split(" ..., ", 1)[1])
    assert message == f'fill in the line {name} = ...: it\'s "half"'


@pytest.mark.parametrize("path", course(), ids=lambda path: path.stem)
def test_every_open_cell_is_python(path):
    for cell in learner_copy(nbformat.read(path, as_version=4)).cells:
        if cell.cell_type == "code":
            ast.parse(cell.source)


def stopped(notebook: NotebookNode) -> CellExecutionError:
    client = NotebookClient(notebook, timeout=300, startup_timeout=120, kernel_name="python3", extra_arguments=QUIET)
    client.resources = {"metadata": {"path": str(NOTEBOOKS)}}
    with pytest.raises(CellExecutionError) as error:
        client.execute()
    return error.value


@pytest.mark.parametrize("number", ["02", "05"])
def test_a_copy_stops_at_its_first_open_line_and_then_at_the_second(number, monkeypatch):
    monkeypatch.setenv("MW_STATIC", "1")
    whole = nbformat.read(find_notebook(number), as_version=4)
    copy = learner_copy(whole)
    places = [place for place, cell in enumerate(whole.cells) if "  # your turn: " in cell.source]
    assert len(places) == 2
    for place in places:
        hint = HOLE.search(whole.cells[place].source)[4]
        error = stopped(copy)
        assert error.ename == "AssertionError" and error.evalue.endswith(f" = ...: {hint}")
        assert "site-packages" not in error.traceback and "mwlib/" not in error.traceback  # it stops in the notebook itself
        copy.cells[place] = whole.cells[place]
