"""A sample of the spoilt files that `make fuzz` reads, in this process."""

from __future__ import annotations

from mwlib.data import load
from tests.fuzz.campaign import cases
from tests.fuzz.seeds import seeds
from tests.fuzz.worker import read


def written(folder, files):
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


def test_whole_files_are_read(tmp_path):
    for number, (kind, name, files) in enumerate(seeds()):
        assert read(written(tmp_path / str(number), files) / name) == ("", True), kind


def test_spoilt_files_are_read_or_refused(tmp_path):
    outcomes = set()
    for number, case in enumerate(cases(200, seed=7)):
        fault, is_read = read(written(tmp_path / str(number), case.files) / case.name)
        assert not fault, (number, case.kind, fault)
        outcomes.add((case.kind.split()[0], is_read))
    assert len(outcomes) > 10 and {("bvh", True), ("bvh", False), ("hostile", False)} <= outcomes


def test_a_failure_that_no_reader_foresaw_is_a_fault(tmp_path, monkeypatch):
    def reader(file, known):
        return [][0]

    monkeypatch.setitem(load.READERS, ".bvh", reader)
    fault, _ = read(written(tmp_path / "a", {"clip.bvh": b""}) / "clip.bvh")
    assert "IndexError" in fault


def test_a_case_is_the_same_whatever_the_count():
    assert list(cases(20, seed=3)) == list(cases(40, seed=3))[:20] != list(cases(20, seed=4))
