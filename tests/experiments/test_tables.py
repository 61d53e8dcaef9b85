"""Tables of grids: which configurations are asked for, and what becomes of their numbers."""

from __future__ import annotations

import json
from statistics import mean, stdev
from types import SimpleNamespace

import pytest

from mwlib.experiments import tables
from mwlib.experiments.grids import Budget, Grid, Row, row_config
from mwlib.experiments.tables import differences, lines, measure, provenance
from mwlib.metrics import Column
from mwlib.plots import results_table, save_table
from mwlib.prediction.config import Config
from mwlib.prediction.system import METRICS

ROWS = (Row("haar", {"wavelet": "haar"}, {"ade": 0.4}), Row("db2", {"wavelet": "db2"}, {}), Row("once", {}, {}, seeds=1))
DATA = object()


def grid_of(trains: bool, **parts) -> Grid:
    body = dict(rows=ROWS, base={"level": 2}, budgets=(Budget(1000, 3),)) | parts
    return Grid("bases", "prediction", "three bases", "", "", trains, **body)


@pytest.fixture
def asked(monkeypatch):
    """Every configuration whose result is asked for; the answers follow from wavelet and seeds."""
    seen = []

    def answer(cfg, data, progress):
        assert data is DATA
        seen.append(cfg)
        k = 10 * len(cfg.model.wavelet) + cfg.sampling.sampling_seed**2 + 3 * cfg.training.seed
        values = {m: k + i for i, m in enumerate(METRICS)}
        errors = {m: k / 100 for m in METRICS}
        each = {m: [value, value + 1.0] for m, value in values.items()}
        about = {"windows": 5, "seconds": 2.0, "actions": {"walk": values}}
        return {"mean": values, "standard_error": errors, "values": each, **about}

    monkeypatch.setattr(tables, "get_result", answer)
    return seen


@pytest.mark.parametrize("trains", [True, False])
def test_every_row_is_asked_with_the_same_seeds(asked, trains):
    """Rows are paired: at every seed all of them have the same noise, and the same training where each has its own."""
    cfg = Config.preset("tiny", seed=7)
    measure(grid_of(trains), cfg, data=DATA)
    expected = [cfg.override(level=2, wavelet=w, sampling_seed=k) for w in ("haar", "db2") for k in (0, 1, 2)]
    expected.append(cfg.override(level=2, sampling_seed=0))
    assert asked == [c.override(seed=c.sampling.sampling_seed) if trains else c for c in expected]


def test_numbers_over_seeds_by_hand(asked):
    first, second, once = measure(grid_of(True), Config.preset("tiny"), data=DATA)
    k = [40 + s**2 + 3 * s for s in (0, 1, 2)]
    for i, m in enumerate(METRICS):
        assert first["mean"][m] == pytest.approx(mean(k) + i) and first["seed_deviation"][m] == pytest.approx(stdev(k))
        assert first["standard_error"][m] == pytest.approx(0.4), "of the first seed"
        assert first["actions"]["walk"][m] == 40 + i and first["values"][m] == pytest.approx([mean(k) + i, mean(k) + i + 1])
        assert second["mean"][m] == pytest.approx(mean(k) - 10 + i) and once["seed_deviation"][m] is None
    assert [(row["seeds"], row["windows"], row["seconds"]) for row in (first, second, once)] == [(3, 5, 6.0)] * 2 + [(1, 5, 2.0)]


def test_lines_are_in_the_unit_of_their_column(asked):
    found = measure(grid_of(True), Config.preset("tiny"), data=DATA)
    line, second, once = lines(found, METRICS, errors=True)
    for m, column in METRICS.items():
        value, spread, error = (found[0][kind][m] for kind in ("mean", "seed_deviation", "standard_error"))
        assert line[column.heading] == pytest.approx((column.scale * value, column.scale * spread))
        assert line[f"{column.heading}, standard error"] == pytest.approx(column.scale * error)
        assert once[column.heading] == pytest.approx(column.scale * found[2]["mean"][m])
    assert (line["ADE, paper"], second["ADE, paper"]) == (0.4, None) and "FDE, paper" not in line
    assert (line["seeds"], once["seeds"], line["windows"]) == (3, 1, 5)


def measured(name: str, values: list[float], clips: str = "aabbc") -> dict:
    """A row as `measure` gives it, with one metric."""
    mean_of = {"ade": mean(values), "worst": 2.0}
    about = {"seeds": 1, "windows": 5, "paper": {}, "seed_deviation": {"ade": None, "worst": None}}
    errors = {"ade": 0.1, "worst": None}
    return {"name": name, "mean": mean_of, "standard_error": errors, "values": {"ade": values}, "clips": [*clips], **about}


