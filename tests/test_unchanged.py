"""A test file runs again when something changed that it may depend on, and not otherwise."""

from __future__ import annotations

import pytest

from tests import unchanged
from tests.unchanged import ROOT, behind, key, keys

LINEAR, README = ROOT / "tests" / "transforms" / "test_linear.py", ROOT / "tests" / "test_readme.py"
SENTENCES = ROOT / "mwlib" / "text_to_motion" / "system.py"


def test_imports_are_followed_through_stubs_and_names_in_quotes():
    assert ROOT / "mwlib" / "transforms" / "dwt.py" in behind(LINEAR) and SENTENCES not in behind(LINEAR)
    assert SENTENCES in behind(README), "README generates a motion by a function that is imported at its first use"
    assert SENTENCES in behind(ROOT / "tests" / "experiments" / "test_tables.py"), "systems are found by their names"


@pytest.mark.parametrize(
    "file, again", [("mwlib/transforms/dwt.py", True), ("tests/conftest.py", True), ("mwlib/text_to_motion/system.py", False)]
)
def test_another_file_counts_if_it_is_behind_the_test(monkeypatch, file, again):
    before, old = key(LINEAR), unchanged.hashed
    monkeypatch.setattr(unchanged, "hashed", lambda one: "other" if one == ROOT / file else old(one))
    assert (key(LINEAR) != before) == again


def test_who_starts_processes_depends_on_everything(monkeypatch):
    before, old = key(ROOT / "tests" / "test_installed.py"), unchanged.hashed
    monkeypatch.setattr(unchanged, "hashed", lambda one: "other" if one == SENTENCES else old(one))
    assert key(ROOT / "tests" / "test_installed.py") != before


def test_only_files_that_passed_are_left_out(monkeypatch, tmp_path):
    monkeypatch.setattr(unchanged, "PASSED", tmp_path)
    now = keys()
    assert "tests/test_readme.py" in now and unchanged.ALWAYS not in now and unchanged.unchanged(now) == []
    unchanged.keep(now, ["tests/test_readme.py", "tests/test_files.py", "elsewhere.py"])
    assert sorted(unchanged.unchanged(now)) == ["tests/test_files.py", "tests/test_readme.py"]
    assert unchanged.unchanged(now | {"tests/test_files.py": "other"}) == ["tests/test_readme.py"]
