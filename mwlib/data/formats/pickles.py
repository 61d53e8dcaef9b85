"""Nested dictionaries of arrays, or lists of words, out of a pickle, and nothing else: no code of the file's choosing runs.

A pickle is a program. This is an interpreter of the few instructions that NumPy needs for dictionaries of arrays, protocols 2 to
5, from Python 2 or 3: it calls nothing that a file names, and every other instruction is refused.
"""

import math
import pickletools
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mwlib.data.untrusted import MOST_DIMENSIONS, MOST_VALUES, MotionFormatError, allowed

EXPECTED = "a pickle of dictionaries and NumPy arrays of numbers"
WORDS = "a pickle of a list of words, or of a dictionary from words to whole numbers"
MOST_STEPS = 250_000  # instructions in a file of up to 10 MB; an array takes about 25, all of Human3.6M about 6000
KINDS = re.compile("f[248]|[iu][1248]|b1|O8?")  # of dtypes
NAMES = {
    "numpy.ndarray", "numpy.dtype", "_codecs.encode",
    *(f"numpy.{core}.{name}" for core in ("core", "_core") for name in ("multiarray._reconstruct", "numeric._frombuffer")),
}  # fmt: skip
PUSHED = (
    "SHORT_BINUNICODE BINUNICODE SHORT_BINSTRING BINSTRING SHORT_BINBYTES BINBYTES BYTEARRAY8 BININT BININT1 BININT2 LONG1 INT"
).split()
REMEMBERED, RECALLED, IDLE = ("MEMOIZE", "BINPUT", "LONG_BINPUT"), ("BINGET", "LONG_BINGET"), ("PROTO", "FRAME", "STOP")


class _Refused(ValueError):
    """The pickle does something else; the message says what."""


class _Mark:
    """Where the items of a tuple, list or dictionary begin."""


@dataclass
class _Name:
    """A name that NumPy's pickles contain. It stands for itself; nothing can call it."""

    name: str


@dataclass
class _Dtype:
    """Stands for numpy.dtype."""

    code: str
    order: str = "|"


@dataclass
class _Array:
    """Stands for numpy.ndarray: the array, or what an object array of one element holds."""

    value: object = None


def unpickle(data: bytes, file: Path, place: str) -> object:
    """What a pickled dictionary of dictionaries of arrays holds; arrays are read-only.

    Raises:
        MotionFormatError: anything else is in it, and nothing of it has run; or more than the file's size allows.
    """
    return _read(data, file, place, EXPECTED, _plain)


def unpickle_words(data: bytes, file: Path) -> list[str] | dict[str, int]:
    """A pickled list of words, or dictionary from words to whole numbers.

    Raises:
        MotionFormatError: as `unpickle`.
    """
    return _read(data, file, "pickle", WORDS, _words)


def _read(data: bytes, file: Path, place: str, expected: str, finish: Callable[[object], Any]) -> Any:
    """What `finish` makes of the tree that the instructions build."""
    machine = _Machine(allowed(MOST_VALUES, file))
    most = allowed(MOST_STEPS, file)
    try:
        with warnings.catch_warnings(action="ignore"):  # of broken names
            for count, (opcode, argument, _) in enumerate(pickletools.genops(data)):
                if count > most:
                    raise _Refused(f"more than {most} instructions")
                machine.step(opcode.name, argument)
        (tree,) = machine.stack
        return finish(tree)
    except (ValueError, LookupError, TypeError, RecursionError) as error:  # any instruction may meet any operand
        raise MotionFormatError(file, place, str(error)[:200] or type(error).__name__, expected) from error


def _plain(tree: object, depth: int = 2) -> object:
    """Stand-ins in so many levels of dictionaries replaced by what they stand for."""
    if isinstance(tree, _Array):
        tree = tree.value
    if isinstance(tree, np.ndarray):
        return tree
    if not isinstance(tree, dict) or depth == 0:
        raise _Refused(f"{type(tree).__name__} among the dictionaries")
    return {key: _plain(value, depth - 1) for key, value in tree.items()}


def _words(tree: object) -> list[str] | dict[str, int]:
    if isinstance(tree, list) and all(isinstance(word, str) for word in tree):
        return tree
    if isinstance(tree, dict) and all(type(number) is int for number in tree.values()):
        return tree
    raise _Refused(f"{type(tree).__name__.strip('_')} with something else")


