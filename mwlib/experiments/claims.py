"""Claims of papers, verdicts that follow from measured tables by one rule, and the page about them."""

import json
import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Any

from mwlib.experiments.grids import HYPHENED, LIST, NUMBER, WORDS, Place, check_fields, read_grids
from mwlib.experiments.results import committed_folder, read_table, rendered
from mwlib.paths import course_folder
from mwlib.plots.tables import significant
from mwlib.settings import read_yaml

KINDS = ("holds", "contradicted", "inconclusive", "not tested", "slip in the paper")  # of verdicts
BEYOND = 2.0  # standard errors that decide a comparison

REFERENCE = re.compile(r"\{([^{}|]+)\|([^{}|]+)\|([^{}|]+)\}")  # {table|row|column}
SPREAD = re.compile(r" (sd|se)$")  # at the end of a column
SPREADS = {"sd": ", deviation", "se": ", standard error"}
MADE_WITH = re.compile(r"_(paired|details|actions)$")


class NotMeasured(LookupError):
    """A table of a known grid is not there yet."""


class Tables:
    """Measured tables of a folder, by name, read when they are asked for.

    Args:
        folder: of the CSV files; None = the course's `figures/cmu`. Its neighbours are named with a slash: `lafan1/bridges`.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder or committed_folder()
        self._rows: dict[str, dict[str, dict[str, str]]] = {}

    def file(self, name: str) -> Path:
        """Where a table lies."""
        return (self.folder.parent if "/" in name else self.folder) / f"{name}.csv"

    def rows(self, name: str) -> dict[str, dict[str, str]]:
        """The lines of a table by what stands in the first column.

        Raises:
            NotMeasured: the table is not there, but a grid is called so.
            ValueError: nothing is called so.
        """
        file = self.file(name)
        if name not in self._rows:
            if not file.is_file():
                if MADE_WITH.sub("", file.stem) in read_grids():
                    raise NotMeasured(f"`{file.name}` is not there yet")
                others = ", ".join(sorted(file.stem for file in file.parent.glob("*.csv"))) or "no tables"
                raise ValueError(f"{file} is not there, and no grid is called {name!r}; the folder has {others}")
            self._rows[name] = {next(iter(row.values())): row for row in read_table(file)}
        return self._rows[name]

    def text(self, name: str, row: str, column: str) -> str:
        """One cell as it stands in the file.

        Raises:
            NotMeasured: as `rows`.
            ValueError: there is no such table, row or column, or the cell is empty.
        """
        found: Any = self.rows(name)
        for what, key in (("row", row), ("column", column)):
            if key not in found:
                raise ValueError(f"{self.file(name)} has no {what} {key!r}; expected one of {', '.join(found)}")
            found = found[key]
        if not found:
            raise ValueError(f"{self.file(name)}, row {row!r}: {column!r} is empty; expected a number")
        return found

    def printed(self, name: str, row: str, column: str) -> str:
        """What a reference in a sentence becomes: three digits, with the spread if the column ends in "± sd" or "± se"."""
        mean, pair, spread = column.partition(" ± ")
        said, asked = [], [(mean, 3), (f"{mean} {spread}", 2)] if pair else [(column, 3)]
        for heading, digits in asked:
            text = self.text(name, row, SPREAD.sub(lambda end: SPREADS[end[1]], heading))
            said.append(text if text.isdigit() else significant(float(text), digits))
        return " ± ".join(said)

    def about(self, name: str) -> dict[str, Any]:
        """What the JSON file beside a table says of it."""
        return json.loads(self.file(name).with_suffix(".json").read_text(encoding="utf-8"))

    def number(self, name: str, row: str, column: str, spread: str = "") -> float:
        """One cell, or its deviation over seeds ("sd") or standard error ("se"): 0 where the table has none."""
        if not spread:
            return float(self.text(name, row, column))
        return float(self.rows(name)[row].get(column + SPREADS[spread]) or 0)

    def pairs(self, name: str, column: str) -> tuple[str, dict[str, tuple[float, float]]]:
        """The row with which all others are compared window by window, and each one's mean difference with its standard error."""
        paired, found, reference = f"{MADE_WITH.sub('', name)}_paired", {}, ""
        for pair, cells in (self.rows(paired) if self.file(paired).is_file() else {}).items():
            row, _, reference = pair.rpartition(" - ")
            if cells.get(column):
                found |= {row: (float(cells[column]), self.number(paired, pair, column, "se")), reference: (0.0, 0.0)}
        return reference, found

    def filled(self, text: str) -> str:
        """A sentence with its numbers."""
        full = REFERENCE.sub(lambda found: self.printed(*found.groups()), text)
        if "{" in full or "}" in full:
            raise ValueError(f"{text!r} has a brace without a reference; expected {{table|row|column}}")
        return " ".join(full.split())

    def behind(self, name: str) -> list[dict[str, str]]:
        """The lines of a grid's own table, of which one that was made with it has windows and seeds."""
        return [*self.rows(MADE_WITH.sub("", name)).values()]


