"""Calls of `predict`, `inbetween`, `generate` and `windows` with spoilt arguments, in seeded order, and how each ended."""

from __future__ import annotations

import random
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import torch

import mwlib as mw
from mwlib.body.skeleton import H36M17
from mwlib.data.windows import prepare
from mwlib.synthetic import synthetic_motions
from tests.inbetweening import sample as bridges
from tests.sample_settings import untrained as a_predictor
from tests.text_to_motion.sample import untrained as a_writer

# No number from a thousand to a million: so many samples are no mistake, and take long.
NUMBERS = (0, 1, 2, 3, 7, -1, -3, 10**6 + 1, 2**31, 2**63, 2**64, -(2**63), 10**30, 10**400)
NOTHING = (
    None, True, False, 0.5, 1.5, -0.5, 1e-300, 1e300, float("nan"), float("inf"), -float("inf"), 1j, "", "3", "a", "\x00", b"1",
    "走",   
    (), [], {}, {"a": 1}, set(), [None], [[]], ["a"], [0.5], [True], [1, 2], [-1], [10**30], object(), int, len, Fraction(1, 3),
    np.float32(2.5), np.int8(3), np.bool_(True), np.array(3), np.array(3.0), np.array("3"), np.zeros(0), np.zeros((2, 2)),
    np.array([None]), np.datetime64("2020-01-01"), torch.tensor(3), torch.tensor(2.5), torch.zeros(0), torch.ones(3),
    torch.zeros(2, device="meta"), range(3), slice(2), NotImplemented, ...,
)  # fmt: skip
# What a message calls an argument, where it does not say its name.
CALLED = {
    "source": "source|x_history|windows?|history|frames|joints|skeleton|fps|clip|the rig", "window_ids": "window_ids",
    "motions": "motions|frames|skeleton|fps|windows|clip", "start": "start|frames|keyframe|skeleton|fps|body|joints|up|bone",
    "end": "end|keyframe|frames|skeleton|fps|body|joints|bone", "texts": "texts|sentences", "seconds": "seconds|lengths",
    "history": "history|windows?|frames", "future": "future|windows?|frames", "stride": "stride|windows?",
    "frames": "frames|keyframe",
}  # fmt: skip


class Call(NamedTuple):
    """A function, its arguments, and which of these are spoilt."""

    function: str
    arguments: dict[str, Any]
    spoilt: tuple[str, ...]


class Function(NamedTuple):
    """What is called.

    Args:
        call: with arguments by name.
        whole: arguments as they should be.
        fits: whether a result has the right shape; asked with the arguments.
    """

    call: Callable[..., Any]
    whole: dict[str, Any]
    fits: Callable[[Any, dict[str, Any]], bool]


@cache
def functions() -> dict[str, Function]:
    """The four functions with tiny models, made once."""
    clips = prepare(synthetic_motions(subjects=1)[:3], 10.0)
    predictor, bridge, writer = a_predictor(), bridges.untrained(), a_writer()
    cut = mw.windows(clips, 6, 14, 20)

    def futures(found: torch.Tensor, given: dict[str, Any]) -> bool:
        return found.ndim == 4 and found.shape[1:] == (given["samples"] or 3, 14, 48)

    return {
        "predict": Function(
            predictor.predict,
            {"source": cut.x_history, "samples": 2, "seed": 3, "window_ids": None, "chunk": 4},
            lambda found, given: futures(found, given) and bool(found.isfinite().all()),
        ),
        "predict clips": Function(
            predictor.predict,
            {"source": clips, "samples": 2, "seed": 3, "window_ids": [4, 0, 9], "chunk": None},
            lambda found, given: futures(found, given) and bool(found.isfinite().all()),
        ),
        "windows": Function(
            mw.windows,
            {"motions": clips, "history": 6, "future": 14, "stride": 5},
            lambda found, given: (
                found.x.shape[1:] == (given["history"] + given["future"], 48) and bool(found.x.isfinite().all())
                and len(found) > 0
            ),
        ),
        "inbetween": Function(
            mw.inbetween,
            {"start": clips[0], "end": [3, 10], "frames": None, "samples": 2, "seed": 3, "run": bridge},
            lambda found, given: _motions(found, given["samples"] or 2, 8),
        ),
        "inbetween of two": Function(
            mw.inbetween,
            {"start": clips[0].cut(0, 4), "end": clips[0].cut(11, 15), "frames": 6, "samples": 2, "seed": 3, "run": bridge},
            lambda found, given: _motions(found, given["samples"] or 2, 8),
        ),
        "generate": Function(
            mw.generate,
            {"texts": ["a person goes up", "someone falls"], "seconds": [0.4, 0.6], "samples": 2, "seed": 3, "run": writer},
            lambda found, given: _motions(found, len(found)) and len(found) % given["samples"] == 0 < len(found),
        ),
    }  # fmt: skip


def _motions(found: list[mw.Motion], count: int, frames: int | None = None) -> bool:
    return len(found) == count and all(
        np.isfinite(motion.positions).all() and len(motion) == (frames or len(motion)) for motion in found
    )


