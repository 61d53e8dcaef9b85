"""The run contract: hashes, atomic results, one training for many askers, and goings-on after a kill at a bad moment."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mwlib.experiments import get_model, get_result, get_run, load_run, runs, store, train_run
from mwlib.files import write_atomic
from mwlib.training import CHECKPOINT, CURVES, MODEL
from tests.sample_settings import small, two_people

ROOT = Path(__file__).parents[2]


def test_results_are_believed_only_when_whole(tmp_path):
    assert store.read_result(tmp_path, "abc") is None
    store.write_result(tmp_path, {"ade": 0.5}, "abc", {})
    assert store.read_result(tmp_path, "abc") == {"ade": 0.5} and store.read_result(tmp_path, "abd") is None
    text = (tmp_path / store.RESULT).read_text()
    for broken in (text[:-5], "[]", json.dumps({"status": "running", "hash": "abc"}), ""):
        write_atomic(tmp_path / store.RESULT, broken)
        assert store.read_result(tmp_path, "abc") is None


def test_the_hash_of_a_notebooks_parameters_leaves_out_where_results_go():
    parameters = {"preset": "tiny", "level": 2}
    assert store.parameters_hash(parameters) == store.parameters_hash({"level": 2, "preset": "tiny", "out": "build/01"})
    assert store.parameters_hash(parameters) != store.parameters_hash(parameters | {"level": 3})


ASK = """
import sys, torch; torch.set_num_threads(1)
from mwlib.experiments import get_run
from tests.sample_settings import small, two_people
path = get_run(small(), two_people())
print(path, (path / "model.safetensors").stat().st_mtime_ns)
"""


def test_two_processes_train_a_run_once(tmp_path):
    environment = {**os.environ, "MWLIB_RUNS": str(tmp_path), "OMP_NUM_THREADS": "1"}
    asking = dict(cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    askers = [subprocess.Popen([sys.executable, "-c", ASK], **asking) for _ in range(2)]
    answers = [asker.communicate(timeout=300)[0] for asker in askers]
    assert answers[0] == answers[1] != "" and len(list(tmp_path.iterdir())) == 1


def test_runs_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    assert store.runs_folder() == tmp_path
    monkeypatch.delenv("MWLIB_RUNS")
    monkeypatch.chdir(tmp_path)
    assert store.runs_folder() == tmp_path / "runs"


def test_a_predictor_samples_as_its_configuration_says(monkeypatch, tmp_path):
    """Two configurations that differ in sampling share a run; each gets its own settings back."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = small()
    guided = cfg.override(guidance_weight=0.7, tabg_space="eps")
    folder = get_run(guided, two_people())
    assert load_run(folder).sampling == guided.sampling
    assert get_model(cfg, two_people()).sampling == cfg.sampling != guided.sampling
    assert list(tmp_path.iterdir()) == [folder]


def test_a_kill_between_the_last_checkpoint_and_the_result_costs_nothing(monkeypatch, tmp_path):
    """The training is over, the proof of it is missing: it is written without another step, and with the losses."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg, data = small(), two_people()
    data = data._replace(test=data.validation)
    folder = get_run(cfg, data)
    whole = json.loads((folder / store.RESULT).read_text())
    (folder / store.RESULT).unlink()
    kept = {name: (folder / name).stat().st_mtime_ns for name in (MODEL, CHECKPOINT)}
    assert get_run(cfg, data) == folder
    assert json.loads((folder / store.RESULT).read_text()) == whole and whole["metrics"]["loss"] > 0
    assert kept == {name: (folder / name).stat().st_mtime_ns for name in kept}
    training = get_result(cfg.override(test_windows=3), data)["training"]
    assert training == whole["metrics"] and training["steps"] == cfg.training.train_steps


def test_a_stopped_training_gives_the_result_of_one_that_was_not(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg, data = small(), two_people()
    whole = store.read_result(get_run(cfg, data), cfg.training_hash())
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "other"))
    for step in train_run(cfg, data, runs.run_path(cfg, data)):
        if step.step == 7:
            break
    again = store.read_result(get_run(cfg, data), cfg.training_hash())
    assert whole is not None and again is not None
    assert {k: v for k, v in again.items() if k != "seconds"} == {k: v for k, v in whole.items() if k != "seconds"}
    texts = [(file.parent / CURVES).read_text() for file in tmp_path.rglob(MODEL)]
    assert texts[0] == texts[1], "step numbers stay whole numbers"


def test_a_baseline_trains_nothing(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    data = two_people()._replace(test=two_people().validation)
    found = get_result(small(method="zero_velocity", test_windows=3), data)
    assert found["training"] is None and found["windows"] == 3 and found["mean"]["apd"] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_loading_nothing_says_what_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"config.yaml is missing"):
        load_run(tmp_path)
    (tmp_path / "config.yaml").write_text(small().to_yaml())
    with pytest.raises(FileNotFoundError, match=r"model.safetensors is missing"):
        load_run(tmp_path)


def test_a_run_of_a_former_version_is_refused_with_the_reason(tmp_path):
    (tmp_path / "config.yaml").write_text("data: {data: synthetic}\nmodel: {latent: 64}\n")
    with pytest.raises(ValueError, match="mwlib before 0.2"):
        load_run(tmp_path)


def test_a_run_killed_at_any_of_its_writes_goes_on_to_the_same_bits(tmp_path):
    """Before, amid and after each write, rename and removal; see `placed_kills`."""
    command = [sys.executable, "-m", "tests.experiments.placed_kills", str(tmp_path)]
    answer = subprocess.run(command, cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"}, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    places, lost = answer.stdout.split(maxsplit=1)
    assert int(places) >= 40 and lost.strip() == "[]"


ONE_OF_TWO = """
import sys, torch; torch.set_num_threads(1)
from mwlib.experiments import get_run, runs
from tests.sample_settings import small, two_people
runs.PATIENCE = 0.2
print(get_run(small(), two_people()))
"""


def test_several_processes_do_not_hang_when_another_finishes_their_run(monkeypatch, tmp_path):
    """The first of the processes waits for the lock; meanwhile somebody else writes the result. Nobody starts to train."""
    cfg, data = small(), two_people()
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "elsewhere"))
    made = get_run(cfg, data)
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    folder = runs.run_path(cfg, data)
    world = {**os.environ, "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free_port()), "WORLD_SIZE": "2", "OMP_NUM_THREADS": "1"}
    with store.locked(folder / ".lock"):
        ranks = [
            subprocess.Popen(
                [sys.executable, "-c", ONE_OF_TWO], cwd=ROOT, stdout=subprocess.PIPE, text=True,
                env={**world, "RANK": str(rank), "LOCAL_RANK": str(rank), "ACCELERATE_USE_CPU": "true"},
            )
            for rank in range(2)
        ]  # fmt: skip
        time.sleep(6)
        shutil.copytree(made, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".lock"))
    assert [rank.communicate(timeout=120)[0].strip() for rank in ranks] == [str(folder)] * 2
    assert all(rank.returncode == 0 for rank in ranks)


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]
