"""Failure drills: whatever happens to a run, it must not count as done unless its notebook got to its end."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import time
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_notebook

from mwlib import files
from mwlib.cli import main
from mwlib.course import execute
from mwlib.course.execute import NotDone, run_notebook
from mwlib.course.notebooks import FILES, ParameterError, source_hash
from mwlib.data.sources import data_fingerprint
from mwlib.experiments import results
from mwlib.files import write_together
from mwlib.hashing import package_hash
from tests.forked import started
from tests.sample_notebooks import NASTY, PARAMETERS, WRITES_ITSELF, bare, code, runnable, save

ROOT = Path(__file__).parents[2]
DEPENDS = {"settings": "abc", "data": {"source": "synthetic", "files": data_fingerprint("synthetic")}}
SLOW = "import pathlib, time\npathlib.Path(out, 'begun').touch()\ntime.sleep(300)"


def test_a_run_that_gets_to_its_end_is_done(tmp_path):
    notebook = save(runnable("print(level)"), tmp_path)
    stored = notebook.read_bytes()
    out = run_notebook(notebook, tmp_path / "out", {"level": 3, "lr": 1})
    expected = {"preset": "tiny", "data": "", "level": 3, "lr": 1.0, "names": ["haar", "db2"]}
    assert results.read_result(out, results.parameters_hash(expected)) == {"answer": 4.0}
    assert results.read_result(out, results.parameters_hash({**expected, "level": 2})) is None
    assert {"notebook.ipynb", "notebook.html"} <= {path.name for path in out.iterdir()}
    assert notebook.read_bytes() == stored


@pytest.mark.parametrize(
    "cells, last, reason",
    [
        pytest.param([], f"{WRITES_ITSELF}\nimport os\nos._exit(0)", "died", id="kernel dies behind the result"),
        pytest.param([f"{WRITES_ITSELF}\nraise SystemExit(0)"], "1", "cell 3.*left by SystemExit", id="early result, exit 0"),
        pytest.param(["1 / 0"], WRITES_ITSELF, "ZeroDivisionError", id="a cell raises"),
        pytest.param([WRITES_ITSELF], "1 / 0", "ZeroDivisionError", id="result before the end"),
    ],
)
def test_a_run_that_breaks_is_not_done(tmp_path, cells, last, reason):
    """The page's own refusals are in tests/experiments/test_page.py; these notebooks do without, and without torch."""
    notebook, out = save(bare(*cells, last=last), tmp_path), tmp_path / "out"
    out.mkdir()
    (out / "metrics.json").write_text(json.dumps({"status": "ok", "hash": "of an earlier run"}))
    with pytest.raises(NotDone, match=reason):
        run_notebook(notebook, out, {}, page=False)
    assert {path.name for path in out.iterdir()} == {"notebook.ipynb"}  # the log stays


@pytest.mark.parametrize("kept", ['{"status": "ok", "ha', '{"status": "finished", "hash": "x", "depends": {}, "metrics": {}}'])
def test_a_result_that_is_cut_or_of_other_parameters_does_not_count(tmp_path, monkeypatch, kept):
    monkeypatch.setattr(execute.papermill, "execute_notebook", lambda *words, **_: pretend(*words, kept=kept))
    with pytest.raises(NotDone, match=r"metrics\.json is missing, half-written or of other parameters"):
        run_notebook(save(runnable(), tmp_path), tmp_path / "out", {}, page=False)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"notebook.ipynb"}


def test_a_run_with_a_skipped_cell_is_not_done(tmp_path):
    notebook = new_notebook(cells=[code(PARAMETERS, "parameters"), code("1 / 0", "skip-execution"), code("1")])
    with pytest.raises(NotDone, match="cell 3, '1 / 0', was not run"):
        run_notebook(save(notebook, tmp_path), tmp_path / "out", {}, page=False)
    assert not (tmp_path / "out" / "metrics.json").exists()


def test_a_cell_that_takes_too_long_is_named_and_its_kernel_killed(tmp_path, monkeypatch, capsys):
    """In a folder whose name papermill would fill in, and the shell would run."""
    for name in ("OMP_NUM_THREADS", "MW_STATIC"):
        monkeypatch.setenv(name, "1")
    folder = tmp_path / NASTY
    cells = [code(PARAMETERS, "parameters"), code("import os, pathlib\npathlib.Path(out, 'pid').write_text(str(os.getpid()))")]
    path, out = save(new_notebook(cells=[*cells, code("import time\ntime.sleep(300)")]), folder), folder / "out"
    assert main(["run-notebook", str(path), "--out", str(out), "--timeout", "1"]) == 1
    told = capsys.readouterr().err
    assert "cell 4, 'import time', took longer than the timeout" in told and "Traceback" not in told
    with pytest.raises(ProcessLookupError):
        os.kill(int((out / "pid").read_text()), 0)
    assert (out / "notebook.html").is_file() and not (out / "metrics.json").exists()


