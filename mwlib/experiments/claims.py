"""Claims of a paper, verdicts that follow from measured tables, and the page about them."""

import ast
import json
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

from mwlib.experiments.grids import expect_fields, read_grids
from mwlib.experiments.results import committed_folder, read_table
from mwlib.paths import course_folder
from mwlib.plots.tables import significant
from mwlib.settings import read_yaml

KINDS = ("holds", "does not hold here", "depends on the reading", "cannot be tested here")  # of verdicts
WITH_A_REASON = KINDS[2:]
PENDING = "not measured yet"
OTHERWISE = "otherwise"  # in the place of a check: if none of the cases before holds

REFERENCE = re.compile(r"\{([^{}|]+)\|([^{}|]+)\|([^{}|]+)\}")  # {table|row|column}
COLUMN = re.compile(r"(?P<name>.*?)(?P<pair> ±)?(?: (?P<of>sd|se))?")
SPREADS = {"sd": ", deviation", "se": ", standard error"}
MADE_WITH = re.compile(r"_(paired|details|actions)$")

FUNCTIONS = {"abs": abs, "min": min, "max": max}
UNDERSTOOD = (  # in a check
    ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div,
    ast.Compare, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.Call, ast.Name, ast.Load, ast.Constant,
)  # fmt: skip


class NotMeasured(LookupError):
    """A table of a known grid is not there yet."""


