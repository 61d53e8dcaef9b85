"""A downloaded pickle yields arrays or an error; it never runs code and never exhausts the machine."""

from __future__ import annotations

import os
import pickle
import random
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.data.formats.pickles import unpickle, unpickle_words
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


HEAD = b"\x80\x04"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (HEAD + b"})" + b"2\x86" * 60 + b"K\x01s.", "an instruction DUP"),
        (HEAD + b"})" + b"\x85" * 30_000 + b"K\x01s.", "more than 20000 instructions"),
        (HEAD + b"})" + b"\x85" * 10_000 + b"K\x01s.", "a key that is no text"),
        (
            HEAD + b"}" + b"".join(b"\x8a\x0a" + (i * (2**61 - 1)).to_bytes(10, "little") + b"Ns" for i in range(60)) + b".",
            "no text",
        ),
        (HEAD + b")\x94h\x00.", "tuple twice"),
        (HEAD + b"}\x94h\x00.", "dict twice"),
        (HEAD + b"]\x94h\x00.", "list twice"),
        (HEAD + b"]NaNa.", "list among"),
        (HEAD + b"(" + b"N" * 10 + b"t.", "tuple among the dictionaries"),
        (HEAD + b"\x8b\x01\x00\x00\x00\x01.", "an instruction LONG4"),
        (HEAD + b"\x82\x01.", "an instruction EXT1"),
        (HEAD + b"cnumpy\ndtype\n}b.", "the state of something that has none"),
        (HEAD + b"cnumpy\ndtype\n)\x81.", "an instruction NEWOBJ"),
        (HEAD + b"N.", "NoneType among the dictionaries"),
        (HEAD + b"}(N.", "a pickle of"),
        (HEAD + b"1.", "an instruction POP_MARK"),
        (b"", "a pickle of"),
        (b".", "a pickle of"),
    ],
)
def test_instructions_that_arrays_do_not_need_are_refused(monkeypatch, content, message):
    monkeypatch.setattr("mwlib.data.formats.pickles.MOST_STEPS", 20_000)
    with pytest.raises(MotionFormatError, match=message):
        tree_of(content)


@pytest.mark.parametrize("protocol", range(2, 6))
def test_lists_and_numbers_of_words_are_read(protocol):
    words = [f"word{number}" for number in range(3000)]
    rows = {word: 40 * number for number, word in enumerate(words)}
    for tree in (words, rows, [], ["one"]):
        assert unpickle_words(pickle.dumps(tree, protocol=protocol), Path("words.pkl")) == tree


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ([1], "list with something else"), (["a", 1], "list among"), (["a", ["b"]], "list among"), ([["a"]], "list with"),
        ({"a": True}, "dict with"), ({"a": {}}, "dict with"), ({1: 1}, "a key that is no text"), ("a", "str with"),
        (np.arange(3), "Array with"), ([Call(exec, "1")], "the name builtins.exec"),
    ],
)  # fmt: skip
def test_pickles_of_other_things_are_no_words(tree, message):
    with pytest.raises(MotionFormatError, match=f"words.pkl, pickle: found .*{message}.*; expected a pickle of a list of words"):
        unpickle_words(pickle.dumps(tree), Path("words.pkl"))


def test_a_far_memo_slot_costs_nothing():
    assert tree_of(HEAD + b"}r\xff\xff\xff\x7f.") == {}


def test_arrays_have_at_most_four_dimensions_and_as_many_numbers_as_the_file_may_hold(monkeypatch):
    for protocol in (2, 4, 5):
        pickled = pickle.dumps(np.array({"a": np.zeros((1,) * 5)}, dtype=object), protocol=protocol)
        with pytest.raises(MotionFormatError, match="an array without a plain shape"):
            tree_of(pickled)
        two = pickle.dumps(np.array({"a": ARRAY, "b": ARRAY + 1}, dtype=object), protocol=protocol)
        monkeypatch.setattr("mwlib.data.formats.pickles.MOST_VALUES", 2 * ARRAY.size)
        assert set(tree_of(two)) == {"a", "b"}
        monkeypatch.setattr("mwlib.data.formats.pickles.MOST_VALUES", 2 * ARRAY.size - 1)
        with pytest.raises(MotionFormatError, match="more numbers than a file of this size may hold"):
            tree_of(two)
    size = pickle.dumps(np.array({"a": np.zeros(3)}, dtype=object), protocol=2).replace(b"K\x03\x85", b"J\xff\xff\xff\x7f\x85")
    with pytest.raises(MotionFormatError, match="do not fill shape"):
        tree_of(size)


def test_no_injury_gets_past_the_reader():
    """Behind the checksums of an archive, which `tests.fuzz` spoils."""
    rng, outcomes, whole = random.Random(3), set(), pickle.dumps(np.array(TREE, dtype=object), protocol=2)
    for _ in range(700):
        try:
            tree_of(mutate(whole, rng))
        except MotionFormatError:
            outcomes.add("refused")
        else:
            outcomes.add("read")
    assert outcomes == {"refused", "read"}
