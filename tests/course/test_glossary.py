"""The glossary: sorted, without doubles, true to the chapters it names, and no symbol of a chapter's table is missing."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from mwlib.course.notebooks import NOTEBOOKS, chapter_number, course

ROW = re.compile(r"^\|(?P<cells>.*)\|$", re.M)
LINK = re.compile(r"\[(\w+)\]\((\S+)\)")
SYMBOLS = re.compile(r"^\|[^|\n]*symbol[^|\n]*\|.*\n\|[ :|-]+\n((?:\|.*\n?)+)", re.M | re.I)
COMMA = re.compile(r",(?![^{(]*[})])")  # not within brackets


class Entry(NamedTuple):
    word: str
    symbols: set[str]
    meaning: str
    unit: str
    chapter: str  # its number
    file: str


def entries(text: str) -> list[Entry]:
    """The rows of the glossary's table."""
    rows = [[cell.strip() for cell in row["cells"].split(" | ")] for row in ROW.finditer(text)]
    assert rows[0] == ["word", "symbol", "meaning", "shape, unit", "chapter"] and all(len(row) == 5 for row in rows[2:])
    return [Entry(row[0], symbols(row[1]), row[2], row[3], *LINK.fullmatch(row[4]).groups()) for row in rows[2:]]


def symbols(cell: str) -> set[str]:
    """Each symbol of a cell: what stands between dollars, up to a comma or an equals sign."""
    parts = [part for formula in re.findall(r"\$([^$]+)\$", cell) for part in COMMA.split(formula)]
    return {found for part in parts if (found := part.split("=")[0].strip())}


def prose(path: Path) -> str:
    """A chapter's sources in lower case, without marks of emphasis, on one line."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return " ".join("\n".join("".join(cell["source"]) for cell in cells).replace("*", "").split()).casefold()


def tabled(path: Path) -> set[str]:
    """The symbols in the first column of a chapter's tables of symbols."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    texts = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    rows = [row for text in texts for table in SYMBOLS.findall(text) for row in table.strip().split("\n")]
    return {symbol for row in rows for symbol in symbols(row.split("|")[1])}


GLOSSARY = entries((NOTEBOOKS / "glossary.md").read_text(encoding="utf-8"))
CHAPTERS = {chapter_number(path): path for path in course()}


def test_words_are_sorted_and_none_stands_twice():
    words = [entry.word.casefold() for entry in GLOSSARY]
    assert len(words) > 100 and all(before < after for before, after in pairwise(words))


@pytest.mark.parametrize("number", CHAPTERS)
def test_a_chapter_uses_the_words_that_it_is_said_to_define(number):
    text = prose(CHAPTERS[number])
    mine = [entry for entry in GLOSSARY if entry.chapter == number]
    assert [entry.word for entry in mine if entry.word.casefold() not in text] == []
    assert {entry.file for entry in mine} <= {CHAPTERS[number].name}


def test_every_chapter_named_exists_and_every_meaning_is_a_sentence():
    assert {entry.chapter for entry in GLOSSARY} <= set(CHAPTERS)
    assert [entry.word for entry in GLOSSARY if not re.fullmatch(r"[A-Z].{10,}\.", entry.meaning)] == []


@pytest.mark.parametrize("number", CHAPTERS)
def test_no_symbol_of_a_chapters_table_is_missing(number):
    """It is explained at that chapter or before."""
    known = {symbol for entry in GLOSSARY if entry.chapter <= number for symbol in entry.symbols}
    assert tabled(CHAPTERS[number]) - known == set()


def test_a_table_of_symbols_is_read():
    assert symbols(r"$\mathbf y=\mathbf D\mathbf x$; $\epsilon_{\mathrm{a},t}$, $K,D$ (a, b)") == {
        r"\mathbf y", r"\epsilon_{\mathrm{a},t}", "K", "D",
    }  # fmt: skip
    assert {r"\gamma", r"t_\gamma(k)", "P_k"} < tabled(CHAPTERS["12"])


def test_a_reader_gets_there():
    assert "](glossary.md)" in prose(CHAPTERS["00"])
    assert "](notebooks/glossary.md)" in (NOTEBOOKS.parent / "README.md").read_text(encoding="utf-8")
