"""A notebook's page: what it shows, what it writes, and what it refuses."""

from __future__ import annotations

import csv
import json
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from mwlib import __version__
from mwlib.data.sources import data_fingerprint
from mwlib.experiments import page as page_module
from mwlib.experiments.page import Page
from mwlib.experiments.results import REFUSED, RESULT, parameters_hash, read_result, result_of
from mwlib.prediction.config import Config

PARAMETERS = {"preset": "tiny", "data": "", "seed": 3}
ALT = "A line that rises from zero to one."
ROWS = [{"method": "a", "ADE": (0.51234, 0.1)}, {"method": "b", "ADE": (0.6, 0.2)}]


@pytest.fixture
def shown(monkeypatch):
    """What was displayed, in order."""
    found = []
    monkeypatch.setattr("IPython.display.display", lambda content, **extra: found.append(content))
    return found


@pytest.fixture
def line():
    fig, ax = plt.subplots(figsize=(2, 1))
    ax.plot([0, 1])
    yield fig
    plt.close(fig)


def page_in(out="", source="synthetic", **parameters) -> Page:
    return Page("01_sample", str(out), Config.preset("tiny", data=source), **(PARAMETERS | parameters))


def provenance_of(file) -> dict:
    return json.loads(file.read_text())


def test_a_picture_is_shown_and_saved_with_its_origin(tmp_path, shown, line):
    out = tmp_path / "new"
    page_in(out).show(line, "fig_a", ALT, {"x": torch.arange(2.0), "peak": 1.0})
    assert [picture["text/plain"] for picture in shown] == [ALT]
    assert {path.name for path in out.iterdir()} == {f"fig_a.{end}" for end in ("png", "pdf", "csv", "txt", "json")}
    assert (out / "fig_a.csv").read_text() == "x,peak\n0,1\n1,\n"
    assert (out / "fig_a.txt").read_text() == ALT + "\n"
    assert provenance_of(out / "fig_a.json") == {
        "figure": "fig_a", "notebook": "01_sample", "version": __version__, "preset": "tiny", "data": "synthetic", "seed": 3,
    }  # fmt: skip