def test_what_an_earlier_run_left_is_removed_and_nothing_else(tmp_path, monkeypatch):
    """A picture of an earlier run beside those of this one would pass for one of them."""
    monkeypatch.setattr(execute.papermill, "execute_notebook", lambda *_, **__: 1 / 0)
    out = tmp_path / "out"
    for stem, notebook in (("fig_a", "01_sample"), ("fig_b", "02_other")):
        write_together({out / f"{stem}.{kind}": "x" for kind in ("png", "pdf", "csv", "txt")})
        (out / f"{stem}.json").write_text(json.dumps({"figure": stem, "notebook": notebook}))
    for name in ("settings.json", "broken.json", "broken.csv"):
        (out / name).write_text("[" if "broken" in name else '{"figure": "x"}')
    with pytest.raises(NotDone, match="division"):
        run_notebook(save(runnable(), tmp_path), out, {}, page=False)
    assert {path.name for path in out.iterdir()} == {
        "settings.json",
        "broken.json",
        "broken.csv",
        *(f"fig_b.{kind}" for kind in FILES["figure"]),
    }


def test_the_result_and_its_page_appear_together_or_not_at_all(tmp_path, monkeypatch):
    monkeypatch.setattr(execute.papermill, "execute_notebook", pretend)
    monkeypatch.setattr(execute, "_page", lambda executed: "<html>")
    out = run_notebook(save(runnable(), tmp_path), tmp_path / "out", {})
    result = results.result_of(out)
    expected = {"notebook": source_hash(runnable()), "mwlib": package_hash(), "surroundings": execute.surroundings()}
    assert result["status"] == "ok" and result["depends"] == DEPENDS | expected
    assert (out / "notebook.html").read_text() == "<html>"

    def full_disk(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files, "_write", full_disk)
    with pytest.raises(OSError, match="No space"):
        run_notebook(save(runnable(), tmp_path), out, {})
    assert {path.name for path in out.iterdir()} == {"notebook.ipynb"}


def test_an_execution_is_kept_for_whoever_asks_for_the_same(tmp_path, monkeypatch):
    """Of the same notebook, parameters, data and surroundings; in another folder, with a page for who wants one."""
    asked = []
    monkeypatch.setattr(execute.papermill, "execute_notebook", lambda *words, **more: (asked.append(words), pretend(*words)))
    monkeypatch.setattr(execute, "_page", lambda executed: "<html>")
    monkeypatch.setenv("MWLIB_EXECUTED", str(tmp_path / "kept"))
    notebook = save(runnable(), tmp_path)
    first = run_notebook(notebook, tmp_path / "first", {}, page=False)
    (tmp_path / "second" / "deep").mkdir(parents=True)
    second = run_notebook(notebook, tmp_path / "second", {})
    assert (
        len(asked) == 1 and results.result_of(second) == results.result_of(first) and results.result_of(first)["status"] == "ok"
    )
    assert {path.name for path in second.iterdir()} - {path.name for path in first.iterdir()} == {"notebook.html", "deep"}
    run_notebook(notebook, tmp_path / "second", {"level": 3})
    run_notebook(save(runnable("1"), tmp_path), tmp_path / "second", {})
    monkeypatch.setenv("MW_STATIC", "another")
    run_notebook(save(runnable("1"), tmp_path), tmp_path / "second", {})
    assert len(asked) == 4
    monkeypatch.delenv("MWLIB_EXECUTED")
    run_notebook(notebook, tmp_path / "second", {})
    assert len(asked) == 5, "only who names a folder gets what is kept"


def pretend(notebook: str, executed: str, values: dict, kept: str = "", **_) -> None:
    """What a run leaves before it is looked at, without a kernel."""
    tree, folder = nbformat.read(notebook, as_version=4), Path(executed).parent
    for number, cell in enumerate(tree.cells, 1):
        cell.execution_count = number
    nbformat.write(tree, executed)
    whole = {"status": "finished", "hash": results.parameters_hash(values), "depends": DEPENDS, "metrics": {}}
    (folder / results.RESULT).write_text(kept or json.dumps(whole))


