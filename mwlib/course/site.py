"""The sources of the site, laid out for Sphinx from the repository as it lies: nothing is executed.

Chapters, committed results and texts keep their places relative to each other, so that the links between them hold.
"""

import re
from collections.abc import Mapping
from importlib import import_module
from inspect import getdoc, ismodule
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import nbformat
from nbformat import NotebookNode

from mwlib.course.exhibits import committed_page, exhibit_pages
from mwlib.course.learner import COPIES, badges, launched_copy, learner_copy, repository, source_of, without
from mwlib.course.notebooks import CHAPTER, FOLDED, WRONG, chapter_number, exhibits_kept, tags, title_of
from mwlib.experiments.results import rendered
from mwlib.files import sweep, write_atomic

TEXTS = ("REPRODUCTION.md", "RESULTS.md", "CONTRIBUTING.md", "notebooks/glossary.md")
DETAILS = "results"  # folder of one page a system
SOURCES = ("index.md", "chapters.md", "claims.md", "any-motions.md", "believed.md", "howto", "live", "_static")  # of docs/
PLAYED = {
    "01": "wavelet",
    "05": "number",
    "07": "futures",
    "11": "between",
    "13": "sentences",
}  # chapter -> its page of docs/live
EXAMPLES = {"howto/curves_system.py": "tests/experiments/curves_system.py"}  # shown on a page, and tested where it lies
PROMPTS = {"solution": "solution", "guard": "check of the numbers above"}
ANCHOR = re.compile(r'^(#+) <a id="([\w-]+)"></a>', re.M)
CHAPTERS = "{chapters}\n"  # stands in docs/chapters.md for the cards
TAUGHT = r"^\| \[{stem}\]\([^)]*\) \| (.*?) \|"  # in README's table of the course
FOLDER_LINK = re.compile(r"\]\((\.\./)?figures/cmu/?\)")
FOLDER_PAGE = r"](\1figures/cmu/index.md)"


def write_site_sources(folder: Path, root: Path) -> list[Path]:
    """Lay out everything that Sphinx turns into the site.

    Args:
        folder: where to; made if missing.
        root: a checkout, with docs/, notebooks/ and figures/.

    Returns:
        The files written.

    Raises:
        FileNotFoundError: the checkout lacks one of its texts; the message names it.
        ValueError: the manifest, or a notebook, is not valid.
    """
    details = [file.relative_to(root).as_posix() for file in sorted((root / DETAILS).glob("*.md"))]
    pages: dict[str, str | bytes] = {name: site_text((root / name).read_text(encoding="utf-8")) for name in [*TEXTS, *details]}
    for source in SOURCES:
        for file in _files(root / "docs" / source):
            pages[file.relative_to(root / "docs").as_posix()] = file.read_bytes()
    pages |= {name: (root / place).read_bytes() for name, place in EXAMPLES.items()}
    for card in sorted((root / "mwlib" / "models").glob("*/card.md")):
        pages[card.relative_to(root).as_posix()] = "---\norphan: true\n---\n" + card.read_text(encoding="utf-8")
    trees, address = {}, repository(root)
    for path in sorted((root / "notebooks").glob("*.ipynb")):
        trees[path.stem] = tree = nbformat.read(path, as_version=4)
        launch = badges(address, path.name) if CHAPTER.fullmatch(chapter_number(path)) else ""
        pages[f"notebooks/{path.name}"] = nbformat.writes(site_copy(tree, path.name, launch))
        if launch:
            pages[f"{COPIES}/{path.name}"] = nbformat.writes(launched_copy(tree, source_of(address)))
        pages[f"notebooks/executed/{path.name}"] = path.read_bytes()
        pages[f"notebooks/learner/{path.name}"] = nbformat.writes(learner_copy(tree))
    for name in ("cmu", "lafan1", "bandai_namco", "synthetic", "claims.yaml", "verdicts.png"):
        for file in _files(root / "figures" / name):
            if file.suffix != ".md":
                pages[file.relative_to(root).as_posix()] = file.read_bytes()
    pages |= exhibit_pages(root, trees)
    pages["figures/cmu/index.md"] = committed_page(root)
    cards = chapter_cards(trees, (root / "README.md").read_text(encoding="utf-8"), address)
    pages["chapters.md"] = (root / "docs" / "chapters.md").read_text(encoding="utf-8").replace(CHAPTERS, cards)
    pages["api/index.rst"] = library_page()
    for place in {(folder / name).parent for name in pages}:
        sweep(place)
    for name, content in pages.items():
        write_atomic(folder / name, content)
    return [folder / name for name in pages]


