"""Stored outputs are matched with the stems of the source, cell by cell, without running anything."""

from __future__ import annotations

import json
from base64 import b64encode

import pytest

from mwlib.course.manifest import read_manifest
from mwlib.course.notebooks import course
from mwlib.course.outputs import alternative_texts, kept_outputs
from tests.sample_notebooks import code


def shown(source: str, *outputs: str) -> dict:
    """A cell with its outputs: words that begin with "<" are tables, others pictures, whose alternative text they are."""
    cell = code(source)
    for text in outputs:
        kind = "text/html" if text.startswith("<") else "image/png"
        content = text if text.startswith("<") else b64encode(text.encode()).decode() + "\n"
        metadata = {} if text.startswith("<") else {kind: {"alt": text}}
        cell.outputs.append({"output_type": "display_data", "data": {kind: content, "text/plain": ""}, "metadata": metadata})
    return cell


def told(*cells: dict) -> dict[str, str]:
    return {stem: kept.alt or kept.content for stem, kept in kept_outputs({"cells": list(cells)}).items()}


HELPER = "def report(stem):\n    page.table(rows, stem)\n    page.table(changes)\n    page.show(fig, 'fig_' + stem, alt, x)"


def test_pictures_and_tables_of_one_cell():
    cell = shown('page.show(fig, "fig_a", alt, x)\npage.table(rows, "table_a")\npage.show(fig, "fig_b", alt, x)', "a", "<a>", "b")
    assert told(cell) == {"fig_a": "a", "table_a": "<a>", "fig_b": "b"}


def test_what_has_no_stem_takes_its_place_all_the_same():
    cell = shown(
        'page.show(fig, None, alt)\npage.show(fig, "fig_a", alt, x)\npage.table(rows)\npage.table(rows, "t")',
        "-",
        "a",
        "<->",
        "<t>",
    )
    assert told(cell) == {"fig_a": "a", "t": "<t>"}


def test_a_loop_shows_pass_after_pass():
    source = 'for n in "ab":\n    page.show(fig, f"x_{n}", alt, x)\n    page.show(fig, f"y_{n}", alt, x)'
    source = source.replace('"ab"', '("a", "b")')
    assert told(shown(source, "xa", "ya", "xb", "yb")) == {"x_a": "xa", "y_a": "ya", "x_b": "xb", "y_b": "yb"}


def test_a_helper_shows_where_it_is_called():
    first, second = shown('report("a")', "<a>", "<->", "a"), shown('made = report("b")\nprint(made)', "<b>", "<->", "b")
    expected = {"a": "<a>", "fig_a": "a", "b": "<b>", "fig_b": "b"}
    assert told(code(HELPER), first, code("x = 1"), second) == expected


def test_outputs_that_do_not_match_their_calls_are_left_out():
    assert told(shown('if predict:\n    page.show(fig, "fig_a", alt, x)\npage.show(fig, "fig_b", alt, x)', "b")) == {}


def test_alternative_texts_go_by_the_picture():
    notebook = {
        "cells": [shown("page.show(fig, None, 'one')", "one"), code("print(1)"), shown("page.show(a, None, b)", "two", "<t>")]
    }
    assert alternative_texts(notebook) == {b64encode(text.encode()).decode(): text for text in ("one", "two")}


@pytest.mark.parametrize("path", course(), ids=lambda path: path.stem)
def test_every_exhibit_of_the_course_is_found(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    kept = kept_outputs(notebook)
    rows = {row.stem: row for row in read_manifest() if row.notebook == path.stem and row.status == "made"}
    assert rows.keys() - kept.keys() == set(), "the site shows these; expected one output for each call of the page in a cell"
    for stem, row in rows.items():
        assert kept[stem].alt if row.kind == "figure" else kept[stem].content.startswith("<table"), stem
        assert f'"{stem[:6]}' in str(notebook["cells"]) or stem[:6] in str(notebook["cells"])
