"""Numbers of measured tables, in sentences and in conditions; nothing that a condition holds is executed."""

from __future__ import annotations

import ast
import csv
import json
import operator
import re
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from mwlib.experiments.grids import read_grids
from mwlib.paths import course_folder
from mwlib.plots.tables import significant

REFERENCE = re.compile(r"\{([^{}|]+)\|([^{}|]+)\|([^{}|]+)\}")
COLUMN = re.compile(r"(?P<name>.*?)(?P<pair> ±)?(?: (?P<of>sd|se))?")
SPREADS = {"sd": ", deviation", "se": ", standard error"}
MADE_WITH = re.compile(r"_(paired|details|actions)$")

ARITHMETIC = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
COMPARISONS = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq}
FUNCTIONS = {"abs": abs, "min": min, "max": max}


class NotMeasured(LookupError):
    """A table is known to come, and not there yet."""


class Tables:
    """Measured tables of a folder, by name, read when they are asked for.

    Args:
        folder: of the CSV files; None = the course's `figures/cmu`.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = course_folder() / "figures" / "cmu" if folder is None else Path(folder)
        self._rows: dict[str, dict[str, dict[str, str]]] = {}
        self.coming: set[str] = set()  # tables that may be missing although no grid is called so

    @cached_property
    def _grids(self) -> frozenset[str]:
        return frozenset(read_grids())

    def rows(self, name: str) -> dict[str, dict[str, str]]:
        """The lines of a table by what stands in the first column.

        Raises:
            NotMeasured: the table is not there, but it is known to come, or a grid is called so.
            ValueError: nothing is called so.
        """
        file = self.folder / f"{name}.csv"
        if name not in self._rows:
            if not file.is_file():
                if MADE_WITH.sub("", name) in self.coming | self._grids:
                    raise NotMeasured(f"`{file.name}` is not there yet")
                raise ValueError(f"{file} is not there, and no grid is called {name!r}; the folder has {self._others()}")
            with file.open(encoding="utf-8", newline="") as lines:
                self._rows[name] = {next(iter(row.values())): row for row in csv.DictReader(lines)}
        return self._rows[name]

    def _others(self) -> str:
        return ", ".join(sorted(file.stem for file in self.folder.glob("*.csv"))) or "no tables"

    def text(self, name: str, row: str, column: str) -> str:
        """One cell as it stands in the file.

        Raises:
            NotMeasured: as `rows`.
            ValueError: there is no such table, row or column, or the cell is empty.
        """
        rows, file = self.rows(name), self.folder / f"{name}.csv"
        if row not in rows:
            raise ValueError(f"{file} has no row {row!r}; expected one of {', '.join(rows)}")
        if column not in rows[row]:
            raise ValueError(f"{file} has no column {column!r}; expected one of {', '.join(rows[row])}")
        if not rows[row][column]:
            raise ValueError(f"{file}, row {row!r}: {column!r} is empty; expected a number")
        return rows[row][column]

    def value(self, name: str, row: str, column: str) -> float | tuple[float, ...]:
        """The number that a reference in a check stands for; row "*" gives those of all rows."""
        found = COLUMN.fullmatch(column)
        if found is None or found["pair"]:
            raise ValueError(f"{column!r} stands in a check; expected one number, without ±")
        column = found["name"] + SPREADS.get(found["of"], "")
        if row == "*":
            return tuple(float(self.text(name, each, column)) for each in self.rows(name))
        return float(self.text(name, row, column))

    def printed(self, name: str, row: str, column: str) -> str:
        """What a reference in a sentence becomes: three digits, with the spread if the column ends in "± sd" or "± se"."""
        found = COLUMN.fullmatch(column)
        assert found is not None  # .*? matches anything
        spread = SPREADS.get(found["of"], "")
        names = [found["name"], found["name"] + spread] if found["pair"] else [found["name"] + spread]
        texts = [self.text(name, row, each) for each in names]
        return " ± ".join(
            text if text.isdigit() else significant(float(text), digits) for text, digits in zip(texts, (3, 2), strict=False)
        )

    def about(self, name: str) -> dict[str, Any]:
        """What the JSON file beside a table says of it."""
        return json.loads((self.folder / f"{name}.json").read_text(encoding="utf-8"))


def filled(text: str, tables: Tables) -> str:
    """A sentence with its numbers."""
    full = REFERENCE.sub(lambda found: tables.printed(*found.groups()), text)
    if "{" in full or "}" in full:
        raise ValueError(f"{text!r} has a brace without a reference; expected {{table|row|column}}")
    return " ".join(full.split())


def holds(check: str, value: Callable[[str, str, str], float | tuple[float, ...]]) -> bool:
    """Whether a condition over cells of tables is true. Only what a condition needs is understood; nothing is executed.

    Args:
        check: comparisons joined by and, or, not, of numbers, `{table|row|column}`, + - * /, abs, min and max.
        value: gives the number of a reference.

    Raises:
        ValueError: the check holds something else, or is no comparison.

    >>> holds("{a|b|c} < 2 * 3 and not 1 > 2", lambda *where: 5.0)
    True
    """
    cells: dict[str, float | tuple[float, ...]] = {}

    def named(found: re.Match[str]) -> str:
        cells[name := f"cell_{len(cells)}"] = value(*found.groups())
        return name

    text = REFERENCE.sub(named, " ".join(check.split()))
    try:
        result = _value(ast.parse(text, mode="eval").body, cells)
    except (SyntaxError, ZeroDivisionError, RecursionError) as error:
        raise ValueError(f"the check {check!r} cannot be read: {type(error).__name__}; expected a comparison") from None
    if not isinstance(result, bool):
        raise ValueError(f"the check {check!r} gives {result}; expected a comparison, which is true or false")
    return result


def _value(node: ast.expr, cells: Mapping[str, float | tuple[float, ...]]) -> Any:
    match node:
        case ast.Constant(value=float() | int() as number) if not isinstance(number, bool):
            return float(number)
        case ast.Name(id=name) if name in cells:
            return cells[name]
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return -_number(inner, cells)
        case ast.UnaryOp(op=ast.Not(), operand=inner):
            return not _truth(inner, cells)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
            return ARITHMETIC[type(op)](_number(left, cells), _number(right, cells))
        case ast.BoolOp(op=op, values=parts):
            truths = [_truth(part, cells) for part in parts]
            return all(truths) if isinstance(op, ast.And) else any(truths)
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARISONS for op in ops):
            numbers = [_number(part, cells) for part in (left, *others)]
            return all(COMPARISONS[type(op)](a, b) for op, a, b in zip(ops, numbers[:-1], numbers[1:], strict=True))
        case ast.Call(func=ast.Name(id=name), args=[*parts], keywords=[]) if name in FUNCTIONS and parts:
            found = [_value(part, cells) for part in parts]
            values = [v for one in found for v in (one if isinstance(one, tuple) else (one,))]
            if len(values) == 1 or name != "abs":
                return abs(values[0]) if name == "abs" else FUNCTIONS[name](values)
    raise ValueError(f"{ast.unparse(node)!r} may not stand in a check; expected comparisons, and, or, not, + - * /, numbers, "
                     f"{{table|row|column}}, {', '.join(FUNCTIONS)}")  # fmt: skip


def _number(node: ast.expr, cells: Mapping[str, float | tuple[float, ...]]) -> float:
    found = _value(node, cells)
    if not isinstance(found, float):
        raise ValueError(f"{ast.unparse(node)!r} is {found}; expected one number")
    return found


def _truth(node: ast.expr, cells: Mapping[str, float | tuple[float, ...]]) -> bool:
    found = _value(node, cells)
    if not isinstance(found, bool):
        raise ValueError(f"{ast.unparse(node)!r} is {found}; expected a comparison")
    return found
