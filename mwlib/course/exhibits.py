"""Pages of exhibits: what a build made, what the site shows, and all committed results, in one form.

Exhibits are written as Markdown. Sphinx reads it as it is; a build's `index.html` is the same turned into HTML.
"""

import csv
import json
import re
from base64 import b64decode
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nbconvert.filters.markdown import markdown2html

from mwlib.course.claims import read_build, summed_up
from mwlib.course.execute import PAGE, outdated

from mwlib.course.notebooks import (  # isort: skip
    MANIFEST, Exhibit, exhibits_kept, from_text, read_manifest, read_notebook, read_parameters, resolve, title_of,
)  # fmt: skip
from mwlib.data.sources import data_fingerprint
from mwlib.experiments.grids import read_grids
from mwlib.experiments.results import parameters_hash, rendered
from mwlib.files import write_atomic
from mwlib.plots import significant

FOLDER = "exhibits"  # of the site
KINDS = ("png", "md", "csv", "pdf", "txt", "json")  # of files that belong to an exhibit


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
    chapters = read_build(build, [path.stem for path in notebooks])
    (found, broken), stems = saved_exhibits(build), {path.stem for path in notebooks}
    rows = [row for row in read_manifest(manifest) if row.notebook in stems]
    listed, fingerprint = {(row.notebook, row.stem) for row in rows}, cache(data_fingerprint)
    body = rendered(
        "course/build.md.jinja",
        name=build.resolve().name,
        notebooks=[_notebook(build, path, given, fingerprint) for path in notebooks],
        sections=in_order(rows),
        claims=summed_up(chapters),
        chapters=chapters,
        found=found,
        broken=broken,
        unlisted={key: text for key, text in found.items() if key not in listed},
        first_sentence=first_sentence,
        plain=_plain,
    )
    title = f"Figures and tables: {build.resolve().name}"
    write_atomic(build / "index.html", rendered("course/index.html.jinja", title=title, body=markdown2html(body)))
    return build / "index.html"


def _notebook(build: Path, path: Path, given: Sequence[str], fingerprint: Callable[[str], str]) -> tuple[str, str, str]:
    """Name of a notebook, where its page is, if it has one, and why its result does not count, if it does not."""
    tree = read_notebook(path)
    wanted = parameters_hash(resolve(offered := read_parameters(tree), from_text(offered, list(given)))) if given else None
    page = f"{path.stem}/{PAGE}"
    return path.stem, page if (build / page).is_file() else "", outdated(build / path.stem, tree, wanted, fingerprint)


def saved_exhibits(build: Path) -> tuple[dict[tuple[str, str], str], list[str]]:
    """What notebooks saved under a build folder, as Markdown by (notebook, stem); and what could not be read, with the reason.

    A picture or table is a `stem.json` (provenance) beside a `stem.csv`; the .json is written last, so what has one is complete.
    """
    found, broken = {}, []
    for sidecar in sorted(build.glob("[0-9][0-9]*_*/**/*.json")):
        if sidecar.with_suffix(".csv").is_file():
            place = quote(sidecar.parent.relative_to(build).as_posix()) + "/"
            try:
                told = json.loads(sidecar.read_text(encoding="utf-8"))
                if not isinstance(told, dict):
                    raise ValueError(f"its .json holds {str(told)[:40]!r}; expected a mapping")
                found[sidecar.relative_to(build).parts[0], sidecar.stem] = from_files(sidecar, place, told)
            except (OSError, ValueError, csv.Error) as error:
                broken.append(f"{sidecar.relative_to(build).with_suffix('')}: {error}")
    return found, broken


def from_files(file: Path, place: str, facts: Mapping[str, Any] | None = None) -> str:
    """A picture or table that lies in a folder, as Markdown, with links to the files beside it.

    Args:
        file: any of its files, with its ending or without.
        place: where the folder is, seen from the page; ends in a slash.
        facts: its provenance: the first facts become a line that unfolds to the others.

    Raises:
        ValueError: there are none.
    """
    near = {kind: found for kind in KINDS if (found := file.with_suffix(f".{kind}")).is_file()}
    if not near.keys() & {"png", "md", "csv"}:
        raise ValueError(f"{file}.md and {file}.png are missing; the manifest says that one of them is committed")
    rows: list[list[str]] = []
    if not {"png", "md"} & {*near}:
        with near["csv"].open(newline="", encoding="utf-8") as lines:
            rows = [*csv.reader(lines)] or [[]]
    told = {"near": near, "place": place, "facts": facts, "rows": rows, "value": _value, "plain": _plain, "short": _short}
    return rendered("course/exhibit.md.jinja", **told).rstrip()


