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
from mwlib.experiments import grids
from mwlib.experiments.claims import (
    KINDS,
    MADE_WITH,
    REFERENCE,
    Claim,
    Comparison,
    Outcome,
    Tables,
    compare,
    decide,
    findings,
    read_claims,
    reproduction,
    scores,
    verdict,
)
from mwlib.plots.lines import evidence
from mwlib.plots.look import CYCLE, OBSERVED

pytestmark = pytest.mark.usefixtures("grids_read_once")
ROOT = Path(__file__).parents[2]
COMMITTED = (ROOT / "REPRODUCTION.md").read_text(encoding="utf-8")
LOWER = {"lower": "table_6|linear", "than": "cosine", "in": "APD"}
ONE = {
    "id": "linear-apd", "theme": "Schedules", "title": "Linear is narrow", "paper": "Table 6", "claim": "APD is 5.370.",
    "done": "We train.", "measured": [LOWER],
    "because": "Linear has {table_6|linear|APD ± sd}, cosine {table_6|cosine|APD}, over {table_6|linear|windows} windows; "
               "error {table_6|linear|APD se}.",
}  # fmt: skip
TABLE = """row,APD,"APD, deviation","APD, standard error",ADE,seeds,windows
linear,4.6451,0.2253,0.0407,,3,273
cosine,6.2968,0.2365,0.2079,0.7,3,273
sqrt,5,0,0.3,0.7,3,273
"""
PAIRED = """row,APD,"APD, standard error"
cosine - linear,1.5,0.3
sqrt - linear,0.5,0.4
"""


@pytest.fixture
def tables(tmp_path) -> Tables:
    """A folder with one small table."""
    folder = tmp_path / "cmu"
    folder.mkdir()
    (folder / "table_6.csv").write_text(TABLE, encoding="utf-8")
    about = {"mwlib": "0.2.0", "preset": "cmu_paper", "seeds_of": "training and sampling", "budget_share": 0.125}
    about["seconds_of_training"] = {"linear": 10.0, "cosine": 11.0, "sqrt": 10.0}
    (folder / "table_6.json").write_text(json.dumps(about), encoding="utf-8")
    return Tables(folder)


@pytest.fixture(scope="module")
def claims() -> list[Claim]:
    """Those of the course."""
    return read_claims()


def report(file: Path, tables: Tables) -> str:
    return reproduction(file, tables, findings(file, tables))


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
    assert (tmp_path / "now.md").read_text(encoding="utf-8") == COMMITTED, "run `mwlib reproduction` and read what changed"
    assert capsys.readouterr().out.strip() == str(tmp_path / "now.md")
    drawn = [folder / "figures" / "verdicts.csv" for folder in (ROOT, tmp_path)]
    assert drawn[0].read_text(encoding="utf-8") == drawn[1].read_text(encoding="utf-8"), "its picture"


def test_every_verdict_follows_and_is_counted(claims):
    tables = Tables()
    verdicts = [decide("claims.yaml", claim, tables).kind for claim in claims]
    assert len(claims) >= 70 and {*verdicts} == {*KINDS}
    for kind in KINDS:
        assert f"| {kind} | {verdicts.count(kind)} |" in COMMITTED
    assert f"| all | {len(claims)} |" in COMMITTED
    for claim in claims:
        assert COMMITTED.count(f'<a id="{claim.id}"></a>') == COMMITTED.count(f"](#{claim.id})") == 1


def test_every_link_of_the_report_leads_somewhere():
    links = {link for link in re.findall(r"\]\(([^)#]+)\)", COMMITTED) if not link.startswith("http")}
    assert links and all((ROOT / link).exists() for link in links)


def test_only_a_table_of_a_known_grid_may_be_missing():
    """While a grid is being measured its claims say so; a table that nobody measures is a mistake."""
    tables = Tables()
    with pytest.raises(
        ValueError, match=r"table_60\.csv is not there, and no grid is called 'table_60'; the folder has .*table_6"
    ):
        tables.rows("table_60")
    with pytest.raises(ValueError, match=r"figures.lafan1.bridge\.csv is not there"):
        tables.rows("lafan1/bridge")
    assert tables.rows("lafan1/bridges")["truth"]["L2P"] == "0"


