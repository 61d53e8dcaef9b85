"""Ways to spoil a file: its bytes, its words, what it is packed in, and contents meant to do harm."""

from __future__ import annotations

import gzip
import lzma
import random
import re
import struct
import zipfile
from collections.abc import Callable

import numpy as np

from tests.fuzz.seeds import npy, npz, pickled
from tests.sample_motions import mutate

NUMBERS = b"nan inf -inf 1e308 -1e308 1e12 -1 0 1e-320 999999999999 99999999999999999999999 0x10 1_0 1e7 -9999999".split()


def flip(data: bytes, rng: random.Random) -> bytes:
    """Some bytes changed."""
    content = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        if content:
            content[rng.randrange(len(content))] = rng.randrange(256)
    return bytes(content)


def truncate(data: bytes, rng: random.Random) -> bytes:
    """The end cut off."""
    return data[: rng.randrange(len(data) + 1)]


def insert(data: bytes, rng: random.Random) -> bytes:
    """Random bytes put in."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.choice((1, 4, 100))) + data[at:]


def repeat(data: bytes, rng: random.Random) -> bytes:
    """A block doubled, now and then thousands of times."""
    start = rng.randrange(len(data) + 1)
    stop = min(len(data), start + rng.choice((1, 10, 100, 1000)))
    return data[:stop] + data[start:stop] * rng.choice((1, 1, 10, 1000)) + data[stop:]


def renumber(data: bytes, rng: random.Random) -> bytes:
    """A number made huge, negative or none at all; in binary files, four or eight bytes."""
    places = list(re.finditer(rb"(?<![\w.])-?\d[\d.e-]*", data))
    if places and rng.random() < 0.7:
        place = rng.choice(places)
        return data[: place.start()] + rng.choice(NUMBERS) + data[place.end() :]
    at = rng.randrange(len(data) + 1)
    value = rng.choice((0, 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1, 0x7FF0000000000000, 0x7FF8000000000000))
    new = struct.pack("<Q", value)[: rng.choice((2, 4, 8))]
    return data[:at] + new + data[at + len(new) :]


BYTES: tuple[Callable[[bytes, random.Random], bytes], ...] = (flip, truncate, insert, repeat, renumber, mutate)


def spoil(data: bytes, rng: random.Random) -> bytes:
    """One to three injuries."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        data = rng.choice(BYTES)(data, rng)
    return data


def pack(name: str, data: bytes, rng: random.Random) -> tuple[str, bytes]:
    """The file packed, by one, two or many streams, and the packing perhaps spoilt, too; or as it is."""
    if rng.random() < 0.6:
        return name, data
    suffix, packing = rng.choice(((".xz", lambda d: lzma.compress(d, preset=0)), (".gz", lambda d: gzip.compress(d, mtime=0))))
    cut = rng.randrange(len(data) + 1)
    parts = rng.choice(((data,), (data[:cut], data[cut:]), (packing(data),)))
    packed = b"".join(map(packing, parts))
    packed = packing(b"") * rng.choice((0, 0, 0, 5, 2000)) + packed
    return name + suffix, rng.choice((flip, truncate, insert, repeat))(packed, rng) if rng.random() < 0.4 else packed


def hostile(rng: random.Random) -> tuple[str, dict[str, bytes]]:
    """A file that is meant to hang or exhaust its reader: name and files."""
    kind = rng.choice((_pickle, _header, _archive, _text))
    return kind(rng)


