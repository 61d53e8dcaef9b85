"""Runs and results: what they depend on, atomic results, one training for many askers, goings-on after a kill."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

import pytest
import torch
from filelock import FileLock

from mwlib.experiments import get_model, get_result, get_run, load_run, results, runs, system_of, train_run
from mwlib.experiments.grids import code_of
from mwlib.experiments.results import locked, models_used, read_result, result_of, write_result
from mwlib.experiments.runs import CODE, Run
from mwlib.files import write_atomic
from mwlib.hashing import file_hash
from mwlib.inbetweening.config import Config as Inbetweening
from mwlib.paths import CONFIG
from mwlib.prediction.config import Config
from mwlib.text_to_motion.config import Config as SentencesConfig
from mwlib.training import CHECKPOINT, CURVES, MODEL
from tests.experiments import placed_kills
from tests.forked import done, started
from tests.inbetweening.sample import WINDOW
from tests.inbetweening.sample import small as small_inbetweening
from tests.sample_settings import small, two_people

ROOT = Path(__file__).parents[2]


def test_results_are_believed_only_when_whole(tmp_path):
    assert read_result(tmp_path, "abc") is None
    write_result(tmp_path, {"ade": 0.5}, "abc", {})
    assert read_result(tmp_path, "abc") == {"ade": 0.5} and read_result(tmp_path, "abd") is None
    text = (tmp_path / results.RESULT).read_text()
    lacking = [json.dumps({"status": status, "hash": "abc"}) for status in ("running", "ok")]
    for broken in (text[:-5], "[]", "", *lacking):
        write_atomic(tmp_path / results.RESULT, broken)
        assert read_result(tmp_path, "abc") is None


def test_the_hash_of_a_notebooks_parameters_leaves_out_where_results_go():
    parameters = {"preset": "tiny", "level": 2}
    assert results.parameters_hash(parameters) == results.parameters_hash({"level": 2, "preset": "tiny", "out": "build/01"})
    assert results.parameters_hash(parameters) != results.parameters_hash(parameters | {"level": 3})


def test_a_file_of_settings_counts_by_what_it_says(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("system: prediction\n")
    before = results.parameters_hash({"preset": str(file)})
    file.write_text("system: prediction\ntraining:\n  train_steps: 3\n")
    assert results.parameters_hash({"preset": str(file)}) != before


def ask() -> None:
    torch.set_num_threads(1)
    runs.PATIENCE = 0.2
    folder = get_run(small(), two_people())
    print(folder, (folder / MODEL).stat().st_mtime_ns, flush=True)


def test_two_processes_train_a_run_once(tmp_path):
    logs = [tmp_path / "0.log", tmp_path / "1.log"]
    askers = [started(ask, log=log, cwd=ROOT, env={"MWLIB_RUNS": str(tmp_path / "runs")}) for log in logs]
    for asker in askers:
        asker.join(300)
    answers = [log.read_text().splitlines()[-1:] for log in logs]  # one may say before that it waits
    assert answers[0] == answers[1] != [] and len(list((tmp_path / "runs").iterdir())) == 1


def test_runs_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    assert results.runs_folder() == tmp_path
    monkeypatch.delenv("MWLIB_RUNS")
    monkeypatch.chdir(tmp_path)
    assert results.runs_folder() == tmp_path / "runs"


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
    whole = json.loads((folder / results.RESULT).read_text())
    (folder / results.RESULT).unlink()
    (folder / ".model.safetensors.4711.part").write_text("half a file")
    kept = {name: (folder / name).stat().st_mtime_ns for name in (MODEL, CHECKPOINT)}
    assert get_run(cfg, data) == folder
    assert json.loads((folder / results.RESULT).read_text()) == whole and not list(folder.glob(".*.part"))
    assert whole["metrics"]["loss"] > 0 and whole["metrics"]["validation"] > 0
    assert kept == {name: (folder / name).stat().st_mtime_ns for name in kept}
    training = get_result(cfg.override(test_windows=3), data)["training"]
    assert training == whole["metrics"] and training["steps"] == cfg.training.train_steps


def test_a_stopped_training_gives_the_result_of_one_that_was_not(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg, data = small(), two_people()
    whole = read_result(get_run(cfg, data), cfg.training_hash())
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "other"))
    for step in train_run(cfg, data, Run(cfg, data).folder):
        if step.step == 7:
            break
    again = read_result(get_run(cfg, data), cfg.training_hash())
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


def test_a_run_killed_at_any_of_its_writes_goes_on_to_the_same_bits(tmp_path):
    """Before each write, rename and removal, and amid each write; see `placed_kills`."""
    told = done(placed_kills.main, tmp_path / "runs", log=tmp_path / "log", cwd=ROOT)
    places, lost = told.split(maxsplit=1)
    assert int(places) >= 25 and lost.strip() == "[]"


def ask_aloud() -> None:
    """Ask for the run as one of several processes, and print all that they agree on."""
    agreed = runs._agreed

    def aloud(said: str) -> str:
        word = agreed(said)
        print(word, flush=True)
        return word

    runs._agreed = aloud
    ask()


def ask_for_sizes() -> None:
    """The same of in-betweens whose loss asks the network for more than its output."""
    torch.set_num_threads(1)
    folder = get_run(sized())
    print("done", folder, flush=True)


def sized() -> Inbetweening:
    return small_inbetweening(**WINDOW, mean_width=8, batch=4, dropout=0.0)


def ranks(tmp_path: Path, asking: Callable[[], None] = ask_aloud) -> tuple[list[BaseProcess], list[Path]]:
    """Two processes as ``accelerate launch`` starts them, and what they print."""
    logs = [tmp_path / "0.log", tmp_path / "1.log"]
    world = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free_port()), "WORLD_SIZE": "2", "ACCELERATE_USE_CPU": "true"}
    world["OMP_NUM_THREADS"] = "1"  # else Accelerate chooses, and says so
    ranked = [{**world, "RANK": str(rank), "LOCAL_RANK": str(rank)} for rank in range(2)]
    return [started(asking, log=log, cwd=ROOT, env=env) for log, env in zip(logs, ranked, strict=True)], logs


def test_several_processes_do_not_hang_when_another_finishes_their_run(monkeypatch, tmp_path):
    """The first of the processes waits for the lock; meanwhile somebody else writes the result. Nobody starts to train."""
    cfg, data = small(), two_people()
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "elsewhere"))
    made = get_run(cfg, data)
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    folder = Run(cfg, data).folder
    with locked(folder / ".lock"):
        processes, logs = ranks(tmp_path)
        until = time.monotonic() + 120
        while any(not log.exists() or log.read_text().count("wait") < 3 for log in logs):
            assert time.monotonic() < until and all(process.is_alive() for process in processes)
            time.sleep(0.05)
        assert [file.name for file in folder.iterdir()] == [".lock"]
        shutil.copytree(made, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".lock"))
        written = (folder / MODEL).stat().st_mtime_ns
    for process in processes:
        process.join(120)
    waiting = f"another process holds {folder / '.lock'}; waiting for its end\n"
    assert [log.read_text().count(waiting) for log in logs] == [1, 0]
    told = [log.read_text().replace(waiting, "").split() for log in logs]
    assert told[0] == told[1] and told[0][-3:] == ["done", str(folder), str(written)] and "train" not in told[0]
    assert (folder / MODEL).stat().st_mtime_ns == written and [process.exitcode for process in processes] == [0, 0]


def test_several_processes_train_one_run_together(monkeypatch, tmp_path):
    """Nobody else trains: both take part, and one result is written."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    processes, logs = ranks(tmp_path)
    for process in processes:
        process.join(120)
    told = [log.read_text().split() for log in logs]
    folder = Run(small(), two_people()).folder
    assert told[0] == told[1] == [str(folder), "wait", "train", "done", str(folder), told[0][-1]]
    assert read_result(folder, small().training_hash())["steps"] == 12 and [process.exitcode for process in processes] == [0, 0]


