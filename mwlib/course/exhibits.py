"""Pages of exhibits: what a build made, what the site shows, and all committed results, in one form.

Exhibits are written as Markdown. Sphinx reads it as it is; a build's `index.html` is the same turned into HTML.
"""

import csv
import json
import os
import re
from base64 import b64decode
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import quote

from nbconvert.filters.markdown import markdown2html

from mwlib.course.claims import read_build, summed_up
from mwlib.course.execute import PAGE, outdated

from mwlib.course.notebooks import (  # isort: skip
    MANIFEST, Exhibit, exhibits_kept, from_text, read_manifest, read_notebook, read_parameters, resolve,
)  # fmt: skip
from mwlib.data.sources import data_fingerprint
from mwlib.experiments.grids import read_grids
from mwlib.experiments.results import parameters_hash
from mwlib.files import write_atomic
from mwlib.plots import significant

FIRST = ("data", "preset", "seed", "seeds")
LINKS = {"csv": "numbers", "pdf": "for print", "txt": "alternative text", "json": "data and settings"}
LONGEST_TABLE = 60  # rows shown; the CSV has them all
FOLDER = "exhibits"  # of the site
COMMITTED_PAGE = "../figures/cmu/index"
INTRODUCTION = """# Tables and figures of {name}

In the paper's order. Where a result on real people is committed with the software, it is shown, with the data, settings and
seeds that stand beside it. Everything else is what the chapter shows on the embedded
synthetic data at the preset `tiny`; it shows how the thing is made, and its numbers hold for those data alone."""
INDEX = """# Exhibits

Every table and figure. The pages say where each comes from, and on which data.

```{{toctree}}
:hidden:
{pages}
```

{listed}
"""
OWN = """# The chapters' own exhibits

What the chapters show beside the tables and figures of the papers, on the embedded synthetic data at the preset `tiny`."""
COMMITTED = """# Results on real people

Measured on clips of the CMU motion capture database. The settings beside each table say which clips, people and seeds.
[RESULTS.md](../../RESULTS.md) says what they show. The data used in this project was obtained from mocap.cs.cmu.edu.
The database was created with funding from NSF EIA-0196217."""
OWN_TITLE = "The course's own"
BUILD = """# Figures and tables: {name}

Each exhibit says on which data, with which preset and seeds it was made. Numbers hold for those and for nothing else.

## Notebooks"""


