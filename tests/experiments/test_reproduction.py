"""The report on the paper's claims: numbers from tables, verdicts that follow from them, links that lead somewhere."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path

import pytest
import yaml

from mwlib.cli import main
from mwlib.experiments.claims import KINDS, MADE_WITH, OTHERWISE, PENDING, REFERENCE, Tables, decide, holds, read_claims
from mwlib.experiments.claims import reproduction as report
from mwlib.experiments.grids import read_grids

ROOT = Path(__file__).parents[2]
CLAIMS = ROOT / "figures" / "claims.yaml"
ONE = {
    "id": "linear-apd", "theme": "Schedules", "title": "Linear is narrow", "paper": "Table 6", "claim": "APD is 5.370.",
    "done": "We train.",
    "verdict": "holds", "check": "{table_6|linear|APD} < {table_6|cosine|APD} - 2 * {table_6|linear|APD se}",
    "because": "Linear has {table_6|linear|APD ± sd}, cosine {table_6|cosine|APD}, over {table_6|linear|windows} windows; "
               "error {table_6|linear|APD se}.",
}  # fmt: skip
TABLE = """row,APD,"APD, deviation","APD, standard error",ADE,seeds,windows
linear,4.6451,0.2253,0.0407,,3,273
cosine,6.2968,0.2365,0.2079,0.7,3,273
"""


@pytest.fixture
def tables(tmp_path) -> Tables:
    """A folder with one small table."""
    folder = tmp_path / "cmu"
    folder.mkdir()
    (folder / "table_6.csv").write_text(TABLE, encoding="utf-8")
    about = {"mwlib": "0.2.0", "preset": "cmu_paper", "seeds_of": "training and sampling", "budget_share": 0.125}
    (folder / "table_6.json").write_text(json.dumps(about), encoding="utf-8")
    return Tables(folder)


def write(folder: Path, *claims: dict) -> Path:
    """A file of claims."""
    path = folder / "claims.yaml"
    path.write_text(yaml.safe_dump({"claims": list(claims)}, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path


def without(claim: dict, *names: str) -> dict:
    """A claim that lacks some fields."""
    return {name: value for name, value in claim.items() if name not in names}


def test_the_committed_report_is_what_the_command_writes(tmp_path, capsys):
    assert main(["reproduction", "--out", str(tmp_path / "now.md")]) == 0
    now = (tmp_path / "now.md").read_text(encoding="utf-8")
    assert (ROOT / "REPRODUCTION.md").read_text(encoding="utf-8") == now, "run `mwlib reproduction` and read what changed"
    assert capsys.readouterr().out.strip() == str(tmp_path / "now.md")


def test_every_verdict_follows_and_is_counted():
    claims, tables = read_claims(), Tables()
    verdicts = [decide("claims.yaml", claim, tables)[0].kind for claim in claims]
    assert len(claims) >= 28 and {*verdicts} <= {*KINDS, PENDING}
    text = report()
    for kind in KINDS:
        assert f"| {kind} | {verdicts.count(kind)} |" in text
    assert f"| all | {len(claims)} |" in text
    for claim in claims:
        assert text.count(f'<a id="{claim.id}"></a>') == text.count(f"](#{claim.id})") == 1


def test_every_link_of_the_report_leads_somewhere():
    links = {link for link in re.findall(r"\]\(([^)#]+)\)", report()) if not link.startswith("http")}
    assert links and all((ROOT / link).exists() for link in links)


def test_only_a_table_of_a_known_grid_may_be_missing():
    """While a grid is being measured its claims say so; a table that nobody measures is a mistake."""
    tables = Tables()
    with pytest.raises(
        ValueError, match=r"table_60\.csv is not there, and no grid is called 'table_60'; the folder has .*table_6"
    ):
        tables.rows("table_60")
    for claim in read_claims():
        case, _ = decide("claims.yaml", claim, tables)
        assert (case.verdict == PENDING) == ("is not there yet" in case.because)


def test_numbers_come_out_of_the_table(tmp_path, tables):
    text = report(write(tmp_path, ONE), tables, ROOT / "notebooks")
    assert "**Verdict: holds.** Linear has 4.65 ± 0.23, cosine 6.30, over 273 windows; error 0.0407." in text
    assert (
        "[table_6.csv](figures/cmu/table_6.csv) (273 windows, 3 seeds of training and sampling, preset `cmu_paper`, 0.125 of"
        in text
    )


LOW = "{table_6|linear|APD} > {table_6|cosine|APD}"
PLACE = {"notebook": "00_start_here", "section": "5 · Back, exactly"}


@pytest.mark.parametrize(
    "change, message",
    [
        (
            {"check": LOW},
            r"no verdict follows any more: 'holds' needs .*, which is 4\.6451 > 6\.2968, and false. Expected a check",
        ),
        ({"check": "{table_7|linear|APD} > 1"}, r"table_7\.csv is not there, and no grid is called 'table_7'"),
        ({"check": "{table_6|lineal|APD} > 1"}, r"table_6\.csv has no row 'lineal'; expected one of linear, cosine"),
        ({"check": "{table_6|linear|APO} > 1"}, r"table_6\.csv has no column 'APO'; expected one of row, APD"),
        ({"check": "{table_6|linear|ADE} > 1"}, r"table_6\.csv, row 'linear': 'ADE' is empty; expected a number"),
        ({"check": "{table_6|linear|APD ± sd} > 1"}, "'APD ± sd' stands in a check; expected one number"),
        ({"because": "It is {table_6|linear}."}, "has a brace without a reference"),
        ({"verdict": "is true"}, "the verdict is 'is true'; expected one of holds, does not hold here"),
        ({"verdict": "depends on the reading"}, "expected a reason after a colon"),
        ({"check": None}, "check is None; expected a text"),
        ({"colour": "blue"}, r"has \['because', .*'colour'.*; expected \['claim', "),
        ({"id": "linear_apd"}, "the id is 'linear_apd'; expected lower-case words with hyphens"),
        ({"cases": [{"verdict": "holds", "because": "So."}]}, "expected a verdict or a list of cases, and not both"),
        ({"shown": [{**PLACE, "section": "None"}]}, "points to the section 'None'; the notebook has 00 · Start here"),
        ({"shown": [{**PLACE, "notebook": "00_start"}]}, "00_start.ipynb is not there; the claim linear-apd points to it"),
        ({"shown": [{**PLACE, "prints": "x9"}]}, "no output says 'x9'; the claim linear-apd quotes it"),
    ],
)
def test_what_is_wrong_is_refused_by_name(tmp_path, tables, change, message):
    with pytest.raises((ValueError, FileNotFoundError), match=message) as refused:
        report(write(tmp_path, {**ONE, **change}), tables, ROOT / "notebooks")
    assert f"claim {change.get('id', 'linear-apd')}" in str(refused.value), "which claim"


@pytest.mark.parametrize(
    "claim, message",
    [
        (without(ONE, "check"), "gives measured numbers and no check"),
        ({**without(ONE, "check"), "because": "So it is."}, "has no evidence; expected a check or a place in a notebook"),
        (without(ONE, "paper"), r"claim linear-apd has .*; expected \['claim', 'done', 'id', 'paper'"),
        ("text", "claim number 1 has text; expected"),
    ],
)
def test_a_claim_without_its_parts_is_refused(tmp_path, claim, message):
    with pytest.raises(ValueError, match=message):
        read_claims(write(tmp_path, claim))


@pytest.mark.parametrize(
    "text, message",
    [("claims: {a: 1}", "expected a mapping with a list"), ("a: ]", "is not YAML"), ("a: 1\na: 2", "line 2: 'a' is already")],
)
def test_a_file_that_holds_no_claims_is_told(tmp_path, text, message):
    (tmp_path / "claims.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=rf"claims\.yaml,? .*{message}|claims\.yaml,? {message}"):
        read_claims(tmp_path / "claims.yaml")


def test_two_claims_of_one_id_are_refused(tmp_path):
    with pytest.raises(ValueError, match="two claims have the id 'linear-apd'"):
        read_claims(write(tmp_path, ONE, ONE))


def test_the_command_tells_the_claim_and_writes_nothing(tmp_path, tables, capsys):
    path = write(tmp_path, {**ONE, "check": "{table_6|linear|APD} > {table_6|cosine|APD}"})
    words = ["--claims", str(path), "--tables", str(tables.folder), "--out", str(tmp_path / "report.md")]
    assert main(["reproduction", *words]) == 1
    assert "claim linear-apd: no verdict follows any more" in capsys.readouterr().err and not (tmp_path / "report.md").exists()


def with_changed_cell(folder: Path, row: str, column: str, value: float) -> Tables:
    """A copy of the committed tables, with another number in one cell of table 6."""
    shutil.copytree(ROOT / "figures" / "cmu", folder, ignore=shutil.ignore_patterns("*.png", "*.pdf"))
    with (folder / "table_6.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    next(line for line in rows if line["row"] == row)[column] = str(value)
    with (folder / "table_6.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return Tables(folder)


def test_a_changed_table_flips_a_committed_verdict(tmp_path):
    """One number of one committed table: the schedules change places; then, bones that keep their lengths refuse the report."""
    claim = "The linear schedule gives the least diversity"
    verdict = {
        text: next(line for line in text.split(claim, 2)[2].splitlines() if "Verdict" in line)
        for text in (
            report(CLAIMS, Tables(ROOT / "figures" / "cmu"), ROOT / "notebooks"),
            report(CLAIMS, with_changed_cell(tmp_path / "least", "linear", "APD", 0.5), ROOT / "notebooks"),
        )
    }
    before, after = verdict.values()
    assert "does not hold here" in before and "Verdict: holds" in after
    with pytest.raises(ValueError, match=r"claims\.yaml: claim plausibility: no verdict follows any more"):
        report(CLAIMS, with_changed_cell(tmp_path / "rigid", "cosine", "bone jitter (mm)", 0.01), ROOT / "notebooks")


def test_cases_are_tried_in_order_and_pass_over_what_is_not_measured(tmp_path, tables):
    paired = {"verdict": "does not hold here", "check": "{table_6_paired|cosine - linear|APD} < 0", "because": "Paired."}
    narrow = {"verdict": "holds", "check": "{table_6|linear|APD} < 1", "because": "Far."}
    rest = {"verdict": "depends on the reading: of both", "check": "otherwise", "because": "Linear has {table_6|linear|APD}."}
    claim = without(ONE, "verdict", "check", "because")

    def verdict(*cases: dict) -> tuple[str, str]:
        (read,) = read_claims(write(tmp_path, {**claim, "cases": list(cases)}))
        case, _ = decide("file", read, tables)
        return case.verdict, case.because

    assert verdict(paired, narrow, rest) == ("depends on the reading: of both", "Linear has 4.65.")
    assert verdict(rest, narrow)[0] == "depends on the reading: of both"
    pending, why = verdict(paired)
    assert (pending, why) == (PENDING, "The table `table_6_paired.csv` is not there yet.")
    with pytest.raises(ValueError, match="'holds' needs .*4.6451 < 1, and false"):
        verdict(paired, narrow)
    to_come = {**paired, "check": "{to_come_paired|linear|APD} < 0"}
    with pytest.raises(ValueError, match="no grid is called 'to_come_paired'"):
        verdict(to_come)


def five(table: str, row: str, column: str) -> float | tuple[float, ...]:
    """The value of every cell."""
    return (5.0, 5.0) if row == "*" else 5.0


@pytest.mark.parametrize(
    "check, expected",
    [
        ("{a|b|c} < 6", True), ("{a|b|c} > 6", False), ("4 < {a|b|c} <= 5", True), ("5 < {a|b|c} < 6", False),
        ("{a|b|c} == 5", True), ("not {a|b|c} < 6", False), ("{a|b|c} < 6 and 1 > 2", False), ("{a|b|c} > 6 or 1 < 2", True),
        ("{a|b|c} - 2 * 3 + 1 == 0", True), ("{a|b|c} / 2 >= 2.5", True), ("abs(3 - {a|b|c}) == 2", True), ("-{a|b|c} < 0", True),
        ("min({a|b|c}, 3) == 3", True), ("max({a|b|c}, 3) == 3", False), ("{a|b, c: d|e f (g)} == 5", True),
    ],
)  # fmt: skip
def test_conditions_by_hand(check, expected):
    assert holds(check, five) is expected


@pytest.mark.parametrize(
    "check",
    [
        "__import__('os').system('true') == 0", "open('/etc/passwd') == 1", "(lambda: 1)() == 1", "[1][0] == 1",
        "{a|b|c}.real == 5", "x == 1", "'a' == 'a'", "True", "2 ** 9 > 1", "1 if 1 > 0 else 2", "abs(1, 2) > 0", "min() < 1",
        "max(1, key=abs) == 1", "{a|b|c}", "{a|b|c} + 1", "1 < 2 + (3 > 2)", "1 and 2", "not 1", "1 <", "{a|b|c} != 4",
        "1 / 0 > 1", "[x for x in (1,)] == 1", "(y := 1) == 1", "f'{1}' == 1", "1 in (1, 2)", "", "eval == 1",
    ],
)  # fmt: skip
def test_nothing_but_a_condition_is_understood(check):
    with pytest.raises(ValueError, match="expected"):
        holds(check, five)


def test_a_star_stands_for_all_rows(tables):
    assert holds("min({table_6|*|APD}) == {table_6|linear|APD} and max({table_6|*|APD}) == {table_6|cosine|APD}", tables.value)
    with pytest.raises(ValueError, match="may stand in min and max only"):
        holds("{table_6|*|APD} > 1", tables.value)


def test_sentences_print_three_digits_and_spreads_two(tables):
    assert tables.filled("{table_6|linear|APD} {table_6|linear|APD sd} {table_6|linear|APD ± se}") == "4.65 0.225 4.65 ± 0.041"


def test_cases_that_wait_for_a_table_can_be_read_and_name_rows_of_its_grid():
    """What is not measured yet is not looked up; a slip in it would show only when the table is there."""
    grids = read_grids()
    for claim in read_claims():
        for case in claim.cases:
            assert case.check in ("", OTHERWISE) or isinstance(holds(case.check, five), bool)
            for name, row, _ in REFERENCE.findall(case.check + case.because):
                if grid := grids.get(MADE_WITH.sub("", name)):
                    rows = [known.name for known in grid.rows]
                    pairs = [f"{known} - {grid.reference}" for known in rows]
                    assert row in (*(pairs if name.endswith("_paired") else rows), "*"), f"{claim.id}: {name}, {row}"
