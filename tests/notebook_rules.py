"""Structure rules of the notebooks: what a committed notebook looks like. No kernel is started.

Each rule takes a notebook and yields what is wrong with it. The rules exist because nbval passes vacuously on a notebook
without outputs, and because a reader, a screen reader and papermill each need something that execution alone does not show.
"""

from __future__ import annotations

import ast
import base64
import io
import re
import statistics
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import nbformat
from nbformat import NotebookNode
from PIL import Image

from mwlib.course.execute import ALWAYS, PICTURES, WIDGET, is_table
from mwlib.course.learner import FUNCTION, HOLE
from mwlib.course.notebooks import FOLDED, WRONG, ParameterError, exhibits_kept, read_parameters, source_hash, tags
from mwlib.plots.loops import MOST_BYTES

Rule = Callable[[NotebookNode], Iterator[str]]
COMMON = {"preset": "str", "data": "str", "out": "str"}
MEDIAN_BUSY = 8  # an open line and its check stand in one cell
LONGEST_CELL, MEDIAN_CELL, MOST_CELLS, LARGEST_FILE = 25, 5, 60, 1_000_000
FORBIDDEN = {
    r"^\s*[%!]": "a magic or shell command",
    r"\btqdm\b": "tqdm; a bar cannot be compared and floods logs",
    r"\bclear_output\b": "clear_output, which nbval does not know",
    r"\bimport \*": "a star import",
    r"\bplots\.(show|save|save_table)\b|^from mwlib\.plots\S* import .*\b(show|save|save_table)\b": (
        "a picture or table of its own; page.show and page.table show and save"
    ),
    r"(?i)^\s*#+\s*(NBVAL|PYTEST_VALIDATE)_\w+": "a comment that nbval obeys; tags say what is compared",
    r"\b(runs|store)\.finish\(|\bwrite_result\(": "a result of its own; page.finish writes it",
    r"""["'](/|~/|[A-Za-z]:\\)\w""": "an absolute path",
}
MACHINE_PATH = r"(?<![\w.:/])/(home|root|tmp|Users|mnt|opt|work|var|usr)/\w+"
SKIPPING = {"nbval-skip", "skip-execution"}
SEEN = "What you should see"
SEEN_FOLDED = f"<details><summary>{SEEN}</summary>"
MOST_WORDS, MOST_IN_ALL, MOST_TABLES, LEAST_HOLES, LEAST_WRONG = 3500, 85, 8, 6, 3  # of a chapter that has wrong answers
ORDERS, TOLERANCE = (ast.Lt, ast.LtE, ast.Gt, ast.GtE), 1e-3  # of asserts about numbers
IN_DETAILS = re.compile(r"<details><summary>[^<]+</summary>\n\n.*\n\n</details>$", re.S)
HOLE_MARK, NEAR = "# your turn", 3  # a check stands within so many cells after its hole
FILLING = {"append", "extend", "insert", "add", "update"}  # methods that put something into what they are called on
EXERCISE = r"\bEx (\d+[a-z]?)\.(\d+)\b"


def check(path: Path) -> list[str]:
    """Everything that is wrong with a notebook file, one line each; empty if nothing is."""
    notebook = nbformat.read(path, as_version=4)
    problems = [f"{rule.__name__}: {text}" for rule in RULES for text in rule(notebook)]
    name = next((made.args[0] for cell in code_cells(notebook) if (made := page_made(cell)) and made.args), None)
    if name is not None and ast.unparse(name) != repr(path.stem):
        problems.append(f"name: the page is called {ast.unparse(name)}; expected {path.stem!r}, the file's name")
    if path.stat().st_size > LARGEST_FILE:
        problems.append(f"size: {path.stat().st_size} bytes; expected at most {LARGEST_FILE}")
    return problems


def code_cells(notebook: NotebookNode) -> list[NotebookNode]:
    """The code cells that hold code."""
    return [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]


def parsed(*cells: NotebookNode) -> ast.Module:
    """The code of some cells as one syntax tree; a cell that is not plain Python is left out."""
    statements = []
    for cell in cells:
        with suppress(SyntaxError):
            statements += ast.parse(cell.source).body
    return ast.Module(statements, [])


