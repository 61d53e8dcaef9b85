"""Plausible wrong answers: put in place of the right ones, each is refused with a hint that fits; so is a hole left open.

A chapter's cells run in this process, in order, but only those that a hole or an exercise needs, at first or second hand: nothing
is trained that none asks for. After each wrong answer the names are as before it.
"""

from __future__ import annotations

import ast
import dis
import traceback
import types
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import nbformat
import pytest
import torch
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from mwlib.course.learner import FUNCTION, HOLE, opened
from mwlib.course.notebooks import NOTEBOOKS, WRONG, course, tags


class Trial(NamedTuple):
    """A cell's code with one answer changed, and a part of what the reader must be told."""

    source: str
    hint: str


def answered(source: str, answer: str) -> str:
    """A cell's code with one of its holes filled by another answer: a line, or a function, that begins as the right one does."""
    for hole in (*FUNCTION.finditer(source), *HOLE.finditer(source)):
        head = hole[2].split("(")[0] + "(" if hole.re is FUNCTION else f"{hole[2]} "
        if answer.startswith(head):
            text = "\n".join(hole[1] + line for line in answer.rstrip().split("\n"))
            return source[: hole.start()] + text + ("\n" if hole[0].endswith("\n") else "") + source[hole.end() :]
    raise ValueError(f"{answer!r} answers no hole; expected it to begin as one of {[hole[2] for hole in HOLE.finditer(source)]}")


def trials(cell: NotebookNode) -> Iterator[Trial]:
    """The wrong answers of a cell; for one with holes also each hole left open."""
    for wrong in cell.metadata.get(WRONG, []):
        whole = "solution" in tags(cell)
        yield Trial(wrong["code"] if whole else answered(cell.source, wrong["code"]), wrong["hint"])
    if holes := [*FUNCTION.finditer(cell.source), *HOLE.finditer(cell.source)]:
        yield Trial(
            opened(cell.source), min(holes, key=lambda hole: hole.start())[0].partition("# your turn: ")[2].split("\n")[0]
        )


def checks(cells: list[NotebookNode], place: int) -> list[int]:
    """The cells that check an answer, up to the last assert: of three after a hole, after a solution of all up to a heading."""
    solution = "solution" in tags(cells[place])
    found: list[int] = []
    for now, cell in enumerate(cells[place + 1 :], place + 1):
        code = cell.cell_type == "code"
        if (not code and cell.source.startswith("#")) if solution else ("solution" in tags(cell) or len(found) == 3):
            break
        found += [now] if code and cell.source.strip() and "guard" not in tags(cell) else []
    kept, wanted = list[int](), set[str]()
    for now in reversed(found):  # what only draws is left out
        asked, bound, changed = names(cells[now].source)
        if "assert" in cells[now].source or wanted & (bound | changed):
            kept, wanted = [now, *kept], wanted | asked
    return kept


def names(source: str) -> tuple[set[str], set[str], set[str]]:
    """What code asks of the cells before it, what it binds, and what it changes in place."""
    asked, bound, whole = set[str](), set[str](), compile(source, "a cell", "exec")
    for step in dis.get_instructions(whole):  # in order: what it has bound itself it asks of nobody
        if step.opname == "LOAD_NAME":
            asked |= {step.argval} - bound
        bound |= {step.argval} if step.opname in ("STORE_NAME", "STORE_GLOBAL") else set()
    inner = [const for const in whole.co_consts if isinstance(const, types.CodeType)]
    while inner:
        code = inner.pop()
        inner += [const for const in code.co_consts if isinstance(const, types.CodeType)]
        asked |= {step.argval for step in dis.get_instructions(code) if step.opname in ("LOAD_NAME", "LOAD_GLOBAL")} - bound
    changed: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        targets = node.targets if isinstance(node, ast.Assign) else []
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            targets = [node.value.func]
        for part in (part for target in targets for part in ast.walk(target) if isinstance(part, ast.Attribute | ast.Subscript)):
            changed |= {root.id for root in ast.walk(part) if isinstance(root, ast.Name)}
    return asked, bound, changed - {"page"}


