"""Arguments of the functions that a room offers, held against their annotations where callers come in."""

from __future__ import annotations

import functools
import inspect
import math
import operator
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from annotated_types import Gt

from mwlib.settings import KINDS, shown


def checking(door: Callable[[str], Any]) -> Callable[[str], Any]:
    """The door of a room, its `__getattr__`, whose functions refuse what their annotations do not name.

    Modules of the library import each other's functions by another way and spare the time.

    Raises:
        ValueError: (the functions) an argument is of another kind; the message names it, what was found and what was expected.
    """

    @functools.wraps(door)
    def opened(name: str) -> Any:
        """What the room offers by this name; of a function one that checks."""
        found = door(name)
        return _checked(found) if isinstance(found, types.FunctionType) else found

    return opened


@functools.cache
def _checked(function: types.FunctionType) -> Callable[..., Any]:
    """The function behind a check of its arguments."""
    signature, hints = inspect.signature(function), typing.get_type_hints(function, include_extras=True)
    known = {name: hints[name] for name, one in signature.parameters.items() if "VAR" not in one.kind.name}

    @functools.wraps(function)
    def call(*words: Any, **named: Any) -> Any:
        """The function's own answer, after the check."""
        for name, value in signature.bind(*words, **named).arguments.items():
            if name in known and (found := fault(name, value, known[name])):
                raise ValueError(found)
        return function(*words, **named)

    return call


def fault(name: str, value: Any, hint: Any, inside: bool = False) -> str:
    """A sentence on an argument that is not what its annotation names; "" if it is, or nobody can tell.

    Own choice: of numbers `inside` a mapping or a list only that they are some is asked, as pictures draw whatever they are.

    >>> fault("fps", "25", float), fault("fps", 25, float)
    ("fps is '25'; expected a number", '')
    """
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Annotated:
        above = next((float(rule.gt) for rule in parts[1:] if isinstance(rule, Gt)), -math.inf)  # pyright: ignore[reportArgumentType]
        is_beyond = isinstance(value, int | float) and not above < value < math.inf
        return fault(name, value, parts[0], inside) or (
            f"{name} is {value}; expected a number above {above:g}" if is_beyond else ""
        )
    if origin in (typing.Union, types.UnionType):
        faults = [fault(name, value, part, inside) for part in parts]
        if not all(faults):
            return ""
        return next((deeper for deeper in faults if not deeper.startswith(f"{name} is ")), _said(name, value, hint))
    within: Iterable[tuple[str, Any, Any]] = ()
    if isinstance(origin, type) and issubclass(origin, Mapping):
        fits = isinstance(value, Mapping)
        within = ((f"{name}[{key!r}]", each, parts[1]) for key, each in value.items()) if fits else ()
    elif origin in (tuple, list, Sequence):
        fits = (
            _is_array(value)
            and value.ndim > 0
            or isinstance(value, Collection)
            and not isinstance(value, str | bytes | Mapping)
            and not hasattr(value, "dtype")
        )
        if fits and isinstance(value, list | tuple):
            kinds = parts if origin is tuple and parts[-1] is not Ellipsis else parts[:1] * len(value)
            fits = len(kinds) == len(value)
            within = ((f"{name}[{n}]", each, kind) for n, (each, kind) in enumerate(zip(value, kinds, strict=False)))
    else:
        is_of_numbers = hint in (float, np.ndarray) or hasattr(hint, "dim_str")  # in whatever shape
        fits = inside and is_of_numbers and (_is_array(value) or isinstance(value, list | tuple | Real))
        fits = fits or _fits(value, hint, origin, parts)
    return next(filter(None, (fault(*each, inside=True) for each in within)), "") if fits else _said(name, value, hint)


def _fits(value: Any, hint: Any, origin: Any, parts: tuple[Any, ...]) -> bool:
    """Whether a value is of a kind that holds no others."""
    if origin is typing.Literal:
        return isinstance(value, str) and value in parts
    if hasattr(hint, "dim_str"):
        return _fits_array(value, hint)
    if hint in (float, int):
        is_one = isinstance(value, Real) and not isinstance(value, bool) or _is_array(value) and value.ndim == 0
        return is_one and (hint is float or hasattr(value, "__index__"))
    if hint is bool:
        return "bool" in type(value).__name__
    kind = origin or hint
    return not isinstance(kind, type) or isinstance(value, kind)


def _is_array(value: Any) -> bool:
    """Whether it holds numbers or truths, or texts, and no Python objects."""
    return hasattr(value, "ndim") and str(getattr(value, "dtype", "object")) != "object"


def _fits_array(value: Any, hint: Any) -> bool:
    """Whether an array has the library, the kind of numbers and the axes of a jaxtyping annotation.

    Own choice: what is for NumPy goes through `np.asarray` there, so tensors, lists and whole numbers fit, too.
    """
    words = hint.dim_str.split()
    axes = [word for word in words if not word.startswith("*") and word != "..."]
    if issubclass(hint.array_type, np.ndarray):
        array = np.asarray(value) if isinstance(value, list | tuple) else value
        is_known = _is_array(array) and not str(array.dtype).startswith("<U")
    else:
        array, is_dense = value, isinstance(value, hint.array_type) and not value.is_meta and not value.is_sparse
        is_known = is_dense and str(value.dtype).rpartition(".")[2] in hint.dtypes
    if not is_known or not (operator.ge if len(axes) < len(words) else operator.eq)(array.ndim, len(axes)):
        return False
    pairs = zip(axes[::-1], array.shape[::-1], strict=False)
    return all(not axis.isdigit() or int(axis) == size for axis, size in pairs)


def _said(name: str, value: Any, hint: Any) -> str:
    return f"{name} is {shown(value)}; expected {' or '.join(dict.fromkeys(_words(hint)))}"


def _words(hint: Any) -> list[str]:
    """What an annotation names, in words."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return [word for part in parts if part is not types.NoneType for word in _words(part)]
    if origin is typing.Annotated:
        return _words(parts[0])
    if origin is typing.Literal:
        return [repr(part) for part in parts]
    if hasattr(hint, "dim_str"):
        kind = "an array" if hint.array_type.__name__ == "ndarray" else "a tensor"
        numbers = hint.__name__.split("[")[0].lower().replace("num", "real")
        return [f"{kind} of {numbers} numbers ({', '.join(hint.dim_str.split())})"]
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return [f"a mapping of names to {_words(parts[1])[0]}"]
    if origin in (tuple, list, Sequence):
        return [f"several of {_words(parts[0])[0]}"]
    words = KINDS | {float: "a number", types.NoneType: "None"}
    return [words.get(hint) or f"a {getattr(origin or hint, '__name__', hint)}"]
