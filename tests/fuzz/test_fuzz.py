"""A sample of the spoilt files and calls of `make fuzz`, in this process."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.data import load
from mwlib.experiments import grids
from tests.fuzz.calls import Call, calls, functions, outcome
from tests.fuzz.campaign import cases
from tests.fuzz.seeds import seeds
from tests.fuzz.texts import texts
from tests.fuzz.worker import read


def written(folder, files):
    folder.mkdir()
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def test_whole_files_are_read(tmp_path):
    for number, (kind, name, files) in enumerate([*seeds(), *texts()]):
        assert read(written(tmp_path / str(number), files) / name) == ("", True), kind


def test_spoilt_files_are_read_or_refused(tmp_path):
    outcomes = set()
    for number, case in enumerate(cases(500, seed=11)):
        fault, is_read = read(written(tmp_path / str(number), case.files) / case.name)
        assert not fault, (number, case.kind, fault)
        outcomes.add((case.kind.split()[0], is_read))
    read_and_refused = {(kind, is_read) for kind in ("bvh", "config.yaml", "train.txt") for is_read in (True, False)}
    assert len(outcomes) > 18 and read_and_refused | {("hostile", False), ("grids.yaml", False)} <= outcomes


def test_a_failure_that_no_reader_foresaw_is_a_fault(tmp_path, monkeypatch):
    def reader(file, known):
        return [][0]

    monkeypatch.setitem(load.READERS, ".bvh", reader)
    fault, _ = read(written(tmp_path / "a", {"clip.bvh": b""}) / "clip.bvh")
    assert "IndexError" in fault


def test_a_refusal_of_a_text_that_does_not_name_the_file_is_a_fault(tmp_path, monkeypatch):
    def reader(file):
        raise ValueError("there are no grids")

    monkeypatch.setattr(grids, "read_grids", reader)
    assert read(written(tmp_path / "a", {"grids.yaml": b""}) / "grids.yaml") == ("without its place: there are no grids", False)


def test_a_case_is_the_same_whatever_the_count():
    assert list(cases(20, seed=3)) == list(cases(40, seed=3))[:20] != list(cases(20, seed=4))
    few, many = ([repr((c.function, c.spoilt, c.arguments)) for c in calls(count, seed=3)] for count in (12, 24))
    assert few == many[:12]


@pytest.mark.usefixtures("unchecked")
def test_whole_calls_give_results_and_spoilt_ones_too_or_say_what_is_spoilt():
    for name, function in functions().items():
        assert outcome(Call(name, dict(function.whole), ())) == ("", True), name
    ends = set()
    for number, call in enumerate(calls(120, seed=7)):
        fault, has_result = outcome(call)
        assert not fault, (number, call.function, call.spoilt, fault)
        ends.add((call.function.split()[0], has_result))
    assert len(ends) == 8


FAULTS = {
    "another error": (lambda: [][0], "IndexError: list index out of range"),
    "no name": (lambda: int("a"), "ValueError that names nothing"),
    "no run": (lambda: open("/nowhere/samples"), "FileNotFoundError that names nothing"),
    "a warning": (lambda: np.float64(1e308) * 10 and torch.zeros(5, 2, 14, 48), "a warning: overflow encountered"),
    "not finite": (lambda: torch.full((5, 2, 14, 48), torch.nan), "a result of another shape, or not finite"),
    "too few frames": (lambda: torch.zeros(5, 2, 13, 48), "a result of another shape, or not finite"),
}  # fmt: skip


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("call, message", FAULTS.values(), ids=FAULTS)
def test_ends_of_a_call_that_are_at_fault(monkeypatch, call, message):
    whole = functions()["predict"]
    monkeypatch.setitem(functions(), "predict", whole._replace(call=lambda **given: call()))
    assert outcome(Call("predict", dict(whole.whole), ("samples",)))[0].startswith(message)
