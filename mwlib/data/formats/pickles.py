"""Nested dictionaries of arrays out of a pickle, and nothing else: no code of the file's choosing runs."""

from __future__ import annotations

import io
import math
import pickle
import pickletools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mwlib.data.errors import MotionFormatError

EXPECTED = "a pickle of dictionaries and NumPy arrays of numbers"
MOST_MEMO = 1_000_000  # memo slots; pickle allocates the highest one named
MOST_TUPLES = 20_000  # a few per array; hashing very deeply nested ones would overflow the stack
FORBIDDEN = {"EXT1", "EXT2", "EXT4", "PERSID", "BINPERSID", "INST", "OBJ", "NEWOBJ", "NEWOBJ_EX"}
NUMBER = re.compile(r"(f[248]|[iu][1248]|b1)")


class _Call:
    """One permitted name of a pickle; it can be called and nothing else."""

    __slots__ = ("make",)

    def __init__(self, make: Callable[..., object]) -> None:
        self.make = make

    def __call__(self, *args: object) -> object:
        return self.make(*args)

    def __setstate__(self, state: object) -> None:
        raise pickle.UnpicklingError("it sets the state of a function")


class _Dtype:
    """Stands for numpy.dtype until its byte order is known."""

    def __init__(self, code: str, *flags: object) -> None:
        if not isinstance(code, str) or not (NUMBER.fullmatch(code) or code in ("O", "O8")):
            raise pickle.UnpicklingError(f"dtype {str(code)[:20]!r}")
        self.code, self.order = code, "|"

    def __setstate__(self, state: tuple) -> None:
        if state[1] not in ("<", ">", "|", "="):
            raise pickle.UnpicklingError(f"byte order {str(state[1])[:20]!r}")
        self.order = state[1]


class _Array:
    """Stands for numpy.ndarray until shape, dtype and data are known."""

    def __setstate__(self, state: tuple) -> None:
        _, shape, dtype, fortran, data = state
        if not isinstance(dtype, _Dtype) or not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
            raise pickle.UnpicklingError("an array without a plain shape and dtype")
        if dtype.code.startswith("O"):
            if shape != () or not isinstance(data, list) or len(data) != 1:
                raise pickle.UnpicklingError(f"an object array of shape {shape}")
            self.value = data[0]
            return
        kind = np.dtype(dtype.order + dtype.code)
        raw = data.encode("latin1") if isinstance(data, str) else data  # Python 2 wrote text
        if not isinstance(raw, bytes) or len(raw) != math.prod(shape) * kind.itemsize:
            raise pickle.UnpicklingError(f"an array whose data do not fill shape {shape}")
        self.value = np.frombuffer(raw, kind).reshape(shape, order="F" if fortran else "C")


class _Unpickler(pickle.Unpickler):
    """Knows the names with which NumPy pickles an array, under their old and new modules."""

    def find_class(self, module: str, name: str) -> object:
        if module in ("numpy.core.multiarray", "numpy._core.multiarray") and name == "_reconstruct":
            return _Call(lambda kind, shape, code: _Array())
        if (module, name) == ("numpy", "ndarray"):
            return _Call(_refuse)  # only ever an argument of _reconstruct
        if (module, name) == ("numpy", "dtype"):
            return _Call(_Dtype)
        if (module, name) == ("_codecs", "encode"):
            return _Call(_latin1)
        raise pickle.UnpicklingError(f"the name {module[:60]}.{name[:60]}")


def unpickle(data: bytes, file: Path, place: str) -> object:
    """What a pickled dictionary of dictionaries of arrays holds; arrays are read-only.

    Raises:
        MotionFormatError: anything else is in it, and nothing of it has run.
    """
    try:
        _inspect(data)
        tree = _Unpickler(io.BytesIO(data), encoding="latin1").load()
        return _plain(tree, depth=3)
    except Exception as error:  # a hostile pickle can provoke nearly any
        raise MotionFormatError(file, place, str(error)[:200] or type(error).__name__, EXPECTED) from error


def _inspect(data: bytes) -> None:
    """Refuse instructions that arrays do not need, and those that would exhaust memory or stack."""
    tuples = 0
    for opcode, argument, _ in pickletools.genops(data):
        tuples += "TUPLE" in opcode.name
        is_far = opcode.name.endswith("PUT") and (argument is None or int(argument) > MOST_MEMO)
        if opcode.name in FORBIDDEN or is_far or tuples > MOST_TUPLES:
            raise pickle.UnpicklingError(f"an instruction {opcode.name}, or too many of them")


def _plain(tree: object, depth: int) -> object:
    """Stand-ins replaced by what they stand for."""
    if isinstance(tree, _Array):
        tree = tree.value
    if isinstance(tree, np.ndarray):
        return tree
    if not isinstance(tree, dict) or depth == 0 or not all(isinstance(key, str) for key in tree):
        raise pickle.UnpicklingError(f"{type(tree).__name__} among the dictionaries")
    return {key: _plain(value, depth - 1) for key, value in tree.items()}


def _refuse(*args: object) -> None:
    raise pickle.UnpicklingError("it builds an array by itself")


def _latin1(text: str, encoding: str) -> bytes:
    if encoding not in ("latin1", "latin-1"):
        raise pickle.UnpicklingError(f"the encoding {encoding[:20]!r}")
    return text.encode("latin1")
