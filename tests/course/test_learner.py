"""A learner's copy: each open line and function is followed by one that stops there, with the hint."""

from __future__ import annotations

import ast

import nbformat
import pytest

from mwlib.course.learner import learner_copy, opened
from mwlib.course.notebooks import course
from tests.course.test_wrong_answers import answered


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