def needed(cells: list[NotebookNode], ends: set[int]) -> list[int]:
    """Places of the cells that some cells need, and of these cells."""
    wanted, kept = set[str](), set[int]()
    for place in reversed(range(len(cells))):
        if cells[place].cell_type != "code":
            continue
        asked, bound, changed = names(cells[place].source)
        if place in ends or wanted & (bound | changed):
            kept.add(place)
            wanted = (wanted - bound) | asked
    return sorted(kept)


def run(source: str, known: dict[str, Any]) -> None:
    exec(compile(source, "a cell", "exec"), known)


def refusal(sources: list[str], known: dict[str, Any]) -> AssertionError | None:
    """What the first assert says that fails; the names are as before."""
    before = dict(known)
    try:
        for source in sources:
            run(source, known)
    except AssertionError as error:
        return error
    finally:
        known.clear()
        known.update(before)
    return None


def tried(cells: list[NotebookNode]) -> list[str]:
    """A chapter's wrong answers that pass, or that meet another hint; a line each."""
    drills = {place: checks(cells, place) for place, cell in enumerate(cells) if cell.cell_type == "code" and [*trials(cell)]}
    ends = {place for drill, after in drills.items() for place in (drill, *after)}
    known, problems = {"__name__": "a chapter"}, []
    for place in needed(cells, ends):
        for trial in trials(cells[place]) if place in drills else []:
            with torch.random.fork_rng():
                error = refusal([trial.source, *(cells[check].source for check in drills[place])], known)
            if error is None or trial.hint not in str(error):
                problems.append(f"{trial.source!r} meets {str(error)!r}; expected {trial.hint!r}")
            elif traceback.extract_tb(error.__traceback__)[-1].filename != "a cell":
                problems.append(f"{trial.source!r} fails in the library; expected in the reader's own cells")
        run(cells[place].source, known)
    return problems


@pytest.mark.parametrize("path", course(), ids=lambda path: path.stem)
def test_wrong_answers_are_refused_with_a_hint(path, monkeypatch, unchecked):
    cells = nbformat.read(path, as_version=4).cells
    if not any(WRONG in cell.metadata for cell in cells):
        return  # its answers have none yet
    monkeypatch.setenv("MW_STATIC", "1")
    monkeypatch.chdir(NOTEBOOKS)
    with warnings.catch_warnings(), torch.random.fork_rng():
        warnings.simplefilter("ignore")  # those of a chapter are its own matter
        assert tried(cells) == []


def sample(*wrong: dict[str, str]) -> list[NotebookNode]:
    """A chapter with a hole and an exercise."""
    hole = new_code_cell("half = four / 2  # your turn: half of four", metadata={WRONG: list(wrong)})
    solution = new_code_cell("twice = 8", metadata={"tags": ["solution"], WRONG: [{"code": "twice = 5", "hint": "twice four"}]})
    sources = ["four = 4", "1 / 0", "four = four + 0"], ["assert half == 2, f'{half} is not half of four'"]
    first, check = ([new_code_cell(source) for source in group] for group in sources)
    last = [new_markdown_cell("### Ex 1.1"), solution, new_code_cell("assert twice == 8, 'twice four'"), new_code_cell("1 / 0")]
    return new_notebook(cells=[*first, hole, *check, *last[:-1], new_markdown_cell("## End"), last[-1]]).cells


def test_only_what_is_needed_is_run_and_a_right_answer_is_no_wrong_one():
    assert tried(sample({"code": "half = 2 * four", "hint": "8 is not half"})) == []
    (problem,) = tried(sample({"code": "half = 2.0", "hint": "not half"}))
    assert problem.endswith("meets 'None'; expected 'not half'")
    (problem,) = tried(sample({"code": "half = 3", "hint": "4 is not"}))
    assert "meets '3 is not half of four'" in problem
    with pytest.raises(ValueError, match="expected it to begin as one of \\['half ='\\]"):
        tried(sample({"code": "third = 3", "hint": "-"}))


def test_what_a_cell_binds_first_it_asks_of_nobody():
    assert names("x = 1\ny = x + z\nz = 2")[0] == {"z"}
    assert names("def f():\n    return x + y\n\n\ny = 2")[0] == {"x"}
    assert names("total += 1")[0] == {"total"}


def test_what_a_cell_changes_in_place_is_no_name_of_its_own():
    assert names("x[0] = y\nrows.append([a for a in z])") == ({"x", "y", "rows", "z"}, set(), {"x", "rows"})
