"""Small whole files of every reader, by name and with what lies beside them."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Iterator

import numpy as np

from tests.data.formats import sample_smpl
from tests.sample_motions import AMC, ASF, BENCHMARK, BVH, python2_pickle

POSITIONS = 0.2 * np.random.default_rng(0).normal(size=(4, 17, 3)).astype(np.float32)  # of human size
LAYOUT = json.dumps({"name": "H36M17", "fps": 50, "unit": 1.0, "up": "y"}).encode()
OWN = json.dumps(
    {"name": "own", "joints": [f"j{i}" for i in range(17)], "parents": list(range(-1, 16)), "left": [1], "right": [2], "fps": 25,
     "parts": {"arm": [1, 2]}, "unit": "cm", "up": "z"}
).encode()  # fmt: skip
CLIPS = b"file,fps,subject,action,frames\nclip.bvh,60,Ann,walk,3\nother.bvh,25,,,\n"


def npy(array: np.ndarray) -> bytes:
    """An array as NumPy saves it."""
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npz(method: int = zipfile.ZIP_DEFLATED, **entries: bytes) -> bytes:
    """An archive of ready .npy streams."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in entries.items():
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), content, method)  # at no time, so that seeds decide all
    return buffer.getvalue()


def pickled(content: bytes, shape: tuple[int, ...] = (), dtype: str = "|O") -> bytes:
    """A pickle behind the header of an object array, or other content behind another header."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": dtype, "fortran_order": False, "shape": shape})
    return buffer.getvalue() + content


def pickles() -> Iterator[tuple[str, bytes]]:
    """Subject -> action -> array, as every protocol and Python 2 write it."""
    tree = {"S1": {"Walking": POSITIONS, "Eating 1": POSITIONS[:2]}, "S9": {"Walking": np.asfortranarray(POSITIONS)}}
    for protocol in range(2, 6):
        yield f"protocol {protocol}", pickle.dumps(np.array(tree, dtype=object), protocol=protocol)
    yield "Python 2", python2_pickle("S1", "Walking", POSITIONS)


def seeds() -> Iterator[tuple[str, str, dict[str, bytes]]]:
    """What is spoilt, the file that is then read, and all files: the last one named is the spoilt one."""
    yield "bvh", "clip.bvh", {"clip.bvh": BVH.encode()}
    yield "clips.csv", "clip.bvh", {"clip.bvh": BVH.encode(), "clips.csv": CLIPS}
    yield "amc", "05_01.amc", {"05.asf": ASF.encode(), "05_01.amc": AMC.encode()}
    yield "asf", "05_01.amc", {"05_01.amc": AMC.encode(), "05.asf": ASF.encode()}
    yield "txt", "walk_1.txt", {"walk_1.txt": BENCHMARK.encode()}
    yield "npy", "a.npy", {"skeleton.json": LAYOUT, "a.npy": npy(POSITIONS)}
    yield "npy int8", "a.npy", {"skeleton.json": LAYOUT, "a.npy": npy((POSITIONS * 45).astype(np.int8))}
    for name, layout in (("layout", LAYOUT), ("skeleton", OWN)):
        yield f"skeleton.json {name}", "a.npy", {"a.npy": npy(POSITIONS), "skeleton.json": layout}
    texts = {"skeleton": "H36M17", "subject": "Ann", "action": "walk", "up": "y", "unit": "m"}
    entries = {"positions": npy(POSITIONS), "fps": npy(np.array(50.0))} | {k: npy(np.array(v)) for k, v in texts.items()}
    for method in (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED):
        yield "npz", "a.npz", {"a.npz": npz(method, **entries)}
    clip, body = (
        {name: npy(array) for name, array in made.items()} for made in (sample_smpl.poses("smpl", 4), sample_smpl.model("smpl"))
    )
    beside = {"a.npz": npz(**clip)}, {"body_models/SMPL_MALE.npz": npz(**body)}
    yield "smpl", "a.npz", beside[1] | beside[0]
    yield "body model", "a.npz", beside[0] | beside[1]
    for name, content in pickles():
        yield f"pickle {name}", "h.npz", {"h.npz": npz(zipfile.ZIP_STORED, positions_3d=pickled(content))}