def test_a_claim_waits_for_a_table_of_a_known_grid(tmp_path, tables):
    (claim,) = read_claims(write(tmp_path, {**ONE, "measured": [{**LOWER, "lower": "table_5|linear"}]}))
    assert decide("file", claim, tables).verdict == "not tested: the table `table_5.csv` is not there yet"


def test_numbers_come_out_of_the_table(tmp_path, tables):
    text = report(write(tmp_path, ONE), tables)
    assert "**Verdict: holds.** Linear has 4.65 ± 0.23, cosine 6.30, over 273 windows; error 0.0407." in text
    assert "table_6: linear − cosine, APD: -1.65 ± 0.28, as claimed‡." in text
    assert (
        "[table_6.csv](figures/cmu/table_6.csv): cmu/asfamc, 273 windows, 3 seeds of training and sampling, preset `cmu_paper`,"
        " 0.125 of the preset's training steps, mwlib 0.2.0" in text
    )


def test_a_proxy_is_told_where_the_verdict_begins(tmp_path, tables):
    text = report(write(tmp_path, {**ONE, "proxy": "We measure width."}), tables)
    assert "**Verdict, by a proxy: holds.** We measure width. Linear has" in text


def test_errors_of_a_comparison_by_hand(tables):
    """Unpaired: both errors and both trainings, in squares. Paired: the table's own. One training: no error over trainings."""
    trainings = (0.2253**2 + 0.2365**2) / 3
    apart = compare(Comparison("table_6|linear", "cosine", "APD", -1), tables)
    assert apart.difference == pytest.approx(4.6451 - 6.2968)
    assert apart.error == pytest.approx((0.0407**2 + 0.2079**2 + trainings) ** 0.5)
    assert apart.score == pytest.approx(-apart.difference / apart.error) and apart.score > 2
    (tables.folder / "table_6_paired.csv").write_text(PAIRED, encoding="utf-8")
    paired = Tables(tables.folder)
    beside = compare(Comparison("table_6|linear", "cosine", "APD", -1), paired)
    assert (beside.difference, beside.error) == (-1.5, pytest.approx((0.3**2 + trainings) ** 0.5))
    same = compare(Comparison("table_6|sqrt", "table_6|linear", "APD", 1), paired)
    assert (same.difference, same.error) == (0.5, 0.4), "equal seconds of training: the same networks"
    over_a_third = compare(Comparison("table_6|cosine", "sqrt", "APD", 1), paired)
    assert (over_a_third.difference, over_a_third.error) == (1.0, pytest.approx((0.7**2 + 0.2365**2 / 3) ** 0.5))
    twice = compare(Comparison("table_6|sqrt", "linear", "APD", 1, 2.0), paired)
    assert (twice.difference, twice.error) == (pytest.approx(5 - 2 * 4.6451), pytest.approx((0.3**2 + (2 * 0.0407) ** 2) ** 0.5))
    number = compare(Comparison("table_6|sqrt", 4.5, "APD", 1), paired)
    assert (number.difference, number.error, number.score) == (0.5, 0.3, pytest.approx(5 / 3))


@pytest.mark.parametrize(
    "scores, expected",
    [
        ((2.1, 9), "holds"), ((-2.1, -9), "contradicted"), ((-3, -3), "contradicted"),
        ((-2.1, 1), "inconclusive: 0 of 2 comparisons as claimed, 1 the other way"),
        ((2.1, 1.9), "inconclusive: 1 of 2 comparisons as claimed, 0 the other way"),
        ((2.1, -2.1), "inconclusive: 1 of 2 comparisons as claimed, 1 the other way"),
        ((-1.9, 0), "inconclusive: 0 of 2 comparisons as claimed, 0 the other way"),
    ],
)  # fmt: skip
def test_one_rule_decides(scores, expected):
    assert verdict([Outcome(Comparison("a|b", 0.0, "c", 1), score, 1.0) for score in scores]) == expected
    assert verdict([Outcome(Comparison("a|b", 0.0, "c", -1), -score, 1.0) for score in scores]) == expected


