"""A learner's copy, run as it is: it stops at each open line in turn, in the learner's own cell, with the hint."""

from __future__ import annotations

import ast
import traceback
import warnings

import nbformat
import pytest
import torch

from mwlib.course.learner import HOLE, answered, learner_copy, opened
from mwlib.course.notebooks import NOTEBOOKS, course, find_notebook


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


FUNCTION = """x = 1


def mean(x, y):  # your turn: their mean
    total = x + y

    return total / 2


y = 2  # your turn: two"""


def test_a_function_is_left_open_whole():
    lines = opened(FUNCTION).split("\n")
    assert lines[:4] == ["x = 1", "", "", "def mean(x, y):"]
    assert lines[4] == "    answer = ...  # your turn: their mean" and lines[5].startswith("    assert answer is not ..., ")
    assert lines[6:10] == ["    return answer", "", "", "y = ...  # your turn: two"]


@pytest.mark.parametrize("answer", ["def mean(x, y):\n    return x", "y = 3"])
def test_an_answer_takes_the_place_of_the_hole_that_begins_like_it(answer):
    known = {}
    exec(answered(FUNCTION, answer), known)
    assert (known["mean"](4, 6), known["y"]) == ((4, 2) if answer.startswith("def") else (5, 3))


@pytest.mark.parametrize("path", course(), ids=lambda path: path.stem)
def test_every_open_cell_is_python(path):
    for cell in learner_copy(nbformat.read(path, as_version=4)).cells:
        if cell.cell_type == "code":
            ast.parse(cell.source)


@pytest.mark.parametrize("number", ["02", "05"])
def test_a_copy_stops_at_its_first_open_line_and_then_at_the_second(number, monkeypatch, unchecked):
    """Run in this process, cell by cell; filled in, an open cell lets the learner go on to the next."""
    monkeypatch.setenv("MW_STATIC", "1")
    monkeypatch.chdir(NOTEBOOKS)
    whole = nbformat.read(find_notebook(number), as_version=4)
    places = [place for place, cell in enumerate(whole.cells) if "  # your turn: " in cell.source]
    assert len(places) >= 2
    cells, known, now = learner_copy(whole).cells, {}, 0
    with warnings.catch_warnings(), torch.random.fork_rng():
        warnings.simplefilter("ignore")  # those of a chapter are its own matter
        while places:
            source = cells[now].source if cells[now].cell_type == "code" else ""
            try:
                exec(compile(source, "a cell", "exec"), known)
                now += 1
            except AssertionError as error:
                assert str(error).endswith(f" = ...: {HOLE.search(whole.cells[places[0]].source)[4]}")
                assert {entry.filename for entry in traceback.extract_tb(error.__traceback__)[1:]} == {"a cell"}
                now = places.pop(0)
                cells[now] = whole.cells[now]
