"""Where the notebooks are, and hashes of sources that outputs do not change."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mwlib.files import write_atomic
from mwlib.material import course_folder

ROOT = course_folder()  # of the folder that the process was started in
NOTEBOOKS = ROOT / "notebooks"
EXPERIMENT = NOTEBOOKS / "experiment.ipynb"  # one row of a grid
TIMEOUT = 86400.0  # seconds for one cell: the paper's own presets train for hours in one
# Chapters that take minutes: whoever runs several begins with them, with 06 first, whose model others wait for.
LONGEST = ("06", "11", "08", "03", "13", "10", "07", "04")
CHAPTER = re.compile(r"\d\d[a-z]?")  # a chapter's number: 05, or 05b for its second half


def course(folder: Path = NOTEBOOKS) -> list[Path]:
    """The notebooks of the course, in order."""
    return sorted(path for path in folder.glob("*_*.ipynb") if CHAPTER.fullmatch(chapter_number(path)))


def chapter_number(path: Path) -> str:
    """What a notebook's name begins with.

    >>> chapter_number(Path("notebooks/05b_diffusion_on_the_manifold.ipynb"))
    '05b'
    """
    return path.stem.partition("_")[0]


def find_notebook(name: str, folder: Path = NOTEBOOKS) -> Path:
    """A notebook by path, by name, or by its number: two digits, and a letter where it has one. "05" is never "05b".

    Raises:
        FileNotFoundError: there is none, or more than one; the message lists the course.
    """
    if name.endswith(".ipynb") and Path(name).is_file():
        return Path(name)
    found = [path for path in course(folder) if path.stem == name or chapter_number(path) == name]
    if len(found) != 1:
        names = ", ".join(path.stem for path in course(folder)) or "nothing"
        raise FileNotFoundError(f"no notebook {name!r}; expected a path, a name or a number of: {names}")
    return found[0]


def read_notebook(path: Path) -> dict[str, Any]:
    """A notebook file as a tree, with all that is relied on later: cells that have a type and a source.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no notebook; the message names the file and what was found.
    """
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is not a notebook: {error}; expected JSON with a list of cells") from None
    cells = tree.get("cells") if isinstance(tree, dict) else None
    if not isinstance(cells, list) or not all(map(_is_cell, cells)):
        raise ValueError(f"{path} is not a notebook: {str(tree)[:40]}; expected cells, each with a type, metadata and a source")
    return tree


def _is_cell(cell: Any) -> bool:
    if not isinstance(cell, dict) or not isinstance(cell.get("cell_type"), str) or not isinstance(cell.get("metadata", {}), dict):
        return False
    source = cell.get("source")
    return isinstance(source, str) or (isinstance(source, list) and all(isinstance(line, str) for line in source))


def source_hash(notebook: Path | Mapping[str, Any]) -> str:
    """Hash of what a notebook says, not of what running it produced: types, tags and sources of its cells.

    Raises:
        FileNotFoundError, ValueError: as in `read_notebook`.
    """
    tree = read_notebook(notebook) if isinstance(notebook, Path) else notebook
    cells = [
        (cell["cell_type"], cell.get("metadata", {}).get("tags", []), "".join(cell["source"]).strip())
        for cell in tree["cells"]
    ]  # fmt: skip
    return hashlib.sha256(json.dumps(cells).encode()).hexdigest()


def write_hashes(folder: Path, hashes: Mapping[str, str]) -> None:
    """Write `<name>.sha256` for each; a file whose content stays is not touched.

    Snakemake rules depend on these files instead of on what was hashed: executing a notebook in place or touching a file of the
    data schedules nothing, and no path of a user's is taken for a pattern.
    """
    for name, text in hashes.items():
        target = folder / f"{name}.sha256"
        if not target.is_file() or target.read_text(encoding="utf-8") != text:
            write_atomic(target, text)
