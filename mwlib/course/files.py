"""Where the notebooks are, and hashes of sources that outputs do not change."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

from mwlib.files import write_atomic
from mwlib.material import PACKAGED, course_folder

ROOT = course_folder()  # of the folder that the process was started in
NOTEBOOKS = ROOT / "notebooks"
EXPERIMENT = NOTEBOOKS / "experiment.ipynb"  # one row of a grid


def course(folder: Path = NOTEBOOKS) -> list[Path]:
    """The notebooks of the course, in order."""
    return sorted(folder.glob("[0-9][0-9]_*.ipynb"))


def find_notebook(name: str, folder: Path = NOTEBOOKS) -> Path:
    """A notebook by path, by name, or by its two digits.

    Raises:
        FileNotFoundError: there is none, or more than one; the message lists the course.
    """
    if name.endswith(".ipynb") and Path(name).is_file():
        return Path(name)
    found = [path for path in course(folder) if path.stem == name or path.stem[:2] == name]
    if len(found) != 1:
        names = ", ".join(path.stem for path in course(folder)) or "nothing"
        raise FileNotFoundError(f"no notebook {name!r}; expected a path, a name or two digits of: {names}")
    return found[0]


def source_hash(notebook: Path | dict) -> str:
    """Hash of what a notebook says, not of what running it produced: types, tags and sources of its cells."""
    tree = json.loads(notebook.read_text(encoding="utf-8")) if isinstance(notebook, Path) else notebook
    cells = [
        (cell["cell_type"], cell.get("metadata", {}).get("tags", []), "".join(cell["source"]).strip())
        for cell in tree["cells"]
    ]  # fmt: skip
    return hashlib.sha256(json.dumps(cells).encode()).hexdigest()


def package_hash(package: Path = PACKAGED.parent) -> str:
    """Hash of the library's files; this tooling and the copy of the notebooks are left out, for they change no result."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package)
        if path.is_file() and "__pycache__" not in inside.parts and inside.parts[0] not in ("course", PACKAGED.name):
            digest.update(inside.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def write_source_hashes(folder: Path, notebooks: Iterable[Path]) -> None:
    """Write `<stem>.sha256` per notebook and `mwlib.sha256`; a file whose content stays is not touched.

    Snakemake rules depend on these files, so executing a notebook in place schedules nothing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for stem, text in [("mwlib", package_hash()), *((path.stem, source_hash(path)) for path in notebooks)]:
        target = folder / f"{stem}.sha256"
        if not target.is_file() or target.read_text(encoding="utf-8") != text:
            write_atomic(target, text)