class _Machine:
    """Stack and memo."""

    def __init__(self, values: int) -> None:
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.values_left = values

    def step(self, name: str, argument: Any) -> None:
        """One instruction.

        Raises:
            _Refused, ValueError, LookupError, TypeError: it is none that NumPy needs, or its operands are not.
        """
        if name in PUSHED:
            self.stack.append(argument)
        elif name in MADE:
            self.stack.append(MADE[name]())
        elif name in TAKERS:
            take, count = TAKERS[name]
            take(self, self._pop(count))
        elif name == "GLOBAL":
            self.name(argument.split(" "))
        elif name in REMEMBERED:
            self.memo[len(self.memo) if argument is None else argument] = self.stack[-1]
        elif name in RECALLED:
            self.recall(argument)
        elif name not in IDLE:
            raise _Refused(f"an instruction {name}")

    def _pop(self, count: int | None) -> list[Any]:
        """So many items from the top, or all above the last mark, in the order in which they came."""
        items: list[Any] = []
        while count is None or len(items) < count:
            item = self.stack.pop()
            if isinstance(item, _Mark):
                break
            items.append(item)
        if count is not None and len(items) < count:
            raise _Refused("an instruction without operands")
        return items[::-1]

    def put_tuple(self, items: list[Any]) -> None:
        """TUPLE."""
        self.stack.append(tuple(items))

    def recall(self, slot: int) -> None:
        """GET: only what NumPy uses twice, so that nothing small stands for something vast."""
        item = self.memo[slot]
        if not isinstance(item, str | bytes | _Name | _Dtype):
            raise _Refused(f"{type(item).__name__.strip('_')} twice")
        self.stack.append(item)

    def put_items(self, items: list[Any]) -> None:
        """SETITEMS: keys are text, so that no chosen ones collide."""
        keys, values = items[::2], items[1::2]
        if not isinstance(self.stack[-1], dict) or not all(type(key) is str for key in keys):
            raise _Refused("a key that is no text among the dictionaries")
        self.stack[-1].update(zip(keys, values, strict=True))

    def append(self, items: list[Any]) -> None:
        """APPENDS: a list is the one element of an object array, or holds texts."""
        made = self.stack[-1]
        if not isinstance(made, list) or not (
            len(made) + len(items) <= 1 or all(isinstance(item, str) for item in (*made[:1], *items))
        ):
            raise _Refused("list among the dictionaries")
        made += items

    def name(self, words: list[Any]) -> None:
        """GLOBAL: one of the names that NumPy writes."""
        name = ".".join(str(word)[:60] for word in words)
        if name not in NAMES:
            raise _Refused(f"the name {name}")
        self.stack.append(_Name(name))

    def reduce(self, operands: list[Any]) -> None:
        """REDUCE: what the call of a permitted name would give."""
        called, arguments = operands
        if not isinstance(called, _Name) or not isinstance(arguments, tuple):
            raise _Refused("a call of something without a name")
        name = called.name.rpartition(".")[2]
        if name == "_reconstruct":
            made: object = _Array()
        elif name == "dtype":
            code = arguments[0]
            if not isinstance(code, str) or not KINDS.fullmatch(code):
                raise _Refused(f"dtype {str(code)[:20]!r}")
            made = _Dtype(code)
        elif name == "encode" and isinstance(arguments[0], str) and arguments[1] in ("latin1", "latin-1"):
            made = arguments[0].encode("latin1")
        elif name == "_frombuffer":
            content, dtype, shape, order = arguments
            made = _Array(self._numbers(content, dtype, shape, order == "F"))
        else:
            raise _Refused(f"a call of {called.name}")
        self.stack.append(made)

    def build(self, operands: list[Any]) -> None:
        """BUILD: byte order of a dtype; shape, dtype and data of an array."""
        made, state = operands
        if isinstance(made, _Dtype) and isinstance(state, tuple) and state[1] in tuple("<>|="):
            made.order = state[1]
        elif isinstance(made, _Array) and isinstance(state, tuple) and len(state) == 5:
            _, shape, dtype, fortran, data = state
            if isinstance(dtype, _Dtype) and dtype.code.startswith("O"):
                if shape != () or not isinstance(data, list):
                    raise _Refused(f"an object array of shape {str(shape)[:40]}")
                (made.value,) = data
            else:
                made.value = self._numbers(data, dtype, shape, fortran)
        else:
            raise _Refused("the state of something that has none")
        self.stack.append(made)

    def _numbers(self, content: object, dtype: object, shape: object, fortran: bool) -> np.ndarray:
        if (
            not isinstance(dtype, _Dtype) or dtype.code.startswith("O")
            or not isinstance(shape, tuple) or len(shape) > MOST_DIMENSIONS or not all(type(n) is int and n >= 0 for n in shape)
        ):  # fmt: skip
            raise _Refused("an array without a plain shape and dtype")
        count, kind = math.prod(shape), np.dtype(dtype.order + dtype.code)
        raw = content.encode("latin1") if isinstance(content, str) else content  # Python 2 wrote text
        if not isinstance(raw, bytes | bytearray) or len(raw) != count * kind.itemsize:
            raise _Refused(f"an array whose data do not fill shape {str(shape)[:60]}")
        self.values_left -= count
        if self.values_left < 0:
            raise _Refused("more numbers than a file of this size may hold")
        return np.frombuffer(bytes(raw), kind).reshape(shape, order="F" if fortran else "C")


MADE: dict[str, Callable[[], object]] = {
    "MARK": _Mark, "EMPTY_DICT": dict, "EMPTY_LIST": list, "EMPTY_TUPLE": tuple,
    "NONE": lambda: None, "NEWTRUE": lambda: True, "NEWFALSE": lambda: False,
}  # fmt: skip
# What takes how many operands; None: all above the last mark.
TAKERS: dict[str, tuple[Callable[[_Machine, list[Any]], None], int | None]] = {
    **{f"TUPLE{count}": (_Machine.put_tuple, count) for count in (1, 2, 3)},
    "TUPLE": (_Machine.put_tuple, None),
    "SETITEM": (_Machine.put_items, 2),
    "SETITEMS": (_Machine.put_items, None),
    "APPEND": (_Machine.append, 1),
    "APPENDS": (_Machine.append, None),
    "STACK_GLOBAL": (_Machine.name, 2),
    "REDUCE": (_Machine.reduce, 2),
    "BUILD": (_Machine.build, 2),
}
