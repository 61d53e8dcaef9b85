"""The workflow on a cluster, played by a script that runs each job in the background: one job is killed midway."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import matplotlib

from tests.sample_notebooks import bare, save

ROOT = Path(__file__).parents[2]
# What a queue does: takes a job script, gives back a name for it, and says how that job fares.
SUBMIT = """#!/bin/sh
setsid sh -c '"$0" >"$0.log" 2>&1; echo $? >"$0.rc"' "$1" </dev/null >/dev/null 2>&1 &
echo $! >"$1.pid"
echo "$1"
"""
STATUS = """#!/bin/sh
if [ -f "$1.rc" ]; then [ "$(cat "$1.rc")" = 0 ] && echo success || echo failed
elif kill -0 "$(cat "$1.pid")" 2>/dev/null; then echo running
else echo failed; fi
"""
TOGETHER = """import pathlib, time
here = pathlib.Path(out)
(here / "begun").touch()
while not all((here.parent / name / "begun").exists() for name in ("01_first", "02_second")):
    time.sleep(0.1)"""
WAITS = "time.sleep(300)"


def workflow(folder: Path) -> list[str]:
    for name, text in (("submit", SUBMIT), ("status", STATUS)):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--executor", "cluster-generic"]
    command += ["--cluster-generic-submit-cmd", str(folder / "submit"), "--cluster-generic-status-cmd", str(folder / "status")]
    command += "--jobs 3 --keep-going --rerun-incomplete --seconds-between-status-checks 1 --latency-wait 5".split()
    return [*command, "--config", "preset=tiny", "data=synthetic", "out=my out", "grids=grids.yaml"]


def test_a_killed_job_costs_itself_only(tmp_path):
    (tmp_path / "grids.yaml").write_text("grids: {}")
    save(bare(TOGETHER), tmp_path / "notebooks", "01_first")
    save(bare(TOGETHER, WAITS), tmp_path / "notebooks", "02_second")
    out = tmp_path / "my out"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])}
    environment |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "MPLCONFIGDIR": matplotlib.get_cachedir(), "OMP_NUM_THREADS": "1"}
    quiet = dict(cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    with subprocess.Popen(workflow(tmp_path), **quiet) as process:
        deadline = time.monotonic() + 200
        while not all((out / name / "begun").exists() for name in ("01_first", "02_second")) and time.monotonic() < deadline:
            assert process.poll() is None, process.stdout.read()
            time.sleep(0.1)
        (job,) = [file for file in out.glob(".snakemake/tmp.*/*.pid") if "02_second" in file.with_suffix("").read_text()]
        os.killpg(int(job.read_text()), signal.SIGKILL)
        told = process.communicate()[0]
    assert process.returncode != 0 and (out / "01_first" / "metrics.json").exists(), told
    assert not (out / "02_second" / "metrics.json").exists()
    assert '02_second <span class="missing">not finished' in (out / "index.html").read_text()
    again = subprocess.run([*workflow(tmp_path), "--dry-run"], **quiet)
    assert again.returncode == 0 and re.search(r"notebook +1\n", again.stdout), again.stdout
    assert "wildcards: name=02_second" in again.stdout
