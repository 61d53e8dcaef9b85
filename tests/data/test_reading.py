"""Packed, oversized and undecodable files; tables; plain arrays."""

from __future__ import annotations

import gzip
import io
import lzma
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.data import untrusted as files
from mwlib.data.untrusted import number_table, read_array, read_bytes
from tests.fuzz.seeds import npy
from tests.sample_motions import BVH

FILE = Path("file")


@pytest.mark.parametrize(("suffix", "pack"), [(".xz", lzma.compress), (".gz", gzip.compress), ("", bytes)])
def test_packed_files_are_read_as_they_are(tmp_path, suffix, pack):
    (tmp_path / f"clip.BVH{suffix}").write_bytes(pack(BVH.encode()))
    (tmp_path / "plain.bvh").write_text(BVH)
    motion, plain = load_motions(tmp_path)
    np.testing.assert_array_equal(motion.positions, plain.positions)
    assert motion.name == "clip"


@pytest.mark.parametrize(("suffix", "pack"), [(".xz", lzma.compress), (".gz", gzip.compress)])
def test_broken_and_bursting_packing_is_refused(tmp_path, suffix, pack):
    file = tmp_path / f"clip.bvh{suffix}"
    packed = pack(bytes(2_000_000))
    for spoilt in (packed[:-20], packed[: len(packed) // 2], b"no packing", packed[:30] + b"\xff" * 20 + packed[50:]):
        file.write_bytes(spoilt)
        with pytest.raises(MotionFormatError, match="packing"):
            read_bytes(file, 10**8)
    file.write_bytes(packed)
    with pytest.raises(MotionFormatError, match="more than 1000000 bytes"):
        read_bytes(file, 10**6)


def test_a_dictionary_larger_than_memory_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "UNPACK_MEMORY", 2**20)
    (tmp_path / "a.xz").write_bytes(lzma.compress(b"x", preset=9))
    with pytest.raises(MotionFormatError, match="packing"):
        read_bytes(tmp_path / "a.xz", 100)


def test_text_is_utf_8(tmp_path):
    (tmp_path / "a.bvh").write_bytes(BVH.replace("Chest", "Brust\xe4").encode("latin1"))
    with pytest.raises(MotionFormatError, match="found 0xe4; expected UTF-8"):
        load_motions(tmp_path / "a.bvh")


@pytest.mark.parametrize(
    "text", ["", "1 2\n", "1 2 3\n4 5\n", "1 2 x\n", "1 2 1_0\n", "1 2 inf\n", "1 2 1e8\n", "1 2 3 # no comment\n"]
)
def test_a_table_holds_lines_of_so_many_finite_numbers(text):
    with pytest.raises(MotionFormatError, match="file, here"):
        number_table(text, 3, FILE, "here")


def test_arrays_are_read_and_nothing_else():
    for array in (np.arange(6.0).reshape(2, 3), np.arange(6).reshape(3, 2).T, np.array("text"), np.zeros((0, 3))):
        found = read_array(io.BytesIO(npy(array)), FILE, "here")
        np.testing.assert_array_equal(found, array)
    good = npy(np.arange(6.0))
    python2 = good.replace(b"(6,) ", b"(6L,)")
    np.testing.assert_array_equal(read_array(io.BytesIO(python2), FILE, "here"), np.arange(6.0))
    vast = good.replace(b"(6,)", b"(6" + b"0" * 17 + b",)").replace(b" " * 17, b"", 1)
    for data in (b"", b"\x93NUMPY", good[:-1], good + b"x", vast, npy(np.array({}, dtype=object)), npy(np.zeros(2, "f4,i4"))):
        with pytest.raises(MotionFormatError, match="file, here"):
            read_array(io.BytesIO(data), FILE, "here")