def pictures(cell: NotebookNode) -> list[NotebookNode]:
    """The outputs of a cell that are pictures."""
    return [out for out in cell.get("outputs", []) if any(kind in out.get("data", {}) for kind in PICTURES)]


def heading(notebook: NotebookNode) -> Iterator[str]:
    """One H1, at the top; no level is skipped on the way down."""
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    levels = [len(mark) for mark in re.findall(r"^(#{1,6}) ", re.sub(r"```.*?```", "", text, flags=re.S), re.M)]
    if levels.count(1) != 1 or levels[0] != 1:
        yield f"{levels.count(1)} headings of level 1; expected one, the first"
    for upper, lower in zip(levels, levels[1:], strict=False):
        if lower > upper + 1:
            yield f"a heading of level {lower} follows one of level {upper}"


def first_cell(notebook: NotebookNode) -> Iterator[str]:
    """The first code cell imports what the notebook uses."""
    first, *others = code_cells(notebook)
    if not re.search(r"^(import mwlib as mw$|from mwlib import )", first.source, re.M):
        yield "the first code cell does not import from mwlib"
    for cell in others:
        if re.search(r"^(import|from \S+ import) ", cell.source, re.M):
            yield f"cell {cell.execution_count} imports; imports stand in the first code cell"


def parameters(notebook: NotebookNode) -> Iterator[str]:
    """One cell of typed, commented literals, numbers with their range; the next one turns them into a Config."""
    try:
        offered = read_parameters(notebook)
    except ParameterError as error:
        yield str(error)
        return
    for name, kind in COMMON.items():
        if name not in offered or offered[name].kind != kind:
            yield f"parameters cell: no '{name}: {kind}'"
    for name, parameter in offered.items():
        if parameter.kind in ("int", "float") and parameter.range is None:
            yield f"parameters cell: {name} has no range; expected a comment that ends in '; from 1 to 100'"
    if "out" in offered and offered["out"].default != "":
        yield "parameters cell: out has a default; expected the empty text, which writes nothing"
    cells = code_cells(notebook)
    place = next(i for i, cell in enumerate(cells) if "parameters" in tags(cell))
    if place + 1 == len(cells) or "Config" not in cells[place + 1].source:
        yield "the cell after the parameters cell does not build a Config"


def page(notebook: NotebookNode) -> Iterator[str]:
    """The Config's cell makes the page out of all parameters; the page alone writes files, each stem once."""
    cells = code_cells(notebook)
    place = next((i + 1 for i, cell in enumerate(cells[:-1]) if "parameters" in tags(cell)), 0)
    made = page_made(cells[place])
    if made is None or len(made.args) != 3:
        yield "the cell after the parameters cell has no 'page = Page(name, out, cfg, ...)'"
        return
    typed = [node.target for node in parsed(cells[place - 1]).body if isinstance(node, ast.AnnAssign)]
    offered = {target.id for target in typed if isinstance(target, ast.Name)}
    given = {keyword.arg for keyword in made.keywords if ast.unparse(keyword.value) == keyword.arg}
    if given != offered - {"out"}:
        yield f"the page is given {sorted(map(str, given))}; expected name=name for each parameter: {sorted(offered - {'out'})}"
    for number, cell in enumerate(cells, 1):
        used = sum(isinstance(node, ast.Name) and node.id == "out" for node in ast.walk(parsed(cell)))
        if used > (number - 1 in (place - 1, place)):
            yield f"cell {number} uses 'out'; leave files to page.show, page.table and page.finish"
    stems = [stem for stem, _ in exhibits_kept(notebook)]
    yield from (f"the stem {stem!r} is saved twice" for stem in sorted({s for s in stems if stems.count(s) > 1}))


def page_made(cell: NotebookNode) -> ast.Call | None:
    """The call in ``page = Page(...)``, if a cell has it."""
    for node in parsed(cell).body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call) and ast.unparse(node.targets[0]) == "page":
            return node.value if ast.unparse(node.value.func) == "Page" else None
    return None


def result(notebook: NotebookNode) -> Iterator[str]:
    """The last statement writes the result: nothing else proves that a run got to its end."""
    tree = parsed(*code_cells(notebook))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) == "page.finish"]
    last = tree.body[-1] if tree.body else None
    if not (len(calls) == 1 and isinstance(last, ast.Expr) and last.value is calls[0]):
        yield f"{len(calls)} calls of page.finish; expected one, the last statement of the last code cell"