@dataclass(frozen=True)
class Comparison:
    """What a claim says of two cells of a column, or of one cell and a number.

    Args:
        row: `table|row` that is said to be lower or higher.
        than: `table|row`, the name of a row of the same table, or a number.
        column: of both.
        sign: 1 where the claim says higher, -1 where it says lower.
        times: the second number counts so many times.
    """

    row: str
    than: str | float
    column: str
    sign: int
    times: float = 1.0

    @property
    def places(self) -> tuple[tuple[str, str], ...]:
        """Table and row of the two cells; one where the other is a number."""
        table, _, row = self.row.partition("|")
        if not isinstance(self.than, str):
            return ((table, row),)
        other, _, named = self.than.rpartition("|")
        return (table, row), (other or table, named)


@dataclass(frozen=True)
class Outcome:
    """A comparison as measured: the difference in the table's unit, and its standard error (0 = none is known)."""

    comparison: Comparison
    difference: float
    error: float

    @property
    def score(self) -> float:
        """Difference in errors, positive if it has the claim's sign."""
        signed = self.comparison.sign * self.difference
        return signed / self.error if self.error else math.inf * signed if signed else 0.0

    def sentence(self, corrected: float) -> str:
        """What was compared and found; ‡ marks what lies beyond the errors that many comparisons ask for."""
        one, *two = self.comparison.places
        times = f"{self.comparison.times:g} × " if self.comparison.times != 1 else ""
        other = two[0][1] if two else f"{self.comparison.than:g}"
        error = f" ± {significant(self.error, 2)}" if self.error else ""
        word = "as claimed" if self.score > BEYOND else "the other way" if self.score < -BEYOND else "undecided"
        mark = "‡" if self.error and abs(self.score) > corrected else ""
        return (
            f"{one[0]}: {one[1]} − {times}{other}, {self.comparison.column}: {significant(self.difference)}{error}, {word}{mark}"
        )


def compare(comparison: Comparison, tables: Tables) -> Outcome:
    """Measure a comparison.

    Rows that are compared with one row saw the same windows: their difference is taken window by window, its error over clips.
    Where only differences from a third row are kept, the error is at most the sum of two. Rows of different trainings have the
    error over trainings beside it.
    """
    (table, row), *others = comparison.places
    column, times = comparison.column, comparison.times
    value, error = tables.number(table, row, column), tables.number(table, row, column, "se")
    if not others:
        return Outcome(comparison, value - times * float(comparison.than), error)
    ((other, named),) = others
    difference = value - times * tables.number(other, named, column)
    error = math.hypot(error, times * tables.number(other, named, column, "se"))
    (reference, pairs), (other_reference, other_pairs) = (tables.pairs(each, column) for each in (table, other))
    if times == 1 and reference == other_reference and row in pairs and named in other_pairs:
        difference, error = pairs[row][0] - other_pairs[named][0], pairs[row][1] + other_pairs[named][1]
    return Outcome(comparison, difference, math.hypot(error, _over_trainings(comparison, tables)))


def _over_trainings(comparison: Comparison, tables: Tables) -> float:
    """Standard error that trainings add: 0 where both rows sample the same trained models, told by their seconds of training."""
    seconds = [tables.about(MADE_WITH.sub("", table)).get("seconds_of_training", {}).get(row) for table, row in comparison.places]
    if None in seconds or seconds[0] == seconds[1]:
        return 0.0
    one, other = (
        tables.number(table, row, comparison.column, "sd") / math.sqrt(int(tables.rows(table)[row].get("seeds") or 1))
        for table, row in comparison.places
    )
    return math.hypot(one, comparison.times * other)


