"""Every notebook runs as papermill runs it: it prints what is committed, and leaves the exhibits that the manifest promises.

Own choice: one run serves both questions. nbval would run each notebook a second time to compare the same cells. A run of the
same notebook, code, data and settings, by `make figures` or an earlier `make test`, is not repeated.
"""

from __future__ import annotations

import json
from pathlib import Path

import nbformat
import pytest
from nbformat import NotebookNode

from mwlib.course.execute import EXECUTED, PICTURES, filter_notebook, run_notebook
from mwlib.course.notebooks import LONGEST, chapter_number, course, read_manifest, read_parameters, tags

KEPT = Path(__file__).parents[1] / "build" / "executed"  # as in the Makefile
COMPARED = "nbval-check-output"  # nbval's own tag, so that it can compare these cells, too


def first_long() -> list[Path]:
    """First the one whose model others wait for, beside a long one that does not; then those that are shorter."""
    order = [*LONGEST, "05b", "09", "05"]
    places = {number: place for place, number in enumerate(order)}
    return sorted(course(), key=lambda path: places.get(chapter_number(path), len(order)))


@pytest.mark.parametrize("path", first_long(), ids=lambda path: path.stem)
def test_notebook_prints_what_is_committed_and_leaves_its_exhibits(path, tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_EXECUTED", str(KEPT))
    offered = read_parameters(json.loads(path.read_text(encoding="utf-8")))
    assert offered["data"].default != "synthetic"  # by the preset alone; a parameter of another value must arrive
    folder = run_notebook(path, tmp_path, {"data": "synthetic"}, page=False)
    assert compared(nbformat.read(folder / EXECUTED, as_version=4)) == compared(nbformat.read(path, as_version=4))
    for row in read_manifest():
        if row.notebook == path.stem and row.status == "made":
            seeded = bool({"seed", "seeds"} & set(offered))
            check_exhibit({kind: folder / f"{row.stem}.{kind}" for kind in row.files}, seeded)


def compared(notebook: NotebookNode) -> dict[str, list[dict]]:
    """What the cells show that are to be the same in every run, by the cell's id; of pictures only that there are some."""
    filter_notebook(notebook)
    shown = {cell.id: cell.outputs for cell in notebook.cells if COMPARED in tags(cell)}
    return {name: [_without_pixels(output) for output in outputs] for name, outputs in shown.items()}


def _without_pixels(output: NotebookNode) -> dict:
    data = {kind: "" if kind in PICTURES else text for kind, text in output.get("data", {}).items()}
    return {"text": output.get("text", ""), "data": data}


def check_exhibit(files: dict[str, Path], seeded: bool) -> None:
    """All files are there, the picture is described, and the provenance names what the exhibit depends on."""
    assert all(file.stat().st_size > 0 for file in files.values())
    about = set(json.loads(files["json"].read_text()))
    assert {"data", "preset"} <= about and (not seeded or {"seed", "seeds"} & about), files["json"]
    if "txt" in files:
        assert len(files["txt"].read_text()) > 20, files["txt"]