def test_without_out_everything_is_shown_and_nothing_written(tmp_path, shown, line, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = page_in()
    for _ in range(2):  # a reader runs a cell again
        page.show(line, "fig_a", ALT, {"x": [1]})
        page.table(ROWS, "table_a")
        page.finish({"answer": 1})
    assert len(shown) == 4 and not list(tmp_path.iterdir())


def test_a_table_is_shown_in_part_and_saved_whole(tmp_path, shown):
    page = page_in(tmp_path)
    page.table(ROWS, "table_a", ["ADE"])
    page.table(ROWS, "table_b", data=[{"x": 1}])
    page.table(ROWS)
    assert [table.header for table in shown] == [("ADE",), ("method", "ADE"), ("method", "ADE")]
    with (tmp_path / "table_a.csv").open() as file:
        assert list(csv.reader(file)) == [["method", "ADE", "ADE, deviation"], ["a", "0.51234", "0.1"], ["b", "0.6", "0.2"]]
    assert (tmp_path / "table_b.csv").read_text() == "x\n1\n"
    assert {path.name for path in tmp_path.iterdir()} == {f"table_{x}.{end}" for x in "ab" for end in ("csv", "json")}
    assert provenance_of(tmp_path / "table_b.json")["table"] == "table_b"


def test_a_call_may_say_another_origin(tmp_path, shown, line):
    page = page_in(tmp_path, "cmu/asfamc")
    page.provenance["windows"] = 24
    page.show(line, "fig_a", ALT, {"x": [1]}, provenance={"data": "synthetic", "seeds": [0, 1]})
    page.table(ROWS, "table_a")
    here, usual = (provenance_of(tmp_path / f"{stem}.json") for stem in ("fig_a", "table_a"))
    assert (here["data"], here["seeds"], here["windows"]) == ("synthetic", [0, 1], 24)
    assert (usual["data"], usual["windows"]) == ("cmu/asfamc", 24) and "seeds" not in usual
    assert "mocap.cs.cmu.edu" in usual["acknowledgement"]


@pytest.mark.parametrize("recorded", [True, False])
@pytest.mark.parametrize(
    "change, error, message",
    [
        ({"data": None}, ValueError, "data are empty"),
        ({"data": {}}, ValueError, "data are empty"),
        ({"alt": " "}, ValueError, "alternative text is empty"),
        ({"stem": "a/fig"}, ValueError, "without a folder"),
        ({"provenance": {"x": np.arange(2)}}, TypeError, "not JSON serializable"),
    ],
)
def test_what_cannot_be_saved_is_refused_even_where_nothing_is_saved(tmp_path, shown, line, recorded, change, error, message):
    arguments = {"fig": line, "stem": "fig_a", "alt": ALT, "data": {"x": [1]}} | change
    with pytest.raises(error, match=message):
        page_in(tmp_path if recorded else "").show(**arguments)
    assert not shown and not list(tmp_path.iterdir())


def test_a_stem_is_saved_once(tmp_path, shown, line):
    page = page_in(tmp_path)
    page.show(line, "fig_a", ALT, {"x": [1]})
    with pytest.raises(ValueError, match="'fig_a', which this page has saved already"):
        page.table(ROWS, "fig_a")
    page.show(line, None, ALT)
    page.show(line, None, ALT)
    assert len(shown) == 3


def test_finish_writes_the_result_under_the_hash_of_the_parameters(tmp_path):
    page_in(tmp_path).finish({"answer": 1.5})
    assert read_result(tmp_path, parameters_hash(PARAMETERS), "finished") == {"answer": 1.5}
    assert read_result(tmp_path, parameters_hash(PARAMETERS | {"seed": 4}), "finished") is None
    assert read_result(tmp_path, parameters_hash(PARAMETERS)) is None, "only run-notebook knows whether every cell ran"


def test_the_result_names_what_it_depends_on(tmp_path, monkeypatch):
    (tmp_path / "a.bvh").write_text("x")
    monkeypatch.setattr(page_module, "models_used", {"a-run": "abc"})
    page_in(tmp_path / "out", str(tmp_path / "a.bvh")).finish({})
    depends = result_of(tmp_path / "out")["depends"]
    assert {"mwlib", "mwlib.experiments.page", "mwlib.prediction.config"} < set(depends.pop("modules"))
    assert depends == {
        "parameters": parameters_hash(PARAMETERS), "settings": Config.preset("tiny", data=str(tmp_path / "a.bvh")).hash(),
        "data": {"source": str(tmp_path / "a.bvh"), "files": data_fingerprint(str(tmp_path / "a.bvh"))},
        "models": {"a-run": "abc"},
    }  # fmt: skip


@pytest.mark.parametrize(
    "more", [lambda page, fig: page.show(fig, None, ALT), lambda page, fig: page.table(ROWS), lambda page, fig: page.finish({})]
)
def test_what_comes_after_the_end_takes_the_result_away(tmp_path, shown, line, more):
    page = page_in(tmp_path)
    page.finish({"answer": 1})
    with pytest.raises(RuntimeError, match="after page.finish; expected page.finish as the notebook's last call"):
        more(page, line)
    assert not shown and not (tmp_path / RESULT).exists()


def test_a_new_page_deletes_the_result_of_an_earlier_run(tmp_path):
    page_in(tmp_path).finish({"answer": 1})
    page_in(tmp_path)
    assert not (tmp_path / RESULT).exists()


@pytest.mark.parametrize("recorded", [True, False])
def test_a_result_that_json_cannot_hold_is_refused(tmp_path, recorded):
    with pytest.raises(TypeError, match="Tensor is not JSON serializable"):
        page_in(tmp_path if recorded else "").finish({"answer": torch.ones(1)})
    assert not list(tmp_path.iterdir())


CLAIM = "the samples stride less than the truth"
STORED = {"sentence": CLAIM, "holds": True, "numbers": {"samples": 0.22, "truth": 0.41}}


@pytest.fixture
def committed(tmp_path, monkeypatch):
    """A course whose notebook stores its claims, made with the default parameters."""
    key = parameters_hash(PARAMETERS | {"data": "synthetic"})
    mark = {"mwlib": {"claims": [STORED], "parameters": key}}
    (tmp_path / "notebooks").mkdir()
    tree = {"cells": [{"cell_type": "markdown"}, {"outputs": [{"output_type": "stream"}, {"metadata": mark}]}]}
    (tmp_path / "notebooks" / "01_sample.ipynb").write_text(json.dumps(tree))
    monkeypatch.setattr(page_module, "course_folder", lambda: tmp_path)


@pytest.mark.parametrize("holds", [0.22 < 0.41, np.bool_(True), torch.tensor(True)])
def test_a_claim_that_holds_is_said_with_its_numbers(shown, capsys, holds):
    page = page_in()
    page.claim(CLAIM, holds, samples=torch.tensor(0.22), truth=np.float32(0.41))
    assert capsys.readouterr().out == f"✓ {CLAIM} (samples 0.220, truth 0.410)\n"
    page.finish({})
    assert shown[0].header == ("claim", "embedded people")
    assert shown[0].rows == ((CLAIM, "holds (samples 0.220, truth 0.410)"),)


@pytest.mark.parametrize("stored", [True, False])
@pytest.mark.parametrize(
    "holds, numbers, told",
    [
        (False, {"samples": 0.5}, "does not hold (samples 0.500)"),
        (None, {}, "cannot be said"),
        (True, {"error": np.nan}, "cannot be said (error –)"),
        (True, {"error": None}, "cannot be said (error –)"),
        (True, {"error": np.inf}, "cannot be said (error –)"),
    ],
)
def test_with_the_default_parameters_a_claim_must_hold(request, stored, holds, numbers, told):
    if stored:
        request.getfixturevalue("committed")
    with pytest.raises(AssertionError, match=re.escape(f"{CLAIM}: {told}")):
        page_in().claim(CLAIM, holds, **numbers)


@pytest.mark.parametrize("other", [{"seed": 4}, {"preset": "laptop"}, {"source": "cmu/asfamc"}])
def test_with_other_parameters_it_is_recorded_beside_what_holds_on_the_embedded_people(tmp_path, shown, capsys, committed, other):
    page = page_in(tmp_path / "out", **other)
    assert "not the chapter's default parameters" in capsys.readouterr().out
    page.claim(CLAIM, False, truth=0.25, samples=0.5)
    page.claim("another", None)
    told = capsys.readouterr().out.splitlines()
    here, there = "does not hold (truth 0.250, samples 0.500)", "holds (truth 0.410, samples 0.220)"
    assert told == [f"✗ {CLAIM}: {here} here; embedded people: {there}", "– another: cannot be said here"]
    page.finish({"ADE": float("nan")})
    assert shown[0].rows == ((CLAIM, f"✗ {here}", there), ("another", "– cannot be said", "–"))
    assert "Of 2 claims 0 hold here, 1 do not, 1 cannot be said." in capsys.readouterr().out
    result = result_of(tmp_path / "out")
    assert result["claims"][0] == {"sentence": CLAIM, "holds": False, "numbers": {"samples": 0.5, "truth": 0.25}}
    assert result["claims"][1]["holds"] is None and result["metrics"] == {"ADE": None}


def test_the_data_of_the_preset_by_name_are_the_default(shown, capsys, committed):
    page = page_in(source="synthetic", data="synthetic")
    with pytest.raises(AssertionError):
        page.claim(CLAIM, False)
    assert "default parameters" not in capsys.readouterr().out


def test_a_claim_is_made_once_where_it_is_written(tmp_path, shown):
    for out, again in (("", True), (tmp_path, False)):
        page = page_in(out)
        page.claim(CLAIM, True)
        if again:
            page.claim(CLAIM, True)
        else:
            with pytest.raises(ValueError, match="is made twice"):
                page.claim(CLAIM, True)


def test_a_number_is_a_number(shown):
    with pytest.raises(ValueError, match="could not convert"):
        page_in().claim(CLAIM, True, samples="many")


def test_what_is_left_out_is_said_once_and_kept(tmp_path, shown, capsys):
    page, sentence = page_in(tmp_path), "no strides are compared: this skeleton has no feet"
    assert page.can(True, sentence) and not page.can(torch.tensor(False), sentence) and not page.can(0, sentence)
    assert capsys.readouterr().out == f"Left out: {sentence}.\n"
    page.finish({})
    assert result_of(tmp_path)["left_out"] == [sentence]


def test_data_that_lack_what_all_needs_are_refused_without_a_traceback(shown):
    page = page_in()
    page.needs(2, "this chapter needs two windows")
    with pytest.raises(page_module.Refused, match="needs two windows") as caught:
        page.needs([], "this chapter needs two windows; these motions have none")
    assert caught.value._render_traceback_() == ["Refused: this chapter needs two windows; these motions have none"]
    assert page_module.Refused.__name__ == REFUSED


@pytest.mark.parametrize("error", [ValueError, FileNotFoundError])
def test_what_cannot_be_loaded_is_refused_with_its_sentence(error):
    def load(cfg):
        if cfg == "none":
            raise error("no test clips: add one")
        return [cfg]

    assert page_in().load(load, "clip") == ["clip"]
    with pytest.raises(page_module.Refused, match="no test clips: add one"):
        page_in().load(load, "none")
