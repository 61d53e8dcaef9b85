"""Stems are read from a notebook's source wherever literals decide them; what a run decides is refused."""

from __future__ import annotations

import pytest

from mwlib.course.stems import saved_stems
from tests.sample_notebooks import code

HELPER = """
def report(name, stem="fig_c", *, rows=3):
    print(name)
    page.table(rows_of(name), stem, data=rows)
"""
SOURCES = {
    "written": ('page.show(fig, "fig_a", alt, {"x": x})\npage.table(rows, "table_a")', ["fig_a", "table_a"]),
    "by name": ('page.table(rows, columns=["x"], stem="table_a")', ["table_a"]),
    "shown only": ("page.show(fig, None, alt)\npage.table(rows)\nother.show(fig, 'fig_a')", []),
    "in a condition": ('if predict:\n    page.show(fig, "fig_a", alt, x)', ["fig_a"]),
    "assigned": ('stem = "fig_a"\npage.show(fig, stem, alt, x)', ["fig_a"]),
    "loop": ('for n in range(2):\n    page.show(fig, f"fig_{n + 1:02d}", alt, x)', ["fig_01", "fig_02"]),
    "loop over pairs": (
        'for n, (name, p) in enumerate({"a b": q(), "c": r()}.items()):\n'
        '    stem = f"fig_{n}_{name.replace(\' \', \'_\')}"\n    page.show(p, stem, alt, x)',
        ["fig_0_a_b", "fig_1_c"],
    ),
    "beside what is unknown": (
        'for name, p in zip(("a", "b"), futures, strict=True):\n    page.show(p, "fig_" + name, alt, x)', ["fig_a", "fig_b"],
    ),
    "helper": (HELPER + 'report("a", "fig_a")\nreport(b, stem="fig_b")\nreport("c")', ["fig_a", "fig_b", "fig_c"]),
    "helper in a loop": (HELPER + 'for n in ("a", "b"):\n    report(x[n], f"fig_{n}")', ["fig_a", "fig_b"]),
    "helper of a helper": (HELPER + 'def two(n):\n    report(n, f"fig_{n}")\n\ntwo("a")\n[two(n) for n in ("b", "c")]',
                           ["fig_a", "fig_b", "fig_c"]),
    "helper that nobody calls": (HELPER, []),
    "the same twice": ('for _ in range(2):\n    page.show(fig, "fig_a", alt, x)', ["fig_a", "fig_a"]),
}  # fmt: skip


@pytest.mark.parametrize("name", SOURCES)
def test_stems_are_read(name):
    source, stems = SOURCES[name]
    assert sorted(saved_stems({"cells": [code(source)]})) == stems


def test_a_helper_may_stand_in_another_cell():
    assert saved_stems({"cells": [code(HELPER), code("%magic"), code('report("a", "fig_a")')]}) == ["fig_a"]


@pytest.mark.parametrize(
    "source",
    [
        "page.show(fig, name(), alt, x)",
        "for stem in stems:\n    page.show(fig, stem, alt, x)",
        'stem = "fig_a"\nstem = "fig_b"\npage.show(fig, stem, alt, x)',
        HELPER + "report(1, f'fig_{settings.name}')",
    ],
)
def test_a_stem_that_only_a_run_can_tell_is_refused(source):
    with pytest.raises(ValueError, match="the stem in page.* cannot be read; expected a literal"):
        saved_stems({"cells": [code(source)]})
