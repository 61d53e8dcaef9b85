"""A working copy of the course: what a reader opens, runs and edits, taken out of the installed package."""

import re
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path
from typing import NamedTuple

from mwlib.experiments.results import rendered
from mwlib.files import write_atomic
from mwlib.paths import carried, installed

PACKAGE = "motion-wavelet-notebooks"


class LaidOut(NamedTuple):
    """What `lay_out` did, as paths relative to the folder."""

    written: list[Path]
    kept: list[Path]  # were there already
    changed: list[Path]  # of those kept, the ones that are not as this mwlib has them


def lay_out(folder: Path) -> LaidOut:
    """Copy notebooks, grids, the list of figures, committed results and Snakefile into a folder; overwrite nothing.

    Args:
        folder: made if missing. What is there already stays as it is, so a second call brings back what was deleted.

    Raises:
        NotADirectoryError: the path is a file, or goes through one.
        PermissionError: the folder cannot be written to.
    """
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"{folder} is a file; expected a folder, or a name that is still free")
    out = LaidOut([], [], [])
    source = installed()
    for file in carried(source):
        name = file.relative_to(source)
        target, content = folder / name, file.read_bytes()
        if not target.exists() and not target.is_symlink():
            write_atomic(target, content)
            out.written.append(name)
            continue
        out.kept.append(name)
        if not target.is_file() or target.read_bytes() != content:
            out.changed.append(name)
    return out


def to_install(extra: str) -> str:
    """The command that brings the packages of an extra that are missing, by their own names: it works wherever mwlib is from.

    Empty if none is missing.
    """
    try:
        lines = requires(PACKAGE) or []
    except PackageNotFoundError:  # a checkout that is on the path, not installed
        return f'pip install ".[{extra}]"'
    of_extra = [line.partition(";")[0].strip() for line in lines if f"extra == '{extra}'" in line]
    missing = [f'"{line}"' for line in of_extra if not _is_there(re.split(r"[^\w.-]", line)[0])]
    return " ".join(["pip install", *missing]) if missing else ""


def _is_there(package: str) -> bool:
    try:
        return bool(distribution(package))
    except PackageNotFoundError:
        return False


def told(folder: Path, done: LaidOut, version: str) -> str:
    """What was done, and what a reader can do next, for the terminal."""
    missing = to_install("notebooks")
    return rendered("course/working_copy.md.jinja", folder=folder, done=done, version=version, missing=missing).rstrip()
