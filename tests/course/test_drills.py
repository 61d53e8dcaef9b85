"""Failure drills: whatever happens to a run, it must not count as done unless its notebook got to its end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mwlib.__main__ import main
from mwlib.course.parameters import ParameterError
from mwlib.course.worker import NotDone, run_notebook
from mwlib.experiments import store
from tests.sample_notebooks import runnable, save

ROOT = Path(__file__).parents[2]
SLOW = "import pathlib, time\npathlib.Path(out, 'begun').touch()\ntime.sleep(300)"
HALF = 'import pathlib\npathlib.Path(out, \'metrics.json\').write_text(\'{"status": "ok", "ha\')'
OTHERS = "Page('01_sample', out, cfg, preset=preset, data=data, level=level + 1, lr=lr, names=names).finish({})"


def test_a_run_that_gets_to_its_end_is_done(tmp_path):
    notebook = save(runnable("print(level)"), tmp_path)
    stored = notebook.read_bytes()
    out = run_notebook(notebook, tmp_path / "out", {"level": 3, "lr": 1})
    expected = {"preset": "tiny", "data": "", "level": 3, "lr": 1.0, "names": ["haar", "db2"]}
    assert store.read_result(out, store.parameters_hash(expected)) == {"answer": 4.0}
    assert store.read_result(out, store.parameters_hash({**expected, "level": 2})) is None
    assert {"notebook.ipynb", "notebook.html"} <= {path.name for path in out.iterdir()}
    assert notebook.read_bytes() == stored


@pytest.mark.parametrize(
    "cells, last, reason",
    [
        pytest.param(["import os\nos._exit(1)"], None, "died", id="kernel dies"),
        pytest.param(["import sys\nsys.exit(0)"], None, "missing", id="exit 0 in a cell"),
        pytest.param(["1 / 0"], None, "ZeroDivisionError", id="a cell raises"),
        pytest.param(["page.finish({})"], None, "after page.finish", id="result before the end"),
        pytest.param([], HALF, "half-written", id="half-written result"),
        pytest.param([], OTHERS, "other parameters", id="result of other parameters"),
    ],
)
def test_a_run_that_breaks_is_not_done(tmp_path, cells, last, reason):
    notebook, out = save(runnable(*cells, **({"last": last} if last else {})), tmp_path), tmp_path / "out"
    out.mkdir()
    (out / "metrics.json").write_text(json.dumps({"status": "ok", "hash": "of an earlier run"}))
    with pytest.raises(NotDone, match=reason):
        run_notebook(notebook, out, {})
    assert not (out / "metrics.json").exists()
    assert (out / "notebook.ipynb").exists()  # the log stays


def test_sigterm_leaves_no_result(tmp_path):
    notebook, out = save(runnable(SLOW), tmp_path), tmp_path / "out"
    command = [sys.executable, "-m", "mwlib", "run-notebook", str(notebook), "--out", str(out)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 180
        while not (out / "begun").exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.1)
        begun = (out / "begun").exists()
        process.send_signal(signal.SIGTERM)
    assert begun and process.returncode == -signal.SIGTERM
    assert not (out / "metrics.json").exists()


def test_the_command_refuses_what_the_notebook_does_not_offer(tmp_path, monkeypatch, capsys):
    for name in ("OMP_NUM_THREADS", "MW_STATIC"):  # the command sets them for its kernel
        monkeypatch.setenv(name, "1")
    words = ["run-notebook", str(save(runnable(), tmp_path)), "--out", str(tmp_path / "out"), "--set", "lvl=3"]
    assert main(words) == 1
    errors = capsys.readouterr().err
    assert "unknown parameter" in errors and "level: int = 2" in errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "given, message",
    [
        ({"lvl": 3}, "unknown parameter 'lvl'.*\n.*level: int = 2"),
        ({"lr": "1e-3"}, "expected float.*1.0e-3"),
        ({"level": 2.5}, "expected int"),
        ({"level": True}, "expected int"),
        ({"names": "haar"}, "expected list.str."),
        ({"names": [1]}, "expected list.str."),
    ],
)
def test_parameters_that_do_not_fit_are_refused_before_anything_runs(tmp_path, given, message):
    with pytest.raises(ParameterError, match=f"(?s){message}"):
        run_notebook(save(runnable(), tmp_path), tmp_path / "out", given)
    assert not (tmp_path / "out").exists()