def forbidden(notebook: NotebookNode) -> Iterator[str]:
    """No installs, absolute paths, progress bars; no machine's paths in what was printed."""
    for cell in code_cells(notebook):
        for pattern, name in FORBIDDEN.items():
            if re.search(pattern, cell.source, re.M):
                yield f"cell {cell.execution_count} has {name}"
        texts = [cell.source, *(str(out.get("text", out.get("data", {}).get("text/plain", ""))) for out in cell.outputs)]
        if any(re.search(MACHINE_PATH, text) for text in texts):
            yield f"cell {cell.execution_count} names a path of one machine"
        if {"raises-exception", "nbval-raises-exception"} & {*tags(cell)}:
            yield f"cell {cell.execution_count} is tagged raises-exception, which papermill counts as a failure"
        if skipping := SKIPPING & {*tags(cell)}:
            yield f"cell {cell.execution_count} is tagged {', '.join(sorted(skipping))}; every cell runs, everywhere"


def length(notebook: NotebookNode) -> Iterator[str]:
    """Short cells, and not too many."""
    lines = [len(cell.source.strip().splitlines()) for cell in code_cells(notebook)]
    if max(lines) > LONGEST_CELL:
        yield f"the longest cell has {max(lines)} lines; expected at most {LONGEST_CELL}"
    most = MEDIAN_BUSY if is_busy(notebook) else MEDIAN_CELL
    if statistics.median(lines) > most:
        yield f"the median cell has {statistics.median(lines)} lines; expected at most {most}"
    if len(lines) > MOST_CELLS:
        yield f"{len(lines)} code cells; expected at most {MOST_CELLS}"


def executed(notebook: NotebookNode) -> Iterator[str]:
    """Executed once from top to bottom, in a new kernel, as it stands now."""
    counts = [cell.execution_count for cell in code_cells(notebook)]
    if counts != list(range(1, len(counts) + 1)):
        yield f"execution counts are {counts}; expected 1 to {len(counts)}: run 'make notebooks'"
    if notebook.metadata.get("mwlib", {}).get("source") != source_hash(notebook):
        yield "a source has changed since the outputs were made: run 'make notebooks'"


def outputs(notebook: NotebookNode) -> Iterator[str]:
    """Only prints and pictures are stored."""
    if "widgets" in notebook.metadata:
        yield "metadata.widgets holds widget state"
    for cell in code_cells(notebook):
        for out in cell.outputs:
            if out.output_type == "error" or out.get("name") == "stderr":
                yield f"cell {cell.execution_count} stores {'an error' if out.output_type == 'error' else 'stderr'}"
            data = {kind: value for kind, value in out.get("data", {}).items() if not is_table(kind, value)}
            if {WIDGET, "text/html", "application/javascript"} & {*data}:
                yield f"cell {cell.execution_count} stores a widget, HTML or a script"
            if re.search(r"<[^<>]* at 0x[0-9a-f]+>", str(out.get("text", out.get("data", {}).get("text/plain", "")))):
                yield f"cell {cell.execution_count} shows an object's address: end a plotting cell without an expression"


def compared(notebook: NotebookNode) -> Iterator[str]:
    """At least one output is compared with what the code says today."""
    checked = [cell for cell in code_cells(notebook) if "nbval-check-output" in tags(cell)]
    if not any(cell.outputs for cell in checked):
        yield "no cell tagged nbval-check-output has an output"
    for cell in checked:
        if {"nbval-ignore-output", "pytest-validate-ignore-output"} & {*tags(cell)}:
            yield f"cell {cell.execution_count} is tagged to be compared and to be ignored; expected one of the two"
        if re.search(r"\bperf_counter\b|\btime\(", cell.source):
            yield f"cell {cell.execution_count} is compared and measures time"


