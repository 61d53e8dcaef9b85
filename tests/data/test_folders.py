"""Folders with files that are broken, do not belong, or are there twice."""

from __future__ import annotations

import gzip
import lzma
import os
import warnings
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.data import BrokenFilesWarning, untrusted
from mwlib.data.check import check_data
from mwlib.data.load import motion_files
from tests.sample_motions import BENCHMARK, BVH


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "good.bvh").write_text(BVH)
    return tmp_path


def names(folder: Path) -> list[str]:
    """What a folder gives without any warning."""
    with warnings.catch_warnings(action="error"):
        return [motion.name for motion in load_motions(folder)]


def test_broken_files_are_left_out_with_one_warning_that_says_why(folder):
    for number in range(14):
        (folder / f"bad{number:02}.bvh").write_text(BVH[:-40])
    os.mkfifo(folder / "wait.bvh")
    with pytest.warns(BrokenFilesWarning) as caught:
        (motion,) = load_motions(folder)
    (warning,) = caught
    text = str(warning.message)
    assert motion.name == "good" and warning.filename == __file__
    assert text.startswith(f"15 of 16 files in {folder} cannot be read and are left out (strict=True refuses them):\n")
    assert text.count("bad") == 12 and "bad11.bvh, MOTION: found" in text and text.endswith("and 3 more")
    with pytest.raises(MotionFormatError, match="bad00.bvh, MOTION"):
        load_motions(folder, strict=True)
    with pytest.raises(MotionFormatError, match="bad00.bvh, MOTION"):
        load_motions(folder / "bad00.bvh")


def test_a_folder_of_nothing_but_broken_files_is_refused_with_the_reasons(folder):
    (folder / "good.bvh").write_text("nothing")
    with pytest.raises(MotionFormatError, match="good.bvh, end of HIERARCHY"):
        load_motions(folder)
    (folder / "other.bvh").write_text("nothing")
    with pytest.raises(MotionFormatError, match="(?s)no file that can be read:.*good.bvh, .*other.bvh, ") as caught:
        load_motions(folder)
    report, is_whole, _ = check_data(folder)
    assert not is_whole and "2 files cannot be read" in report and "other.bvh" in report and "good.bvh" in str(caught.value)


def test_files_that_do_not_belong_are_passed_over_even_broken(folder):
    np.savez(folder / "other.npz", poses=np.zeros(3))
    whole = (folder / "other.npz").read_bytes()
    for name, content in {
        "half.npz": whole[:100], "empty.npz": b"", "notes.txt.gz": b"no packing", "words.txt.gz": gzip.compress(b"a " * 10**6),
        "cut.txt.xz": lzma.compress(b"1,2,3\n" * 1000)[:50], "noise.npy": b"\x93NUMPY\x01\x00\xff\xff",
        "x.npz.gz": gzip.compress(whole),
    }.items():  # fmt: skip
        (folder / name).write_bytes(content)
    os.mkfifo(folder / "wait.txt")
    (folder / "loop.npz").symlink_to(folder / "loop.npz")
    assert names(folder) == ["good"]
    assert check_data(folder)[1]


def test_hidden_files_are_nobodys_motions(folder):
    there = names(folder)
    (folder / ".hidden.bvh").write_text(BVH)
    assert names(folder) == there


def test_a_motion_that_is_cut_off_is_reported(folder):
    positions = np.random.default_rng(0).normal(size=(50, 17, 3)).astype(np.float32)
    np.savez(folder / "own.npz", positions=positions, skeleton="H36M17", fps=50)
    np.save(folder / "own.npy", positions)
    (folder / "clip.txt").write_text(BENCHMARK)
    for name, length in (("own.npz", 3000), ("own.npy", 3000), ("clip.txt", 700)):
        (folder / name).write_bytes((folder / name).read_bytes()[:length])
    with pytest.warns(BrokenFilesWarning, match="(?s)3 of 4 files.*clip.txt, table.*own.npy, array.*own.npz, archive"):
        load_motions(folder)
    report, is_whole, _ = check_data(folder)
    assert not is_whole and "3 files cannot be read" in report


def test_of_a_plain_and_a_packed_file_of_one_name_the_plain_one_is_taken(folder):
    for name in ("good.bvh.xz", "other.bvh.xz"):
        (folder / name).write_bytes(lzma.compress(BVH.replace("1 90 2", "1 95 2").encode()))
    (folder / "other.bvh.gz").write_bytes(gzip.compress(BVH.encode()))
    assert [file.name for file in motion_files(folder)] == ["good.bvh", "other.bvh.gz"]
    assert names(folder) == ["good", "other"]
    assert load_motions(folder)[0].positions[0, 0, 1] == pytest.approx(0.9)


def test_looking_for_motions_reads_heads_only(folder, monkeypatch):
    rng = np.random.default_rng(0)
    np.save(folder / "long.npy", rng.normal(size=(20_000, 17, 3)))
    np.savez(folder / "long.npz", positions=rng.normal(size=(20_000, 17, 3)))
    (folder / "long.txt").write_text("\n".join([BENCHMARK] * 3000))
    (folder / "long.txt.gz").write_bytes((folder / "long.txt").read_bytes())
    seen = 0
    open_plainly = Path.open

    class Counting:
        def __init__(self, stream):
            self.stream, self.seek, self.tell, self.seekable = stream, stream.seek, stream.tell, stream.seekable

        def read(self, size=-1):
            nonlocal seen
            data = self.stream.read(size)
            seen += len(data)
            return data

        def __enter__(self):
            return self

        def __exit__(self, *error):
            self.stream.close()

    monkeypatch.setattr(untrusted.Path, "open", lambda path, mode: Counting(open_plainly(path, mode)))
    assert [file.name for file in motion_files(folder)] == ["good.bvh", "long.npy", "long.npz", "long.txt"]
    assert seen < 4 * 2**16 + 10_000


def test_a_folder_that_cannot_be_listed_is_reported(folder, monkeypatch):
    walk = os.walk

    def refuse(path, onerror):
        onerror(PermissionError(13, "Permission denied", str(folder / "closed")))
        return walk(path)

    (folder / "closed").mkdir()
    monkeypatch.setattr(os, "walk", refuse)
    with pytest.warns(BrokenFilesWarning, match="closed, folder: found no list of its files"):
        assert [motion.name for motion in load_motions(folder)] == ["good"]


def test_check_data_reports_a_folder_without_motions_and_a_table_without_numbers(folder):
    (folder / "clips.csv").write_text("file,frames\ngood.bvh,many\n")
    report, is_whole, _ = check_data(folder)
    assert is_whole and "good has 3, clips.csv says 'many'" in report
    (folder / "good.bvh").unlink()
    report, is_whole, _ = check_data(folder)
    assert not is_whole and "1 files without motions; expected at least one" in report


def test_a_table_of_clips_has_bounds(folder, monkeypatch):
    monkeypatch.setattr("mwlib.data.meaning.MOST_ROWS", 1000)
    (folder / "clips.csv").write_text("file," + "," * 10_000 + "\n" + "good.bvh\n" * 100)
    with pytest.raises(MotionFormatError, match="clips.csv, header: found 10002 columns; expected at most 100"):
        load_motions(folder)
    (folder / "clips.csv").write_text("file\n" + "a\n" * 1001)
    with pytest.raises(MotionFormatError, match="clips.csv, table: found more than 1000 rows"):
        load_motions(folder)
