"""A downloaded pickle yields arrays or an error; it never runs code and never exhausts the machine."""

from __future__ import annotations

import io
import os
import pickle
import random
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.data.formats.pickles import unpickle
from tests.sample_motions import mutate, python2_pickle, write_positions_3d

ARRAY = np.arange(4 * 17 * 3, dtype=np.float32).reshape(4, 17, 3)
TREE = {"S1": {"Walking": ARRAY}}


def tree_of(data: bytes):
    return unpickle(data, Path("file.npz"), "positions_3d")


@pytest.mark.parametrize("protocol", range(2, 6))
def test_every_protocol_that_numpy_writes_is_read(protocol):
    found = tree_of(pickle.dumps(np.array(TREE, dtype=object), protocol=protocol))
    np.testing.assert_array_equal(found["S1"]["Walking"], ARRAY)


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8", "<f2", "<i4", "|u1", "|b1"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_every_kind_of_number_keeps_its_values(kind, order):
    array = np.asarray(np.arange(24).reshape(2, 3, 4) % 2, dtype=kind, order=order)
    found = tree_of(pickle.dumps(np.array({"a": array}, dtype=object), protocol=4))["a"]
    np.testing.assert_array_equal(found, array)
    assert found.dtype == array.dtype


def test_old_and_new_module_names_and_python_2_are_read(tmp_path):
    data = pickle.dumps(np.array(TREE, dtype=object), protocol=2)
    modules = (b"cnumpy._core.multiarray\n", b"cnumpy.core.multiarray\n")
    for module in modules:
        renamed = data.replace(modules[0], module).replace(modules[1], module)
        np.testing.assert_array_equal(tree_of(renamed)["S1"]["Walking"], ARRAY)
    np.testing.assert_array_equal(tree_of(python2_pickle("S1", "Walking", ARRAY))["S1"]["Walking"], ARRAY)


class Call:
    """Pickles as a call of any function."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("hide", [lambda call: call, lambda call: {"S1": call}, lambda call: {"S1": {"Walking": call}}])
def test_code_in_a_file_does_not_run(tmp_path, hide):
    trace = tmp_path / "trace"
    for call in (Call(os.system, f"touch {trace}"), Call(exec, f"open({str(trace)!r}, 'w')"), Call(Path.touch, trace)):
        file = write_positions_3d(tmp_path / "h.npz", hide(call))
        with pytest.raises(MotionFormatError, match="h.npz, positions_3d: found the name .*; expected a pickle of dictionaries"):
            load_motions(file)
        assert not trace.exists()
    with np.load(file, allow_pickle=True) as archive:  # the file does bite whoever trusts it
        archive["positions_3d"]
    assert trace.exists()


@pytest.mark.parametrize(
    "call",
    [
        Call(np.ndarray, (10**12,), "f8"),
        Call(np.dtype, "V1000000000"),
        Call(np._core.multiarray._reconstruct, np.ndarray, (10**12,), b"b"),
        Call(__import__("_codecs").encode, "x" * 100, "zlib"),
        Call(np.load, "other.npy"),
        Call(eval, "1"),
        Call(getattr, "x", "upper"),
    ],
)
def test_permitted_names_cannot_be_put_to_other_uses(call):
    with pytest.raises(MotionFormatError):
        tree_of(pickle.dumps({"S1": call}, protocol=4))


def test_hungry_pickles_are_refused():
    deep = pickle.PROTO + b"\x04" + b"}" + b")" + b"\x85" * 1_000_000 + b"K\x01s."  # a million tuples in each other, as a key
    extension = pickle.PROTO + b"\x04" + b"\x82\x01."
    state = pickle.PROTO + b"\x04" + b"cnumpy\ndtype\n}b."  # set attributes of a function
    size = pickle.dumps(np.array({"a": np.zeros(3)}, dtype=object), protocol=2).replace(b"K\x03\x85", b"J\xff\xff\xff\x7f\x85")
    for data in (deep, extension, state, size, b"", b".", b"\x80\x04N."):
        with pytest.raises(MotionFormatError):
            tree_of(data)


def test_no_injury_gets_past_the_reader(tmp_path):
    rng = random.Random(3)
    buffer = io.BytesIO()
    np.savez(buffer, positions_3d=np.array(TREE, dtype=object))
    files = {"archive": buffer.getvalue(), "pickle": pickle.dumps(np.array(TREE, dtype=object), protocol=2)}
    outcomes = set()
    for kind in [*["archive"] * 300, *["pickle"] * 700]:
        data = mutate(files[kind], rng)
        try:
            if kind == "pickle":
                tree_of(data)
            else:
                (tmp_path / "h.npz").write_bytes(data)
                assert np.isfinite(load_motions(tmp_path / "h.npz", unit="m", up="z")[0].positions).all()
        except MotionFormatError:
            outcomes.add((kind, "refused"))
        else:
            outcomes.add((kind, "read"))
    assert len(outcomes) == 4
