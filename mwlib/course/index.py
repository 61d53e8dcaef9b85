"""The page that shows what a build made: every exhibit with its caption, data, preset and seeds."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2

from mwlib.course.execute import PAGE
from mwlib.course.manifest import MANIFEST, Exhibit, read_manifest
from mwlib.course.notebooks import from_text, read_notebook, read_parameters, resolve, source_hash
from mwlib.experiments.origins import data_fingerprint
from mwlib.experiments.store import parameters_hash, result_of
from mwlib.files import write_atomic
from mwlib.hashing import package_hash
from mwlib.plots import significant

FIRST = ("data", "preset", "seed", "seeds")
LONGEST_TABLE = 60  # rows shown; the CSV has them all


@dataclass(frozen=True)
class Found:
    """What a notebook saved under one stem."""

    notebook: str
    stem: str
    folder: str  # relative to the page
    files: tuple[str, ...]  # endings
    alt: str
    provenance: dict[str, Any]
    table: tuple[tuple[str, ...], ...]  # rows, header first; empty for a picture


def scan(build: Path) -> tuple[dict[tuple[str, str], Found], list[str]]:
    """Everything that notebooks saved under a build folder, by (notebook, stem); and what could not be read, with the reason.

    A picture or table is a `stem.json` (provenance) beside a `stem.csv`; the .json is written last, so what has one is complete.
    """
    found, broken = {}, []
    for sidecar in sorted(build.glob("[0-9][0-9]*_*/**/*.json")):
        if sidecar.with_suffix(".csv").is_file():
            try:
                item = _found(build, sidecar)
            except (OSError, ValueError, csv.Error) as error:
                broken.append(f"{sidecar.relative_to(build).with_suffix('')}: {error}")
            else:
                found[item.notebook, item.stem] = item
    return found, broken


def write_index(build: Path, notebooks: Sequence[Path], manifest: Path = MANIFEST, given: Sequence[str] = ()) -> Path:
    """Write `index.html` into a build folder.

    Args:
        build: folder with one sub-folder per notebook, as `run-notebook` leaves them.
        notebooks: the notebooks that belong to the build.
        manifest: which exhibits there should be; those that are not there are listed as missing.
        given: ``name=value`` words, the parameters that each notebook of the build was to get.

    Returns:
        The page.

    Raises:
        FileNotFoundError: there is no such build folder.
        ValueError: the manifest is not valid, a notebook is none, or does not have a parameter that was given.
    """
    if not build.is_dir():
        raise FileNotFoundError(f"{build} is no folder; expected one with a sub-folder per notebook, as run-notebook leaves them")
    (found, broken), stems = scan(build), {path.stem for path in notebooks}
    now = _Now(given, package_hash(), cache(data_fingerprint))
    rows = [row for row in read_manifest(manifest) if row.notebook in stems]
    listed = {(row.notebook, row.stem) for row in rows}
    template = jinja2.Template(
        resources.files("mwlib.course").joinpath("index.html.jinja").read_text(encoding="utf-8"),
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    page = template.render(
        title=f"Figures and tables: {build.resolve().name}",
        notebooks=[_notebook(build, path, now) for path in notebooks],
        broken=broken,
        sections=[(name, [(row, found.get((row.notebook, row.stem))) for row in part]) for name, part in _sections(rows) if part],
        unlisted=[item for key, item in found.items() if key not in listed],
        longest=LONGEST_TABLE,
    )
    target = build / "index.html"
    write_atomic(target, page)
    return target


def _sections(rows: list[Exhibit]) -> list[tuple[str, list[Exhibit]]]:
    papers = dict.fromkeys(row.paper["system"] for row in rows if row.paper)
    parts = [(f"The tables and figures of {name}", [row for row in rows if row.paper.get("system") == name]) for name in papers]
    return [*parts, ("The course's own", [row for row in rows if not row.paper])]


@dataclass(frozen=True)
class _Now:
    """What results would depend on if they were made today."""

    given: Sequence[str]  # parameters, as words
    library: str  # its hash
    files: Callable[[str], str]  # data source -> its fingerprint


def _notebook(build: Path, path: Path, now: _Now) -> dict[str, Any]:
    page = f"{path.stem}/{PAGE}" if (build / path.stem / PAGE).is_file() else ""
    return {"name": path.stem, "problem": _problem(build / path.stem, path, now), "page": page}


def _problem(folder: Path, notebook: Path, now: _Now) -> str:
    """Why a notebook's result does not count, in a few words; empty if it is what a run would give today."""
    result = result_of(folder)
    if result.get("status") != "ok":
        return "not finished"
    depends, tree = result["depends"], read_notebook(notebook)
    data = depends.get("data", {})
    stale = {
        "notebook": depends.get("notebook") != source_hash(tree),
        "library": depends.get("mwlib") != now.library,
        "data": data.get("files") != now.files(str(data.get("source"))),
        "parameters": bool(now.given) and result.get("hash") != _parameters(tree, now.given),
    }
    changed = [name for name, is_stale in stale.items() if is_stale]
    return f"out of date: another {', '.join(changed)} now" if changed else ""


def _parameters(tree: dict[str, Any], given: Sequence[str]) -> str:
    """The hash under which a notebook's result would be filed."""
    offered = read_parameters(tree)
    return parameters_hash(resolve(offered, from_text(offered, list(given))))


def _found(build: Path, sidecar: Path) -> Found:
    provenance = json.loads(sidecar.read_text(encoding="utf-8"))
    if not isinstance(provenance, dict):
        raise ValueError(f"its .json holds {str(provenance)[:40]!r}; expected a mapping")
    provenance.pop("figure", None)
    ordered = {name: provenance[name] for name in (*FIRST, *provenance) if name in provenance}
    files = tuple(kind for kind in ("png", "pdf", "csv", "txt", "json") if sidecar.with_suffix(f".{kind}").is_file())
    text = sidecar.with_suffix(".txt")
    return Found(
        notebook=sidecar.relative_to(build).parts[0],
        stem=sidecar.stem,
        folder=Path(os.path.relpath(sidecar.parent, build)).as_posix(),
        files=files,
        alt=text.read_text(encoding="utf-8").strip() if text.is_file() else "",
        provenance={name: _told(value) for name, value in ordered.items()},
        table=() if "png" in files else _table(sidecar.with_suffix(".csv")),
    )


def _told(value: Any) -> str:
    """A JSON value as a reader wants it: no brackets, no quotes."""
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_told(part)}" for name, part in value.items())
    if isinstance(value, list):
        return ", ".join(map(_told, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _table(path: Path) -> tuple[tuple[str, ...], ...]:
    with path.open(newline="", encoding="utf-8") as file:
        return tuple(tuple(map(_short, row)) for row in csv.reader(file))


def _short(cell: str) -> str:
    """Numbers with a fraction to three digits: the CSV has them all."""
    try:
        return significant(float(cell)) if cell.strip("-").count(".") or "e" in cell else cell
    except ValueError:
        return cell