def verdict(outcomes: list[Outcome]) -> str:
    """The one rule: a claim holds if every comparison is beyond two errors its way, and is contradicted if every one is beyond
    two errors the other way."""
    with_it, against = (sum(sign * outcome.score > BEYOND for outcome in outcomes) for sign in (1, -1))
    if len(outcomes) in (with_it, against):
        return KINDS[against > 0]
    return f"{KINDS[2]}: {with_it} of {len(outcomes)} comparisons as claimed, {against} the other way"


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
        because: what was found; `{table|row|column}` stands for a measured number.
        verdict: one of KINDS, with a reason after a colon where it needs one; empty = follows from `measured`.
        measured: comparisons from which the verdict follows; beside a verdict all must come out as they say.
        proxy: what was measured in place of what the paper says; may be empty.
        shown: where in the notebooks.
    """

    id: str
    theme: str
    title: str
    paper: str
    claim: str
    done: str
    because: str
    verdict: str = ""
    measured: tuple[Comparison, ...] = ()
    proxy: str = ""
    shown: tuple[Shown, ...] = ()

    @property
    def tables(self) -> list[str]:
        """Those that it rests on."""
        named = [name for name, _, _ in REFERENCE.findall(self.because)]
        return list(dict.fromkeys([*(table for each in self.measured for table, _ in each.places), *named]))


@dataclass(frozen=True)
class Finding:
    """A claim with its verdict, sentences filled in.

    Args:
        claim: what the paper says.
        verdict: with its reason.
        because: the sentences.
        outcomes: of its comparisons.
    """

    claim: Claim
    verdict: str
    because: str
    outcomes: tuple[Outcome, ...] = ()

    @property
    def kind(self) -> str:
        """The verdict without its reason."""
        return self.verdict.partition(":")[0].strip()


# What a claim of the file may hold, see `check_fields`.
OWN = {"id", "theme", "title", "paper", "claim", "done", "because"}
CLAIM = dict.fromkeys([*OWN, "verdict", "proxy"], WORDS) | {"id": HYPHENED, "measured": LIST, "shown": LIST}
SHOWN = dict.fromkeys(["notebook", "section", "prints"], WORDS)
SIDES = {"lower": -1, "higher": 1}
COMPARISON = dict.fromkeys(SIDES, WORDS) | {
    "than": ("a row or a number", lambda value: WORDS[1](value) or NUMBER[1](value)),
    "in": ("a column, or several", lambda value: WORDS[1](value) or LIST[1](value)),
    "times": NUMBER,
}


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
    path = path or claims_file()
    tree = read_yaml(path)
    check_fields(Place(path, "the top"), tree, {"claims"}, {"claims": LIST, "conclusions": LIST})
    found = []
    for number, body in enumerate(tree["claims"], 1):
        name = (body if isinstance(body, dict) else {}).get("id", f"number {number}")
        found.append(_claim(Place(path, f"claim {name}").of(body), body))
        if name in [claim.id for claim in found[:-1]]:
            raise ValueError(f"{path}: two claims have the id {name!r}; expected different ones")
    return found


def _claim(where: Place, body: Any) -> Claim:
    check_fields(where, body, OWN, CLAIM)
    shown = body.get("shown", [])
    for place in shown:
        check_fields(where.of(body, words="shown"), place, {"notebook", "section"}, SHOWN)
    said = body.get("verdict", "")
    kind, _, reason = map(str.strip, said.partition(":"))
    if said and (kind not in KINDS or (kind in KINDS[3:] and not reason)):
        raise ValueError(
            f"{where}: the verdict is {said!r}; expected one of {', '.join(KINDS)}, the last two with a reason after a colon"
        )
    measured = tuple(each for entry in body.get("measured", []) for each in _comparisons(where.of(body, words="measured"), entry))
    if not measured and (not said or (kind != "not tested" and not shown)):
        raise ValueError(
            f"{where} has no evidence; expected comparisons under 'measured', or a verdict and a place under 'shown'"
        )
    texts = {name: " ".join(text.split()) for name, text in body.items() if name not in ("measured", "shown")}
    return Claim(**texts, measured=measured, shown=tuple(Shown(**place) for place in shown))


def _comparisons(where: Place, entry: Any) -> list[Comparison]:
    """Comparisons of one entry: `{lower: table|row, than: row, in: [columns], times: 1}`, or `higher`."""
    check_fields(where, entry, {"than", "in"}, COMPARISON)
    sides = [name for name in SIDES if name in entry]
    if len(sides) != 1 or "|" not in entry[sides[0]]:
        raise ValueError(f"{where} has {entry}; expected one of lower and higher, with table|row")
    (side,), columns = sides, entry["in"] if isinstance(entry["in"], list) else [entry["in"]]
    return [Comparison(entry[side], entry["than"], column, SIDES[side], entry.get("times", 1.0)) for column in columns]


def decide(where: str, claim: Claim, tables: Tables) -> Finding:
    """The verdict of a claim, its sentences filled in.

    Args:
        where: for messages, e.g. the file.
        claim: of a paper.
        tables: measured; while one of a known grid is missing the claim is not tested.

    Raises:
        ValueError: a cell is not there, or a comparison beside a written verdict does not come out as it says; the message names
            the claim.
    """
    try:
        outcomes = tuple(compare(each, tables) for each in claim.measured)
        because = tables.filled(claim.because)
    except NotMeasured as error:
        return Finding(claim, f"{KINDS[3]}: the table {error}", "")
    except ValueError as error:
        raise ValueError(f"{where}: claim {claim.id}: {error}") from None
    if claim.verdict and (wrong := [outcome for outcome in outcomes if outcome.score <= BEYOND]):
        raise ValueError(f"{where}: claim {claim.id}: {claim.verdict!r} does not follow any more: {wrong[0].sentence(math.inf)}. "
                         "Read the table again and write the verdict that follows from it")  # fmt: skip
    return Finding(claim, claim.verdict or verdict([*outcomes]), because, outcomes)


def findings(file: Path, tables: Tables) -> list[Finding]:
    """All claims of a file with their verdicts, each place in a notebook of the course looked up.

    Raises:
        FileNotFoundError, ValueError: a file is missing, a verdict does not follow from its comparisons, or a notebook lacks a
            heading or an output; the message names the file and the claim.
    """
    found = []
    for claim in read_claims(file):
        for place in claim.shown:
            look(course_folder() / "notebooks", place, claim.id)
        found.append(decide(str(file), claim, tables))
    return found


def scores(found: list[Finding]) -> list[dict[str, Any]]:
    """Comparisons with an error, of claims whose verdict follows from tables: theme, claim, column, difference in errors."""
    return [
        {"theme": f.claim.theme, "claim": f.claim.id, "column": outcome.comparison.column, "errors": outcome.score}
        for f in found if not f.claim.verdict for outcome in f.outcomes if outcome.error
    ]  # fmt: skip


def reproduction(file: Path, tables: Tables, found: list[Finding]) -> str:
    """The page about what was found of the claims, as Markdown; links start from the folder of the course.

    Args:
        file, tables: as for `findings`. The file's `conclusions` open the page.
        found: what `findings` gives.
    """
    counts = Counter(finding.kind for finding in found)
    errors = [abs(outcome.score) for finding in found for outcome in finding.outcomes if outcome.error]
    return rendered(
        "experiments/reproduction.md.jinja",
        findings=found,
        names=sorted({name for finding in found if finding.because for name in finding.claim.tables}),
        scores=errors,
        corrected=NormalDist().inv_cdf(1 - 0.05 / 2 / max(len(errors), 1)),  # Bonferroni
        beyond=BEYOND,
        tables=tables,
        conclusions=[tables.filled(sentence) for sentence in read_yaml(file).get("conclusions", [])],
        counts={kind: counts[kind] for kind in KINDS},
    )


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
    if place.prints not in printed:
        raise ValueError(f"{path}: no output says {place.prints!r}; the claim {claim} quotes it: read the output again")


@lru_cache(maxsize=16)
def _said(notebook: str) -> tuple[list[str], str]:
    """Headings of a notebook, and what its outputs say."""
    cells = json.loads(notebook)["cells"]
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    printed = ["".join(output.get("text", output.get("data", {}).get("text/plain", ""))) for output in outputs]
    return re.findall(r"^#+ *(.*)", text, re.MULTILINE), "\n\n".join(printed)
