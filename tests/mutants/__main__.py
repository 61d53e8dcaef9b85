"""Try the mutants: each is planted in a copy of the repository, and of the tests named with it one must fail.

Nothing is changed in the working tree. Exit code 1: a mutant survived, or its place in the code is not found any more.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.mutants.catalogue import MUTANTS
from tests.mutants.mutant import Mutant
from tests.mutants.runner import BROKEN, GONE, KILLED, SURVIVED, attempt_all

ROOT = Path(__file__).parents[2]


def main(words: Sequence[str] | None = None, mutants: Sequence[Mutant] = MUTANTS, root: Path = ROOT) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--only", nargs="+", default=[""], metavar="NAME", help="those whose name or file contains this")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time (default 2)")
    parser.add_argument("--list", action="store_true", help="show the mutants, try none")
    given = parser.parse_args(words)
    chosen = [mutant for mutant in mutants if any(n in mutant.name or n in mutant.file for n in given.only)]
    if not chosen:
        parser.error(f"no mutant is called {' or '.join(given.only)}; --list shows all")
    if given.list:
        for mutant in chosen:
            print(f"{mutant.name}  ({mutant.file})\n  - {mutant.old}\n  + {mutant.new}\n  {' '.join(mutant.tests)}")
        return 0
    fates = attempt_all(chosen, root, max(1, given.jobs))
    for mutant, fate in zip(chosen, fates, strict=True):
        print(f"{fate:18s}  {mutant.name:40s} {' '.join(mutant.tests)}")
    print(", ".join(f"{fates.count(fate)} {fate.lower()}" for fate in (KILLED, SURVIVED, GONE, BROKEN)))
    return int(any(fate != KILLED for fate in fates))


if __name__ == "__main__":
    raise SystemExit(main())