def _pickle(rng: random.Random) -> tuple[str, dict[str, bytes]]:
    """Doubled tuples, colliding keys, vast memo slots, and random instructions."""
    count = rng.choice((10, 60, 1000, 100_000))
    colliding = b"".join(b"\x8a\x0a" + (i * (2**61 - 1)).to_bytes(10, "little") + b"Ns" for i in range(count // 10))
    letters = b"()]}Nabdelqrstu0123\x80\x85\x86\x87\x88\x89\x8c\x93\x94\x95.K"
    content = rng.choice(
        (
            b"\x80\x04})" + b"2\x86" * count + b"K\x01s.",
            b"\x80\x04})" + b"\x85" * count + b"K\x01s.",
            b"\x80\x04}" + colliding + b".",
            b"\x80\x04}r\xff\xff\xff\x7f.",
            b"\x80\x04]\x94" + b"(h\x00h\x00e" * count + b".",
            b"\x80\x04" + b"]\x94" * count + b"a" * count + b".",
            b"\x80\x04\x8b\xff\xff\xff\x7f" + b"\xff" * count + b".",
            b"\x80\x04" + b"}X\x01\x00\x00\x00a" * count + b"s" * count + b".",
            b"\x80\x04\x8c\x05numpy\x8c\x05dtype\x93" + b"(" * count + b"t" * count + b"R.",
            b"\x80\x04" + bytes(rng.choice(letters) for _ in range(count)),
        )
    )
    return "h.npz", {"h.npz": npz(zipfile.ZIP_DEFLATED, positions_3d=pickled(content))}


def _header(rng: random.Random) -> tuple[str, dict[str, bytes]]:
    """Headers of arrays that promise or ask too much."""
    vast = ("(0, 17, 10**30)", f"({'1, ' * 65})", f"(1{'0' * 40}, 17, 3)", f"({'(' * 2000}", "(-4, -17, 3)")
    shape = rng.choice((*vast, "(4, 17, 3)"))
    kind = rng.choice(("<f4", "<U0", "|S0", "|V0", "<U1000000000", "|O", "<f16", "<c16", "<M8[s]", "|i1", "(9,9)<f8"))
    text = f"{{'descr': '{kind}', 'fortran_order': {rng.random() < 0.5}, 'shape': {shape}, }}"
    head = text.encode() + b" " * rng.choice((0, 50, 9000, 50_000)) + b"\n"
    version = rng.choice((b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x07\x09"))
    length = struct.pack("<H" if version == b"\x01\x00" else "<I", rng.choice((len(head), 0, 2**16 - 1)) % 2**16)
    array = b"\x93NUMPY" + version + length + head + bytes(rng.choice((0, 816, 10_000)))
    name = rng.choice(("positions", "positions_3d", "skeleton", "fps", "up", "unit", "subject"))
    others = {"positions": npy(np.zeros((4, 17, 3))), "fps": npy(np.array(50.0)), "skeleton": npy(np.array("H36M17"))}
    return rng.choice((("a.npy", {"a.npy": array}), ("a.npz", {"a.npz": npz(**(others | {name: array}))})))


def _archive(rng: random.Random) -> tuple[str, dict[str, bytes]]:
    """Much in little: zeros packed well, other packings, thousands of entries."""
    vast = npy(np.zeros((rng.choice((10, 100_000, 250_000)), 17, 3), np.int8))
    method = rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    many = {f"e{i}": b"" for i in range(rng.choice((0, 0, 0, 2000)))}
    data = npz(method, **many, positions=vast, fps=npy(np.array(50.0)), skeleton=npy(np.array("H36M17")))
    return "a.npz", {"a.npz": spoil(data, rng) if rng.random() < 0.5 else data}


def _text(rng: random.Random) -> tuple[str, dict[str, bytes]]:
    """Texts of one thing half a million times."""
    name = rng.choice(("a.bvh", "05_01.amc", "a.txt", "skeleton.json", "clips.csv", "05.asf"))
    start = rng.choice((b"", b"HIERARCHY ROOT ", b"1\nroot ", b":bonedata\n", b"file,fps\n", b"[", b'{"name": "x", "joints": ['))
    data = start + rng.choice((b"a ", b"0 ", b"\n", b" ", b"#a\n", b":a\n", b"[", b"0,", b'"a",', b"a b c d\n")) * 500_000
    read = {"skeleton.json": "b.npy", "clips.csv": "b.npy", "05.asf": "05_01.amc"}.get(name, name)
    files = {"b.npy": npy(np.zeros((4, 17, 3))), "05.asf": b":bonedata\n", "05_01.amc": b"1\n"} | {name: data}
    if read == name:
        return f"{name}.xz", {"05.asf": b":bonedata\n", f"{name}.xz": lzma.compress(data, preset=0)}
    return read, files
