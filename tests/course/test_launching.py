"""Chapters that open elsewhere: badges from the one address, copies that install what they need."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import nbformat
import pytest
import yaml

from mwlib.course.learner import badges, launched_copy, repository, source_of
from mwlib.course.notebooks import course
from mwlib.course.site import chapter_cards, site_copy
from tests.sample_notebooks import model_notebook

ROOT = Path(__file__).parents[2]
ADDRESS = "https://github.com/someone/course"


@pytest.mark.parametrize("line, found", [("", ""), (f'[project.urls]\nRepository = "{ADDRESS}/"', ADDRESS)])
def test_the_address_stands_in_one_place(tmp_path, line, found):
    (tmp_path / "pyproject.toml").write_text(f'[project]\nname = "a"\n{line}\n')
    assert repository(tmp_path) == found


@pytest.mark.parametrize("address", ["https://example.org/a/b", "https://github.com/someone", "git@github.com:a/b"])
def test_what_is_no_address_is_refused(tmp_path, address):
    (tmp_path / "pyproject.toml").write_text(f'[project.urls]\nRepository = "{address}"\n')
    with pytest.raises(ValueError, match="expected https://github.com/OWNER/NAME"):
        repository(tmp_path)


def test_nothing_else_in_the_repository_names_an_address():
    """Badges and links are made from the one place; what is written by hand names none, or that one."""
    files = [
        ROOT / name for name in ("README.md", "CITATION.cff", "docs/index.md", "docs/chapters.md", "mwlib/course/learner.py")
    ]
    place = repository(ROOT).removeprefix("https://github.com/")
    said = {
        found
        for file in files
        for found in re.findall(r"(?:colab\S*?/github|mybinder\.org/v2/gh)/([\w.-]+/[\w.-]+)", file.read_text())
    }
    assert said <= {place, "someone/course"}
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text()).get("repository-code", "") in ("", repository(ROOT))


def test_badges_lead_to_files_that_the_workflow_leaves():
    colab, binder = re.findall(r"\((.*?)\)", badges(ADDRESS, "02_a.ipynb"))
    workflow = (ROOT / ".github" / "workflows" / "site.yml").read_text()
    assert colab.endswith("/someone/course/blob/colab/02_a.ipynb") and "git push -f origin colab" in workflow
    assert "build/site-sources/colab" in workflow and "/someone/course/main?" in binder
    assert badges("", "02_a.ipynb") == ""
    assert "[Colab]" in site_copy(model_notebook(), "01_sample.ipynb", badges(ADDRESS, "a.ipynb")).cells[1].source


def test_every_chapter_has_a_card_with_picture_and_words():
    trees = {path.stem: nbformat.read(path, as_version=4) for path in course()}
    cards = chapter_cards(trees, (ROOT / "README.md").read_text(encoding="utf-8"), "").split("{container} chapter")[1:]
    assert len(cards) == len(trees)
    for card, stem in zip(cards, trees, strict=True):
        assert card.count(f"](notebooks/{stem}.ipynb)") == 2 and re.search(r"!\[[^\]]{20,}\]\(exhibits/fig_\w+\.png\)", card)
        assert re.search(r"\n\n\w.{20,}\n", card)


def test_a_copy_installs_what_is_missing_before_anything_is_imported(monkeypatch):
    """The library is missing: pip is asked once, for the library at its commit and for the widgets."""
    monkeypatch.setenv("GITHUB_SHA", "abc")
    notebook = model_notebook()
    copy = launched_copy(notebook, source_of(ADDRESS))
    nbformat.validate(copy)
    assert len(copy.cells) == len(notebook.cells) + 1 and copy.cells[0].cell_type == "markdown"
    asked = []
    monkeypatch.setenv("OMP_NUM_THREADS", "")  # put back after the test
    monkeypatch.delenv("OMP_NUM_THREADS")
    monkeypatch.setattr(subprocess, "run", lambda words, check: asked.append(words))
    exec(copy.cells[1].source, {})
    assert asked == [] and os.environ["OMP_NUM_THREADS"] == "1"
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    exec(copy.cells[1].source, {})
    (words,) = asked
    assert words[1:5] == ["-m", "pip", "install", "--quiet"] and words[5] == f"motion-wavelet-notebooks @ git+{ADDRESS}@abc"
    assert words[6].startswith("anywidget>=")
