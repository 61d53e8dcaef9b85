"""The site's pages of exhibits: the paper's tables and figures in its order, the chapters' own, and all committed results."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from mwlib.course.manifest import Exhibit, read_manifest
from mwlib.course.outputs import Kept, kept_outputs
from mwlib.experiments.grids import read_grids

FOLDER = "exhibits"
INTRODUCTION = """# Tables and figures of {name}

In the paper's order. Where a result on real people is committed with the software, it is shown, with the data, settings and
seeds that stand beside it. Everything else is what the chapter shows on the embedded
synthetic data at the preset `tiny`; it shows how the thing is made, and its numbers hold for those data alone.
"""
INDEX = """# Exhibits

Every table and figure. The pages say where each comes from, and on which data.

```{{toctree}}
:hidden:
{pages}
```

{listed}
"""
OWN = """# The chapters' own exhibits

What the chapters show beside the tables and figures of the papers, on the embedded synthetic data at the preset `tiny`.
"""
COMMITTED = """# Results on real people

Measured on clips of the CMU motion capture database. The settings beside each table say which clips, people and seeds.
[RESULTS.md](../../RESULTS.md) says what they show. The data used in this project was obtained from mocap.cs.cmu.edu.
The database was created with funding from NSF EIA-0196217.
"""


def exhibit_pages(root: Path, notebooks: Mapping[str, Mapping[str, Any]]) -> dict[str, str | bytes]:
    """The pages of exhibits, and the pictures on them.

    Args:
        root: a checkout.
        notebooks: trees of the executed notebooks, by name.

    Returns:
        Files by their places in the site's sources; exhibits/index.md lists the pages.

    Raises:
        ValueError: the manifest is not valid, names a committed result that is missing, or a notebook that is.
    """
    rows = read_manifest(root / "figures" / "manifest.yaml")
    kept = {name: kept_outputs(tree) for name, tree in notebooks.items()}
    pages: dict[str, str | bytes] = {}
    names, listed = [], []
    for system in dict.fromkeys(row.paper["system"] for row in rows if row.paper):
        names.append(re.sub(r"[^a-z0-9]+", "-", system.lower()))
        ordered = sorted((row for row in rows if row.paper.get("system") == system), key=_in_the_paper)
        parts = [_item(item, [*of], root, kept) for item, of in groupby(ordered, key=lambda row: row.paper["item"])]
        pages[f"{FOLDER}/{names[-1]}.md"] = "\n".join([INTRODUCTION.format(name=system), *parts])
        listed += [f"## {system}", *(_line(row.paper["item"], row.caption, f"{names[-1]}.md") for row in ordered), ""]
    own = [row for row in rows if not row.paper]
    parts = [_item(_title(notebooks[name]), [*of], root, kept) for name, of in groupby(own, key=lambda row: row.notebook)]
    pages[f"{FOLDER}/own.md"] = "\n".join([OWN, *parts])
    listed.append(_heading(OWN))
    for name, of in groupby(own, key=lambda row: row.notebook):
        title = _title(notebooks[name])
        listed += [f"### {title}", *(_line(title, row.caption, "own.md", label="") for row in of), ""]
    results = [_line(title, words, "../figures/cmu/index.md") for title, words, _ in _results(root, rows)]
    places = "\n".join([*names, "own", "../figures/cmu/index"])
    pages[f"{FOLDER}/index.md"] = INDEX.format(pages=places, listed="\n".join([*listed, _heading(COMMITTED), *results]))
    for row in rows:
        if row.kind == "figure" and (found := kept[row.notebook].get(row.stem)):
            pages[f"{FOLDER}/{row.stem}.png"] = b64decode(found.content)
    return pages


def committed_page(root: Path) -> str:
    """All committed tables and pictures of CMU: what each shows, in words, and links to its files.

    Args:
        root: a checkout. A table is named by its grid, a picture by its exhibit or else by its alternative text.
    """
    parts = [COMMITTED]
    for title, words, file in _results(root, read_manifest(root / "figures" / "manifest.yaml")):
        parts += [f"## {title}", f"{words}.", _committed(file, ""), ""]
    return "\n\n".join(parts)


def _results(root: Path, rows: Sequence[Exhibit]) -> list[tuple[str, str, Path]]:
    """Title, words and file of every committed result of CMU."""
    folder, grids = root / "figures" / "cmu", root / "figures" / "grids.yaml"
    said = {name.removeprefix("cmu/"): row.caption for row in rows for name in row.committed}
    said |= {name: grid.title for name, grid in read_grids(grids).items()}
    files = sorted([*folder.glob("*.md"), *folder.glob("*.png")])
    return [(f.stem.replace("_", " ").capitalize(), (said.get(f.stem) or _alt(f)).rstrip("."), f) for f in files]


def _line(title: str, caption: str, page: str, label: str | None = None) -> str:
    """One exhibit in the index: the first sentence about it, linked to the heading that it stands under, which is its label."""
    anchor = re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")  # as MyST makes them
    (sentence,) = re.findall(r"^.+?(?=\.(?: [A-Z]|$)|$)", " ".join(caption.split()))
    label = f"{title}: " if label is None else label
    return f"* {label}[{sentence}]({page}#{anchor})"


def _heading(page: str) -> str:
    return f"#{page.splitlines()[0]}\n"


def _in_the_paper(row: Exhibit) -> tuple[str, int, str]:
    """Figures before tables, by number."""
    kind, number = re.fullmatch(r"(\D+?)\s*(\d+).*", row.paper["item"]).groups()  # pyright: ignore[reportOptionalMemberAccess]
    return kind, int(number), row.notebook


def _item(title: str, rows: Sequence[Exhibit], root: Path, kept: Mapping[str, Mapping[str, Kept]]) -> str:
    return "\n\n".join([f"## {title}", *(_exhibit(row, root, kept) for row in rows), ""])


def _exhibit(row: Exhibit, root: Path, kept: Mapping[str, Mapping[str, Kept]]) -> str:
    """Caption, what is shown, and where it comes from."""
    chapter = f"[{row.notebook}](../notebooks/{row.notebook}.ipynb)"
    if row.committed:
        shown = [_committed(_file(root / "figures" / name), "../figures/cmu/") for name in row.committed]
        return "\n\n".join([row.caption, *shown, f"On real people. The chapter {chapter} makes the like on the embedded data."])
    found = kept[row.notebook].get(row.stem)
    if found is None:
        return f"{row.caption}\n\nThe chapter {chapter} shows it."
    shown = found.content if row.kind == "table" else _picture(f"{row.stem}.png", found.alt)
    return "\n\n".join([row.caption, shown, f"From {chapter}."])


def _file(place: Path) -> Path:
    found = [file for file in (place.with_suffix(".md"), place.with_suffix(".png")) if file.is_file()]
    if not found:
        raise ValueError(f"{place}.md and {place}.png are missing; the manifest says that one of them is committed")
    return found[0]


def _committed(file: Path, folder: str) -> str:
    shown = file.read_text(encoding="utf-8") if file.suffix == ".md" else _picture(folder + file.name, _alt(file))
    beside = [file.with_suffix(kind) for kind in (".csv", ".json", ".pdf") if file.with_suffix(kind).is_file()]
    words = {".csv": "numbers", ".json": "data and settings", ".pdf": "for print"}
    links = ", ".join(f"[{words[path.suffix]}]({folder}{path.name})" for path in beside)
    return f"{shown}\n\n{links}" if links else shown


def _alt(file: Path) -> str:
    return file.with_suffix(".txt").read_text(encoding="utf-8").strip()


def _picture(place: str, alt: str) -> str:
    return f"```{{image}} {place}\n:alt: {json.dumps(' '.join(alt.split()), ensure_ascii=False)}\n```"


def _title(notebook: Mapping[str, Any]) -> str:
    return "".join(notebook["cells"][0]["source"]).splitlines()[0].lstrip("# ")