def write_index(build: Path, notebooks: Sequence[Path], manifest: Path = MANIFEST, given: Sequence[str] = ()) -> Path:
    """Write `index.html` into a build folder: every exhibit with its caption, data, preset and seeds.

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
    (found, broken), stems = saved_exhibits(build), {path.stem for path in notebooks}
    rows = [row for row in read_manifest(manifest) if row.notebook in stems]
    fingerprint = cache(data_fingerprint)
    parts = [BUILD.format(name=build.resolve().name)]
    parts.append("\n".join(_notebook(build, path, given, fingerprint) for path in notebooks))
    parts += _claims(build, [path.stem for path in notebooks])
    if broken:
        parts += ["## Saved, but not readable", "\n".join(f"* {_plain(problem)}" for problem in broken)]
    contents = ["## Contents"]
    for system, items in in_order(rows).items():
        parts.append(heading := f"## {f'The tables and figures of {system}' if system else OWN_TITLE}")
        contents.append(f"**{heading.removeprefix('## ')}**\n")
        for item, row in ((item, row) for item, of in items.items() for row in of):
            title, anchor = f"{item}: {first_sentence(row.caption)}", f"{row.notebook}-{row.stem}"
            contents.append(f"* [{title}](#{anchor})")
            rest = " ".join(row.caption.split()).removeprefix(first_sentence(row.caption)).strip(". ")
            parts += [f'<h3 id="{anchor}">{escape(title)}</h3>', *([rest + "."] if rest else []), _built(row, found)]
    parts[2:2] = ["\n".join(contents)] if rows else []
    listed = {(row.notebook, row.stem) for row in rows}
    if unlisted := {key: text for key, text in found.items() if key not in listed}:
        parts.append("## Saved, but not listed in the manifest")
        for (notebook, stem), text in unlisted.items():
            parts += [f"### {_plain(stem.replace('_', ' ').capitalize())} ({_plain(notebook)})", text]
    template = Template(resources.files("mwlib.course").joinpath("index.html").read_text(encoding="utf-8"))
    title = escape(f"Figures and tables: {build.resolve().name}")
    write_atomic(build / "index.html", template.substitute(title=title, body=markdown2html("\n\n".join(parts))))
    return build / "index.html"


def _notebook(build: Path, path: Path, given: Sequence[str], fingerprint: Callable[[str], str]) -> str:
    """A line about one notebook: a link to its page, and why its result does not count, if it does not."""
    tree = read_notebook(path)
    wanted = parameters_hash(resolve(offered := read_parameters(tree), from_text(offered, list(given)))) if given else None
    problem = outdated(build / path.stem, tree, wanted, fingerprint)
    page = f"{path.stem}/{PAGE}"
    line = f"[{_plain(path.stem)}]({quote(page)})" if (build / page).is_file() else _plain(path.stem)
    return f"* {line}" + (f' <span class="missing">{_plain(problem)}</span>' if problem else "")


def _claims(build: Path, names: Sequence[str]) -> list[str]:
    """How many of the chapters' claims hold on the motions of a build, and which do not."""
    chapters = read_build(build, names)
    if not (sentence := summed_up(chapters)):
        return []
    lines = [
        f"* {_plain(name.partition('_')[0])}, {_plain(claim.sentence)}: {_plain(claim.told())}"
        for name, chapter in chapters.items()
        for claim in chapter.claims.values()
        if not claim.holds
    ]
    return ["## What holds on these motions", sentence, "\n".join(lines)]


def _built(row: Exhibit, found: Mapping[tuple[str, str], str]) -> str:
    planned = ": no notebook makes it yet" if row.status == "planned" else ""
    return found.get((row.notebook, row.stem), f'<p class="missing">Not in this build{planned}.</p>')


def saved_exhibits(build: Path) -> tuple[dict[tuple[str, str], str], list[str]]:
    """What notebooks saved under a build folder, as Markdown by (notebook, stem); and what could not be read, with the reason.

    A picture or table is a `stem.json` (provenance) beside a `stem.csv`; the .json is written last, so what has one is complete.
    """
    found, broken = {}, []
    for sidecar in sorted(build.glob("[0-9][0-9]*_*/**/*.json")):
        if sidecar.with_suffix(".csv").is_file():
            try:
                shown = from_files(sidecar, quote(Path(os.path.relpath(sidecar.parent, build)).as_posix()) + "/")
                found[sidecar.relative_to(build).parts[0], sidecar.stem] = f"{shown}\n\n{_facts(sidecar)}"
            except (OSError, ValueError, csv.Error) as error:
                broken.append(f"{sidecar.relative_to(build).with_suffix('')}: {error}")
    return found, broken


def from_files(file: Path, place: str) -> str:
    """A picture or table that lies in a folder, as Markdown, with links to the files beside it.

    Args:
        file: any of its files.
        place: where the folder is, seen from the page; ends in a slash.
    """
    near = {kind: file.with_suffix(f".{kind}") for kind in ("png", "md", *LINKS) if file.with_suffix(f".{kind}").is_file()}
    if "png" in near:
        shown = picture(place + quote(near["png"].name), _text(near["txt"]) if "txt" in near else "")
    else:
        shown = _text(near["md"]) if "md" in near else _table(near["csv"])
    links = ", ".join(f"[{words}]({place}{quote(near[kind].name)})" for kind, words in LINKS.items() if kind in near)
    return f"{shown}\n\n{links}" if links else shown


def picture(place: str, alt: str) -> str:
    """A picture as Markdown."""
    return f"![{_plain(alt)}]({place})"


