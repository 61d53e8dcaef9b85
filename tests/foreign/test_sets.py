"""The foreign sets are what they are said to be; the quick half of the chapters gets to its end on the first, or refuses it."""

from __future__ import annotations

import pytest
import torch

from mwlib.course.claims import read_chapter
from mwlib.course.execute import run_notebook
from mwlib.course.notebooks import NOTEBOOKS, find_notebook
from mwlib.data.load import load_motions
from mwlib.experiments.page import Refused
from tests.foreign.__main__ import quick
from tests.foreign.playing import play
from tests.foreign.sets import SETS, make_sets

SHORT = ("00", "01", "05", "05b", "09")
OF_SENTENCES = ("12", "13")


@pytest.fixture(scope="module")
def sets(tmp_path_factory):
    return make_sets(tmp_path_factory.mktemp("sets"))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """One folder of runs: the model that one chapter trains is there for the next."""
    return tmp_path_factory.mktemp("runs")


def test_the_sets_differ_from_the_embedded_people_in_all_that_a_chapter_may_rely_on(sets):
    read = {name: load_motions(folder) for name, folder in sets.items()}
    assert {*read} == {*SETS} and len(read["one"]) == 1 and len(read["few"]) == 3
    assert len({clip.skeleton for clip in read["two_skeletons"]}) == 2
    assert [len(read[name][0].skeleton) for name in ("five", "hands", "few", "archive")] == [5, 65, 22, 17]
    assert not read["five"][0].skeleton.left
    assert {clip.fps for clip in read["rates"]} == {10.0, 24.0, 240.0}
    assert {round(clip.duration) for clip in read["still"]} == {4, 12, 16, 60}


@pytest.fixture
def played(sets, runs, tmp_path, monkeypatch, unchecked):
    """Plays a chapter here, where all is imported, on three clips of another skeleton."""
    monkeypatch.setenv("MW_STATIC", "1")
    monkeypatch.setenv("MWLIB_RUNS", str(runs))
    monkeypatch.chdir(NOTEBOOKS)

    def act(number):
        path = find_notebook(number)
        with torch.random.fork_rng():
            play(path, {"preset": quick(path, "tiny", tmp_path), "data": str(sets["few"])})

    return act


@pytest.mark.parametrize("number", SHORT)
def test_a_short_chapter_gets_to_its_end_on_three_clips_of_another_skeleton(number, played, capsys):
    played(number)
    assert " hold here, " in capsys.readouterr().out


@pytest.mark.parametrize("number", OF_SENTENCES)
def test_a_chapter_of_sentences_refuses_motions_without_any_at_its_head(number, played):
    with pytest.raises(Refused, match="found no list of clips; expected one of .* beside captions"):
        played(number)


def test_a_chapter_leaves_its_claims_in_a_folder(sets, tmp_path):
    run_notebook(find_notebook("02"), tmp_path, {"data": str(sets["few"])}, page=False)
    assert (chapter := read_chapter(tmp_path)).status == "ok" and chapter.claims
