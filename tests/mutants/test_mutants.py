"""The mutants fit today's code, and the tool tells the killed from the survivors."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutants import runner
from tests.mutants.__main__ import main
from tests.mutants.catalogue import MUTANTS
from tests.mutants.mutant import Mutant

ROOT = Path(__file__).parents[2]


def test_every_mutant_has_one_place_in_the_code_and_tests_that_exist():
    assert [m.name for m in MUTANTS if not m.applies((ROOT / m.file).read_text(encoding="utf-8"))] == []
    assert [m.name for m in MUTANTS if m.old == m.new or not m.tests] == []
    assert len({m.name for m in MUTANTS}) == len(MUTANTS)
    for test in {test for m in MUTANTS for test in m.tests}:
        file, _, name = test.partition("::")
        assert not name or f"def {name}(" in (ROOT / file).read_text(encoding="utf-8"), test


def test_killed_survived_and_gone_are_told_apart(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(runner, "PRELOADED", [])
    for name in ("mwlib", "tests"):
        (tmp_path / name).mkdir()
    (tmp_path / "mwlib" / "sums.py").write_text("def double(x):\n    return 2 * x\n\n\ndef zero():\n    return 0\n")
    test = "from mwlib.sums import double\n\n\ndef test_double():\n    assert double(3) == 6\n"
    (tmp_path / "tests" / "test_sums.py").write_text(test)
    (tmp_path / "mwlib" / "__init__.py").touch()
    places = {"a": ("2 * x", "3 * x"), "b": ("return 0", "return 1"), "c": ("4 * x", "x"), "d": ("def double", "def d")}
    mutants = [Mutant(name, "mwlib/sums.py", *place, ("tests/test_sums.py",)) for name, place in places.items()]
    assert main(["--only", "a", "--jobs", "1"], mutants, tmp_path) == 0 and "killed" in capsys.readouterr().out
    assert main(["--jobs", "2"], mutants, tmp_path) == 1
    said = [line.split("  ")[0] for line in capsys.readouterr().out.splitlines() if "test_sums" in line]
    assert said == ["killed", "SURVIVED", "NO LONGER APPLIES", "TESTS DO NOT RUN"]
    assert (tmp_path / "mwlib" / "sums.py").read_text().startswith("def double(x):\n    return 2 * x\n")
    monkeypatch.setattr(runner, "run_tests", lambda *given, **options: pytest.fail("what is known is tried again"))
    assert main([], mutants[:2], tmp_path) == 1
    assert [line.split("  ")[0] for line in capsys.readouterr().out.splitlines() if "test_sums" in line] == said[:2]
    monkeypatch.setattr(runner, "run_tests", lambda *given, **options: 0)
    (tmp_path / "tests" / "test_sums.py").write_text(f"{test}\n")
    monkeypatch.setattr(runner, "passed", lambda tests, root, copy: {})
    assert main([], mutants[:1], tmp_path) == 1 and "SURVIVED" in capsys.readouterr().out, "another test"


def test_quick_tests_come_first():
    class Item:
        def __init__(self, nodeid: str) -> None:
            self.nodeid = nodeid

    items = [Item("slow"), Item("quick"), Item("new")]
    runner.Clock({"slow": 2.0, "quick": 0.1}).pytest_collection_modifyitems(items)
    assert [item.nodeid for item in items] == ["new", "quick", "slow"]
