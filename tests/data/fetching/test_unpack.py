"""Zips that want out of their folder, or more than there is."""

from __future__ import annotations

import errno
import re
import stat
import zipfile
from pathlib import Path

import pytest

from mwlib import MotionFormatError
from mwlib.data.fetching import unpack as module
from mwlib.data.fetching.unpack import unpack

BVH = re.compile(r"\w+\.bvh")


def zipped(file: Path, *entries: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return file


def take(archive: Path, *, most: int = 1000, together: int = 3000) -> list[Path]:
    return unpack(archive, archive.parent / "out", BVH, most=most, together=together)


def special(name: str, mode: int) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)
    entry.external_attr = mode << 16
    return entry


def test_wanted_files_come_out_of_whatever_folder(tmp_path):
    archive = zipped(
        tmp_path / "a.zip", ("b.bvh", b"2"), ("in/side/a.bvh", b"1" * 1000), ("in/", b""), ("notes.txt", b"no"),
        ("c.bvh.exe", b"no"), ("__MACOSX/in/side/a.bvh", b"fork"), ("._b.bvh", b"fork"),
    )  # fmt: skip
    found = take(archive)
    assert [(file.name, len(file.read_bytes())) for file in found] == [("a.bvh", 1000), ("b.bvh", 1)]
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"a.bvh", "b.bvh"}


@pytest.mark.parametrize(
    "name, content, message",
    [
        ("../a.bvh", b"", "a path that leaves its folder"),
        ("in/../../notes.txt", b"", "a path that leaves its folder"),
        ("/etc/a.bvh", b"", "a path that leaves its folder"),
        ("..\\a.bvh", b"", "a path that leaves its folder"),
        ("C:a.bvh", b"", "a path that leaves its folder"),
        (special("a.bvh", stat.S_IFLNK | 0o777), b"/etc/passwd", "a.bvh: found a link or another special file"),
        (special("notes", stat.S_IFLNK | 0o777), b"/etc", "notes: found a link or another special file"),
        (special("a.bvh", stat.S_IFIFO), b"", "a link or another special file"),
        ("other/good.bvh", b"again", "good.bvh: found a second file of this name"),
        ("other/GOOD.bvh", b"again", "GOOD.bvh: found a second file of this name"),
        ("big.bvh", bytes(1001), "big.bvh: found more than 1000 bytes; expected at most that"),
    ],
)
def test_an_entry_that_means_harm_is_refused(tmp_path, name, content, message):
    archive = zipped(tmp_path / "a.zip", ("good.bvh", b"good"), (name, content))
    with pytest.raises(MotionFormatError, match=re.escape(message)):
        take(archive)
    assert not (tmp_path / "a.bvh").exists()
    assert (tmp_path / "out").exists() == (name == "big.bvh"), "nothing is written before the list was found good"


def test_a_name_with_an_end_in_its_middle_is_refused(tmp_path):
    archive = zipped(tmp_path / "a.zip", ("a.bvh-.txt", b""))
    archive.write_bytes(archive.read_bytes().replace(b"a.bvh-.txt", b"a.bvh\0.txt"))
    with pytest.raises(MotionFormatError):
        take(archive)
    assert not (tmp_path / "out").exists()


def test_all_together_have_a_limit(tmp_path):
    archive = zipped(tmp_path / "a.zip", *((f"c{n}.bvh", bytes(1000)) for n in range(4)))
    with pytest.raises(MotionFormatError, match="c3.bvh: found more than 0 bytes"):
        take(archive)


def test_an_entry_larger_than_it_says_is_refused(tmp_path):
    """What counts is what comes out, not the list of contents."""
    archive = zipped(tmp_path / "a.zip", ("bomb.bvh", bytes(10**7)))
    data = archive.read_bytes()
    archive.write_bytes(data.replace((10**7).to_bytes(4, "little"), (10).to_bytes(4, "little")))
    with pytest.raises(MotionFormatError):
        take(archive)
    assert all(file.stat().st_size <= 1000 for file in (tmp_path / "out").iterdir())


def test_too_many_entries_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_ENTRIES", 3)
    with pytest.raises(MotionFormatError, match="found 4 entries; expected at most 3"):
        take(zipped(tmp_path / "a.zip", *((f"{n}.txt", b"") for n in range(4))))


def test_other_packing_and_encryption_are_refused(tmp_path):
    with pytest.raises(MotionFormatError, match="encryption or another packing"):
        take(zipped(tmp_path / "a.zip", ("a.bvh", b"a"), method=zipfile.ZIP_LZMA))
    archive = zipped(tmp_path / "b.zip", ("a.bvh", b"a"))
    data = bytearray(archive.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    archive.write_bytes(data)
    with pytest.raises(MotionFormatError, match="encryption or another packing"):
        take(archive)


def test_a_full_disk_is_no_broken_zip(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module, "_write", full)
    with pytest.raises(OSError, match="No space left"):
        take(zipped(tmp_path / "a.zip", ("a.bvh", b"a")))


def test_broken_zips_are_refused(tmp_path):
    """Cut anywhere, or with any byte changed, it is refused or gives what it gave."""
    archive = zipped(tmp_path / "a.zip", ("a.bvh", bytes(range(200))), ("in/b.bvh", b"b" * 300))
    whole = archive.read_bytes()
    broken = [whole[:end] for end in range(0, len(whole), 17)]
    broken += [whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :] for at in range(0, len(whole), 3)]
    refused = 0
    for data in broken:
        archive.write_bytes(data)
        try:
            found = {file.name: file.read_bytes() for file in take(archive)}
        except MotionFormatError:
            refused += 1
        else:
            assert all(content in (bytes(range(200)), b"b" * 300) for content in found.values())
    assert refused > len(broken) // 2