def _facts(sidecar: Path) -> str:
    """The provenance of an exhibit: the first facts as a line that unfolds to the others."""
    told = json.loads(_text(sidecar))
    if not isinstance(told, dict):
        raise ValueError(f"its .json holds {str(told)[:40]!r}; expected a mapping")
    names = [name for name in dict.fromkeys((*FIRST, *told)) if name in told and name != "figure"]
    lines = {name: f"{escape(name)}: {escape(_value(told[name]))}" for name in names}
    rest = "".join(f"<li>{line}</li>" for name, line in lines.items() if name not in FIRST)
    return f"<details><summary>{' · '.join(lines[name] for name in names if name in FIRST)}</summary><ul>{rest}</ul></details>"


def _value(value: Any) -> str:
    """A JSON value as a reader wants it: no brackets, no quotes."""
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_value(part)}" for name, part in value.items())
    if isinstance(value, list):
        return ", ".join(map(_value, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _table(file: Path) -> str:
    """A CSV file as an HTML table, its first rows at least."""
    with file.open(newline="", encoding="utf-8") as lines:
        header, *rows = [[escape(_short(cell)) for cell in row] for row in csv.reader(lines)] or [[]]
    head = "".join(f'<th scope="col">{cell}</th>' for cell in header)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows[:LONGEST_TABLE])
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    more = f"\n\nThe first {LONGEST_TABLE} of {len(rows)} rows; all are in the CSV file."
    return table + (more if len(rows) > LONGEST_TABLE else "")


def _short(cell: str) -> str:
    """Numbers with a fraction to three digits: the CSV has them all."""
    try:
        return significant(float(cell)) if cell.strip("-").count(".") or "e" in cell else cell
    except ValueError:
        return cell


def _plain(text: str) -> str:
    """A text as Markdown that shows just this text, on one line."""
    return re.sub(r"([\\`*_\[\]<>&$#|~])", r"\\\1", " ".join(text.split()))


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8").strip()


def in_order(rows: Sequence[Exhibit]) -> dict[str, dict[str, list[Exhibit]]]:
    """Exhibits by system and by the paper's item, in its order; last, under an empty name, the chapters' own by notebook."""
    systems = {row.paper["system"]: {} for row in rows if row.paper}
    for row in sorted((row for row in rows if row.paper), key=_place_in_paper):
        systems[row.paper["system"]].setdefault(row.paper["item"], []).append(row)
    own: dict[str, list[Exhibit]] = {}
    for row in rows:
        if not row.paper:
            own.setdefault(row.notebook, []).append(row)
    return {**systems, **({"": own} if own else {})}


def _place_in_paper(row: Exhibit) -> tuple[str, int, str]:
    """Figures before tables, by number."""
    kind, number = re.fullmatch(r"(\D+?)\s*(\d+).*", row.paper["item"]).groups()  # pyright: ignore[reportOptionalMemberAccess]
    return kind, int(number), row.notebook


def exhibit_pages(root: Path, notebooks: Mapping[str, Mapping[str, Any]]) -> dict[str, str | bytes]:
    """The site's pages of exhibits, and the pictures on them.

    Args:
        root: a checkout.
        notebooks: trees of the executed notebooks, by name.

    Returns:
        Files by their places in the site's sources; exhibits/index.md lists the pages.

    Raises:
        ValueError: the manifest is not valid, names a committed result that is missing, or a notebook that is.
    """
    rows = read_manifest(root / "figures" / "manifest.yaml")
    kept = {(name, stem): output for name, tree in notebooks.items() for stem, output in exhibits_kept(tree)}
    titles = {name: "".join(tree["cells"][0]["source"]).splitlines()[0].lstrip("# ") for name, tree in notebooks.items()}
    pages: dict[str, str | bytes] = {}
    listed = []
    for system, items in in_order(rows).items():
        name = re.sub(r"[^a-z0-9]+", "-", system.lower()) or "own"
        parts = [INTRODUCTION.format(name=system) if system else OWN]
        listed += [f"## {system or _heading(OWN)}", ""]
        for item, of in items.items():
            title = item if system else titles[item]
            listed += [] if system else [f"### {title}"]
            listed += [_line(title, row.caption, f"{name}.md", label=system and title) for row in of] + [""] * (not system)
            parts += [f"## {title}", *(text for row in of for text in (row.caption, *_on_site(row, root, kept)))]
        pages[f"{FOLDER}/{name}.md"] = "\n\n".join([*parts, ""])
        listed.append("")
    results = [_line(title, words, f"{COMMITTED_PAGE}.md", title) for title, words, _ in _results(root, rows)]
    places = "\n".join([*(Path(page).stem for page in pages), COMMITTED_PAGE])
    listed = "\n".join([*listed, f"## {_heading(COMMITTED)}", "", *results])
    pages[f"{FOLDER}/index.md"] = INDEX.format(pages=places, listed=listed)
    for row in rows:
        if "image/png" in (data := kept.get((row.notebook, row.stem), {}).get("data", {})):
            pages[f"{FOLDER}/{row.stem}.png"] = b64decode("".join(data["image/png"]))
    return pages


def _on_site(row: Exhibit, root: Path, kept: Mapping[tuple[str, str], Mapping[str, Any]]) -> list[str]:
    """What is shown of an exhibit, and where it comes from."""
    chapter = f"[{row.notebook}](../notebooks/{row.notebook}.ipynb)"
    if row.committed:
        shown = [from_files(_file(root / "figures" / name), "../figures/cmu/") for name in row.committed]
        return [*shown, f"On real people. The chapter {chapter} makes the like on the embedded data."]
    if (row.notebook, row.stem) not in kept:
        return [f"The chapter {chapter} shows it."]
    output = kept[row.notebook, row.stem]
    if "image/png" in output["data"]:
        return [picture(f"{row.stem}.png", output["metadata"]["image/png"]["alt"]), f"From {chapter}."]
    return ["".join(output["data"]["text/html"]).strip(), f"From {chapter}."]


def _file(place: Path) -> Path:
    found = [file for file in (place.with_suffix(".md"), place.with_suffix(".png")) if file.is_file()]
    if not found:
        raise ValueError(f"{place}.md and {place}.png are missing; the manifest says that one of them is committed")
    return found[0]


def committed_page(root: Path) -> str:
    """All committed tables and pictures of CMU: what each shows, in words, and links to its files.

    Args:
        root: a checkout. A table is named by its grid, a picture by its exhibit or else by its alternative text.
    """
    results = _results(root, read_manifest(root / "figures" / "manifest.yaml"))
    return "\n\n".join([COMMITTED, *(f"## {title}\n\n{words}.\n\n{from_files(file, '')}\n" for title, words, file in results)])


def _results(root: Path, rows: Sequence[Exhibit]) -> list[tuple[str, str, Path]]:
    """Title, words and file of every committed result of CMU."""
    folder = root / "figures" / "cmu"
    said = {name.removeprefix("cmu/"): row.caption for row in rows for name in row.committed}
    said |= {name: grid.title for name, grid in read_grids(root / "figures" / "grids.yaml").items()}
    files = sorted([*folder.glob("*.md"), *folder.glob("*.png")])
    words = [(said.get(file.stem) or _text(file.with_suffix(".txt"))).rstrip(".") for file in files]
    return [(file.stem.replace("_", " ").capitalize(), text, file) for file, text in zip(files, words, strict=True)]


def _line(title: str, caption: str, page: str, label: str) -> str:
    """One exhibit in the index: the first sentence about it, linked to the heading that it stands under."""
    anchor = re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")  # as MyST makes them
    return f"* {label + ': ' if label else ''}[{first_sentence(caption)}]({page}#{anchor})"


def first_sentence(text: str) -> str:
    """The first sentence, without its full stop."""
    return re.findall(r"^.+?(?=\.(?: [A-Z]|$)|$)", " ".join(text.split()))[0]


def _heading(page: str) -> str:
    return page.splitlines()[0].lstrip("# ")