def calls(count: int, seed: int) -> Iterator[Call]:
    """So many calls with one or two spoilt arguments; call number n is the same whatever the count."""
    names = list(functions())
    for number in range(count):
        rng = random.Random(f"{seed}/call/{number}")
        name = names[number % len(names)]
        given = dict(functions()[name].whole)
        spoilt = tuple(rng.sample(sorted(given), rng.choice((1, 1, 1, 2))))
        for argument in spoilt:
            given[argument] = spoil(given[argument], rng)
        yield Call(name, given, spoilt)


def spoil(value: Any, rng: random.Random) -> Any:
    """Something of another kind, or nearly the same thing."""
    if rng.random() < 0.3:
        return rng.choice(NOTHING)
    if isinstance(value, torch.Tensor):
        return _tensor(value.clone(), rng)
    if isinstance(value, mw.Motion):
        return _motion(value, rng)
    if isinstance(value, list) and value:
        return _list(list(value), rng)
    return rng.choice(NUMBERS)


def _list(values: list[Any], rng: random.Random) -> Any:
    """One entry spoilt, doubled, lost, or of another kind; or the list as another container."""
    at = rng.randrange(len(values))
    how = rng.randrange(7)
    if how == 0:
        return values[:at]
    if how == 1:
        return [*values, values[at]]
    if how == 2:
        return rng.choice((tuple, iter, lambda items: dict(enumerate(items)), lambda items: items[0], lambda items: [items]))(
            values
        )
    if isinstance(values[at], str):
        values[at] = rng.choice(
            ("", " ", "...", "走る", "zxqv", "\x00", "a " * 5000, values[at].upper(), f"{values[at]} zxqv", "\ud800")
        )
    elif how > 4 or not isinstance(values[at], mw.Motion):
        values[at] = rng.choice((*NOTHING, *NUMBERS))
    else:
        values[at] = _motion(values[at], rng)
    return values


def _number(rng: random.Random) -> float:
    return rng.choice((float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e30, 1e4, -30.0, 1e-320))


@np.errstate(all="ignore")
def _tensor(x: torch.Tensor, rng: random.Random) -> Any:
    """Numbers, shape, kind, or where it is."""
    factor = rng.choice((0.0, 1e-3, 0.1, 100.0, 1000.0, 1e30, -1.0, float("nan")))
    place = tuple(rng.randrange(n) for n in x.shape)
    return rng.choice((
        lambda: x * factor, lambda: x.double() * 1e308, lambda: x[: rng.randrange(3)], lambda: x[:, : rng.randrange(8)],
        lambda: x[..., : rng.randrange(60)], lambda: x[0], lambda: x[None], lambda: x.mT, lambda: x.flatten(),
        lambda: x.tolist(),
        lambda: x.int(), lambda: x.bool(), lambda: x.half(), lambda: x.bfloat16(), lambda: x.to(torch.complex64),
        lambda: x.to_sparse(), lambda: x.to("meta"), lambda: x.requires_grad_(), lambda: x.numpy(),
        lambda: x.numpy().astype(object),
        lambda: x.numpy().astype(str), lambda: x.numpy().astype(">f8"), lambda: x.numpy()[::-1], 
        lambda: x.index_put(
            tuple(torch.tensor([i]) for i in place), torch.tensor([_number(rng)], dtype=x.dtype)),
        lambda: list(x), lambda: x.numpy()[..., None],
    ))()  # fmt: skip


@np.errstate(all="ignore")
def _motion(motion: mw.Motion, rng: random.Random) -> Any:
    """Its numbers, rate, axis, length, skeleton; now and then what it would not be made with."""
    x = motion.positions.copy()
    x[rng.randrange(len(x)), rng.randrange(x.shape[1]), rng.randrange(3)] = np.float32(max(min(_number(rng), 3e38), -3e38))
    changes = rng.choice((
        {"positions": x}, {"positions": motion.positions * rng.choice((0, 0.1, 100, 1000, 1e30, -1))},
        {"positions": x.astype(np.float16)}, {"positions": x.astype(int)},
        {"positions": motion.positions.astype(np.float64) * 1e300},
        {"fps": rng.choice((1e-12, 1e-6, 0.01, 1.0, 1e3, 1e4, 1e9, 1e300))}, {"up": rng.choice("yz")}, {"positions": x[:1]},
        {"positions": x[: rng.randrange(1, 8)]}, {"name": rng.choice(("\x00", "x" * 10_000, "../../a"))}, {"skeleton": H36M17},
        {"positions": motion.positions + np.float32(rng.choice((100, 1e6, -1e20)))}, {"positions": motion.positions[::-1]},
    ))  # fmt: skip
    return replace(motion, rig=None, **changes)


def outcome(call: Call) -> tuple[str, bool]:
    """What is wrong with how a call ended, and whether it gave a result."""
    function = functions()[call.function]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            fits = function.fits(function.call(**call.arguments), call.arguments)
            fault, has_result = "" if fits else "a result of another shape, or not finite", True
        except (ValueError, TypeError, FileNotFoundError) as error:
            words = "|".join(rf"{CALLED.get(argument, argument)}\b" for argument in call.spoilt)
            named = re.search(words, str(error)) and (not isinstance(error, FileNotFoundError) or "run" in call.spoilt)
            fault, has_result = "" if named else f"{type(error).__name__} that names nothing: {error}", False
        except Exception as error:
            fault, has_result = f"{type(error).__name__}: {error}", False
    others = [warning for warning in told if warning.category is not UserWarning]
    return fault or (f"a warning: {others[0].message}" if others else ""), has_result
