"""A mutant: one small wrong change to the library, and the tests that must notice it."""

from __future__ import annotations

from typing import NamedTuple


class Mutant(NamedTuple):
    """One change of one place.

    Args:
        name: what is wrong then.
        file: of the library.
        old, new: text that stands in the file exactly once, and what replaces it.
        tests: files or ids, some of which must fail; all of them pass without the change.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applies(self, text: str) -> bool:
        """Whether the place is there, once."""
        return text.count(self.old) == 1


def of(file: str, tests: str, *changes: tuple[str, ...]) -> list[Mutant]:
    """Mutants of one file, of the library or below tests/: name, old, new and, where it is not the usual one, the test."""
    found = []
    for name, old, new, *own in changes:
        found.append(
            Mutant(
                name,
                file if file.startswith("tests/") else f"mwlib/{file}",
                old,
                new,
                tuple(f"tests/{test}" for test in (own or [tests])),
            )
        )
    return found
