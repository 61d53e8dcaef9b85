"""The files around the code agree with each other: dependencies, pins, versions, exhibits, make and Snakemake."""

from __future__ import annotations

import ast
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import matplotlib
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import mwlib
from mwlib.course.index import write_index
from mwlib.course.manifest import FILES, read_manifest
from mwlib.course.notebooks import course, source_hash
from mwlib.course.stems import saved_stems
from mwlib.experiments.origins import data_fingerprint
from mwlib.experiments.store import parameters_hash, write_result
from mwlib.files import write_atomic
from mwlib.hashing import package_hash
from tests.sample_notebooks import bare, code, runnable, save

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CONDA = {"torch": "pytorch"}  # where conda's name differs
MODULES = {"pywavelets": "pywt", "pyyaml": "yaml", "pytest-xdist": "xdist"}
BROUGHT = {"cycler": "matplotlib", "PIL": "matplotlib", "IPython": "ipykernel", "packaging": "pytest", "traitlets": "ipykernel"}


def requirements(*extras: str) -> dict[str, Requirement]:
    """Of pyproject.toml: the library's own and those of some extras, by canonical name."""
    lines = PROJECT["dependencies"] + [line for extra in extras for line in PROJECT["optional-dependencies"][extra]]
    return {canonicalize_name(found.name): found for found in map(Requirement, lines)}


def imported(folder: Path, skip: str = "") -> dict[str, str]:
    """Top-level modules that a folder's files import -> one file that does; imports inside functions count too."""
    found = {}
    for path in folder.rglob("*.py"):
        if skip and skip in path.relative_to(folder).parts:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            found |= {name.split(".")[0]: str(path) for name in names}
    local = {"mwlib", "tests", *(path.stem for path in (ROOT / "tests").glob("*.py"))}
    return {name: path for name, path in found.items() if name not in sys.stdlib_module_names and name not in local}


@pytest.mark.parametrize(
    "folder, skip, extras, brought",
    [
        ("mwlib", "course", (), {"IPython", "anywidget", "ipywidgets", "traitlets"}),
        ("mwlib", "", ("notebooks",), set()),
        ("tests", "blender", ("notebooks", "dev", "site"), set()),  # Blender is no dependency, see test-blender
        ("benchmarks", "", ("notebooks", "dev"), set()),
    ],
)
def test_what_is_imported_is_declared(folder, skip, extras, brought):
    """The library runs with its own dependencies; only what shows in a notebook asks for Jupyter's."""
    offered = {MODULES.get(name, name.replace("-", "_")) for name in requirements(*extras)} | brought
    offered |= {module for module, origin in BROUGHT.items() if origin in requirements(*extras)}
    undeclared = {name: path for name, path in imported(ROOT / folder, skip).items() if name not in offered}
    assert undeclared == {}


def test_conda_and_pip_agree():
    lines = yaml.safe_load((ROOT / "environment.yml").read_text())["dependencies"]
    conda = {found.name: found for found in (Requirement(line) for line in lines if isinstance(line, str))}
    assert conda.pop("python").specifier == PROJECT["requires-python"]
    assert [line for line in lines if isinstance(line, dict)] == [{"pip": ["-e .[notebooks,dev]"]}]
    conda.pop("pip")
    ours = {CONDA.get(name, name): found for name, found in requirements("notebooks").items()}
    own = {CONDA.get(name, name) for name in requirements()}
    assert own <= set(conda) <= set(ours)
    assert {name: found.specifier for name, found in conda.items()} == {name: ours[name].specifier for name in conda}


def test_every_dependency_is_pinned_and_every_pin_allowed():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in lines)  # exact; no address, no build tag
    pins = {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}
    for name, wanted in requirements("notebooks", "dev", "site").items():
        assert pins[name] in wanted.specifier, name


def test_bounds_say_from_when_on():
    for name, found in requirements("notebooks", "dev", "site").items():
        assert any(part.operator == ">=" for part in found.specifier), name


def test_one_version_and_one_licence():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert PROJECT["dynamic"] == ["version"]  # hatch reads it from mwlib
    assert mwlib.__version__ == citation["version"]
    assert PROJECT["license"] == citation["license"] == "MIT"
    assert (ROOT / "LICENSE").read_text().startswith("MIT License")