def _value(value: Any) -> str:
    """A JSON value as a reader wants it: no brackets, no quotes."""
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_value(part)}" for name, part in value.items())
    if isinstance(value, list):
        return ", ".join(map(_value, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _short(cell: str) -> str:
    """Numbers with a fraction to three digits: the CSV has them all."""
    try:
        return significant(float(cell)) if "." in cell or "e" in cell else cell
    except ValueError:
        return cell


def _plain(text: str) -> str:
    """A text as Markdown that shows just this text, on one line."""
    return re.sub(r"([\\`*_\[\]<>&$#|~])", r"\\\1", " ".join(text.split()))


def in_order(rows: Sequence[Exhibit]) -> dict[str, dict[str, list[Exhibit]]]:
    """Exhibits by system and by the paper's item, in its order; last, under an empty name, the chapters' own by notebook."""
    found = {row.paper["system"]: {} for row in rows if row.paper}
    for row in sorted(rows, key=_place_in_paper):
        items = found.setdefault(row.paper.get("system", ""), {})
        items.setdefault(row.paper.get("item", row.notebook), []).append(row)
    return found


def _place_in_paper(row: Exhibit) -> tuple[str, int, str]:
    """Figures before tables, by number; behind them what is of no paper."""
    if not row.paper:
        return "~", 0, ""
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
    told = {
        "titles": {name: title_of(tree) for name, tree in notebooks.items()},
        "committed": lambda name: from_files(root / "figures" / name, "../figures/cmu/"),
        "page_of": lambda system: re.sub(r"[^a-z0-9]+", "-", system.lower()) or "own",
        "anchor": lambda title: re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-"),  # as MyST makes them
        "first_sentence": first_sentence,
        "plain": _plain,
        "results": _results(root, rows),
        "kept": kept,
        "sections": in_order(rows),
    }
    pages: dict[str, str | bytes] = {
        f"{FOLDER}/{told['page_of'](system)}.md": rendered("course/exhibits.md.jinja", system=system, items=items, **told)
        for system, items in told["sections"].items()
    }
    pages[f"{FOLDER}/index.md"] = rendered("course/exhibits_index.md.jinja", **told)
    for row in rows:
        if "image/png" in (data := kept.get((row.notebook, row.stem), {}).get("data", {})):
            pages[f"{FOLDER}/{row.stem}.png"] = b64decode("".join(data["image/png"]))
    return pages


def committed_page(root: Path) -> str:
    """All committed tables and pictures of CMU: what each shows, in words, and links to its files.

    Args:
        root: a checkout. A table is named by its grid, a picture by its exhibit or else by its alternative text.
    """
    results = _results(root, read_manifest(root / "figures" / "manifest.yaml"))
    return rendered("course/committed.md.jinja", results=results, from_files=from_files)


def _results(root: Path, rows: Sequence[Exhibit]) -> list[tuple[str, str, Path]]:
    """Title, words and file of every committed result of CMU."""
    folder = root / "figures" / "cmu"
    said = {name.removeprefix("cmu/"): row.caption for row in rows for name in row.committed}
    said |= {name: grid.title for name, grid in read_grids(root / "figures" / "grids.yaml").items()}
    files = sorted([*folder.glob("*.md"), *folder.glob("*.png")])
    words = {file: said.get(file.stem) or file.with_suffix(".txt").read_text(encoding="utf-8") for file in files}
    return [(file.stem.replace("_", " ").capitalize(), text.rstrip(".\n"), file) for file, text in words.items()]


def first_sentence(text: str) -> str:
    """The first sentence, without its full stop."""
    return re.findall(r"^.+?(?=\.(?: [A-Z]|$)|$)", " ".join(text.split()))[0]
