"""The run contract: splits, hashes, atomic results, one training for many askers."""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import replace

import numpy as np
import pytest

from mwlib import Motion, runs
from mwlib.checkpoint import write_atomic
from mwlib.config import Config
from mwlib.data.synthetic import synthetic_motions
from mwlib.skeleton import CMU, H36M17
from mwlib.training import load_run
from tests.test_training import SMALL


def clip(subject: str, frames: int = 60) -> Motion:
    walk = np.random.default_rng(frames).normal(size=(frames, 17, 3))
    return Motion(walk, 50.0, H36M17, subject=subject, name=f"{subject}_{frames}")


def split_of(monkeypatch, motions, **changes):
    monkeypatch.setattr(runs, "load_motions", lambda source: motions)
    return runs.split_motions(Config.preset("laptop", data="somewhere", **changes))


def test_people_are_kept_apart(monkeypatch):
    people = [clip(s) for s in "ABCDEFGH" for _ in range(2)]
    split = split_of(monkeypatch, people)
    assert {m.subject for m in split.test} == {"G", "H"} and {m.subject for m in split.train} == set("ABCDEF")
    split = split_of(monkeypatch, people, test_subjects=["B"], validation_subjects=["C"])
    assert {m.subject for m in split.test} == {"B"} and {m.subject for m in split.validation} == {"C"}
    assert {m.subject for m in split.train} == set("ADEFGH")


def test_one_person_is_split_by_clips(monkeypatch):
    split = split_of(monkeypatch, [clip("A", 60 + i) for i in range(8)])
    assert [m.name for m in split.test] == ["A_66", "A_67"] and len(split.train) == 6
    with pytest.raises(ValueError, match="no training clips"):
        split_of(monkeypatch, [clip("A")])
    with pytest.raises(ValueError, match=r"no subjects \['Z'\]"):
        split_of(monkeypatch, [clip("A"), clip("B")], test_subjects=["Z"])


def test_prepare_turns_resamples_and_retargets():
    y_up = Motion(np.random.default_rng(0).normal(size=(25, 31, 3)), 120.0, CMU, up="y")
    (ready,) = runs.prepare([y_up], 60.0)
    assert (ready.up, ready.fps, ready.skeleton) == ("z", 60.0, H36M17) and len(ready) == 13
    np.testing.assert_allclose(ready.positions[:, 0, 2], y_up.positions[::2, 0, 1])


def test_results_are_believed_only_when_whole(tmp_path):
    assert runs.read_result(tmp_path, "abc") is None
    runs.write_result(tmp_path, {"ade": 0.5}, "abc")
    assert runs.read_result(tmp_path, "abc") == {"ade": 0.5} and runs.read_result(tmp_path, "abd") is None
    text = (tmp_path / runs.RESULT).read_text()
    for broken in (text[:-5], "[]", json.dumps({"status": "running", "hash": "abc"}), ""):
        write_atomic(tmp_path / runs.RESULT, broken)
        assert runs.read_result(tmp_path, "abc") is None


def test_a_failed_write_leaves_the_old_file(tmp_path):
    write_atomic(tmp_path / "a", "old")
    with pytest.raises(AttributeError):
        write_atomic(tmp_path / "a", 3)
    assert (tmp_path / "a").read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_finish_writes_only_where_asked(tmp_path):
    runs.finish("", {"x": 1}, {"preset": "tiny"})
    runs.finish(str(tmp_path), {"x": 1}, {"preset": "tiny", "out": str(tmp_path)})
    assert runs.read_result(tmp_path, runs.parameters_hash({"preset": "tiny"})) == {"x": 1}


def test_fingerprint_sees_every_frame():
    motions = synthetic_motions(subjects=1)
    changed = motions[3].positions.copy()
    changed[-1, 5, 2] += 1e-3
    assert runs.fingerprint(motions) == runs.fingerprint(synthetic_motions(subjects=1))
    assert runs.fingerprint(motions) != runs.fingerprint([*motions[:3], replace(motions[3], positions=changed), *motions[4:]])


def _ask(folder: str, queue) -> None:
    import os

    os.environ["MWLIB_RUNS"] = folder
    cfg = Config.preset("tiny", **SMALL)
    path = runs.get_run(cfg)
    queue.put((str(path), (path / "model.safetensors").stat().st_mtime_ns))


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_two_processes_train_a_run_once(tmp_path):
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    askers = [context.Process(target=_ask, args=(str(tmp_path), queue)) for _ in range(2)]
    for asker in askers:
        asker.start()
    answers = [queue.get(timeout=300) for _ in askers]
    for asker in askers:
        asker.join()
    assert answers[0] == answers[1] and len(list(tmp_path.iterdir())) == 1


def test_runs_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    assert runs.runs_folder() == tmp_path
    monkeypatch.delenv("MWLIB_RUNS")
    monkeypatch.chdir(tmp_path)
    assert runs.runs_folder() == tmp_path / "runs"


def test_a_predictor_samples_as_its_configuration_says(monkeypatch, tmp_path):
    """Two configurations that differ in sampling share a run; each gets its own settings back."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = Config.preset("tiny", **SMALL)
    guided = cfg.override(cfg_weight=0.7, tabg_space="eps")
    folder = runs.get_run(guided)
    assert load_run(folder).cfg.sampling == guided.sampling
    assert runs.get_predictor(cfg).cfg.sampling == cfg.sampling != guided.sampling
    assert list(tmp_path.iterdir()) == [folder]