def claims(notebook: NotebookNode) -> Iterator[str]:
    """What the data at hand show is claimed, not asserted.

    Refused is an assert that asks which preset or data it has. Refused, too, is one that orders numbers which follow from what
    `page.load` read, as a model's predictions do, or compares them with what is typed. Three kinds of these may stand: one that
    allows for rounding; a check of the reader's answer, which has a message and uses what follows from an answer close by; and
    what is true of any data, for the reason that the cell's metadata give under `always`. An equality of two measured numbers
    passes: it may be one of code and library.
    """
    measured: set[str] = set()
    for cell, answers in _answered(notebook):
        _follow(parsed(cell).body, measured, lambda node: "page.load(" in ast.unparse(node))
        reason = cell.metadata.get(ALWAYS, "")
        for node in ast.walk(parsed(cell)):
            if not isinstance(node, ast.Assert):
                continue
            if (names := _names(node.test)) & {"preset", "data"}:
                yield f"cell {cell.execution_count} asserts something of one preset or data; expected page.claim"
            checks_answer = node.msg and names & answers
            if _is_finding(node.test) and names & measured and not (checks_answer or reason or _is_tolerance(node.test)):
                yield (
                    f"cell {cell.execution_count} asserts what was measured ({', '.join(sorted(names & measured))}); expected "
                    f"page.claim, or a hint if it checks the reader's answer, or why it is true of any data in metadata.{ALWAYS}"
                )
        if "nbval-check-output" in tags(cell) and re.search(r"\bpage\.claim\(", cell.source):
            yield f"cell {cell.execution_count} is compared and claims; a claim's numbers follow from a training"


def _answered(notebook: NotebookNode) -> Iterator[tuple[NotebookNode, set[str]]]:
    """Each code cell, with the names that follow from a hole at most three cells before, or from the exercise it stands in."""
    answers, left, in_exercise = set[str](), 0, False
    for cell in notebook.cells:
        if headings := re.findall(r"^#+ .*", cell.source, re.M) if cell.cell_type == "markdown" else []:
            in_exercise = re.search(EXERCISE, headings[-1]) is not None
        if cell.cell_type != "code" or not cell.source.strip():
            continue
        lines, is_solution = cell.source.splitlines(), "solution" in tags(cell)
        left = NEAR if HOLE_MARK in cell.source else left - (not {*FOLDED} & {*tags(cell)})
        if left < 0 and not in_exercise:
            answers.clear()
        _follow(
            parsed(cell).body,
            answers,
            lambda node, own=is_solution, of=lines: (
                own or any(HOLE_MARK in line for line in of[node.lineno - 1 : node.end_lineno])
            ),
        )
        yield cell, answers


def _follow(body: list[ast.stmt], known: set[str], begins: Callable[[ast.stmt], bool]) -> None:
    """Add the names that some statements make of those known, or where they begin; take away those made of something else."""
    for node in body:
        targets, source, own, changes = set[str](), ast.AST(), set[str](), False
        match node:
            case ast.Assign(targets=found, value=source):
                targets = {name for target in found for name in _names(target)}
                changes = any(isinstance(target, ast.Subscript) for target in found)
            case ast.AnnAssign(target=target, value=ast.expr() as source):
                targets = _names(target)
            case ast.AugAssign(target=target, value=source):
                targets, changes = _names(target), True
            case ast.For(target=target, iter=source):
                targets = _names(target)
            case ast.FunctionDef(name=name):
                targets, source = {name}, node
                own = {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
            case ast.Expr(value=ast.Call(func=ast.Attribute(value=target, attr=method)) as source) if method in FILLING:
                targets, changes = _names(target), True
            case _:
                pass
        if (_names(source) - own) & known or (targets and begins(node)):
            known |= targets
        elif not changes:
            known -= targets
        if isinstance(node, (ast.For, ast.With, ast.If)):
            _follow([*node.body, *getattr(node, "orelse", [])], known, begins)


def _names(node: ast.AST) -> set[str]:
    """The names in an expression, but those that its own loops and functions bind."""
    own = {name for part in ast.walk(node) if isinstance(part, ast.comprehension) for name in _names(part.target)}
    own |= {part.arg for part in ast.walk(node) if isinstance(part, ast.arg)}
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)} - own


