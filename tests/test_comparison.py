"""The table of guidances and baselines: complete, resumable, honest about what it is."""

from __future__ import annotations

import csv
import json

import pytest

from mwlib import comparison, report
from mwlib.__main__ import main
from mwlib.config import Config
from mwlib.runs import split_motions
from tests.test_training import SMALL

TINY = {**SMALL, "train_steps": 6, "test_windows": 5, "samples": 4}


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compare")
    patch = pytest.MonkeyPatch()
    patch.setenv("MWLIB_RUNS", str(folder / "runs"))
    changes = [word for name, value in TINY.items() for word in ("--set", f"{name}={json.dumps(value)}")]
    assert main(["compare", "--preset", "tiny", "--out", str(folder / "out"), "--seeds", "0", "1", *changes]) == 0
    yield folder
    patch.undo()


def test_every_row_is_there_with_its_provenance(done):
    rows = list(csv.DictReader((done / "out" / "table.csv").read_text().splitlines()))
    assert [r["method"] for r in rows] == [r.name for r in comparison.rows(Config.preset("tiny"))]
    by_name = {r["method"]: r for r in rows}
    assert float(by_name["zero velocity"]["apd"]) == 0 and by_name["zero velocity"]["ade_seed_deviation"] == ""
    assert all(int(r["windows"]) == 5 for r in rows)
    assert float(by_name["MotionWavelet + CFG"]["ade_seed_deviation"]) > 0
    about = json.loads((done / "out" / "table.json").read_text())
    text = json.dumps(about)
    for name in ("sampling_seeds", "test_subjects", "train_steps", "machine", "samples", "training_hash"):
        assert name in text
    for stem in ("curves", "storyboard_1", "storyboard_3"):
        assert (done / "out" / f"{stem}.png").stat().st_size > 5000 and (done / "out" / f"{stem}.txt").read_text()


def test_finished_parts_are_not_done_again(done, monkeypatch):
    def never(*_, **__):
        raise AssertionError("evaluated again")

    cfg = Config.preset("tiny", **TINY)
    whole = comparison.compare(cfg, done / "out", (0, 1))
    monkeypatch.setattr(comparison, "evaluate", never)
    assert comparison.compare(cfg, done / "out", (0, 1)) == whole
    part = next((done / "out" / "parts").glob("zero*"))
    part.unlink()
    with pytest.raises(AssertionError, match="evaluated again"):
        comparison.compare(cfg, done / "out", (0, 1))


def test_chunks_and_subsets_do_not_change_a_window(done):
    cfg = Config.preset("tiny", **TINY)
    split = split_motions(cfg)
    every = comparison.windows(split.test, 6, 14, cfg.data.test_stride)
    predict = comparison.baseline("nearest_history", cfg, split)
    few = comparison.evaluate(lambda past, ids: predict(past), every.thin(5), every, 0.5)
    assert few["windows"]["ade"] == 5


def test_the_printed_table_is_markdown(done):
    table = comparison.compare(Config.preset("tiny", **TINY), done / "out", (0, 1))
    text = repr(report.results(table))
    assert text.startswith("| method") and "±" in text and "**" in text


def test_unknown_settings_are_refused(capsys):
    assert main(["train", "--preset", "tiny", "--set", "test_window=3"]) == 1
    assert "did you mean 'test_windows'" in capsys.readouterr().err