def test_differences_are_taken_window_by_window():
    """What both rows find hard goes out of the difference, and windows of a clip count as one observation."""
    hard = [0.0, 5.0, 10.0, 20.0, 40.0]
    apart = [0.1, 0.1, 0.3, 0.3, 0.2]
    rows = [measured("ours", hard), measured("theirs", [h + d for h, d in zip(hard, apart, strict=True)])]
    rows.append(measured("elsewhere", hard, "aabbb"))
    (line,) = differences(rows, {"ade": Column("ADE (mm)", scale=1000.0), "fde": Column("FDE")}, "ours")
    totals = [-0.2, 0.2, 0.0]  # of a, b and c around the mean, 0.2
    expected = (3 / 2 * sum(t**2 for t in totals)) ** 0.5 / 5
    assert line.pop("row") == "theirs - ours"
    assert line == {"ADE (mm)": pytest.approx(200), "ADE (mm), standard error": pytest.approx(1000 * expected)}
    with pytest.raises(ValueError, match="reference is 'nobody'; expected one of ours, theirs, elsewhere"):
        differences(rows, METRICS, "nobody")


def test_what_a_row_lacks_is_left_out():
    """A largest value has no standard error; a table of details has only what was measured."""
    rows = [measured("ours", [1.0, 2.0, 3.0, 4.0, 5.0])]
    columns = {"ade": Column("ADE"), "worst": Column("worst"), "jerk": Column("jerk")}
    assert lines(rows, columns, errors=True) == [
        {"row": "ours", "ADE": 3.0, "ADE, standard error": 0.1, "worst": 2.0, "seeds": 1, "windows": 5}
    ]


def test_a_row_wins_over_the_base_and_the_base_over_the_budget():
    budget = Budget(1000, 3, changes={"level": 1, "batch": 4, "test_windows": 9})
    rows = (Row("a", {"batch": 6, "guidance_weight": 0.5}, {}), Row("b", {}, {}))
    grid = grid_of(True, rows=rows, base={"level": 2, "guidance_weight": 0.1}, budgets=(budget,))
    cfg = Config.preset("tiny")
    common = cfg.override(level=2, test_windows=9)
    assert row_config(grid, rows[0], cfg) == common.override(batch=6, guidance_weight=0.5)
    assert row_config(grid, rows[1], cfg) == common.override(batch=4, guidance_weight=0.1)


def test_everything_that_is_counted_in_steps_is_cut_to_the_budgets_share():
    """The preset's full length still belongs to the budget; one step more does not."""
    grid = grid_of(True, rows=ROWS[2:], base={}, budgets=(Budget(1000, 3, share=0.1),))
    lengths = dict(train_steps=1000, warmup=60, ema_start=250, lr_period=90)
    cfg = Config.preset("tiny", lr_milestones=[200, 700], **lengths)
    short = row_config(grid, ROWS[2], cfg)
    assert {name: short.get(name) for name in lengths} == dict(train_steps=100, warmup=6, ema_start=25, lr_period=9)
    assert short.training.lr_milestones == (20, 70)
    assert short == cfg.override(**{name: short.get(name) for name in (*lengths, "lr_milestones")}), "and nothing else"
    longer = cfg.override(train_steps=1001)
    assert row_config(grid, ROWS[2], longer) == longer


def test_a_row_names_its_machines_adds_up_its_trainings_and_leaves_out_what_is_no_number(monkeypatch):
    def result(cfg, data, progress):
        device = f"card {cfg.get('seed') % 2}"
        mean_of = {m: 1.0 for m in METRICS} | {"speed": float("nan")}
        return {
            "mean": mean_of, "standard_error": {}, "windows": 5, "seconds": 1.0, "training": {"seconds": 7.0},
            "machine": {"device": device, "torch": "2.0"},
        }  # fmt: skip

    monkeypatch.setattr("mwlib.experiments.tables.get_result", result)
    row = measure(grid_of(True), Config.preset("tiny"), data=DATA)[0]
    assert row["machines"] == ["card 0 with torch 2.0", "card 1 with torch 2.0"]
    assert row["training_seconds"] == 7.0 * row["seeds"] == 21 and "speed" not in row["mean"]


def test_one_test_clip_is_told_before_the_training_and_gives_a_table_without_errors(monkeypatch, tmp_path):
    asked: list[bool] = []

    def result(cfg, data, progress):
        asked.append(True)
        one = {m: 1.0 for m in METRICS}
        return {"mean": one, "standard_error": dict.fromkeys(METRICS, float("nan")), "windows": 5, "seconds": 1.0}

    monkeypatch.setattr("mwlib.experiments.tables.get_result", result)
    monkeypatch.setattr("warnings.warn", lambda text, **_: asked.append(text.startswith("one test clip: ")))
    grid, cfg = grid_of(False), Config.preset("tiny")
    found = measure(grid, cfg, data=SimpleNamespace(test=["the only clip"]))
    assert asked[0] is True and len(asked) == 1 + sum(row["seeds"] for row in found)
    _, about = save_table(lines(found, METRICS, errors=True), tmp_path, "one", provenance=provenance(grid, cfg, found))
    assert json.loads(about.read_text())["standard_error_over_clips"][grid.rows[0].name]["ade"] is None
    assert "–" in str(results_table(lines(found, METRICS, errors=True)))
