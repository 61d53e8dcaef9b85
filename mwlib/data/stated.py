"""Who says what the numbers of a file mean, and a motion together with that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from mwlib.body.motion import Motion

Value = TypeVar("Value")

CALLER, TABLE, ENTRY, BESIDE = "the caller", "clips.csv", "its own entry", "skeleton.json"
FILE, FORMAT, SKELETON, SIZE, DEFAULT = "the file", "the format", "the skeleton", "the body's size", "the default"
BY_USER = (CALLER, TABLE, ENTRY, BESIDE)  # said by somebody who looked at these very data


@dataclass(frozen=True)
class Stated(Generic[Value]):
    """A value, and who says so: one of the words above."""

    value: Value
    source: str

    @property
    def is_users(self) -> bool:
        """Whether the user said it: it is believed even where the body looks odd then."""
        return self.source in BY_USER


def stated(value: Value | None, source: str) -> Stated[Value] | None:
    """A value and its source; None if there is no value."""
    return None if value is None else Stated(value, source)


@dataclass(frozen=True)
class Reading:
    """A motion as its file has it, in metres, and who said so: metres per unit, the up-axis, frames per second."""

    motion: Motion
    unit: Stated[float]
    up: Stated[str]
    fps: Stated[float]