def _is_finding(test: ast.expr) -> bool:
    """Whether a test orders numbers, or compares something, but a size, with what is typed; 0 may follow from the mathematics."""
    for part in ast.walk(test):
        if isinstance(part, ORDERS):
            return True
        if isinstance(part, ast.Compare) and not re.search(r"\.(shape|ndim|dtype)\b|\blen\(", ast.unparse(part)):
            sides = [part.left, *part.comparators]
            typed = [value for side in sides for value in (side.elts if isinstance(side, (ast.List, ast.Tuple)) else [side])]
            if any(isinstance(value, ast.Constant) and value.value not in (0, None) for value in typed):
                return True
    return False


def _is_tolerance(test: ast.expr) -> bool:
    """Whether a number in a test is so small that it can only allow for rounding."""
    numbers = [part.value for part in ast.walk(test) if isinstance(part, ast.Constant)]
    return any(isinstance(number, float) and 0 < number <= TOLERANCE for number in numbers)


def symbols(notebook: NotebookNode) -> Iterator[str]:
    """Where there are equations there is a table of symbols: paper, code, shape, unit."""
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    if "$$" in text and not re.search(r"^\|[^\n]*symbol[^\n]*\|[ ]*\n\|[ :|-]+\|", text, re.M | re.I):
        yield "equations, but no table whose header has 'symbol'"


def described(notebook: NotebookNode) -> Iterator[str]:
    """Every picture has an alternative text, and prose that says what to look for."""
    for place, cell in enumerate(notebook.cells):
        for out in pictures(cell):
            kind = next(kind for kind in PICTURES if kind in out.data)
            if len(out.metadata.get(kind, {}).get("alt", "")) < 20:
                yield f"a picture of cell {cell.execution_count} has no alternative text"
        following = next((later.source for later in notebook.cells[place + 1 :] if later.cell_type == "markdown"), "")
        if pictures(cell) and SEEN not in following:
            yield f"the text after the picture of cell {cell.execution_count} has no '{SEEN}'"
        elif pictures(cell) and is_busy(notebook) and SEEN_FOLDED not in following:
            yield f"'{SEEN}' after the picture of cell {cell.execution_count} is not folded; expected {SEEN_FOLDED!r}"


def moving(notebook: NotebookNode) -> Iterator[str]:
    """A picture that moves is small, and does not stop before a reader has come to it."""
    for cell in code_cells(notebook):
        found = [out.data[kind] for out in pictures(cell) for kind in PICTURES if kind in out.data]
        for content in map(base64.b64decode, found):
            image = Image.open(io.BytesIO(content))
            if not getattr(image, "is_animated", False):
                continue
            if len(content) > MOST_BYTES:
                yield f"a moving picture of cell {cell.execution_count} has {len(content)} bytes; expected at most {MOST_BYTES}"
            if times := image.info.get("loop", 1):
                yield f"a moving picture of cell {cell.execution_count} stops after {times} rounds; expected a loop"


def exercises(notebook: NotebookNode) -> Iterator[str]:
    """Exercises are numbered in order; each has a cell tagged `solution` and a check that does not show it."""
    places = [
        (place, match.groups())
        for place, cell in enumerate(notebook.cells)
        if cell.cell_type == "markdown" and (match := re.search(r"^#+ .*?" + EXERCISE, cell.source, re.M))
    ]
    numbers = [int(number) for _, (_, number) in places]
    if numbers != list(range(1, len(places) + 1)) or len({chapter for _, (chapter, _) in places}) > 1:
        yield f"exercises are numbered {['.'.join(pair) for _, pair in places]}; expected 1, 2, ... of one chapter"
    ends = [place for place, _ in places[1:]] + [len(notebook.cells)][: len(places)]
    for (place, pair), end in zip(places, ends, strict=True):
        cells = [cell for cell in notebook.cells[place:end] if cell.cell_type == "code"]
        if not any("solution" in tags(cell) for cell in cells):
            yield f"Ex {'.'.join(pair)} has no cell tagged 'solution'"
        if not any("solution" in tags(cell) for cell in notebook.cells[place:end] if cell.cell_type == "markdown"):
            yield f"Ex {'.'.join(pair)} has no derivation: a Markdown cell tagged 'solution'"
        if not any("assert" in cell.source and "solution" not in tags(cell) for cell in cells):
            yield f"Ex {'.'.join(pair)} has no self-check: a cell with an assert, not tagged 'solution'"
    solutions = [cell for cell in notebook.cells if "solution" in tags(cell)]
    if solutions and not places:
        yield f"{len(solutions)} cells are tagged 'solution', but no heading has 'Ex <chapter>.<number>'"
    for cell in (cell for cell in notebook.cells if {*FOLDED} & {*tags(cell)}):
        if cell.cell_type == "code" and not cell.metadata.get("jupyter", {}).get("source_hidden"):
            yield f"the {tags(cell)[0]} in cell {cell.execution_count} is not folded; expected metadata.jupyter.source_hidden"
        if cell.cell_type == "markdown" and not IN_DETAILS.match(cell.source):
            yield f"a solution in words begins {cell.source[:20]!r}; expected '<details><summary>Solution</summary>'"


