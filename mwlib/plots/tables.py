"""Tables of results, for a notebook's page and for a terminal."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from numbers import Real


@dataclass(frozen=True)
class Table:
    """Cells as text; shows itself as HTML in a notebook and as Markdown in print.

    Args:
        header: column names.
        rows: cells, one tuple per row.
        numeric: which columns hold numbers; they are set to the right.
        best: (row, column) of cells to set in bold.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[bool, ...]
    best: frozenset[tuple[int, int]] = frozenset()

    def __repr__(self) -> str:
        header, *rows = self._written("**{}**", lambda cell: cell.replace("|", "\\|"))
        widths = [max(3, *map(len, column)) for column in zip(header, *rows, strict=True)]
        rule = ["-" * (width - 1) + (":" if right else "-") for width, right in zip(widths, self.numeric, strict=True)]
        sides = [f"{'>' if right else '<'}{width}" for width, right in zip(widths, self.numeric, strict=True)]
        return "\n".join(f"| {' | '.join(map(format, line, sides))} |" for line in (header, rule, *rows))

    def _repr_html_(self) -> str:
        align = [f'style="text-align: {"right" if right else "left"}"' for right in self.numeric]
        header, *rows = self._written("<strong>{}</strong>", escape)
        head = "".join(f'<th scope="col" {a}>{name}</th>' for a, name in zip(align, header, strict=True))
        lines = ("".join(f"<td {a}>{cell}</td>" for a, cell in zip(align, row, strict=True)) for row in rows)
        body = "\n".join(f"<tr>{line}</tr>" for line in lines)
        return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>"

    def _written(self, mark: str, escaped: Callable[[str], str]) -> list[list[str]]:
        """The header and the rows, the best cells marked."""
        rows = [[escaped(cell) for cell in row] for row in (self.header, *self.rows)]
        for row, column in self.best:
            rows[row + 1][column] = mark.format(rows[row + 1][column])
        return rows


def results_table(
    rows: Sequence[Mapping[str, object]], columns: Sequence[str] | None = None, *, better: Mapping[str, str] | None = None
) -> Table:
    """A table of results: numbers to 3 significant digits, the best of a column in bold.

    Args:
        rows: column -> value. Numbers are rounded; a pair (value, spread) becomes "value ± spread"; None and missing
            values leave a dash; anything else is written as it is.
        columns: which columns, in order; None takes them as they first appear.
        better: column -> "lower" or "higher", for the columns whose best value is set in bold.

    Raises:
        ValueError: no rows, or `better` says something else.
    """
    if not rows:
        raise ValueError("there are no rows; expected at least one result")
    columns = tuple(columns or dict.fromkeys(key for row in rows for key in row))
    cells = [[row.get(column) for column in columns] for row in rows]
    best = {place for column, which in (better or {}).items() for place in _best(cells, columns.index(column), which)}
    numeric = tuple(any(_number(cell) is not None for cell in column) for column in zip(*cells, strict=True))
    return Table(columns, tuple(tuple(map(_text, row)) for row in cells), numeric, frozenset(best))


def significant(value: float, digits: int = 3) -> str:
    """A number to so many significant digits, without an exponent as long as it stays readable: 0.4, 12.3, 1235, 1.2e-07.

    Trailing zeros count as digits: 0.400 says more than 0.4.
    """
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    exponent = int(f"{value:.{digits - 1}e}".split("e")[1])
    if not -4 <= exponent <= 5:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - exponent, 0)}f}"


def _number(value: object) -> float | None:
    value = value[0] if isinstance(value, tuple) and value else value
    value = getattr(value, "item", lambda: value)()  # of tensors and arrays of one number
    return float(value) if isinstance(value, Real) and not isinstance(value, bool) else None


def _text(value: object) -> str:
    if value is None:
        return "–"
    number = _number(value)
    if number is None or isinstance(value, int):
        return str(value)
    if not isinstance(value, tuple):
        return significant(number)
    spread = _number(value[1])
    return f"{significant(number)} ± {'–' if spread is None else significant(spread, 2)}"


def _best(cells: list[list[object]], column: int, which: str) -> list[tuple[int, int]]:
    if which not in ("lower", "higher"):
        raise ValueError(f"better is {which!r}; expected 'lower' or 'higher'")
    found = {row: number for row, line in enumerate(cells) if (number := _number(line[column])) is not None and number == number}
    edge = (min if which == "lower" else max)(found.values(), default=0)
    return [(row, column) for row, number in found.items() if significant(number) == significant(edge)]