def test_without_an_error_the_sign_decides():
    assert [Outcome(Comparison("a|b", 0.0, "c", 1), each, 0.0).score for each in (1e-9, 0.0, -1)] == [
        float("inf"),
        0,
        float("-inf"),
    ]


PLACE = {"notebook": "00_start_here", "section": "5 · Back, exactly"}


@pytest.mark.parametrize(
    "change, message",
    [
        (
            {"verdict": "holds", "measured": [{**LOWER, "lower": "table_6|cosine", "than": "linear"}]},
            r"'holds' does not follow any more: table_6: cosine − linear, APD: 1\.65 ± 0\.28, the other way\. Read the table",
        ),
        ({"measured": [{**LOWER, "lower": "table_7|linear"}]}, r"table_7\.csv is not there, and no grid is called 'table_7'"),
        ({"measured": [{**LOWER, "than": "lineal"}]}, r"table_6\.csv has no row 'lineal'; expected one of linear, cosine"),
        ({"measured": [{**LOWER, "in": "APO"}]}, r"table_6\.csv has no column 'APO'; expected one of row, APD"),
        ({"measured": [{**LOWER, "in": "ADE"}]}, r"table_6\.csv, row 'linear': 'ADE' is empty; expected a number"),
        ({"measured": [{**LOWER, "higher": "table_6|sqrt"}]}, r"expected one of lower and higher, with table\|row"),
        ({"measured": [{**LOWER, "lower": "linear"}]}, r"expected one of lower and higher, with table\|row"),
        ({"measured": [{**LOWER, "than": True}]}, "than is True.*expected a row or a number"),
        ({"measured": [{**LOWER, "tmes": 2}]}, r"measured has .*'tmes'.*expected \['in', 'than'\]"),
        ({"because": "It is {table_6|linear}."}, "has a brace without a reference"),
        ({"verdict": "is true"}, "the verdict is 'is true'; expected one of holds, contradicted"),
        ({"verdict": "slip in the paper"}, "the last two with a reason after a colon"),
        ({"because": None}, "because is None; expected a text"),
        ({"colour": "blue"}, r"has \['because', .*'colour'.*; expected \['because', "),
        ({"id": "linear_apd"}, "id is 'linear_apd'; expected lower-case words with hyphens"),
        ({"shown": [{**PLACE, "section": "None"}]}, "points to the section 'None'; the notebook has 00 · Start here"),
        ({"shown": [{**PLACE, "notebook": "00_start"}]}, "00_start.ipynb is not there; the claim linear-apd points to it"),
        ({"shown": [{**PLACE, "prints": "x9"}]}, "no output says 'x9'; the claim linear-apd quotes it"),
    ],
)
def test_what_is_wrong_is_refused_by_name(tmp_path, tables, change, message):
    with pytest.raises((ValueError, FileNotFoundError), match=message) as refused:
        report(write(tmp_path, {**ONE, **change}), tables)
    assert f"claim {change.get('id', 'linear-apd')}" in str(refused.value), "which claim"


@pytest.mark.parametrize(
    "claim, message",
    [
        (without(ONE, "measured"), "has no evidence; expected comparisons under 'measured', or a verdict and a place"),
        ({**without(ONE, "measured"), "verdict": "holds"}, "has no evidence"),
        (without(ONE, "paper"), r"claim linear-apd has .*; expected \['because', 'claim', 'done', 'id', 'paper'"),
        ("text", "claim number 1 has text; expected"),
    ],
)
def test_a_claim_without_its_parts_is_refused(tmp_path, claim, message):
    with pytest.raises(ValueError, match=message):
        read_claims(write(tmp_path, claim))


