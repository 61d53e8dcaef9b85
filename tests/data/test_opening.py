"""What may be opened, and how much it may unfold to."""

from __future__ import annotations

import gzip
import json
import lzma
import os
import random
import socket
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.data import load, untrusted
from mwlib.data.formats import frames
from mwlib.data.load import read_motion_file
from mwlib.data.untrusted import MOST_POINTS, SMALL_FILE, allowed, read_bytes, read_head
from tests.fuzz.seeds import npz, pickled
from tests.sample_motions import AMC, ASF, BENCHMARK, BVH


@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "loop", "broken link", "folder"])
@pytest.mark.parametrize("suffix", [".bvh", ".npz", ".txt.gz", ".npy.xz"])
def test_only_regular_files_are_opened(tmp_path, monkeypatch, kind, suffix):
    file = tmp_path / f"a{suffix}"
    monkeypatch.chdir(tmp_path)  # the name of a socket is short
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as there:
            there.bind(file.name)
    elif kind == "folder":
        file.mkdir()
    else:
        file.symlink_to({"device": "/dev/zero", "loop": file, "broken link": tmp_path / "none"}[kind])
    with pytest.raises(MotionFormatError, match=f"{file.name}, (file|folder): found"):
        read_motion_file(file)
    if kind != "folder":
        with pytest.raises(MotionFormatError, match=f"{file.name}, file: found .*; expected a regular file"):
            load_motions(file)


def test_a_file_that_may_not_be_read_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.bvh").write_text(BVH)

    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(MotionFormatError, match="a.bvh, file: found Permission denied; expected a regular file"):
        load_motions(tmp_path / "a.bvh")


def test_what_a_file_may_unfold_to_grows_with_its_size(tmp_path):
    file = tmp_path / "a"
    assert allowed(MOST_POINTS, file) == MOST_POINTS
    with file.open("wb") as stream:
        stream.truncate(3 * SMALL_FILE)
    assert allowed(MOST_POINTS, file) == 3 * MOST_POINTS


@pytest.mark.parametrize(("suffix", "pack"), [(".xz", lzma.compress), (".gz", gzip.compress)])
def test_packing_is_taken_apart_piece_by_piece(tmp_path, suffix, pack):
    file = tmp_path / f"a{suffix}"
    content = random.Random(0).randbytes(300_000) + bytes(300_000)
    for parts, zeros in (((content,), 0), ((content[:70_000], content[70_000:]), 4), ((b"", content, b""), 0)):
        file.write_bytes(bytes(zeros).join(map(pack, parts)))
        assert read_bytes(file, 10**6) == content and read_head(file, 100_000) == content[:100_000]
    file.write_bytes(pack(b"x") * 1001)
    with pytest.raises(MotionFormatError, match="packing: found more than 1000 streams"):
        read_bytes(file, 10**6)


MOTION = "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 0 JOINT b { OFFSET 0 0 0 CHANNELS 0 } }\nMOTION\nFrames: 1 Frame Time: 1\n"


@pytest.mark.parametrize(
    ("name", "start", "words"),
    [
        *(("a.bvh", start, "ab ") for start in ("", "HIERARCHY ROOT ", "HIERARCHY ROOT a { ", MOTION)),
        ("a.bvh", MOTION, "0 "), ("a.bvh", MOTION, "\n"), ("a.txt", "", "0,"), ("a.txt", "", "0\n"), ("05_01.amc", "", "ab "),
        ("05_01.amc", "", "#a\n"), ("05_01.amc", "1\n", " \n"), ("05.asf", ":bonedata\n", "a\n"), ("05.asf", "", "#a\n"),
        ("skeleton.json", "", "["), ("skeleton.json", '{"name": "x", "joints": [', '"a",'), ("clips.csv", "", "a\n"),
    ],
)  # fmt: skip
def test_nonsense_is_refused_at_the_cost_of_a_few_copies(tmp_path, monkeypatch, name, start, words):
    monkeypatch.setattr("mwlib.data.untrusted.BLOCK", 20_000)
    np.save(tmp_path / "a.npy", np.zeros((2, 17, 3)))
    (tmp_path / "05.asf").write_text(ASF)
    (tmp_path / "05_01.amc").write_text(AMC)
    text = start + words * 100_000
    (tmp_path / name).write_text(text)
    read = {"05.asf": "05_01.amc", "skeleton.json": "a.npy", "clips.csv": "a.npy"}.get(name, name)
    tracemalloc.start()
    try:
        with pytest.raises(MotionFormatError):
            load_motions(tmp_path / read)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    small = name in ("05.asf", "skeleton.json", "clips.csv")  # of these no more than 4 MB are read
    assert most < (250 if small else 6) * len(text) + 2_000_000