def test_every_saved_exhibit_is_in_the_manifest_and_made_ones_are_saved():
    saved = {(path.stem, stem) for path in course() for stem in saved_stems(json.loads(path.read_text()))}
    assert saved == {(row.notebook, row.stem) for row in read_manifest() if row.status == "made"}


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"status": "soon"}, "status is 'soon'"),
        ({"kind": "movie"}, "kind is 'movie'"),
        ({"caption": ""}, "caption is ''"),
        ({"files": ["png"]}, "files lack"),
        ({"id": "Two Words"}, "lower-case"),
        ({"paper": {"item": "Table 1"}}, "expected 'system' and 'item'"),
        ({"colour": "blue"}, "unknown fields"),
    ],
)
def test_manifest_names_what_is_wrong(tmp_path, changes, message):
    path = write_manifest(tmp_path, {**ROW, **changes})
    with pytest.raises(ValueError, match=f"(?s){re.escape(str(path))}.*row 1.*{message}"):
        read_manifest(path)


def test_manifest_refuses_the_same_exhibit_twice(tmp_path):
    with pytest.raises(ValueError, match="the same id twice"):
        read_manifest(write_manifest(tmp_path, ROW, ROW))


ROW = {
    "id": "own-bands", "kind": "figure", "caption": "Energy & bands", "notebook": "01_sample", "stem": "bands",
    "files": list(FILES["figure"]), "data": "synthetic", "status": "made",
}  # fmt: skip


def write_manifest(folder: Path, *rows: dict) -> Path:
    path = folder / "manifest.yaml"
    path.write_text(yaml.safe_dump({"exhibits": list(rows)}))
    return path


def write_exhibit(folder: Path, stem: str, rows: list[list], *, picture: bool) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{stem}.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    (folder / f"{stem}.json").write_text(json.dumps({"figure": stem, "preset": "tiny", "data": "synthetic", "seeds": [0, 1]}))
    if picture:
        (folder / f"{stem}.txt").write_text('Bars of "four" bands.\n')
        (folder / f"{stem}.png").write_bytes(b"png")


def write_done(build: Path, notebook: Path, data: str = "synthetic", changes: dict | None = None) -> None:
    """The result of a run that is done, as run-notebook writes it."""
    depends = {"data": {"source": data, "files": data_fingerprint(data)}, "notebook": source_hash(notebook)}
    depends |= {"mwlib": package_hash()} | (changes or {})
    values = {"preset": "tiny", "data": data, "level": 2, "lr": 0.5, "names": ["haar", "db2"]}
    write_result(build / notebook.stem, {}, parameters_hash(values), depends)


@pytest.mark.parametrize(
    "changes, given, problem",
    [
        ({}, [], ""),
        ({}, ["preset=tiny", "data={data}"], ""),
        ({}, ["preset=laptop", "data={data}"], "out of date: another parameters now"),
        ({"notebook": "x"}, [], "out of date: another notebook now"),
        ({"mwlib": "x"}, [], "out of date: another library now"),
        ({"data": {}}, [], "out of date: another data now"),
    ],
)
def test_index_believes_a_result_only_if_it_is_of_today(tmp_path, changes, given, problem):
    notebook, data = save(bare(), tmp_path), str(tmp_path / "data")
    write_atomic(tmp_path / "data" / "a.bvh", "a")
    write_done(tmp_path / "build", notebook, data, changes)
    page = write_index(tmp_path / "build", [notebook], write_manifest(tmp_path), [word.format(data=data) for word in given])
    assert ('<span class="missing">' in page.read_text()) == bool(problem) and problem in page.read_text()
    if not problem:
        (tmp_path / "data" / "a.bvh").touch()
        write_atomic(tmp_path / "data" / "b.bvh", "b")
        assert (
            "out of date: another data now" in write_index(tmp_path / "build", [notebook], write_manifest(tmp_path)).read_text()
        )


def test_index_lives_with_broken_files_and_odd_names(tmp_path):
    build = tmp_path / "build"
    for stem, text in (("half", '{"figure"'), ("list", "[]"), ("bytes", "\udcff")):
        write_exhibit(build / "01_sample", stem, [["x"]], picture=False)
        (build / "01_sample" / f"{stem}.json").write_text(text, errors="surrogateescape")
    write_exhibit(build / "01_sample" / "#1?", "50% a", [["x"]], picture=True)
    page = write_index(build, [], write_manifest(tmp_path)).read_text()
    for stem in ("half", "list", "bytes"):
        assert f"<li>01_sample/{stem}: " in page
    assert 'href="01_sample/%231%3F/50%25%20a.csv"' in page and 'src="01_sample/%231%3F/50%25%20a.png"' in page