@pytest.mark.parametrize(
    "text, message",
    [
        ("claims: {a: 1}", "claims is {'a': 1}; expected a list"),
        ("a: ]", "is not YAML"),
        ("a: 1\na: 2", "line 2: 'a' is already"),
    ],
)
def test_a_file_that_holds_no_claims_is_told(tmp_path, text, message):
    (tmp_path / "claims.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=rf"claims\.yaml,? .*{message}|claims\.yaml,? {message}"):
        read_claims(tmp_path / "claims.yaml")


def test_two_claims_of_one_id_are_refused(tmp_path):
    with pytest.raises(ValueError, match="two claims have the id 'linear-apd'"):
        read_claims(write(tmp_path, ONE, ONE))


def test_the_command_tells_the_claim_and_writes_nothing(tmp_path, tables, capsys):
    path = write(tmp_path, {**ONE, "verdict": "holds", "measured": [{**LOWER, "than": 1}]})
    words = ["--claims", str(path), "--tables", str(tables.folder), "--out", str(tmp_path / "report.md")]
    assert main(["reproduction", *words]) == 1
    assert "claim linear-apd: 'holds' does not follow any more" in capsys.readouterr().err
    assert not (tmp_path / "report.md").exists()


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


def test_a_changed_table_flips_a_committed_verdict(tmp_path, claims):
    """One number of one committed table: bones that keep their lengths leave the paper's own doubt open."""
    (claim,) = (each for each in claims if each.id == "plausibility")
    assert decide("", claim, Tables()).verdict == "holds"
    rigid = with_changed_cell(tmp_path / "cmu", "cosine", "bone jitter (mm)", 0.01)
    assert decide("", claim, rigid).kind == "inconclusive"


def test_the_picture_has_each_comparison_that_decides(tmp_path, tables):
    """None without an error, none of a claim whose verdict was written."""
    number = {"higher": "table_6|cosine", "than": 6, "in": "APD"}
    written = {**ONE, "id": "written", "verdict": "not tested: too short", "shown": [PLACE]}
    path = write(tmp_path, {**ONE, "measured": [LOWER, number, {**LOWER, "than": 5, "in": "seeds"}]}, written)
    first, second = scores(findings(path, tables))
    assert first["claim"] == second["claim"] == "linear-apd" and first["theme"] == "Schedules"
    assert first["errors"] > 2 and second["errors"] == pytest.approx((6.2968 - 6) / 0.2079)
    colours = [line.get_color() for line in evidence({"A": [3.0, -3.0, 0.5, 30.0], "B": [0.5]})[1].lines]
    assert colours == [CYCLE[1], OBSERVED, CYCLE[0], CYCLE[0], OBSERVED]


def test_conclusions_open_the_page_with_their_numbers(tmp_path, tables):
    path = write(tmp_path, ONE)
    told = {"conclusions": ["Linear has {table_6|linear|APD ± sd}."]}
    path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text(encoding="utf-8")) | told), encoding="utf-8")
    assert "* Linear has 4.65 ± 0.23.\n" in report(path, tables).partition("| verdict |")[0]


def test_sentences_print_three_digits_and_spreads_two(tables):
    assert tables.filled("{table_6|linear|APD} {table_6|linear|APD sd} {table_6|linear|APD ± se}") == "4.65 0.225 4.65 ± 0.041"


def test_rows_that_claims_name_stand_in_their_grids(claims):
    """What is not measured yet is not looked up; a slip in it would show only when the table is there."""
    known = grids.read_grids()
    for claim in claims:
        cells = [(table, row) for each in claim.measured for table, row in each.places]
        for name, row in [*cells, *(place[:2] for place in REFERENCE.findall(claim.because))]:
            if grid := known.get(MADE_WITH.sub("", name)):
                assert row in [each.name for each in grid.rows], f"{claim.id}: {name}, {row}"
