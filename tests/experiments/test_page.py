"""A notebook's page: what it shows, what it writes, and what it refuses."""

from __future__ import annotations

import csv
import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from mwlib import __version__
from mwlib.data.sources import data_fingerprint
from mwlib.experiments import page as page_module
from mwlib.experiments.page import Page
from mwlib.experiments.results import RESULT, parameters_hash, read_result, result_of
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
    page.table(ROWS, "table_a", ["ADE"], better={"ADE": "lower"})
    page.table(ROWS, "table_b", data=[{"x": 1}])
    page.table(ROWS)
    assert [table.header for table in shown] == [("ADE",), ("method", "ADE"), ("method", "ADE")]
    assert shown[0].best == {(0, 0)}
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
