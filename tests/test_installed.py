"""What a wheel gives somebody who has no checkout: the command, the library, and a working copy of the course."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from mwlib import __version__
from mwlib.cli import main
from mwlib.course.notebooks import lay_out
from mwlib.data.formats.h36m import write_h36m
from mwlib.paths import carried, course_folder, home, installed
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_notebooks import runnable, save

ROOT = Path(__file__).parents[1]
OTHERS = ("PYTHONPATH", "MWLIB_RUNS", "MWLIB_DATA", "SOURCE_DATE_EPOCH", "JUPYTER_PATH")  # set by the tests' own surroundings
SMALL = {"train_steps": 2, "batch": 4, "width": 16, "layers": 2, "heads": 2, "feedforward": 16}
# Several commands in one process, for starting is what takes time; what each printed.
TOGETHER = """
import contextlib, io, json, sys
from mwlib.cli import main
told = []
for words in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main(words) == 0, words
    told.append(printed.getvalue())
print(json.dumps(told))
"""
COMMANDS = ("check-data", "write-synthetic", "train", "predict", "export-bvh", "course", "run-notebook", "grid-table")


@dataclass(frozen=True)
class Installed:
    """A new environment that has the wheel, beside an empty folder to work in."""

    folder: Path
    wheel: Path
    scripts: Path
    environment: dict[str, str]

    @property
    def empty(self) -> Path:
        return self.folder / "empty"

    def __call__(self, *words: str | Path, cwd: Path | None = None, program: str = "mwlib") -> str:
        """Run a program of the environment; what it printed."""
        command = [str(self.scripts / program), *map(str, words)]
        done = subprocess.run(command, cwd=cwd or self.empty, env=self.environment, capture_output=True, encoding="utf-8")
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def each(self, *commands: list[str]) -> list[str]:
        """Run commands of mwlib, one after the other; what each printed."""
        return json.loads(self("-c", TOGETHER, json.dumps(commands), program="python"))


@pytest.fixture(scope="module")
def new(tmp_path_factory) -> Installed:
    """The packages that mwlib depends on come from the tests' environment, by a path; the checkout does not come along, for the
    file that names it there is read in that environment only."""
    folder = tmp_path_factory.mktemp("installed")
    environment = {name: value for name, value in os.environ.items() if name not in OTHERS}
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, env=environment, check=True, capture_output=True)
    venv.create(folder / "venv", symlinks=os.name == "posix")
    place = sysconfig.get_paths("venv", {"base": str(folder / "venv"), "platbase": str(folder / "venv")})
    pip = [sys.executable, "-m", "pip", "--python", str(Path(place["scripts"], "python")), "install", "--quiet"]
    (wheel,) = folder.glob(f"*-{__version__}-*.whl")
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], env=environment, check=True)
    ours = sysconfig.get_paths()
    Path(place["purelib"], "dependencies.pth").write_text("\n".join(sorted({ours["purelib"], ours["platlib"]})))
    environment["JUPYTER_PATH"] = str(Path(ours["data"], "share", "jupyter"))  # templates of nbconvert
    environment["PATH"] = os.pathsep.join([place["scripts"], environment["PATH"]])
    environment["XDG_CACHE_HOME"] = str(folder / "cache")
    (folder / "empty").mkdir()
    return Installed(folder, wheel, Path(place["scripts"]), environment | {"OMP_NUM_THREADS": "1"})


def test_the_command_says_what_it_does(new):
    told = new("--help")
    assert all(name in told for name in COMMANDS)


def test_data_are_checked_and_a_model_is_trained_and_used(new):
    """In an empty folder: what is written lies in that folder."""
    write_h36m(new.empty / "people.npz", synthetic_motions(subjects=2))
    changes = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
    train = ["train", "--preset", "tiny", "--set", "data=people.npz", *changes]
    by_name, by_path, trained = new.each(["check-data", "synthetic"], ["check-data", "people.npz"], train)
    assert "subjects" in by_name and "subjects" in by_path
    run = Path(trained.strip())
    assert run.parent == new.empty / "runs" and (run / "metrics.json").is_file()
    few = [str(run), "people.npz", "--samples", "2", "--clips", "1", "--out"]
    *_, read_back = new.each(["predict", *few, "futures.npz"], ["export-bvh", *few, "bvh"], ["check-data", "bvh"])
    assert (new.empty / "futures.npz").is_file() and len(list((new.empty / "bvh").glob("*.bvh"))) == 2
    assert "every file could be read" in read_back


def test_a_working_copy_is_complete_and_runs(new):
    """Notebooks, grids and workflow are those of the copy, the library is the installed one, results stay in the copy."""
    work = new.folder / "my course"
    assert "snakemake --cores" in new("course", work)
    names = {file.relative_to(ROOT) for file in carried(ROOT)}
    assert {file.relative_to(work) for file in work.rglob("*") if file.is_file()} == names
    with zipfile.ZipFile(new.wheel) as wheel:
        assert all((work / name).read_bytes() == wheel.read(f"mwlib/_material/{name.as_posix()}") for name in names)

    grids = {"mine": {"title": "mine", "rows": [{"name": "as it is"}]}}
    (work / "figures" / "grids.yaml").write_text(yaml.safe_dump({"grids": grids}))
    todo = new("-m", "snakemake", "grids", "--dry-run", "--cores", "1", cwd=work, program="python")
    assert "output: grids/mine.csv" in todo and "table_4" not in todo
    assert (work / "build" / "tiny-synthetic" / ".sources" / "grids.sha256").is_file()

    save(runnable("import mwlib\nprint(mwlib.__file__)"), work / "notebooks", "99_mine")
    out = Path(new("run-notebook", "99", cwd=work / "notebooks").strip())
    assert out.parent == work / "build" / "runs"
    cells = json.loads((out / "notebook.ipynb").read_text(encoding="utf-8"))["cells"]
    printed = next("".join(cell["outputs"][0]["text"]) for cell in cells if "mwlib.__file__" in "".join(cell["source"]))
    assert Path(printed.strip()).is_relative_to(new.folder / "venv")


def test_what_is_there_is_kept(tmp_path, capsys):
    first = lay_out(tmp_path / "course")
    assert set(first.written) == {file.relative_to(ROOT) for file in carried(ROOT)} and not first.kept
    grids, gone = tmp_path / "course" / "figures" / "grids.yaml", tmp_path / "course" / "Snakefile"
    grids.write_text("grids: {}")
    gone.unlink()
    assert main(["course", str(tmp_path / "course")]) == 0
    told = capsys.readouterr().out
    assert "1 files written" in told and f"not as in mwlib {__version__}: figures/grids.yaml\n" in told
    assert grids.read_text() == "grids: {}" and gone.is_file()


def test_a_file_is_no_place_for_a_course(tmp_path, capsys):
    (tmp_path / "course").write_text("mine")
    assert main(["course", str(tmp_path / "course")]) == 1
    assert "course is a file; expected a folder" in capsys.readouterr().err
    assert (tmp_path / "course").read_text() == "mine"


def test_the_course_around_the_working_folder_comes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert home() == tmp_path and course_folder() == installed() == ROOT
    lay_out(tmp_path)
    monkeypatch.chdir(tmp_path / "notebooks")
    assert home() == course_folder() == tmp_path and installed() == ROOT


def test_installed_notebooks_are_not_executed_in_place(monkeypatch, capsys):
    monkeypatch.setattr("mwlib.paths.PACKAGED", ROOT)
    assert main(["execute-notebooks", "01"]) == 1
    assert "mwlib course FOLDER" in capsys.readouterr().err


def test_a_command_says_what_to_install(monkeypatch, capsys, tmp_path):
    for name in ("nbformat", "jinja2"):
        monkeypatch.setitem(sys.modules, name, None)
    for name in ("learner", "exhibits"):
        monkeypatch.delitem(sys.modules, f"mwlib.course.{name}", raising=False)
    monkeypatch.setattr("mwlib.course.notebooks._is_there", lambda package: package != "nbformat")
    assert main(["learner-copies", "--out", str(tmp_path)]) == 1
    assert re.search(r'; pip install "nbformat[<>=,.\d]+" brings it$', capsys.readouterr().err)
