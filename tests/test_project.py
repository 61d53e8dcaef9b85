"""The files around the code agree with each other: dependencies, pins, versions, make and Snakemake."""

from __future__ import annotations

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import matplotlib
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from snakemake import cli

import mwlib
from mwlib.files import write_atomic
from tests.forked import done
from tests.sample_notebooks import code, runnable, save

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
        if skip and skip in path.relative_to(folder).with_suffix("").parts:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            found |= {name.split(".")[0]: str(path) for name in names}
    local = {"mwlib", "tests", *(path.stem for own in ("tests", "benchmarks") for path in (ROOT / own).glob("*.py"))}
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


def test_a_release_begins_with_a_version_that_all_files_agree_on(tmp_path):
    release = ROOT / ".ci" / "release.py"
    assert runpy.run_path(str(release))["version"]() == mwlib.__version__
    for name in (".ci/release.py", "CHANGELOG.md", "CITATION.cff", "mwlib/version.py"):
        write_atomic(tmp_path / name, (ROOT / name).read_bytes())
    (tmp_path / "mwlib" / "version.py").write_text('__version__ = "9.9.9"\n')
    with pytest.raises(SystemExit, match=r"CHANGELOG.md begins with .*; expected '9.9.9 \(YYYY-MM-DD\)'"):
        runpy.run_path(str(tmp_path / ".ci" / "release.py"))["version"]()
    (tmp_path / "CHANGELOG.md").write_text("## 9.9.9 (2030-01-01)\n")
    with pytest.raises(SystemExit, match="expected 9.9.9, 2030-01-01"):
        runpy.run_path(str(tmp_path / ".ci" / "release.py"))["version"]()


def test_workflows_run_what_there_is():
    """Their make targets, scripts and folders exist; the oldest Python is the one that pyproject.toml names."""
    targets = {*re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)}
    flows = {file.stem: file.read_text() for file in (ROOT / ".github" / "workflows").glob("*.yml")}
    runs = [line for flow in flows.values() for line in re.findall(r"- run: (.*)", flow)]
    assert {word for line in runs for word in re.findall(r"^make ([\w-]+)", line)} <= targets
    assert [name for line in runs for name in re.findall(r"tests/[\w./]+", line) if not (ROOT / name).exists()] == []
    oldest = yaml.safe_load(flows["test"])["jobs"]["linux"]["strategy"]["matrix"]["python"][0]
    assert PROJECT["requires-python"] == f">={oldest}" and "id-token: write" in flows["release"]


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
    settings = ["--config", "out=out", "grids=grids.yaml", "data=data", f"preset={preset}"]
    command = ["--snakefile", str(ROOT / "Snakefile"), "--cores", "1", *words, *settings]
    environment = {"XDG_CACHE_HOME": str(folder / "cache"), "MPLCONFIGDIR": matplotlib.get_cachedir()}
    (folder / "log").unlink(missing_ok=True)
    return done(cli.main, command, log=folder / "log", cwd=folder, env=environment)


def jobs(todo: str) -> dict[str, int]:
    """How many runs of notebooks a dry run plans, by rule."""
    return {rule: int(count) for rule, count in re.findall(r"^(\w*notebook) +(\d+)$", todo, re.M)}


def as_if_run(folder: Path, *stems: str) -> None:
    """Notebooks, data, and what a build of them leaves."""
    for stem in stems:
        save(runnable(), folder / "notebooks", stem)
        write_atomic(folder / "out" / stem / "metrics.json", "{}")
    for name in ("out/index.html", "data/a.bvh"):
        write_atomic(folder / name, "a")
    (folder / "grids.yaml").write_text("grids: {}")
    snakemake(folder, "--touch")


def test_snakemake_runs_again_what_changed_and_nothing_else(tmp_path):
    """Neither an executed notebook nor a touched file schedules anything; a source, a preset or the data do."""
    as_if_run(tmp_path, "01_first", "06_training", "09_attention")
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


def test_a_clock_that_was_put_back_hides_no_change(tmp_path):
    """Then a file that changed is older than what was made of it before."""
    as_if_run(tmp_path, "01_first", "02_second")
    tomorrow = time.time() + 86400
    for file in [*(tmp_path / "out").glob("*/metrics.json"), tmp_path / "out" / "index.html"]:
        os.utime(file, (tomorrow, tomorrow))
    assert "Nothing to be done" in snakemake(tmp_path, "--dry-run")
    save(runnable("print('changed')"), tmp_path / "notebooks", "01_first")
    assert jobs(snakemake(tmp_path, "--dry-run")) == {"notebook": 1}


def test_a_folder_that_takes_nothing_is_told_in_a_sentence(tmp_path):
    (tmp_path / "out").touch()
    (tmp_path / "grids.yaml").write_text("grids: {}")
    save(runnable(), tmp_path / "notebooks", "01_first")
    with pytest.raises(AssertionError, match=rf"nothing can be written to {tmp_path}/out: File exists; say another out") as told:
        snakemake(tmp_path)
    assert "Traceback" not in str(told.value)


SPHINX_STOPS = """#!/bin/sh
for last; do :; done
case "$*" in *sphinx*) mkdir -p "$last"; touch "$last/half.html"; exit ${STOPS:-0};; esac
"""
KILLED_REMOVING = """#!/bin/sh
case "$*" in *site-sources*) exec /bin/rm "$@";; esac
for folder; do /bin/rm -f "$folder/index.html"; done
kill -9 $PPID
"""


def test_a_site_that_cannot_be_built_leaves_the_one_before(tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    python = tmp_path / ".venv" / "bin" / "python"
    write_atomic(python, SPHINX_STOPS)
    python.chmod(0o755)
    for name in ("pyproject.toml", "constraints.txt", "docs/package-lock.json", ".venv/.ready", ".venv/.site-ready"):
        write_atomic(tmp_path / name, "")
    site = tmp_path / "build" / "site"
    for name in ("index.html", "other.html"):
        write_atomic(site / name, "before")
    make = dict(args=["make", "site"], cwd=tmp_path, capture_output=True)
    assert subprocess.run(**make, env={**os.environ, "STOPS": "1"}).returncode != 0
    assert {file.name for file in site.iterdir()} == {"index.html", "other.html"}
    write_atomic(tmp_path / "bin" / "rm", KILLED_REMOVING)
    (tmp_path / "bin" / "rm").chmod(0o755)
    assert subprocess.run(**make, env={**os.environ, "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}).returncode != 0
    assert [file.name for file in site.iterdir()] == ["half.html"], "a kill amid the removal of the old one"
    write_atomic(site / "index.html", "before")
    assert subprocess.run(**make).returncode == 0
    assert [file.name for file in site.iterdir()] == ["half.html"], "the new one, nothing of the old"
    assert {file.name for file in site.parent.iterdir()} == {"site"}
