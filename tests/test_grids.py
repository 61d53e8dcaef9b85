"""Grids of experiments: read, budgeted, measured once, and resumable after a kill."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from mwlib import experiment, grids, plots
from mwlib.__main__ import main
from mwlib.config import Config
from mwlib.course.files import course
from tests.test_training import SMALL

ROOT = Path(__file__).parents[1]
MICRO = {**SMALL, "train_steps": 3, "test_windows": 3, "samples": 3, "ddim_steps": 4}
ROWS = [
    {"name": "haar", "set": {"wavelet": "haar"}, "paper": {"ade": 0.4}},
    {"name": "db2", "set": {"wavelet": "db2"}},
    {"name": "db3", "set": {"wavelet": "db3"}},
]


def write(folder: Path, **changes) -> Path:
    """A small grid file."""
    body = {"title": "three bases", "trains": True, "base": MICRO, "rows": ROWS, "budgets": [{"until": 1000, "seeds": 2}]}
    path = folder / "grids.yaml"
    path.write_text(yaml.safe_dump({"grids": {"bases": body | changes}}))
    return path


def test_the_papers_grids_are_complete():
    known = grids.read_grids()
    sizes = {name: sum(bool(row.paper) for row in known[name].rows) for name in known if known[name].paper}
    assert sizes == {"table_2": 2, "table_3": 10, "table_4": 11, "table_4_raw": 11, "table_5": 2, "table_6": 3}
    best = known["table_4"].rows[7]
    assert best.changes == {"tabg_scale": 1.0, "tabg_sigma": 2.5, "wmsg": "every_step"}
    assert best.paper == {"apd": 6.506, "ade": 0.376, "fde": 0.408, "mmade": 0.466, "mmfde": 0.443}
    assert {grid.notebook for grid in known.values() if grid.notebook} <= {path.stem for path in course()}


@pytest.mark.parametrize(
    "changes, message",
    [
        (
            {"rows": [{"name": "a", "set": {"wavlet": "haar"}}]},
            "bases, row 'a': unknown parameter 'wavlet'; did you mean 'wavelet'",
        ),
        ({"rows": [{"name": "a", "set": {"level": "two"}}]}, "level is 'two'"),
        ({"rows": [{"name": "a"}, {"name": "a"}]}, "two rows have the same name"),
        ({"rows": [{"set": {}}]}, "row 1 has"),
        ({"seeds": 3}, "bases has"),
        ({"budgets": [{"seeds": 3}]}, "budgets has"),
    ],
)
def test_a_grid_that_does_not_fit_is_refused(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        grids.read_grids(write(tmp_path, **changes))


def test_budgets_cut_small_configurations_only(tmp_path):
    budgets = [{"until": 1000, "seeds": 2, "share": 0.5, "set": {"test_windows": 7}}]
    grid = grids.read_grids(write(tmp_path, base={}, budgets=budgets))["bases"]
    small, large = Config.preset("tiny"), Config.preset("h36m")
    assert grids.configs(grid, small)[1] == small.override(
        wavelet="db2", train_steps=500, test_windows=7, lr_milestones=[m // 2 for m in small.training.lr_milestones]
    )
    assert grids.configs(grid, large)[1] == large.override(wavelet="db2")
    assert (grid.budget(small).seeds, grid.budget(large).seeds) == (2, 3)


@pytest.mark.parametrize("words, message", [(["haar"], "expected name=value"), (["level=[1"], "not YAML")])
def test_changes_that_cannot_be_read_are_refused(words, message):
    with pytest.raises(ValueError, match=message):
        experiment.parse_changes(words)


def test_a_grid_is_measured_once(tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    grid, cfg = grids.read_grids(write(tmp_path))["bases"], Config.preset("tiny")
    found = grids.measure(grid, cfg)
    assert [row["name"] for row in found] == ["haar", "db2", "db3"] and all(row["seeds"] == 2 for row in found)
    assert all(row["seed_deviation"]["ade"] > 0 and row["windows"] == 3 for row in found)
    monkeypatch.setattr(experiment, "evaluate", lambda *_: pytest.fail("measured again"))
    assert grids.measure(grid, cfg) == found
    line = grids.lines(found, ("ade",), errors=True)[0]
    assert line["ADE, paper"] == 0.4 and line["ADE"] == (found[0]["mean"]["ade"], found[0]["seed_deviation"]["ade"])
    assert grids.lines(found, ("ade",))[1]["ADE, paper"] is None
    assert json.loads(json.dumps(grids.provenance(grid, cfg, found)))["seeds_of"] == "training and sampling"

    assert main(["grid-table", "bases", "--grids", str(tmp_path / "grids.yaml"), "--out", str(tmp_path / "out")]) == 0
    header, first = (tmp_path / "out" / "bases.csv").read_text().splitlines()[:2]
    assert "ADE, deviation" in header and "ADE, standard error" in header and first.startswith("haar")


def workflow(folder: Path) -> list[str]:
    settings = [f"grids={folder / 'grids.yaml'}", f"out={folder / 'out'}", "preset=tiny", "data=synthetic"]
    command = [sys.executable, "-m", "snakemake", "grids", "--snakefile", str(ROOT / "Snakefile"), "--directory", str(folder)]
    return [*command, "--cores", "1", "--rerun-incomplete", "--config", *settings]


def test_after_a_kill_only_what_is_missing_runs_again(tmp_path):
    """`kill -9` on the whole workflow in the middle of a grid; the next call does the rest."""
    write(tmp_path, budgets=[{"until": 1000, "seeds": 1}], rows=ROWS[:2])
    parts = tmp_path / "out" / "grids" / "bases"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MWLIB_RUNS": str(tmp_path / "runs")}
    environment |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "OMP_NUM_THREADS": "1"}
    quiet = dict(cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    with subprocess.Popen(workflow(tmp_path), start_new_session=True, **quiet) as process:
        deadline = time.monotonic() + 200
        while len(list(parts.glob("*"))) < 2 and time.monotonic() < deadline:  # the second has begun
            assert process.poll() is None, process.stdout.read()
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGKILL)
    done = list(parts.glob("*/metrics.json"))
    assert len(done) == 1 and not (tmp_path / "out" / "grids" / "bases.csv").exists()
    first = done[0].stat().st_mtime_ns
    subprocess.run([*workflow(tmp_path), "--unlock"], check=True, **quiet)
    again = subprocess.run(workflow(tmp_path), **quiet)
    assert again.returncode == 0, again.stdout
    assert again.stdout.count("rule experiment:") == 1, again.stdout
    assert done[0].stat().st_mtime_ns == first
    assert (tmp_path / "out" / "grids" / "bases.csv").read_text().count("\n") == 3


def test_the_committed_tables_come_back_as_lines(tmp_path):
    found = {"name": "a", "paper": {"ade": 0.4}, "windows": 3, "seeds": 2, "seconds": 1.0}
    found |= {"mean": dict.fromkeys(grids.METRICS, 0.5), "standard_error": dict.fromkeys(grids.METRICS, 0.1)}
    rows = [found | {"seed_deviation": dict.fromkeys(grids.METRICS, 0.25)}]
    rows.append(found | {"name": "b", "paper": {}, "seed_deviation": dict.fromkeys(grids.METRICS)})
    plots.save_table(grids.lines(rows, grids.METRICS, errors=True), tmp_path, "bases", provenance={"data": "synthetic"})
    metrics = ("ade", "bone_length_jitter")
    assert grids.committed("bases", metrics, tmp_path) == grids.lines(rows, metrics)
    with pytest.raises(FileNotFoundError, match="table_9"):
        grids.committed("table_9")
    for name in grids.read_grids():
        assert len(grids.committed(name)) == len(grids.read_grids()[name].rows)
