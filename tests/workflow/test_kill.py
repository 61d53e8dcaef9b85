"""A workflow that is killed in the middle of a grid goes on where it was."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import matplotlib

from tests.experiments.test_grids import ROWS, write
from tests.sample_notebooks import NASTY

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
        deadline = time.monotonic() + 200
        while len(list(parts.glob("*"))) < 2 and time.monotonic() < deadline:  # the second has begun
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