def test_index_shows_what_was_made_and_says_what_is_missing(tmp_path):
    build, notebooks = tmp_path / "build", [tmp_path / "01_sample.ipynb", tmp_path / "02_other.ipynb"]
    write_exhibit(build / "01_sample", "bands", [["x"], [1]], picture=True)
    write_exhibit(build / "01_sample" / "tables", "errors", [["method", "ADE"], ["<ours>", 0.5]], picture=False)
    for path in notebooks:
        save(bare(), tmp_path, path.stem)
    write_done(build, notebooks[0])
    (build / "01_sample" / "notebook.html").write_text("")
    (build / "02_other").mkdir()
    (build / "02_other" / "metrics.json").write_text('{"status": "ok"')  # half-written
    paper = {"paper": {"system": "MotionWavelet", "item": "Table 1"}, "kind": "table", "files": ["csv", "json"]}
    absent = {**ROW, **paper, "id": "absent", "stem": "absent", "caption": "Errors of all"}
    page = write_index(build, notebooks, write_manifest(tmp_path, ROW, absent)).read_text()
    assert '<img src="01_sample/bands.png" alt="Bars of &#34;four&#34; bands."' in page
    assert "Energy &amp; bands" in page and "<dt>seeds</dt><dd>0, 1</dd>" in page and 'href="01_sample/bands.csv"' in page
    assert '<th scope="col">ADE</th>' in page and "<td>&lt;ours&gt;</td>" in page  # not listed, shown all the same
    assert "Table 1" in page and "Not in this build" in page
    assert '<a href="01_sample/notebook.html">01_sample</a></li>' in page
    assert '02_other <span class="missing">not finished</span>' in page
    assert not re.search(r"""(src|href)=["'](https?:)?//""", page)  # self-contained


@pytest.mark.parametrize("text", ["- a", "exhibits: {a: 1}", "exhibits: [a]", "a: ]"])
def test_a_manifest_that_is_none_is_told(tmp_path, text):
    (tmp_path / "manifest.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"manifest\.yaml (holds|is not YAML)"):
        read_manifest(tmp_path / "manifest.yaml")


@pytest.mark.parametrize("answer, message", [("3.9", "Python 3.11 or newer is needed"), (None, "not found; install Python 3.11")])
def test_make_says_which_python_it_needs(tmp_path, answer, message):
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    python = tmp_path / "python-of-old"
    if answer:
        python.write_text(f'#!/bin/sh\n[ "$1" = --version ] && echo Python {answer} && exit 0\nexit 1\n')
        python.chmod(0o755)
    done = subprocess.run(["make", "test", f"PYTHON={python}"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0 and message in done.stderr
    assert not (tmp_path / ".venv").exists()


def snakemake(folder: Path, *words: str, preset: str = "tiny") -> str:
    """The course's Snakefile on a folder of notebooks, on data beside them; what it would do and why."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--cores", "1", *words]
    settings = ["--config", "out=out", "grids=grids.yaml", "data=data", f"preset={preset}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(folder / "cache")}
    environment["MPLCONFIGDIR"] = matplotlib.get_cachedir()
    done = subprocess.run([*command, *settings], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def jobs(todo: str) -> dict[str, int]:
    """How many runs of notebooks a dry run plans, by rule."""
    return {rule: int(count) for rule, count in re.findall(r"^(\w*notebook) +(\d+)$", todo, re.M)}


def test_snakemake_runs_again_what_changed_and_nothing_else(tmp_path):
    """Neither an executed notebook nor a touched file schedules anything; a source, a preset or the data do."""
    for stem in ("01_first", "06_training", "09_attention"):
        save(runnable(), tmp_path / "notebooks", stem)
        write_atomic(tmp_path / "out" / stem / "metrics.json", "{}")
    for name in ("out/index.html", "data/a.bvh"):
        write_atomic(tmp_path / name, "a")
    (tmp_path / "grids.yaml").write_text("grids: {}")
    snakemake(tmp_path, "--touch")  # as if all had been run

    executed = runnable()
    executed.cells[-1].execution_count = 7
    save(executed, tmp_path / "notebooks", "01_first")
    (tmp_path / "data" / "a.bvh").touch()
    assert "Nothing to be done" in snakemake(tmp_path, "--dry-run")

    todo = snakemake(tmp_path, "--dry-run", preset="laptop")
    assert jobs(todo) == {"notebook": 2, "long_notebook": 1} and "before: ['--set', 'preset=tiny'" in todo
    assert re.search(r"output: 06_training/metrics.json\n(?: .*\n)*? +priority: 1\n", todo)  # the long one comes first

    executed.cells.append(code("print('changed')"))
    save(executed, tmp_path / "notebooks", "01_first")
    todo = snakemake(tmp_path, "--dry-run")
    assert "Updated input files: .sources/01_first.sha256" in todo and jobs(todo) == {"notebook": 1}

    (tmp_path / "data" / "b.bvh").write_text("b")
    todo = snakemake(tmp_path, "--dry-run")
    assert ".sources/data.sha256" in todo and jobs(todo) == {"notebook": 2, "long_notebook": 1}
