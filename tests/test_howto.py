"""The how-tos are true: their Python shows what happens, their commands are accepted, their links lead somewhere."""

from __future__ import annotations

import doctest
import json
import re
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
import yaml

from mwlib import cli
from mwlib.cli.options import choice_of
from mwlib.course.notebooks import RANGE, chapter_number, course, from_text, read_notebook, read_parameters, resolve
from mwlib.experiments.grids import system
from mwlib.settings import parse_changes

pytestmark = pytest.mark.usefixtures("grids_read_once")
ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted((DOCS / "howto").glob("*.md"))
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
VARIABLES = set(re.findall(r"^([A-Z]+) \??:?=", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
CONFIG = set(re.findall(r'told\("(\w+)"', (ROOT / "Snakefile").read_text(encoding="utf-8")))


def blocks(page: Path, kind: str) -> list[str]:
    """The fenced blocks of one kind on a page."""
    return re.findall(rf"^```{kind}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S)


def commands() -> Iterator[tuple[str, str]]:
    for page in [*PAGES, DOCS / "index.md", DOCS / "chapters.md"]:
        text = page.read_text(encoding="utf-8")
        lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
        for line in [*lines, *re.findall(r"`((?:make|mwlib) [^`]+)`", text)]:
            yield page.stem, line


COMMANDS = sorted(set(commands()))


def test_every_page_is_there_and_listed():
    listed = blocks(DOCS / "howto" / "index.md", r"\{toctree\}")[0].split()[2:]
    assert sorted(listed) == [page.stem for page in PAGES if page.stem != "index"]
    assert len(listed) >= 6


@pytest.mark.parametrize(
    "page", [page for page in PAGES if ">>>" in page.read_text(encoding="utf-8")], ids=lambda page: page.stem
)
def test_python_shows_what_happens(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    for number, block in enumerate(blocks(page, "yaml")):
        (tmp_path / f"{number}.yaml").write_text(block)
        (tmp_path / "my-grids.yaml").write_text(block)  # the name that the page gives it
    text = "\n".join(blocks(page, "python"))
    test = doctest.DocTestParser().get_doctest(text, {}, page.stem, str(page), 0)
    with torch.random.fork_rng():
        doctest.DebugRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test)


def check_mwlib(words: list[str], page: Path) -> None:
    if words[-1] == "--help":
        with pytest.raises(SystemExit, match="0|None"):
            cli.parse(words)
        return
    _, given = cli.parse(words)
    changes = given.get("set", [])
    if words[0] == "run-notebook":
        (notebook,) = [path for path in course() if chapter_number(path) == given["notebook"]]
        offered = read_parameters(read_notebook(notebook))
        values = yaml.safe_load(blocks(page, "yaml")[0]) if "parameters" in given else {}
        resolve(offered, {**values, **from_text(offered, changes)})
    elif words[0] == "grid-table":
        with tempfile.TemporaryDirectory() as folder:
            if "grids" in given and given["grids"].name == "my-grids.yaml":
                given["grids"] = Path(folder) / "my-grids.yaml"
                given["grids"].write_text(blocks(page, "yaml")[0], encoding="utf-8")
            grid, preset, changes, _ = choice_of(**given)
            assert system(grid.system).Config.preset(preset, **changes)
    elif changes or "preset" in given:
        system(given.get("system", "prediction")).Config.preset(given.get("preset", "laptop"), **parse_changes(changes))


def check_make(words: list[str], page: Path) -> None:
    names, settings = [word for word in words if "=" not in word], [word.split("=")[0] for word in words if "=" in word]
    assert set(names) <= TARGETS and set(settings) <= VARIABLES, words


def check_snakemake(words: list[str], page: Path) -> None:
    from snakemake.cli import get_argument_parser

    own = [word for word in words if not word.startswith(("--executor", "--cluster-generic", "./", "slurm", "cluster-generic"))]
    given = get_argument_parser().parse_args(own)
    assert given.jobs == 50 and given.keep_going and given.rerun_incomplete
    assert {word.split("=")[0] for word in given.config} <= CONFIG, given.config


CHECKS = {"mwlib": check_mwlib, "make": check_make, "snakemake": check_snakemake}


@pytest.mark.parametrize(("page", "line"), COMMANDS)
def test_a_command_is_accepted(page, line):
    first, *words = shlex.split(line)
    place = DOCS / "howto" / f"{page}.md"
    CHECKS[first](words, place if place.is_file() else DOCS / f"{page}.md")


def test_a_wrong_command_is_not_accepted():
    for words in (["run-notebook", "03", "--set", "bases=sym9"], ["train", "--set", "wavelets=sym9"]):
        with pytest.raises(ValueError):
            check_mwlib(words, PAGES[0])
    with pytest.raises(SystemExit):
        check_mwlib(["check-data", "--units", "m", "x"], PAGES[0])
    with pytest.raises(AssertionError):
        check_make(["figure"], PAGES[0])


def test_the_formulae_of_the_site_are_pinned():
    """One version of KaTeX, whole: no address of a registry, a hash for each package."""
    asked = json.loads((DOCS / "package.json").read_text(encoding="utf-8"))["dependencies"]
    lock = json.loads((DOCS / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert lock["node_modules/katex"]["version"] == asked["katex"]
    assert all(entry["integrity"].startswith("sha512-") and "resolved" not in entry for place, entry in lock.items() if place)


def test_the_parameters_of_all_chapters_are_listed():
    words = {"bool": "True or False", "str": "text"}
    rows = []
    for path in course():
        offered = read_parameters(read_notebook(path))
        for one in [one for name, one in offered.items() if name not in ("preset", "data", "out", "seed")]:
            allowed = f"{one.range[0]:g} to {one.range[1]:g}" if one.range else words[one.kind]
            about = (chapter_number(path), f"`{one.name}`", f"`{one.default!r}`", allowed, RANGE.sub("", one.comment))
            rows.append(f"| {' | '.join(about)} |")
    text = (DOCS / "howto" / "rerun-a-notebook.md").read_text(encoding="utf-8")
    table = text[text.index("| chapter |") :].partition("\n\n")[0]
    assert table.splitlines()[2:] == rows


def test_every_row_of_what_was_believed_names_its_test():
    _, *sections = (ROOT / "docs" / "believed.md").read_text(encoding="utf-8").split("\n## ")
    rows = 0
    for section in sections:
        files = re.findall(r"`(tests/[\w/]+\.py)`", section.split("\n|")[0])
        text = "\n".join((ROOT / file).read_text(encoding="utf-8") for file in files)
        for line in re.findall(r"^\| .* \|$", section, re.M)[1:]:
            *_, name, _ = (cell.strip() for cell in re.split(r"(?<!\\)\|", line))
            assert f"\ndef test_{name.replace(' ', '_')}(" in text, f"{section.splitlines()[0]}: {name} is no test of {files}"
            rows += 1
    assert rows > 40
