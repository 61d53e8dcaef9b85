"""The list of exhibits, and the page of a build: every exhibit with its files, and results believed only if they are of today."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest
import yaml

from mwlib.course.exhibits import write_index
from mwlib.course.notebooks import FILES, course, exhibits_kept, read_manifest, source_hash
from mwlib.data.sources import data_fingerprint
from mwlib.experiments.results import parameters_hash, write_result
from mwlib.files import write_atomic
from mwlib.hashing import package_hash
from tests.sample_notebooks import bare, save

ROW = {
    "id": "own-bands", "kind": "figure", "caption": "Energy & bands", "notebook": "01_sample", "stem": "bands",
    "files": list(FILES["figure"]), "data": "synthetic", "status": "made",
}  # fmt: skip


def write_manifest(folder: Path, *rows: dict) -> Path:
    path = folder / "manifest.yaml"
    path.write_text(yaml.safe_dump({"exhibits": list(rows)}))
    return path


def test_what_the_course_keeps_is_what_the_manifest_promises():
    """Each exhibit once; pictures are described, tables are tables."""
    made = {(row.notebook, row.stem): row for row in read_manifest() if row.status == "made"}
    kept = [((path.stem, stem), out) for path in course() for stem, out in exhibits_kept(json.loads(path.read_text("utf-8")))]
    assert sorted(key for key, _ in kept) == sorted(made)
    for key, output in kept:
        if made[key].kind == "figure":
            assert "image/png" in output["data"] and output["metadata"]["image/png"]["alt"], key
        else:
            assert "".join(output["data"]["text/html"]).startswith("<table"), key


@pytest.mark.parametrize(
    "rows, message",
    [
        ([{**ROW, "status": "soon"}], "row 1.*status is 'soon'"),
        ([{**ROW, "kind": "movie"}], "row 1.*kind is 'movie'"),
        ([{**ROW, "caption": ""}], "row 1.*caption is ''"),
        ([{**ROW, "files": ["png"]}], "row 1.*files lack"),
        ([{**ROW, "id": "Two Words"}], "row 1.*lower-case"),
        ([{**ROW, "paper": {"item": "Table 1"}}], "row 1.*expected 'system' and 'item'"),
        ([{**ROW, "colour": "blue"}], "row 1.*has .*'colour'.*expected"),
        ([ROW, ROW], "the same id twice"),
        ([ROW, {**ROW, "id": "other"}], "the same notebook and stem twice"),
    ],
)
def test_manifest_names_what_is_wrong(tmp_path, rows, message):
    path = write_manifest(tmp_path, *rows)
    with pytest.raises(ValueError, match=f"(?s){re.escape(str(path))}.*{message}"):
        read_manifest(path)


@pytest.mark.parametrize("text", ["- a", "exhibits: {a: 1}", "exhibits: [a]", "a: ]", "exhibits: []\nexhibits: []"])
def test_a_manifest_that_is_none_is_told(tmp_path, text):
    (tmp_path / "manifest.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"manifest\.yaml( holds| is not YAML|, line 2: 'exhibits' is already)"):
        read_manifest(tmp_path / "manifest.yaml")


def write_exhibit(folder: Path, stem: str, rows: list[list], *, picture: bool) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{stem}.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    (folder / f"{stem}.json").write_text(json.dumps({"figure": stem, "preset": "tiny", "data": "synthetic", "seeds": [0, 1]}))
    if picture:
        (folder / f"{stem}.txt").write_text('Bars of "four" *bands* <x>.\n')
        (folder / f"{stem}.png").write_bytes(b"png")


def write_done(build: Path, notebook: Path, data: str = "synthetic", changes: dict | None = None) -> None:
    """The result of a run that is done, as run-notebook writes it."""
    depends = {"data": {"source": data, "files": data_fingerprint(data)}, "notebook": source_hash(notebook)}
    depends |= {"mwlib": package_hash()} | (changes or {})
    values = {"preset": "tiny", "data": data, "level": 2, "lr": 0.5, "names": ["haar", "db2"]}
    write_result(build / notebook.stem, {}, parameters_hash(values), depends)


@pytest.mark.parametrize(
    "changes, given, problem",
    [
        ({}, [], ""),
        ({}, ["preset=tiny", "data={data}"], ""),
        ({}, ["preset=laptop", "data={data}"], "out of date: another parameters now"),
        ({"notebook": "x"}, [], "out of date: another notebook now"),
        ({"mwlib": "x"}, [], "out of date: another library now"),
        ({"modules": ["mwlib"]}, [], "out of date: another library now"),
        ({"data": {}}, [], "out of date: another data now"),
    ],
)
def test_index_believes_a_result_only_if_it_is_of_today(tmp_path, changes, given, problem):
    notebook, data = save(bare(), tmp_path), str(tmp_path / "data")
    write_atomic(tmp_path / "data" / "a.bvh", "a")
    write_done(tmp_path / "build", notebook, data, changes)

    def page(*words: str) -> str:
        return write_index(tmp_path / "build", [notebook], write_manifest(tmp_path), words).read_text()

    told = page(*(word.format(data=data) for word in given))
    assert ('<span class="missing">' in told) == bool(problem) and problem in told
    if not problem:
        (tmp_path / "data" / "a.bvh").touch()
        assert '<span class="missing">' not in page()
        write_atomic(tmp_path / "data" / "b.bvh", "b")
        assert "out of date: another data now" in page()


def test_index_lives_with_broken_files_and_odd_names(tmp_path):
    build = tmp_path / "build"
    for stem, text in (("half", '{"figure"'), ("list", "[]"), ("bytes", "\udcff")):
        write_exhibit(build / "01_sample", stem, [["x"]], picture=False)
        (build / "01_sample" / f"{stem}.json").write_text(text, errors="surrogateescape")
    write_exhibit(build / "01_sample" / "#1?", "50% a", [["x"]], picture=True)
    page = write_index(build, [], write_manifest(tmp_path)).read_text()
    for stem in ("half", "list", "bytes"):
        assert f"<li>01_sample/{stem}: " in page
    assert 'href="01_sample/%231%3F/50%25%20a.csv"' in page and 'src="01_sample/%231%3F/50%25%20a.png"' in page


def test_index_shows_what_was_made_and_says_what_is_missing(tmp_path):
    build, notebooks = tmp_path / "build", [tmp_path / "01_sample.ipynb", tmp_path / "02_other.ipynb"]
    write_exhibit(build / "01_sample", "bands", [["x"], [1]], picture=True)
    errors = [["method", "ADE"], ["<ours> | `a`", 0.56789], *(["n", n] for n in range(60))]
    write_exhibit(build / "01_sample" / "tables", "errors", errors, picture=False)
    for path in notebooks:
        save(bare(), tmp_path, path.stem)
    write_done(build, notebooks[0])
    (build / "01_sample" / "notebook.html").write_text("")
    (build / "02_other").mkdir()
    (build / "02_other" / "metrics.json").write_text('{"status": "ok"')  # half-written
    paper = {"paper": {"system": "MotionWavelet", "item": "Table 1"}, "kind": "table", "files": ["csv", "json"]}
    absent = {**ROW, **paper, "id": "absent", "stem": "absent", "caption": "Errors of all"}
    planned = {**absent, "id": "planned", "stem": "planned", "status": "planned"}
    page = write_index(build, notebooks, write_manifest(tmp_path, ROW, absent, planned)).read_text()
    assert 'src="01_sample/bands.png" alt="Bars of &quot;four&quot; *bands* &lt;x&gt;."' in page
    assert "Energy &amp; bands" in page and "data: synthetic · preset: tiny · seeds: 0, 1" in page
    assert '<a href="01_sample/bands.csv">numbers</a>' in page and '<a href="01_sample/bands.txt">' in page
    assert (
        '<th scope="col">ADE</th>' in page and "<td>&lt;ours&gt; | `a`</td><td>0.568</td>" in page
    )  # not listed, shown all the same
    assert page.count("<tr>") == 61 and "The first 60 of 61 rows; all are in the CSV file." in page
    assert "Table 1" in page and "Not in this build." in page and "Not in this build: no notebook makes it yet." in page
    assert '<a href="01_sample/notebook.html">01_sample</a></li>' in page
    assert '02_other <span class="missing">not finished</span>' in page
    assert not re.search(r"""(src|href)=["'](https?:)?//""", page)  # self-contained
