"""Files are whole or not there; a tensor file that was changed or cut is refused."""

from __future__ import annotations

import errno
import os
import resource

import pytest
import torch

from mwlib import files
from mwlib.files import sweep, write_atomic, write_together
from mwlib.training.checkpoint import DamagedFileError, load_tensors, save_tensors

TENSORS = {
    "x": torch.arange(6.0).reshape(2, 3), "scalar": torch.tensor(3.0, dtype=torch.float64), "none": torch.zeros(0),
    "half": torch.ones(2, dtype=torch.bfloat16),
}  # fmt: skip
TEXT = {"step": "1", "key": "abc"}


def test_tensors_come_back(tmp_path):
    save_tensors(tmp_path / "a.safetensors", TENSORS, TEXT)
    tensors, text = load_tensors(tmp_path / "a.safetensors")
    assert text == TEXT and tensors.keys() == TENSORS.keys()
    assert all(torch.equal(tensors[k], v) and tensors[k].dtype == v.dtype for k, v in TENSORS.items())


def test_the_same_content_gives_the_same_bytes(tmp_path):
    for name, order in (("a", 1), ("b", -1)):
        save_tensors(tmp_path / name, dict(list(TENSORS.items())[::order]), dict(list(TEXT.items())[::order]))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_every_flipped_or_missing_byte_is_noticed(tmp_path):
    file = tmp_path / "a.safetensors"
    save_tensors(file, TENSORS, TEXT)
    whole = file.read_bytes()
    for place in range(len(whole)):
        for spoilt in (whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :], whole[:place]):
            file.write_bytes(spoilt)
            with pytest.raises(DamagedFileError, match=r"a\.safetensors"):
                load_tensors(file)


def full_disk(monkeypatch, after: int) -> None:
    """Let so many files be written; then the disk is full."""
    left, write = iter(range(after)), files._write

    def fill(file, content):
        if next(left, None) is None:
            file.write_bytes(content[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(file, content)

    monkeypatch.setattr(files, "_write", fill)


@pytest.mark.parametrize("after", [0, 1, 2])
def test_a_full_disk_leaves_the_old_files_and_no_debris(tmp_path, monkeypatch, after):
    names = [tmp_path / name for name in ("a.png", "a.csv", "a.json")]
    write_together(dict.fromkeys(names, "old"))
    full_disk(monkeypatch, after)
    with pytest.raises(OSError, match="No space"):
        write_together(dict.fromkeys(names, "new"))
    assert sorted(tmp_path.iterdir()) == sorted(names) and {name.read_text() for name in names} == {"old"}


def test_a_file_that_the_disk_does_not_take_is_named(tmp_path):
    """In earnest: the kernel lets no file grow beyond a limit."""
    table = tmp_path / "a.csv"
    write_atomic(table, "old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(OSError, match=rf"^\[Errno {errno.EFBIG}\] File too large: '{table}'$"):
            write_atomic(table, "new" * 10_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert table.read_text() == "old" and list(tmp_path.iterdir()) == [table]


def test_the_proof_is_never_beside_files_of_another_time(tmp_path, monkeypatch):
    """Stopped between any two renames: either there is no proof, or all files are of one time."""
    names = [tmp_path / name for name in ("a.png", "a.csv", "a.json")]
    replace = os.replace
    for stop in range(4):
        write_together(dict.fromkeys(names, "old"))
        done = iter(range(stop))

        def rename(source, target, done=done):
            if next(done, None) is None:
                raise KeyboardInterrupt
            replace(source, target)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", rename)
            try:
                write_together(dict.fromkeys(names, "new"))
            except KeyboardInterrupt:
                assert stop < 3
        texts = [name.read_text() for name in names if name.exists()]
        assert not names[-1].exists() or len(set(texts)) == 1, f"stopped after {stop} renames: {texts}"
        assert not list(tmp_path.glob(".*"))


def test_leftovers_of_the_dead_are_swept(tmp_path):
    write_atomic(tmp_path / "kept", "x")
    (tmp_path / ".model.safetensors.4711.part").write_text("half")
    sweep(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
