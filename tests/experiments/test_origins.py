"""What a result depends on: every change of it changes a hash, and nothing else does."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NamedTuple

import pytest

from mwlib.experiments import get_model, get_result, load_run, runs
from mwlib.experiments.origins import data_fingerprint, models_used
from mwlib.experiments.results import result_file
from mwlib.experiments.store import result_of
from mwlib.hashing import file_hash, package_hash
from mwlib.paths import CONFIG
from mwlib.text_to_motion.config import Config as SentencesConfig
from mwlib.training import MODEL
from tests.sample_settings import small, two_people


@pytest.fixture
def data(tmp_path) -> Path:
    """A folder of files in two levels, below another."""
    folder = tmp_path / "all" / "data"
    for name in ("a.bvh", "deep/b.amc", "deep/b.asf", "clips.csv"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    return folder


def swap(one: Path, other: Path) -> None:
    text = one.read_text()
    one.write_text(other.read_text())
    other.write_text(text)


CHANGES = {
    "edited": lambda folder: (folder / "a.bvh").write_text("A.bvh"),
    "edited at the same time": lambda folder: ((folder / "a.bvh").write_text("A.bvh"), os.utime(folder / "a.bvh", (1, 1))),
    "added": lambda folder: (folder / "deep" / "c.npz.xz").write_text(""),
    "removed": lambda folder: (folder / "a.bvh").unlink(),
    "renamed": lambda folder: (folder / "a.bvh").rename(folder / "b.bvh"),
    "moved": lambda folder: (folder / "a.bvh").rename(folder / "deep" / "a.bvh"),
    "swapped": lambda folder: swap(folder / "a.bvh", folder / "deep" / "b.amc"),
    "skeleton": lambda folder: (folder / "deep" / "b.asf").write_text("other"),
    "hints": lambda folder: (folder / "clips.csv").write_text("other"),
    "hints above": lambda folder: (folder.parent / "clips.csv").write_text("new"),
}
NO_CHANGES = {
    "nothing": lambda folder: None,
    "touched": lambda folder: os.utime(folder / "a.bvh", (1, 1)),
    "written again": lambda folder: (folder / "a.bvh").write_text("a.bvh"),
    "other files": lambda folder: (folder / "notes.md").write_text("x"),
    "hidden": lambda folder: (folder / ".a.bvh").write_text("x"),
    "pipe": lambda folder: os.mkfifo(folder / "pipe.bvh"),
    "broken link": lambda folder: (folder / "link.bvh").symlink_to("nowhere"),
}


@pytest.mark.parametrize("name", [*CHANGES, *NO_CHANGES])
def test_the_fingerprint_of_data_follows_their_files(data, name):
    before = data_fingerprint(str(data))
    {**CHANGES, **NO_CHANGES}[name](data)
    assert (data_fingerprint(str(data)) != before) == (name in CHANGES)


def test_a_single_file_counts_with_its_skeleton_and_hints_only(data):
    file = str(data / "deep" / "b.amc")
    before = data_fingerprint(file)
    (data / "a.bvh").unlink()
    assert data_fingerprint(file) == before
    (data / "deep" / "b.asf").write_text("other")
    after = data_fingerprint(file)
    (data / "clips.csv").unlink()
    assert len({before, after, data_fingerprint(file)}) == 3


def test_data_are_found_where_loading_finds_them(data, monkeypatch):
    monkeypatch.setenv("MWLIB_DATA", str(data.parent))
    assert data_fingerprint("data") == data_fingerprint(str(data)) != data_fingerprint("nowhere")
    assert data_fingerprint("synthetic") == data_fingerprint("tiny") == data_fingerprint("nowhere")


def test_runs_and_results_name_settings_data_library_and_model(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    models_used.clear()
    cfg, data = small(test_windows=3), two_people()._replace(test=two_people().validation)
    found = get_result(cfg, data)
    folder, library = runs.run_path(cfg, data), package_hash()
    model = file_hash(folder / MODEL)
    training, testing = data.fingerprints()
    assert result_of(folder)["depends"] == {
        "settings": cfg.training_hash(), "data": training, "mwlib": library, "model": model
    }  # fmt: skip
    expected = {"settings": cfg.hash(), "data": [training, testing], "mwlib": library, "models": {folder.name: model}}
    assert found["depends"] == expected and models_used == {folder.name: model}
    for ask in (lambda: get_result(cfg, data), lambda: get_model(cfg, data), lambda: load_run(folder)):
        models_used.clear()
        ask()
        assert models_used == {folder.name: model}, "a page names the models of its process, however they were had"


@pytest.mark.parametrize("broken", ["", '{"mean": {', "[]", "{}"])
def test_a_broken_result_is_measured_again(monkeypatch, tmp_path, broken):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg, data = small(method="zero_velocity", test_windows=3), two_people()._replace(test=two_people().validation)
    file = result_file(cfg, data)
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
        return runs.run_path(changed, Given()), result_file(changed, Given())

    found = places()
    plain = places(cfg.override(start="", semantic_weight=0.0))
    for name, trains in (("critic", True), ("start", True), ("evaluator", False)):
        (tmp_path / name / MODEL).write_bytes(b"second")
        run, result = places()
        assert (run != found[0]) == trains and result != found[1], name
        assert places(cfg.override(start="", semantic_weight=0.0))[0] == plain[0], "which no other model stands behind"
        (tmp_path / name / MODEL).write_bytes(b"first")
    assert places() == found