def test_several_processes_train_what_a_loss_asks_of_a_network(monkeypatch, tmp_path):
    """Mean and size of a window lie outside the network's output; their gradients are shared as all others."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    processes, logs = ranks(tmp_path, ask_for_sizes)
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0, 0], [log.read_text()[-2000:] for log in logs]
    folder = Run(sized()).folder
    begun, weights = get_model(sized().override(train_steps=1)).net.state_dict(), load_run(folder).net.state_dict()
    for name in ("log_factor.0.weight", "mean_of.leave.1.weight", "inner.net.leave.weight"):
        assert not torch.equal(weights[name], begun[name]) and weights[name].isfinite().all()


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def test_runs_and_results_name_settings_data_library_and_model(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    models_used.clear()
    cfg, data = small(test_windows=3), two_people()._replace(test=two_people().validation)
    found = get_result(cfg, data)
    folder, code = Run(cfg, data).folder, code_of(system_of(cfg))
    model = file_hash(folder / MODEL)
    training, testing = data.fingerprints()
    assert result_of(folder)["depends"] == {
        "settings": cfg.training_hash(), "data": training, "code": code, "model": model, "sampling": cfg.sampled()
    }  # fmt: skip
    expected = {"settings": cfg.hash(), "data": [training, testing], "code": code, "models": {folder.name: model}}
    assert found["depends"] == expected and models_used == {folder.name: model}
    for ask in (lambda: get_result(cfg, data), lambda: get_model(cfg, data), lambda: load_run(folder)):
        models_used.clear()
        ask()
        assert models_used == {folder.name: model}, "a page names the models of its process, however they were had"


@pytest.mark.parametrize("broken", ["", '{"mean": {', "[]", "{}"])
def test_a_broken_result_is_measured_again(monkeypatch, tmp_path, broken):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg, data = small(method="zero_velocity", test_windows=3), two_people()._replace(test=two_people().validation)
    file = Run(cfg, data).file
    file.parent.mkdir()
    file.write_text(broken)
    assert get_result(cfg, data)["windows"] == 3 and json.loads(file.read_text())["windows"] == 3


class Given(NamedTuple):
    """Data that only have names."""

    def fingerprints(self):
        return "a", "b"


def test_another_model_behind_a_run_makes_it_another_run(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    for name in ("critic", "evaluator", "start"):
        (tmp_path / name).mkdir()
        (tmp_path / name / CONFIG).write_text("system: matching")
        (tmp_path / name / MODEL).write_bytes(b"first")
    behind = {name: str(tmp_path / name) for name in ("critic", "evaluator", "start")}
    cfg = SentencesConfig.preset("tiny", semantic_weight=0.5, **behind)

    def places(changed=cfg):
        return Run(changed, Given()).folder, Run(changed, Given()).file

    found = places()
    plain = places(cfg.override(start="", semantic_weight=0.0))
    for name, trains in (("critic", True), ("start", True), ("evaluator", False)):
        (tmp_path / name / MODEL).write_bytes(b"second")
        run, result = places()
        assert (run != found[0]) == trains and result != found[1], name
        assert places(cfg.override(start="", semantic_weight=0.0))[0] == plain[0], "which no other model stands behind"
        (tmp_path / name / MODEL).write_bytes(b"first")
    assert places() == found


HOLD = """
import sys, time
from pathlib import Path
from mwlib.experiments.results import locked
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
    data = system_of(cfg).load_data(cfg)
    file = Run(cfg, data).file
    file.parent.mkdir()
    file.write_text(json.dumps({"mean": {"ade": 0.5}}))
    run = Run(cfg, data).folder
    write_result(run, {}, cfg.training_hash(), {})
    write_atomic(run / CONFIG, cfg.to_yaml())
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(results, "locked", lambda file: pytest.fail(f"{file} was locked"))
    assert get_result(cfg, data) == {"mean": {"ade": 0.5}} and get_run(cfg, data) == run
    assert sorted(tmp_path.rglob("*")) == before