@pytest.mark.parametrize(
    ("shape", "dtype", "message"),
    [
        ((12_000_000, 17, 3), "|i1", "at most 9000000 values in a file of this size"), ((1,) * 65, "<f4", "at most 4 lengths"),
        ((0, 17, 10**30), "<f4", "at most 9000000 values"), ((10**15, 17, 3), "<f8", "at most 9000000 values"),
        *(((4, 17, 3), kind, "numbers or strings") for kind in ("<U0", "|O", "|S0")),
    ],
)  # fmt: skip
def test_an_array_is_refused_by_its_head(tmp_path, shape, dtype, message):
    (tmp_path / "skeleton.json").write_text(json.dumps({"name": "H36M17", "fps": 50, "unit": 1.0}))
    content = pickled(b"", shape, dtype)
    (tmp_path / "a.npy").write_bytes(content)
    (tmp_path / "b.npz").write_bytes(npz(positions=content))
    for name in ("a.npy", "b.npz"):
        with pytest.raises(MotionFormatError, match=message):
            load_motions(tmp_path / name)


def test_an_amc_of_too_many_frames_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("mwlib.data.formats.asf_amc.MOST_POINTS", 4)
    (tmp_path / "05.asf").write_text(ASF)
    (tmp_path / "05_01.amc").write_text(AMC)
    with pytest.raises(MotionFormatError, match="frames: found more than 1 frames; expected at most that for 4 bones"):
        load_motions(tmp_path / "05_01.amc")


def test_a_table_has_so_many_numbers_and_no_endless_line(tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text(BENCHMARK)
    monkeypatch.setattr("mwlib.data.untrusted.MOST_VALUES", 200)
    with pytest.raises(MotionFormatError, match="table: found more than 200 numbers"):
        load_motions(tmp_path / "a.txt")
    (tmp_path / "a.txt").write_text("0," * 10**6)
    with pytest.raises(MotionFormatError, match="more than 1048576 characters without a break"):
        load_motions(tmp_path / "a.txt")


def many_frames(kind: str, folder: Path) -> Path:
    """A file of 70 frames in which everything turns."""
    rng = np.random.default_rng(0)
    turns = (np.cumsum(rng.normal(scale=60, size=(70, 20)), axis=0) + 180) % 360 - 180  # quaternions change sign where these wrap
    if kind == "bvh":
        rows = "\n".join(" ".join(f"{v:.3f}" for v in row) for row in turns)
        text = BVH.split("Frames")[0] + f"Frames: 70\nFrame Time: 0.01\n{rows}\n"
    elif kind == "amc":
        (folder / "05.asf").write_text(ASF)
        angles = turns[:, :12].round(2).astype(str)
        names = [("root", 0, 6), ("lleg", 6, 9), ("rleg", 9, 11), ("larm", 11, 12)]
        frames = ("\n".join(f"{name} {' '.join(row[a:b])}" for name, a, b in names) for row in angles)
        lines = [f"{number}\n{frame}" for number, frame in enumerate(frames)]
        text = "\n".join(lines)
    else:
        text = "\n".join(",".join(map(str, row)) for row in rng.normal(size=(70, 117)))
    (folder / f"05_01.{kind}").write_text(text)
    return folder / f"05_01.{kind}"


@pytest.mark.parametrize("kind", ["bvh", "amc", "txt"])
def test_blocks_of_frames_change_not_a_bit(tmp_path, monkeypatch, kind):
    file = many_frames(kind, tmp_path)
    (whole,) = load_motions(file, unit="cm")
    monkeypatch.setattr(frames, "POINTS_AT_ONCE", 1)
    monkeypatch.setattr("mwlib.data.untrusted.BLOCK", 5000 if kind == "txt" else 500)
    for fewest in (1, 7, 69):
        monkeypatch.setattr(frames, "FEWEST_FRAMES", fewest)
        (again,) = load_motions(file, unit="cm")
        np.testing.assert_array_equal(again.positions, whole.positions)
        if whole.rig is not None:
            for name in ("rotations", "root", "offsets", "moves"):
                np.testing.assert_array_equal(getattr(again.rig, name), getattr(whole.rig, name), err_msg=name)
    assert len(whole) == 70


def test_what_a_reader_raises_names_the_file_and_faults_are_seen(tmp_path, monkeypatch):
    (tmp_path / "a.bvh").write_text(BVH)
    bad_files = (
        IndexError("beyond"),
        OverflowError("large"),
        RecursionError("deep"),
        MemoryError(),
        OSError(5, "disk"),
        KeyError(),
    )
    for error in (*bad_files, TypeError(), AttributeError(), AssertionError(), NameError()):

        def reader(file, known, error=error):
            raise error

        monkeypatch.setitem(load.READERS, ".bvh", reader)
        with pytest.raises(MotionFormatError if error in bad_files else type(error)) as caught:
            load_motions(tmp_path / "a.bvh")
        if error in bad_files:
            assert caught.match(f"a.bvh, content: found {type(error).__name__}") and caught.value.__cause__ is error


def test_memory_of_an_xz_dictionary_is_bounded():
    assert untrusted.UNPACK_MEMORY < 2**28