def library_page() -> str:
    """The page of the public names and the rooms, in reStructuredText; Sphinx makes those of the modules from the docstrings."""
    package = import_module("mwlib")
    public = [getattr(package, name) for name in package.__all__ if not name.startswith("_")]
    places = [thing.__name__ if ismodule(thing) else f"{thing.__module__}.{thing.__qualname__}" for thing in public]
    rooms = [f"mwlib.{found.name}" for found in iter_modules(package.__path__) if not found.name.startswith("_")]
    return rendered("course/library.rst.jinja", example=getdoc(package), public=places, rooms=rooms)


def chapter_cards(notebooks: Mapping[str, Mapping[str, Any]], readme: str, address: str) -> str:
    """The chapters as Markdown: of each its first picture, title, what README says that it teaches, and where it opens.

    Args:
        notebooks: trees of the executed notebooks, by name.
        readme: with the table of the course.
        address: of the repository, or empty.
    """
    chapters = []
    for stem, tree in notebooks.items():
        pictures = ((name, out) for name, out in exhibits_kept(tree) if "image/png" in out["data"])
        taught = re.search(TAUGHT.format(stem=stem), readme, re.MULTILINE)
        if taught and (first := next(pictures, None)):
            chapters.append((stem, title_of(tree), taught[1], first[0], first[1]["metadata"]["image/png"]["alt"]))
    return rendered("course/chapters.md.jinja", chapters=chapters, badges_of=lambda name: badges(address, name))


def site_text(text: str) -> str:
    """A text of the repository as a page: its HTML anchors become targets that Sphinx checks.

    >>> print(site_text('### <a id="lossless"></a>The transform loses nothing'))
    (lossless)=
    ### The transform loses nothing
    """
    return FOLDER_LINK.sub(FOLDER_PAGE, ANCHOR.sub(r"(\2)=\n\1 ", text))


def site_copy(notebook: NotebookNode, name: str, launch: str = "") -> NotebookNode:
    """A notebook as a page: solutions and guards are folded away, and the notebook itself can be had below its title.

    Args:
        notebook: as committed, executed.
        name: of its file.
        launch: links that open it elsewhere.
    """
    copy = without(notebook, "mwlib")
    copy.cells = [_folded(cell) for cell in notebook.cells]
    text = f"*This page is a notebook. Download it {{download}}`as it is here <executed/{name}>`,"
    if any("solution" in tags(cell) for cell in notebook.cells):
        text += f" {{download}}`without its solutions <learner/{name}>`,"
    text += f"{f' open it in {launch},' if launch else ''} or run `make lab`.*"
    if (page := PLAYED.get(name.partition("_")[0])) is not None:
        text += f"\n\n*Play with it in your browser: [{page}](../live/{page}.md).*"
    copy.cells.insert(1, nbformat.v4.new_markdown_cell(text, id="downloads"))
    return copy


def _folded(cell: NotebookNode) -> NotebookNode:
    """Solutions in words fold themselves: the structure rules of the notebooks see to it. Links to folders go to their pages."""
    cell = without(cell, WRONG)
    if cell.cell_type == "markdown":
        cell.source = FOLDER_LINK.sub(FOLDER_PAGE, cell.source)
    if cell.cell_type == "code" and (kind := next((name for name in FOLDED if name in tags(cell)), "")):
        prompts = {"code_prompt_show": f"Show the {PROMPTS[kind]}", "code_prompt_hide": f"Hide the {PROMPTS[kind]}"}
        cell.metadata = NotebookNode(tags=[*tags(cell), "hide-cell"], mystnb=prompts)
    return cell


def _files(place: Path) -> list[Path]:
    """A file, or all files of a folder.

    Raises:
        FileNotFoundError: there is neither.
    """
    if not place.exists():
        raise FileNotFoundError(f"{place} is missing; expected a checkout of the repository, with its docs/")
    return [place] if place.is_file() else sorted(file for file in place.rglob("*") if file.is_file())