class Tables:
    """Measured tables of a folder, by name, read when they are asked for.

    Args:
        folder: of the CSV files; None = the course's `figures/cmu`.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = committed_folder() if folder is None else Path(folder)
        self._rows: dict[str, dict[str, dict[str, str]]] = {}

    @cached_property
    def _grids(self) -> set[str]:
        return {*read_grids()}

    def rows(self, name: str) -> dict[str, dict[str, str]]:
        """The lines of a table by what stands in the first column.

        Raises:
            NotMeasured: the table is not there, but a grid is called so.
            ValueError: nothing is called so.
        """
        file = self.folder / f"{name}.csv"
        if name not in self._rows:
            if not file.is_file():
                if MADE_WITH.sub("", name) in self._grids:
                    raise NotMeasured(f"`{file.name}` is not there yet")
                others = ", ".join(sorted(file.stem for file in self.folder.glob("*.csv"))) or "no tables"
                raise ValueError(f"{file} is not there, and no grid is called {name!r}; the folder has {others}")
            self._rows[name] = {next(iter(row.values())): row for row in read_table(file)}
        return self._rows[name]

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
        names, pair = _columns(column)
        if pair:
            raise ValueError(f"{column!r} stands in a check; expected one number, without ±")
        numbers = tuple(float(self.text(name, each, names[-1])) for each in (self.rows(name) if row == "*" else [row]))
        return numbers if row == "*" else numbers[0]

    def printed(self, name: str, row: str, column: str) -> str:
        """What a reference in a sentence becomes: three digits, with the spread if the column ends in "± sd" or "± se"."""
        names, pair = _columns(column)
        texts = [self.text(name, row, each) for each in (names if pair else names[-1:])]
        return " ± ".join(
            text if text.isdigit() else significant(float(text), digits) for text, digits in zip(texts, (3, 2), strict=False)
        )

    def about(self, name: str) -> dict[str, Any]:
        """What the JSON file beside a table says of it."""
        return json.loads((self.folder / f"{name}.json").read_text(encoding="utf-8"))

    def filled(self, text: str) -> str:
        """A sentence with its numbers."""
        full = REFERENCE.sub(lambda found: self.printed(*found.groups()), text)
        if "{" in full or "}" in full:
            raise ValueError(f"{text!r} has a brace without a reference; expected {{table|row|column}}")
        return " ".join(full.split())

    def link(self, name: str) -> str:
        """A link to a table with its windows and seeds; a table made with a grid's has those of the grid's."""
        about = self.about(name)
        rows = self.rows(MADE_WITH.sub("", name)).values()
        windows = {row["windows"] for row in rows if row.get("windows")} or {str(about.get("windows", "?"))}
        seeds = max((int(row["seeds"]) for row in rows if row.get("seeds")), default=1)
        share = about.get("budget_share") or 1.0
        parts = [
            f"{' or '.join(sorted(windows))} windows",
            f"{seeds} seed{'s' if seeds > 1 else ''} of {about.get('seeds_of') or 'sampling'}",
            f"preset `{about.get('preset') or 'cmu_paper'}`",
            *([f"{share:g} of the preset's training steps"] if share != 1 else []),
            f"mwlib {about['mwlib']}",
        ]
        return f"[{name}.csv](figures/cmu/{name}.csv) ({', '.join(parts)})"


def _columns(column: str) -> tuple[list[str], bool]:
    """A column and that of its spread, if one is named; and whether both are meant."""
    found = COLUMN.fullmatch(column)
    assert found is not None  # .*? matches anything
    return [found["name"], *([found["name"] + SPREADS[found["of"]]] if found["of"] else [])], bool(found["pair"])


def holds(check: str, value: Callable[[str, str, str], float | tuple[float, ...]]) -> bool:
    """Whether a condition over cells of tables is true. What is no condition is refused before anything is computed.

    Args:
        check: comparisons joined by and, or, not, of numbers, `{table|row|column}`, + - * /, abs, min and max.
        value: gives the number of a reference, or those of all rows, which stand in min or max.

    Raises:
        ValueError: the check holds something else, or is no comparison.

    >>> holds("{a|b|c} < 2 * 3 and not 1 > 2", lambda *where: 5.0)
    True
    """
    cells: dict[str, Any] = {}

    def named(found: re.Match[str]) -> str:
        cells[name := f"cell_{len(cells)}"] = value(*found.groups())
        return name

    try:
        tree = ast.parse(REFERENCE.sub(named, " ".join(check.split())), mode="eval")
        _expect_condition(tree, {name for name, found in cells.items() if isinstance(found, tuple)})
        return eval(compile(tree, "check", "eval"), {"__builtins__": {}}, FUNCTIONS | cells)
    except (SyntaxError, TypeError, NameError, ZeroDivisionError, RecursionError) as error:
        raise ValueError(f"the check {check!r} cannot be read: {error}; expected a comparison of numbers") from None


def _expect_condition(tree: ast.Expression, columns: set[str]) -> None:
    """Refuse what has no place in a check: other syntax, a number for a truth or a truth for a number, a column for a number."""
    for node in ast.walk(tree):
        if not isinstance(node, UNDERSTOOD) or (isinstance(node, ast.Constant) and type(node.value) not in (int, float)):
            raise SyntaxError(f"{ast.unparse(node)!r} may not stand there")
        for inner in ast.iter_child_nodes(node):
            if isinstance(inner, ast.expr) and _is_truth(inner) != (_is_truth(node, within=True)):
                raise SyntaxError(f"{ast.unparse(inner)!r} may not stand in {ast.unparse(node)!r}")
            if isinstance(inner, ast.Name) and inner.id in columns and not isinstance(node, ast.Call):
                raise SyntaxError("all rows of a column may stand in min and max only")


def _is_truth(node: ast.AST, within: bool = False) -> bool:
    """Whether an expression is true or false; or, `within`, made of such."""
    return isinstance(node, (ast.BoolOp, ast.Expression if within else ast.Compare)) or (
        isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    )


@dataclass(frozen=True)
class Case:
    """A verdict, and when it is the right one.

    Args:
        verdict: one of KINDS, with a reason after a colon where it needs one.
        because: what was found; `{table|row|column}` stands for a measured number.
        check: a condition over such numbers, or OTHERWISE; empty = always.
    """

    verdict: str
    because: str
    check: str = ""

    @property
    def kind(self) -> str:
        """The verdict without its reason."""
        return self.verdict.partition(":")[0].strip()

    @property
    def tables(self) -> list[str]:
        """Those that it rests on."""
        return list(dict.fromkeys(name for name, _, _ in REFERENCE.findall(self.check + self.because)))


@dataclass(frozen=True)
class Shown:
    """A place in a notebook.

    Args:
        notebook: its stem.
        section: a heading in it, without the signs in front.
        prints: what an output of it says; may be empty.
    """

    notebook: str
    section: str
    prints: str = ""


@dataclass(frozen=True)
class Claim:
    """Something that a paper says and that can be looked at.

    Args:
        id: lower-case words with hyphens.
        theme: heading under which it stands.
        title: in a few words.
        paper: section, table, figure or equation.
        claim: what the paper says, in our words, with its number.
        done: what we did.
        cases: the first whose check holds gives the verdict.
        shown: where in the notebooks.
    """

    id: str
    theme: str
    title: str
    paper: str
    claim: str
    done: str
    cases: tuple[Case, ...]
    shown: tuple[Shown, ...] = ()


OWN, CASE = {"id", "theme", "title", "paper", "claim", "done"}, {"verdict", "because", "check"}


def claims_file() -> Path:
    """`figures/claims.yaml` of the course."""
    return course_folder() / "figures" / "claims.yaml"


def read_claims(path: Path | None = None) -> list[Claim]:
    """The claims of a file, in its order; None = the course's.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: something lacks a field, has an unknown one or one twice, a verdict is none, or a claim has no evidence; the
            message names file and claim, what was found and what was expected.
    """
    path = claims_file() if path is None else Path(path)
    tree = read_yaml(path)
    if not isinstance(tree, dict) or not isinstance(tree.get("claims"), list):
        raise ValueError(f"{path} holds {str(tree)[:40]!r}; expected a mapping with a list under 'claims'")
    found = []
    for number, body in enumerate(tree["claims"], 1):
        name = body.get("id", f"number {number}") if isinstance(body, dict) else f"number {number}"
        found.append(_claim(f"{path}: claim {name}", body))
    if twice := [name for name, times in Counter(claim.id for claim in found).items() if times > 1]:
        raise ValueError(f"{path}: two claims have the id {twice[0]!r}; expected different ones")
    return found


def _claim(where: str, body: Any) -> Claim:
    _expect_texts(where, body, OWN, CASE | {"cases", "shown"})
    one, several = {name: body[name] for name in CASE if name in body}, body.get("cases", [])
    if bool(one) == bool(several) or not isinstance(several, list):
        raise ValueError(
            f"{where} has {sorted(one)} and {len(several)} cases; expected a verdict or a list of cases, and not both"
        )
    cases = [_case(f"{where}, case {number}" if several else where, case) for number, case in enumerate(several or [one], 1)]
    for place in body.get("shown", []):
        _expect_texts(f"{where}, shown", place, {"notebook", "section"}, {"prints"})
    if not body.get("shown") and not all(case.kind == KINDS[3] for case in cases) and not all(case.check for case in cases):
        raise ValueError(f"{where} has no evidence; expected a check or a place in a notebook under 'shown'")
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", body["id"]):
        raise ValueError(f"{where}: the id is {body['id']!r}; expected lower-case words with hyphens")
    shown = tuple(Shown(**place) for place in body.get("shown", []))
    own = {name: " ".join(body[name].split()) for name in OWN}
    return Claim(**own, cases=tuple(cases), shown=shown)


def _case(where: str, body: Any) -> Case:
    _expect_texts(where, body, {"verdict", "because"}, {"check"})
    case = Case(**body)
    if case.kind not in KINDS:
        raise ValueError(
            f"{where}: the verdict is {case.verdict!r}; expected one of {', '.join(KINDS)}, and a reason after a colon"
        )
    if case.kind in WITH_A_REASON and not case.verdict.partition(":")[2].strip():
        raise ValueError(f"{where}: the verdict is {case.verdict!r}; expected a reason after a colon")
    if REFERENCE.search(case.because) and not case.check:
        raise ValueError(f"{where} gives measured numbers and no check; expected the condition from which its verdict follows")
    return case


def _expect_texts(where: str, found: Any, needed: set[str], allowed: set[str]) -> None:
    expect_fields(where, found, needed, allowed)
    for name in {*found} - {"cases", "shown"}:
        if not isinstance(found[name], str) or not found[name].strip():
            raise ValueError(f"{where}: {name} is {found[name]!r}; expected a text")


def decide(where: str, claim: Claim, tables: Tables) -> tuple[Case, list[str]]:
    """The case of a claim that holds, its sentences filled in, and the tables from which it follows.

    Args:
        where: for messages, e.g. the file.

    Returns:
        The case; its verdict is PENDING if no table of any of its cases is there. And the names of its tables.

    Raises:
        ValueError: no check holds, or one cannot be read; the message names the claim.
    """
    false, missing = [], []
    for case in claim.cases:
        try:
            if case.check in ("", OTHERWISE) or holds(case.check, tables.value):
                return Case(tables.filled(case.verdict), tables.filled(case.because), case.check), case.tables
            numbers = REFERENCE.sub(lambda found: str(tables.value(*found.groups())), case.check)
            false.append(f"{case.verdict!r} needs {case.check}, which is {numbers}, and false")
        except NotMeasured as error:
            missing.append(str(error))
        except ValueError as error:
            raise ValueError(f"{where}: claim {claim.id}: {error}") from None
    if not false:
        return Case(PENDING, f"The table {missing[0]}."), []
    raise ValueError(f"{where}: claim {claim.id}: no verdict follows any more: {'; '.join(false)}. Expected a check that holds: "
                     "read the table again and write the verdict that follows from it")  # fmt: skip


def reproduction(file: Path | None = None, tables: Tables | None = None, notebooks: Path | None = None) -> str:
    """The page about the claims, as Markdown; links start from the folder of the course.

    Args:
        file: of the claims; None = `figures/claims.yaml`.
        tables: measured; None = the course's.
        notebooks: their folder; None = the course's.

    Raises:
        FileNotFoundError, ValueError: a file is missing, a verdict does not follow from its check, or a notebook lacks a heading
            or an output; the message names the file and the claim.
    """
    from jinja2 import StrictUndefined, Template  # comes with the notebooks' packages

    file, tables = claims_file() if file is None else file, Tables() if tables is None else tables
    notebooks = course_folder() / "notebooks" if notebooks is None else notebooks
    themes: dict[str, list[tuple[Claim, Case, list[str]]]] = {}
    for claim in read_claims(file):
        for place in claim.shown:
            look(notebooks, place, claim.id)
        themes.setdefault(claim.theme, []).append((claim, *decide(str(file), claim, tables)))
    counts = Counter(case.kind for found in themes.values() for _, case, _ in found)
    kinds = [*KINDS, *([PENDING] if counts[PENDING] else [])]
    text = resources.files("mwlib.experiments").joinpath("reproduction.md.jinja").read_text(encoding="utf-8")
    page = Template(text, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
    return page.render(themes=themes, counts={kind: counts[kind] for kind in kinds}, tables=tables).rstrip() + "\n"


def look(notebooks: Path, place: Shown, claim: str) -> None:
    """Make sure that a notebook has the section that a claim points to, and prints what the claim says it prints.

    Raises:
        FileNotFoundError: there is no such notebook.
        ValueError: it lacks the heading or the output.
    """
    path = notebooks / f"{place.notebook}.ipynb"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; the claim {claim} points to it")
    headings, printed = _said(path.read_text(encoding="utf-8"))
    if place.section not in headings:
        raise ValueError(
            f"{path}: the claim {claim} points to the section {place.section!r}; the notebook has {', '.join(headings)}"
        )
    if place.prints and not any(place.prints in text for text in printed):
        raise ValueError(f"{path}: no output says {place.prints!r}; the claim {claim} quotes it: read the output again")


@lru_cache(maxsize=16)
def _said(notebook: str) -> tuple[list[str], list[str]]:
    """Headings of a notebook, and what its outputs say."""
    cells = json.loads(notebook)["cells"]
    lines = [line for cell in cells if cell["cell_type"] == "markdown" for line in "".join(cell["source"]).splitlines()]
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    texts = [output.get("text", output.get("data", {}).get("text/plain", "")) for output in outputs]
    return [line.lstrip("#").strip() for line in lines if line.startswith("#")], ["".join(text) for text in texts]
