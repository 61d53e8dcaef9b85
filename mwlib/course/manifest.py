"""The list of exhibits, `figures/manifest.yaml`: every table and figure, what it shows and which notebook makes it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mwlib.course.notebooks import ROOT
from mwlib.settings import read_yaml

MANIFEST = ROOT / "figures" / "manifest.yaml"
FILES = {"figure": ("png", "pdf", "csv", "txt", "json"), "table": ("csv", "json")}
STATUS = ("made", "planned")
TEXTS = ("id", "kind", "caption", "notebook", "stem", "data", "status")


@dataclass(frozen=True)
class Exhibit:
    """One row of the manifest.

    Args:
        id: unique, lower case, words joined by hyphens.
        kind: "figure" or "table".
        caption: what it shows, in our words.
        notebook: stem of the notebook that makes it.
        stem: name of its files, without ending; unique within the notebook.
        files: endings of the files that make it up.
        data: which data it is made from.
        status: "made", or "planned" while no notebook makes it.
        paper: the paper's item that it answers to, e.g. {"system": "MotionWavelet", "item": "Table 1"}; may be empty.
        committed: results under figures/ that show the same on real people, without ending; the site shows them instead.
    """

    id: str
    kind: str
    caption: str
    notebook: str
    stem: str
    files: tuple[str, ...]
    data: str
    status: str
    paper: dict[str, str] = field(default_factory=dict, hash=False)
    committed: tuple[str, ...] = ()


def read_manifest(path: Path = MANIFEST) -> list[Exhibit]:
    """All exhibits, in the order of the file.

    Raises:
        ValueError: a row lacks a field, has an unknown one, one twice, or a value that is not allowed; the message names
            the file and every such row.
    """
    tree = read_yaml(path) or {}
    rows = tree.get("exhibits", []) if isinstance(tree, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError(f"{path} holds {str(tree)[:40]!r}; expected exhibits: a list of mappings")
    problems = [f"row {number} ({row.get('id', '?')}): {text}" for number, row in enumerate(rows, 1) for text in _problems(row)]
    for name, keys in (("id", ["id"]), ("notebook and stem", ["notebook", "stem"])):
        values = [tuple(row.get(key) for key in keys) for row in rows]
        problems += [f"{value}: the same {name} twice" for value in sorted(set(values), key=str) if values.count(value) > 1]
    if problems:
        raise ValueError(f"{path}:\n" + "\n".join(problems))
    return [Exhibit(**{**row, **{key: tuple(row.get(key, ())) for key in ("files", "committed")}}) for row in rows]


def _problems(row: dict[str, Any]) -> Iterator[str]:
    for name in TEXTS:
        if not isinstance(row.get(name), str) or not row[name].strip():
            yield f"{name} is {row.get(name)!r}; expected a text"
            return
    if unknown := set(row) - {*TEXTS, "files", "paper", "committed"}:
        yield f"unknown fields {sorted(unknown)}"
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", row["id"]):
        yield "the id is not of lower-case words joined by hyphens"
    if row["status"] not in STATUS:
        yield f"status is {row['status']!r}; expected one of {', '.join(STATUS)}"
    if row["kind"] not in FILES:
        yield f"kind is {row['kind']!r}; expected one of {', '.join(FILES)}"
    elif missing := set(FILES[row["kind"]]) - set(row.get("files", ())):
        yield f"files lack {sorted(missing)}: a {row['kind']} consists of {', '.join(FILES[row['kind']])}"
    if set(row.get("paper", {})) not in (set(), {"system", "item"}):
        yield f"paper is {row['paper']!r}; expected 'system' and 'item'"