def test_sigterm_leaves_no_result(tmp_path):
    notebook, out = save(bare(SLOW), tmp_path), tmp_path / "out"
    process = started(main, ["run-notebook", str(notebook), "--out", str(out)], log=tmp_path / "log", cwd=ROOT)
    deadline = time.monotonic() + 180
    while not (out / "begun").exists() and process.is_alive() and time.monotonic() < deadline:
        time.sleep(0.1)
    begun = (out / "begun").exists()
    process.terminate()
    process.join(60)
    assert begun and process.exitcode == -signal.SIGTERM
    assert not (out / "metrics.json").exists()


ALONE = """import os, pathlib, time
mine = pathlib.Path(out, "mine")
mine.touch(exist_ok=False)
time.sleep(1)
mine.unlink()"""


def test_two_runs_into_one_folder_come_one_after_the_other(tmp_path):
    notebook, out = save(bare(ALONE), tmp_path), tmp_path / "out"
    logs = [tmp_path / "0.log", tmp_path / "1.log"]
    words = ["run-notebook", str(notebook), "--out", str(out)]
    both = [started(main, words, log=log, cwd=ROOT) for log in logs]
    for process in both:
        process.join(180)
    told = [log.read_text() for log in logs]
    assert sum("another process holds" in text for text in told) == 1 and all(str(out) in text for text in told)
    assert results.result_of(out)["status"] == "ok" and not any(NotDone.__name__ in text for text in told)


def test_the_command_refuses_what_the_notebook_does_not_offer(tmp_path, monkeypatch, capsys):
    for name in ("OMP_NUM_THREADS", "MW_STATIC"):  # the command sets them for its kernel
        monkeypatch.setenv(name, "1")
    words = ["run-notebook", str(save(runnable(), tmp_path)), "--out", str(tmp_path / "out"), "--set", "lvl=3"]
    assert main(words) == 1
    errors = capsys.readouterr().err
    assert "unknown parameter" in errors and "level: int = 2" in errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words, message",
    [
        (["{folder}/empty.ipynb"], "empty.ipynb is not a notebook: .*expected cells"),
        (["{folder}/text.ipynb"], "text.ipynb is not a notebook: Expecting value"),
        (["{folder}/cells.ipynb"], "cells.ipynb is not a notebook"),
        (["{folder}/syntax.ipynb"], "parameters cell: "),
        (["{folder}/good.ipynb", "--parameters", "{folder}/list.yaml"], "list.yaml holds .*expected a mapping"),
        (["{folder}/good.ipynb", "--parameters", "{folder}/text.ipynb"], "text.ipynb is not YAML"),
        (["{folder}/good.ipynb", "--set", "out=elsewhere"], "out is given as a parameter, 'elsewhere'; say --out"),
        (["{folder}/good.ipynb", "--timeout", "0"], "timeout is 0"),
        (["{folder}/none.ipynb"], "none.ipynb"),
    ],
)
def test_mistakes_are_told_in_a_sentence(tmp_path, monkeypatch, capsys, words, message):
    for name in ("OMP_NUM_THREADS", "MW_STATIC"):
        monkeypatch.setenv(name, "1")
    save(runnable(), tmp_path, "good")
    save(new_notebook(cells=[code("a: int = (", "parameters")]), tmp_path, "syntax")
    texts = {"empty.ipynb": "{}", "text.ipynb": "}", "cells.ipynb": '{"cells": [3]}', "list.yaml": "- level=3"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    words = [word.format(folder=tmp_path) for word in words]
    assert main(["run-notebook", *words, "--out", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().err
    assert re.search(message, told) and "Traceback" not in told and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "given, message",
    [
        ({"lvl": 3}, "unknown parameter 'lvl'.*\n.*level: int = 2"),
        ({"lr": "1e-3"}, "expected float.*1.0e-3"),
        ({"level": 2.5}, "expected int"),
        ({"level": True}, "expected int"),
        ({"level": -1}, "level is -1; expected 0 to 99"),
        ({"lr": 1.5}, "lr is 1.5; expected 0.0001 to 1"),
        ({"names": "haar"}, "expected list.str."),
        ({"names": [1]}, "expected list.str."),
    ],
)
def test_parameters_that_do_not_fit_are_refused_before_anything_runs(tmp_path, given, message):
    with pytest.raises(ParameterError, match=f"(?s){message}"):
        run_notebook(save(runnable(), tmp_path), tmp_path / "out", given)
    assert not (tmp_path / "out").exists()
