"""The foreign sets are what they are said to be; short chapters get to their end on the first."""

from __future__ import annotations

import pytest

from mwlib.course.claims import read_chapter
from mwlib.course.execute import run_notebook
from mwlib.course.notebooks import find_notebook
from mwlib.data.load import load_motions
from tests.foreign.sets import SETS, make_sets

SHORT = ("01", "02", "05", "05b")


@pytest.fixture(scope="module")
def sets(tmp_path_factory):
    return make_sets(tmp_path_factory.mktemp("sets"))


def test_the_sets_differ_from_the_embedded_people_in_all_that_a_chapter_may_rely_on(sets):
    read = {name: load_motions(folder) for name, folder in sets.items()}
    assert {*read} == {*SETS} and len(read["one"]) == 1 and len(read["few"]) == 3
    assert len({clip.skeleton for clip in read["two_skeletons"]}) == 2
    assert [len(read[name][0].skeleton) for name in ("five", "hands", "few", "archive")] == [5, 65, 22, 17]
    assert not read["five"][0].skeleton.left
    assert {clip.fps for clip in read["rates"]} == {10.0, 24.0, 240.0}
    assert {round(clip.duration) for clip in read["still"]} == {4, 12, 16, 60}


@pytest.mark.parametrize("number", SHORT)
def test_a_short_chapter_gets_to_its_end_on_three_clips_of_another_skeleton(number, sets, tmp_path):
    run_notebook(find_notebook(number), tmp_path, {"data": str(sets["few"])}, page=False)
    assert read_chapter(tmp_path).status == "ok"
