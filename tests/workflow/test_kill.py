"""A workflow that is killed in the middle of a grid or of a chapter goes on where it was; two do not mix."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import matplotlib

from tests.experiments.test_grids import ROWS, write
from tests.sample_notebooks import NASTY, bare, save
from tests.workflow.test_clone import clone

ROOT = Path(__file__).parents[2]


def workflow() -> list[str]:
    command = [sys.executable, "-m", "snakemake", "grids", "--snakefile", str(ROOT / "Snakefile"), "--cores", "1"]
    return [*command, "--rerun-incomplete", "--config", "grids=grids.yaml", "out=out", "preset=tiny", "data=synthetic"]


def test_after_a_kill_only_what_is_missing_runs_again(tmp_path):
    """`kill -9` on the whole workflow in the middle of a grid; the next call does the rest. The folder has an odd name."""
    folder = tmp_path / NASTY
    folder.mkdir()
    write(folder, budgets=[{"until": 1000, "seeds": 1}], rows=ROWS[:2])
    parts = folder / "out" / "grids" / "bases"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MWLIB_RUNS": str(tmp_path / "runs"), "OMP_NUM_THREADS": "1"}
    environment |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "MPLCONFIGDIR": matplotlib.get_cachedir()}
    quiet = dict(cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    with subprocess.Popen(workflow(), start_new_session=True, **quiet) as process:
        deadline = time.monotonic() + 600
        while len(list(parts.glob("*/"))) < 2 and time.monotonic() < deadline:  # the second has begun
            assert process.poll() is None, process.stdout.read()
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGKILL)
    done = list(parts.glob("*/metrics.json"))
    assert len(done) == 1 and not (folder / "out" / "grids" / "bases.csv").exists()
    first = done[0].stat().st_mtime_ns
    subprocess.run([*workflow(), "--unlock"], check=True, **quiet)
    again = subprocess.run(workflow(), **quiet)
    assert again.returncode == 0, again.stdout
    assert again.stdout.count("rule experiment:") == 1, again.stdout
    assert done[0].stat().st_mtime_ns == first
    assert (folder / "out" / "grids" / "bases.csv").read_text().count("\n") == 3
    assert not [*tmp_path.rglob("X")]


HANGS_ONCE = """import pathlib, time
begun = pathlib.Path(out, "begun")
if not begun.exists():
    begun.touch()
    time.sleep(300)"""


def test_figures_killed_in_a_chapter_go_on_by_the_same_command(tmp_path):
    """Meanwhile a second `make figures` into the same folder is refused. What was finished stays."""
    folder = clone(tmp_path / "clone")
    (finished,) = (path.stem for path in folder.glob("notebooks/02*"))
    save(bare(HANGS_ONCE), folder / "notebooks", "03_hangs_once")
    environment = {name: value for name, value in os.environ.items() if name not in ("MWLIB_RUNS", "MWLIB_DATA")}
    environment |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "MPLCONFIGDIR": matplotlib.get_cachedir(), "PYTHON": "false"}
    make = dict(args=["make", "figures", "OUT=out"], cwd=folder, env=environment, text=True)
    out = folder / "out"
    with subprocess.Popen(**make, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 600
        while not ((out / "03_hangs_once" / "begun").exists() and (out / finished / "notebook.html").exists()):
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.1)
        second = subprocess.run(**make, capture_output=True)
        assert second.returncode != 0 and f"another make or Snakemake is at work in {out}; wait for its end" in second.stderr
        assert "Traceback" not in second.stderr
        os.killpg(process.pid, signal.SIGKILL)
    results = [out / name / "metrics.json" for name in (finished, "03_hangs_once")]
    first = results[0].stat().st_mtime_ns
    again = subprocess.run(**make, capture_output=True)
    assert again.returncode == 0, again.stdout + again.stderr
    assert results[0].stat().st_mtime_ns == first and (out / "index.html").exists()
    assert [json.loads(file.read_text())["status"] for file in results] == ["ok", "ok"]