IN_A_COPY = """
import json, os, sys
from pathlib import Path
import accelerate, filelock, pywt, scipy.linalg, torch
torch.set_num_threads(1)
copy = Path(sys.argv[1])
sys.path.insert(0, str(copy))

def measured(**accepting):
    if os.fork() == 0:
        os.environ.update(accepting)
        from mwlib.experiments import get_result
        from tests.sample_settings import small, two_people
        found = get_result(small(test_windows=3), two_people()._replace(test=two_people().validation))
        print(json.dumps([found["mean"]["ade"], found["depends"].get("older_code", [])]), flush=True)
        os._exit(0)
    assert os.wait()[1] == 0

def append(file, text):
    with (copy / "mwlib" / file).open("a") as source:
        source.write(text)

measured()
append("diffusion/samplers.py", "\\n# a comment\\n")
append("plots/look.py", "\\nANOTHER = 1\\n")
measured()
append("diffusion/samplers.py", "\\n_ddim = ddim\\ndef ddim(*given, **options):\\n    for step in _ddim(*given, **options):"
       "\\n        yield step._replace(y=2 * step.y)\\n")
measured(MWLIB_ACCEPT_OLDER_CODE="1")
measured()
"""


def test_another_sampler_gives_another_number(tmp_path):
    """Code that a system imports counts, comments and pictures do not; what older code made is taken where that is asked for."""
    shutil.copytree(ROOT / "mwlib", tmp_path / "mwlib", ignore=shutil.ignore_patterns("__pycache__", "_material", "models"))
    environment = {**os.environ, "MWLIB_RUNS": str(tmp_path / "runs"), "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    answer = subprocess.run(
        [sys.executable, "-c", IN_A_COPY, str(tmp_path)], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    (first, _), same, accepted, (other, marks) = map(json.loads, answer.stdout.splitlines())
    assert same == [first, []] and accepted == [first, ["mwlib.diffusion.samplers"]]
    assert other != first and marks == []
    said = [line for line in answer.stderr.splitlines() if "the code has changed" in line]
    assert len(said) == 3 and all("mwlib.diffusion.samplers" in line for line in said)
    assert "is taken although" in said[0] and said[1].startswith("measuring anew") and said[2].startswith("training anew")
    assert len(list((tmp_path / "runs" / "results").glob("*.json"))) == len(list((tmp_path / "runs").glob("*/model*"))) == 2


@pytest.fixture
def code(monkeypatch, tmp_path) -> dict[str, str]:
    """The code behind every system, to be changed; nothing made so far is of older code."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    monkeypatch.setattr(results, "older_code", set())
    code = {"mwlib.files": "1", "mwlib.body.motion": "1"}
    monkeypatch.setattr(runs, "code_of", lambda system: dict(code))
    return code


def changed(code: dict[str, str]) -> dict[str, str]:
    """Another module, one less, and one more."""
    del code["mwlib.body.motion"]
    code |= {"mwlib.files": "2", "mwlib.body.rig": "1"}
    return code


OTHERS = ["mwlib.body.motion", "mwlib.body.rig", "mwlib.files"]


def test_a_run_of_older_code_is_taken_where_that_is_asked_for(code, monkeypatch, caplog):
    cfg, data = small(test_windows=3), two_people()._replace(test=two_people().validation)
    run = get_run(cfg, data)
    assert result_of(run)["depends"]["code"] == json.loads((run / CODE).read_text()) == code and not caplog.messages
    changed(code)
    monkeypatch.setenv("MWLIB_ACCEPT_OLDER_CODE", "1")
    assert get_run(cfg, data) == run and results.of_older_code() == {"older_code": OTHERS}
    assert caplog.messages == [f"{run.name} is taken although the code has changed since: {', '.join(OTHERS)}"]
    found = get_result(cfg, data)
    assert found["depends"]["older_code"] == OTHERS and found["depends"]["code"] == code
    assert list(found["depends"]["models"]) == [run.name]
    assert get_result(cfg, data) == found
    monkeypatch.setenv("MWLIB_ACCEPT_OLDER_CODE", "0")
    caplog.clear()
    again = get_result(cfg, data)
    assert "older_code" not in again["depends"] and list(again["depends"]["models"]) == [Run(cfg, data).folder.name] != [run.name]
    assert caplog.messages[-1] == (
        f"training anew, as the code has changed since {run.name} was made: {', '.join(OTHERS)} (--accept-older-code takes it)"
    )


def test_a_training_that_older_code_began_goes_on(code, monkeypatch, caplog):
    cfg, data = small(), two_people()
    run = Run(cfg, data).folder
    for step in train_run(cfg, data, run):
        if step.step == 7:
            break
    before = dict(code)
    code |= {f"mwlib.module_{number}": "1" for number in range(9)}
    monkeypatch.setenv("MWLIB_ACCEPT_OLDER_CODE", "1")
    assert get_run(cfg, data) == run and result_of(run)["metrics"]["steps"] == cfg.training.train_steps
    depends = result_of(run)["depends"]
    assert depends["code"] == before and depends["older_code"] == sorted({*code} - {*before})
    assert caplog.messages[0].endswith("mwlib.module_4 and 4 more")
