"""Options that several commands share: a command has those of a function here by ``**name``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from mwlib.experiments.grids import Grid, read_grid
from mwlib.settings import parse_changes

Repeated = Sequence  # an option that may be given several times, one word each


def meaning(
    *, unit: str | None = None, up: Literal["y", "z"] | None = None, file_fps: float | None = None, skeleton: str | None = None
) -> dict[str, Any]:
    """What files do not say, or say wrongly, as arguments of `load_motions`.

    Args:
        unit: metres per unit of the files, or one of `mwlib.data.meaning.UNITS` (default: as they say).
        up: the axis that points up in the files (default: as they say).
        file_fps: frames per second of the files (default: as they say).
        skeleton: of arrays that state none: one of `mwlib.body.skeleton.named_tree`, `mwlib.data.collections.named_tree`.
    """
    return locals()


def expect_ending(name: str, file: Path, *endings: str) -> None:
    """Refuse the name of a file to be written that would not say what is in it.

    Raises:
        ValueError: it ends otherwise.
    """
    if file.suffix.lower() not in endings:
        raise ValueError(f"{name} is {file}; expected a name that ends in {' or '.join(endings)}")


def choice_of(
    grid: str, *, out: Path, preset: str = "tiny", data: str = "", set: Repeated[str] = (), grids: Path | None = None
) -> tuple[Grid, str, dict[str, Any], Path]:
    """What commands about one grid are told: the grid, the preset, what is changed in it, and where results go.

    Args:
        grid: its id, e.g. table_4.
        out: folder for the results.
        preset: what the rows change.
        data: a source that load_motions reads (default: the preset's own).
        set: change one setting, e.g. data=my/folder or lr=1e-3; may be repeated.
        grids: file of the grids (default: figures/grids.yaml).

    Raises:
        ValueError: there is no such grid; the message lists those there are.
    """
    return read_grid(grid, grids), preset, ({"data": data} if data else {}) | parse_changes(set), out
