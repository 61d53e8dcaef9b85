"""What a build's chapters came to, and runs that refuse or fail."""

from __future__ import annotations

import json

import pytest

from mwlib.cli.course import claims
from mwlib.course.claims import named, read_build, report, summed_up
from mwlib.course.execute import NotDone, run_notebook
from mwlib.experiments.page import Claim
from mwlib.experiments.results import RESULT, result_of
from tests.sample_notebooks import bare, save

NAMES = ("00_a", "01_b", "02_c", "03_d")
STRIDE, TURN = "the samples stride less than the truth", "nobody turns round"


def chapter(folder, status, **told):
    folder.mkdir(parents=True)
    (folder / RESULT).write_text(json.dumps({"status": status, "hash": "", "depends": {}, "metrics": {}, **told}))


def claimed(sentence, holds, **numbers):
    return {"sentence": sentence, "holds": holds, "numbers": numbers}


@pytest.fixture
def build(tmp_path):
    folder = tmp_path / "mine"
    chapter(folder / "00_a", "ok", claims=[claimed(STRIDE, False, samples=0.5), claimed(TURN, True)], left_out=["no feet"])
    chapter(folder / "01_b", "refused", reason="01_b: this chapter needs two people")
    chapter(folder / "02_c", "failed", reason="02_c: cell 3 raised\n(see notebook)")
    return folder


def test_a_build_is_summed_up(build):
    chapters = read_build(build, NAMES)
    assert [c.status for c in chapters.values()] == ["ok", "refused", "failed", "not run"]
    assert summed_up(chapters) == "Of 2 claims 1 hold on these motions, 1 do not, 0 cannot be said."
    told = report({"mine": chapters})
    assert "1 of 4 chapters got to their end." in told
    for line in (
        "* 01_b: refused: this chapter needs two people",
        "* 02_c: failed: cell 3 raised\n",
        "* 03_d: not run",
        "* 00_a: left out: no feet",
    ):
        assert line in told
    assert STRIDE in told and "✗ samples 0.500" in told and TURN not in told
    assert TURN in report({"mine": chapters}, whole=True)


def test_builds_are_laid_side_by_side_with_the_embedded_people(build, tmp_path, monkeypatch):
    embedded = {STRIDE: Claim(STRIDE, True, {"longest": 0.4, "samples": 0.2})}
    monkeypatch.setattr("mwlib.course.claims.stored_claims", lambda name: embedded if name == "00_a" else {})
    other = tmp_path / "other"
    chapter(other / "00_a", "ok", claims=[claimed(STRIDE, True, samples=0.1), claimed(TURN, None, turns=None)])
    told = report({folder.name: read_build(folder, NAMES) for folder in (build, other)})
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in told.splitlines() if line.startswith("| 0")]
    became = [["00_a", "ok, in part", "ok"], ["01_b", "refused", "not run"]]
    assert lines[:2] == became and lines[4:] == [
        ["00", STRIDE, "✓ samples 0.200, longest 0.400", "✗ samples 0.500", "✓ samples 0.100"],
        ["00", TURN, "–", "✓", "– turns –"],
    ]


def test_builds_of_one_name_are_told_apart(tmp_path):
    here, there = tmp_path / "here" / "mine", tmp_path / "there" / "mine"
    assert named([here]) == {"mine": here} and named([here, there]) == {"here/mine": here, "there/mine": there}
    with pytest.raises(ValueError, match="given twice: .*mine; expected each once"):
        named([here, tmp_path / "there" / ".." / "here" / "mine"])


def test_the_command_says_by_its_exit_code_whether_a_chapter_failed(build, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("mwlib.cli.course.chapters.course", lambda: [build.parent / f"{name}.ipynb" for name in NAMES])
    assert claims([build]) == 1
    assert "## mine" in capsys.readouterr().out
    monkeypatch.setattr("mwlib.cli.course.chapters.course", lambda: [build.parent / f"{name}.ipynb" for name in NAMES[:2]])
    assert claims([build], out=tmp_path / "report.md") == 0 and "## mine" in (tmp_path / "report.md").read_text()
    with pytest.raises(FileNotFoundError, match="nowhere is no folder; expected a build"):
        claims([tmp_path / "nowhere"])


REFUSES = 'class Refused(ValueError):\n    pass\n\nraise Refused("this chapter needs two people; these motions have one")'


@pytest.mark.parametrize(
    ("cell", "status", "reason"),
    [
        (REFUSES, "refused", r"01_sample: this chapter needs two people; these motions have one\Z"),
        ("1 / 0", "failed", r"01_sample: cell \d raised ZeroDivisionError"),
    ],
)
def test_a_notebook_that_does_not_get_to_its_end_says_why(tmp_path, cell, status, reason):
    path = save(bare(cell), tmp_path)
    with pytest.raises(NotDone, match=reason) as caught:  # without go_on nothing is left, as the drills show
        run_notebook(path, tmp_path / "out", {}, page=False, go_on=True)
    assert caught.value.refused == (status == "refused")
    assert result_of(tmp_path / "out")["status"] == status
    assert read_build(tmp_path, ["out"])["out"].reason == str(caught.value).splitlines()[0]