def is_busy(notebook: NotebookNode) -> bool:
    """Whether a chapter's holes and exercises carry wrong answers: it keeps the third edition's rules, too."""
    return any(WRONG in cell.metadata for cell in notebook.cells)


def holes(notebook: NotebookNode) -> Iterator[str]:
    """The learner's copy leaves lines or functions open; each can be left open, and a check close by says whether it is right."""
    least = LEAST_HOLES if is_busy(notebook) else 2
    if any("solution" in tags(cell) for cell in notebook.cells):
        found = sum(cell.source.count("# your turn: ") for cell in code_cells(notebook))
        if found < least:
            yield f"{found} lines end in '# your turn: hint'; expected {least} or more"
    cells = [cell for cell in code_cells(notebook) if not {*FOLDED} & {*tags(cell)}]
    for place, cell in enumerate(cells):
        source = FUNCTION.sub("", cell.source)
        lines = [line for line in cell.source.split("\n") if "# your turn" in line]
        for line in (line for line in source.split("\n") if "# your turn" in line):
            if not HOLE.fullmatch(line):
                yield f"{line.strip()!r}; expected 'name = expression  # your turn: hint', or the same with 'return' or 'def'"
        checks = parsed(*cells[place : place + 4])
        if lines and not any(isinstance(node, ast.Assert) and node.msg for node in ast.walk(checks)):
            yield f"no check with a message within three cells of {lines[0].strip()!r}"


def wrong_answers(notebook: NotebookNode) -> Iterator[str]:
    """Each hole and each exercise names wrong answers that a learner may give, with a part of the hint that each meets."""
    for cell in code_cells(notebook) if is_busy(notebook) else []:
        named = cell.metadata.get(WRONG, [])
        least = LEAST_WRONG * max(cell.source.count("# your turn: "), "solution" in tags(cell) and not named == [])
        if len(named) < least:
            yield f"cell {cell.execution_count} names {len(named)} wrong answers; expected {least} or more under metadata.{WRONG}"
        if any({*one} != {"code", "hint"} or not all(one.values()) for one in named):
            yield f"cell {cell.execution_count} has a wrong answer that is not {{'code': ..., 'hint': ...}}"
    places = [place for place, cell in enumerate(notebook.cells) if re.search(r"^#+ .*?" + EXERCISE, cell.source, re.M)]
    for place, end in zip(places, [*places[1:], len(notebook.cells)], strict=True) if is_busy(notebook) else []:
        if not any(cell.metadata.get(WRONG) for cell in notebook.cells[place:end]):
            yield f"{notebook.cells[place].source.splitlines()[0]!r} has no wrong answers: metadata.{WRONG} of its solution"


def economy(notebook: NotebookNode) -> Iterator[str]:
    """A chapter is read in its stated time."""
    if not is_busy(notebook):
        return
    texts = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    words = sum(len(text.split()) for text in texts)
    tables = sum(len(re.findall(r"^\|[ :|-]+\|[ ]*$", text, re.M)) for text in texts)
    tables += sum("text/html" in out.get("data", {}) for cell in code_cells(notebook) for out in cell.outputs)
    found = {"words": (words, MOST_WORDS), "cells": (len(notebook.cells), MOST_IN_ALL), "tables": (tables, MOST_TABLES)}
    yield from (f"{count} {what}; expected at most {most}" for what, (count, most) in found.items() if count > most)


RULES: tuple[Rule, ...] = (
    heading, first_cell, parameters, page, result, forbidden, length, executed, outputs, compared, claims, symbols, described,
    moving, exercises, holes, wrong_answers, economy,
)  # fmt: skip
