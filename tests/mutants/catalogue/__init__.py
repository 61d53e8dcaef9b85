"""The mutants, a module a room of the library."""

from importlib import import_module
from pkgutil import iter_modules

from tests.mutants.mutant import Mutant

MUTANTS: list[Mutant] = []
for _room in iter_modules(__path__):
    MUTANTS += import_module(f"{__name__}.{_room.name}").MUTANTS
