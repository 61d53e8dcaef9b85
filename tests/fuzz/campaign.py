"""Spoilt files in seeded order."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import NamedTuple

from tests.fuzz.injuries import hostile, pack, spoil
from tests.fuzz.seeds import seeds
from tests.fuzz.texts import texts

HOSTILE = 0.04  # share of files that are meant to do harm; the others are spoilt at random


class Case(NamedTuple):
    """One spoilt file, what it was made of, and what lies beside it."""

    kind: str
    name: str
    files: dict[str, bytes]


def cases(count: int, seed: int) -> Iterator[Case]:
    """So many spoilt files; case number n is the same whatever the count."""
    whole = [*seeds(), *texts()]
    for number in range(count):
        rng = random.Random(f"{seed}/{number}")
        if rng.random() < HOSTILE:
            yield Case("hostile", *hostile(rng))
            continue
        kind, name, files = whole[number % len(whole)]
        spoilt = list(files)[-1]
        data = files[spoilt] if rng.random() < 0.1 else spoil(files[spoilt], rng)
        rest = {other: content for other, content in files.items() if other != spoilt}
        if spoilt == name and not name.endswith(".yaml"):
            name, data = pack(name, data, rng)
            yield Case(kind, name, rest | {name: data})
        else:
            yield Case(kind, name, rest | {spoilt: data})
