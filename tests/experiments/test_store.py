"""Locks: one process at a time, the others wait, a dead holder holds nothing, and reading needs none."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from filelock import FileLock

from mwlib.experiments import results, runs
from mwlib.experiments.store import locked, write_result
from mwlib.prediction.config import Config

ROOT = Path(__file__).parents[2]
HOLD = """
import sys, time
from pathlib import Path
from mwlib.experiments.store import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(300)
"""


def test_the_second_waits_until_the_first_is_dead(tmp_path):
    file = tmp_path / "runs" / ".lock"
    reached = threading.Event()

    def ask() -> None:
        with locked(file):
            reached.set()

    with subprocess.Popen([sys.executable, "-c", HOLD, str(file)], cwd=ROOT, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        waiting = threading.Thread(target=ask, daemon=True)
        waiting.start()
        assert not reached.wait(0.5)
        holder.kill()  # no chance to tidy up
    assert reached.wait(30)
    waiting.join()


def test_a_lock_is_free_again_after_an_error(tmp_path):
    with pytest.raises(ZeroDivisionError), locked(tmp_path / "lock"):
        raise ZeroDivisionError
    with FileLock(tmp_path / "lock", timeout=0):
        pass


def test_what_is_finished_is_read_without_a_lock(tmp_path, monkeypatch):
    """Shared results may be read-only: nothing is written beside them, not even a lock."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = Config.preset("tiny")
    data = results.system_of(cfg).load_data(cfg)
    file = results.result_file(cfg, data)
    file.parent.mkdir()
    file.write_text(json.dumps({"mean": {"ade": 0.5}}))
    run = runs.run_path(cfg, data)
    write_result(run, {}, cfg.training_hash(), {})
    before = sorted(tmp_path.rglob("*"))
    for module in (results, runs):
        monkeypatch.setattr(module, "locked", lambda file: pytest.fail(f"{file} was locked"))
    assert results.get_result(cfg, data) == {"mean": {"ade": 0.5}} and runs.get_run(cfg, data) == run
    assert sorted(tmp_path.rglob("*")) == before
