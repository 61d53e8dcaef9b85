"""What Sphinx is given: every page listed, every link's file there, solutions folded, exhibits in the paper's order."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
import yaml

from mwlib.course.exhibits import exhibit_pages
from mwlib.course.learner import BLANK
from mwlib.course.notebooks import read_manifest
from mwlib.course.site import site_copy, site_text, write_site_sources
from tests.sample_notebooks import code, model_notebook

ROOT = Path(__file__).parents[2]
LINK = re.compile(
    r"(?<!`)\[(?:\\.|[^\]\\])*\]\(([^)#\s]+)(?:#[^)]*)?\)|<((?:executed|learner)/[^>]+)>`|^```\{(?:image|literalinclude)\} (\S+)",
    re.M,
)


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    (folder / ".index.md.1.part").write_text("cut by a kill")
    written = write_site_sources(folder, ROOT)
    assert {file for file in folder.rglob("*") if file.is_file()} == set(written)
    return folder


def test_the_same_checkout_gives_the_same_pages(sources):
    page = "00_start_here.ipynb"
    notebook = nbformat.read(ROOT / "notebooks" / page, as_version=4)
    first, second = (nbformat.writes(site_copy(notebook, page)) for _ in range(2))
    assert first == second


def texts(folder: Path) -> dict[str, str]:
    """Pages in Markdown, notebooks by their Markdown cells."""
    found = {file.relative_to(folder).as_posix(): file.read_text(encoding="utf-8") for file in folder.rglob("*.md")}
    for file in (folder / "notebooks").glob("*.ipynb"):
        cells = nbformat.read(file, as_version=4).cells
        found[f"notebooks/{file.name}"] = "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    return found


def entries(folder: Path, page: str) -> set[str]:
    """The pages that the lists of a page name."""
    text, found = (folder / page).read_text(encoding="utf-8"), set()
    lists = re.findall(r"^```\{toctree\}\n(.*?)^```", text, re.M | re.S) + re.findall(r"^\.\. toctree::\n(.*)", text, re.M | re.S)
    for line in "\n".join(lists).split("\n"):
        if line.strip() and not line.strip().startswith(":"):
            named = [file for kind in ("md", "rst", "ipynb") for file in (folder / page).parent.glob(f"{line.strip()}.{kind}")]
            assert named, f"{page} lists {line}, which is no page"
            found |= {file.resolve().relative_to(folder.resolve()).as_posix() for file in named}
    return found


def test_every_page_is_listed_from_the_first_one_on(sources):
    seen, todo = set(), ["index.md"]
    while todo:
        page = todo.pop()
        seen.add(page)
        todo += sorted(entries(sources, page) - seen) if not page.endswith(".ipynb") else []
    pages = {file.relative_to(sources).as_posix() for kind in ("md", "rst") for file in sources.rglob(f"*.{kind}")}
    pages |= {f"notebooks/{file.name}" for file in (ROOT / "notebooks").glob("*.ipynb")}
    orphans = {page for page in pages if (sources / page).read_text(encoding="utf-8").startswith("---\norphan: true")}
    assert pages - seen == orphans and all("card" in page for page in orphans)


def test_every_link_has_its_file(sources):
    missing, links = [], 0
    for page, text in texts(sources).items():
        for found in LINK.findall(re.sub(r"^```(?!\{).*?^```", "", text, flags=re.M | re.S)):
            place = "".join(found)
            if not re.match(r"[a-z]+:", place) and "`" not in place and "[" not in place:
                links += 1
                missing += [f"{page}: {place}"] if not ((sources / page).parent / place).exists() else []
    assert missing == [] and links > 150


@pytest.mark.parametrize("system", ["MotionWavelet", "FreqDiffusionBridge"])
def test_every_exhibit_of_the_paper_is_there_in_its_order(sources, system):
    text = (sources / "exhibits" / f"{system.lower()}.md").read_text(encoding="utf-8")
    titles = re.findall(r"^## (.*)$", text, re.M)
    items = {row.paper["item"] for row in read_manifest() if row.paper.get("system") == system}
    assert sorted(titles) == sorted(items)
    places = [(title.split()[0], int(title.split()[1])) for title in titles]
    assert places == sorted(places) and places[0] == ("Fig.", 1) and places[-1][0] == "Table"
    own = (sources / "exhibits" / "own.md").read_text(encoding="utf-8")
    for row in read_manifest():
        if row.paper.get("system", system) == system:
            assert row.caption in (text if row.paper else own)
    assert "shows it." not in text, "an exhibit has neither a committed result nor an output"
    assert text.count("![") >= 5 and "![]" not in text


def test_the_index_says_what_each_exhibit_is(sources):
    text = (sources / "exhibits" / "index.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\* (?:(.+): )?\[(.+)\]\((.+\.md)#(.+)\)$", text, re.M)
    assert [line for line in lines if len(line[1].split()) < 2 or line[1].endswith(".")] == []
    said, headings = {(label, words) for label, words, *_ in lines}, {}
    for row in read_manifest():
        assert any(label == row.paper.get("item", "") and row.caption.startswith(words) for label, words in said), row.id
    for _, _, page, anchor in lines:
        titles = re.findall(r"^## (.*)$", (sources / "exhibits" / page).read_text(encoding="utf-8"), re.M)
        headings[page] = {re.sub(r"[^\w-]", "", title.lower().replace(" ", "-")) for title in titles}
        assert anchor in headings[page], f"{page} has no heading {anchor}"
    assert len(headings) == 5 and len(lines) == len(read_manifest()) + len(headings["../figures/cmu/index.md"])


def test_every_committed_result_is_named_in_words(sources):
    _, *parts = re.split(r"^## .*\n\n", (sources / "figures" / "cmu" / "index.md").read_text(encoding="utf-8"), flags=re.M)
    shown = [*(ROOT / "figures" / "cmu").glob("*.md"), *(ROOT / "figures" / "cmu").glob("*.png")]
    assert len(parts) == len(shown) and [part for part in parts if not re.match(r"[A-Z0-9][^|`\n]{10,}[^.]\.\n\n", part)] == []


def test_committed_results_come_first(tmp_path):
    root = tmp_path / "root"
    row = next(
        row for row in yaml.safe_load((ROOT / "figures" / "manifest.yaml").read_text())["exhibits"] if row.get("committed")
    )
    row |= {
        "committed": ["cmu/table_9"],
        "notebook": "01_sample",
        "stem": "table_01_squares",
        "kind": "table",
        "files": ["csv", "json"],
    }
    (root / "figures" / "cmu").mkdir(parents=True)
    (root / "figures" / "manifest.yaml").write_text(yaml.safe_dump({"exhibits": [row]}))
    (root / "figures" / "grids.yaml").write_text("grids: {}")
    notebooks = {"01_sample": model_notebook()}
    with pytest.raises(ValueError, match=r"table_9\.md and .*table_9\.png are missing"):
        exhibit_pages(root, notebooks)
    (root / "figures" / "cmu" / "table_9.md").write_text("| measured |\n|---|\n| 5 |\n")
    (root / "figures" / "cmu" / "table_9.csv").write_text("measured\n5\n")
    page = exhibit_pages(root, notebooks)["exhibits/motionwavelet.md"]
    assert "| 5 |" in page and "[numbers](../figures/cmu/table_9.csv)" in page and "On real people." in page


def test_solutions_are_folded_and_nothing_else_is():
    notebook = model_notebook()
    before = nbformat.writes(notebook)
    page = site_copy(notebook, "01_sample.ipynb")
    folded = [cell for cell in page.cells if "hide-cell" in cell.metadata.get("tags", [])]
    assert [cell.source for cell in folded] == ["twice = 2 * level"] and "mystnb" in folded[0].metadata
    assert len(page.cells) == len(notebook.cells) + 1 and "<learner/01_sample.ipynb>" in page.cells[1].source
    assert nbformat.writes(notebook) == before


def test_a_notebook_without_solutions_offers_no_copy_without():
    assert "learner" not in site_copy(nbformat.v4.new_notebook(cells=[code("1")]), "x.ipynb").cells[1].source


def test_downloads_are_the_committed_notebooks_and_the_learners(sources):
    for file in (ROOT / "notebooks").glob("*.ipynb"):
        assert (sources / "notebooks" / "executed" / file.name).read_bytes() == file.read_bytes()
    assert BLANK in "".join(
        cell.source for cell in nbformat.read(sources / "notebooks/learner/01_dwt_from_scratch.ipynb", 4).cells
    )


def test_anchors_of_claims_become_targets():
    assert site_text('a\n\n### <a id="x-1"></a>T\n[all](figures/cmu)') == "a\n\n(x-1)=\n### T\n[all](figures/cmu/index.md)"
    chapter = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell(text) for text in ("# T", "[all](../figures/cmu)")])
    assert site_copy(chapter, "02_a.ipynb").cells[2].source == "[all](../figures/cmu/index.md)"


def test_the_library_is_listed(sources):
    """Sphinx goes on from the rooms to their modules; `make test-site` looks for the page of each."""
    index = (sources / "api" / "index.rst").read_text(encoding="utf-8")
    public, rooms = index.split("Public names")[1].split("Rooms\n")
    assert "   ~mwlib.data.load.load_motions\n" in public and index.index(">>>") < index.index("Public names")
    found = {file.stem for file in (ROOT / "mwlib").iterdir() if file.suffix == ".py" or (file / "__init__.py").exists()}
    assert set(re.findall(r"   mwlib\.(\w+)$", rooms, re.M)) == {name for name in found if not name.startswith("_")}


def test_a_folder_that_is_no_checkout_is_told(tmp_path):
    with pytest.raises(FileNotFoundError, match="REPRODUCTION.md"):
        write_site_sources(tmp_path / "out", tmp_path)
