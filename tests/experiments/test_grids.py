"""Grids of experiments: read, budgeted, measured once, each part kept."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from mwlib import plots
from mwlib.cli import main
from mwlib.course.notebooks import course
from mwlib.experiments import committed, committed_pairs, lines, measure, read_grids, tables
from mwlib.experiments.grids import Budget, Grid, Row, changes, row_config, system
from mwlib.experiments.runs import Run
from mwlib.paths import course_folder
from mwlib.prediction.config import Config
from mwlib.prediction.system import METRICS
from tests.sample_settings import SMALL

MICRO = {**SMALL, "train_steps": 3, "test_windows": 3, "samples": 3, "ddim_steps": 4}
ROWS = [
    {"name": "haar", "set": {"wavelet": "haar"}, "paper": {"ade": 0.4}},
    {"name": "db2", "set": {"wavelet": "db2"}},
]


@pytest.fixture(scope="module")
def known() -> dict[str, Grid]:
    """The course's grids."""
    return read_grids()


def write(folder: Path, **parts) -> Path:
    """A small grid file."""
    body = {"title": "three bases", "trains": True, "base": MICRO, "rows": ROWS, "budgets": [{"until": 1000, "seeds": 2}]}
    path = folder / "grids.yaml"
    path.write_text(yaml.safe_dump({"grids": {"bases": body | parts}}))
    return path


def test_the_papers_grids_are_complete(known):
    of_prediction = [grid for grid in known.values() if grid.system == "prediction"]  # the others' numbers are lost to us
    sizes = {grid.id: sum(bool(row.paper) for row in grid.rows) for grid in of_prediction if grid.paper}
    assert sizes == {"table_2": 2, "table_3": 10, "table_4": 11, "table_4_raw": 11, "table_5": 2, "table_6": 3}
    best = known["table_4"].rows[7]
    assert best.changes == {"tabg_scale": 1.0, "tabg_sigma": 2.5, "wmsg": "every_step"}
    assert best.paper == {"apd": 6.506, "ade": 0.376, "fde": 0.408, "mmade": 0.466, "mmfde": 0.443}
    assert {grid.notebook for grid in known.values() if grid.notebook} <= {path.stem for path in course()}


@pytest.mark.parametrize(
    "parts, message",
    [
        (
            {"rows": [{"name": "a", "set": {"wavlet": "haar"}}]},
            "bases, row 'a': unknown setting 'wavlet'; did you mean 'wavelet'",
        ),
        ({"rows": [{"name": "a", "set": {"level": "two"}}]}, "level is 'two'"),
        ({"rows": [{"name": "a"}, {"name": "a"}]}, "row 'a': the same name as 'a'; expected rows that differ"),
        ({"rows": [{"set": {}}]}, "row 1 has"),
        ({"seeds": 3}, "bases has"),
        ({"budgets": [{"seeds": 3}]}, "bases, budget 1 has"),
        ({"rows": 5}, "rows is 5; expected a list"),
        ({"rows": []}, r"rows is \[\]; expected a list of rows"),
        ({"rows": [3]}, "row 1 has 3"),
        ({"rows": [{"name": "a", "set": ["level=2"]}]}, "row 1: set is .*expected a mapping"),
        ({"rows": [{"name": "a", "seeds": "two"}]}, "row 1: seeds is 'two'; expected a whole number"),
        ({"budgets": {"until": 3}}, "budgets is .*expected a list"),
        ({"budgets": [{"until": "1e3", "seeds": 1}]}, "until is '1e3'; expected a number"),
        ({"trains": "no"}, "trains is 'no'; expected true or false"),
        ({"system": ["prediction"]}, "system is .*expected one of prediction"),
        ({"reference": "db9"}, "reference is 'db9'; expected the name of a row"),
    ],
)
def test_a_grid_that_does_not_fit_is_refused(tmp_path, parts, message):
    with pytest.raises(ValueError, match=message):
        read_grids(write(tmp_path, **parts))


IN_LINES = "grids:\n  a:\n    title: t\n    rows:\n      - {{ name: one{row} }}\n{rest}"
BUDGETS = "    budgets:\n      - {{ seeds: 1, {} }}\n"


@pytest.mark.parametrize(
    "row, rest, message",
    [
        (", set: { eta: 0.5, eta: 0.9 }", "", "line 5: 'eta' is already in line 5; expected each key once"),
        ("", "  a: { title: u, rows: [{ name: two }] }\n", "line 6: 'a' is already in line 2; expected each key once"),
        ("", "grid: {}\n", "line 6: the top, but for x- and any name, has ['grid', 'grids']; expected ['grids'], and any of []"),
        ("", "gridz: {}\n", "(did you mean 'grids'?)"),
        (", paper: { adee: 0.3 }", "", "line 5: a, row 1, paper has ['adee']; expected [], and any of ['ade', 'ade_of_mean'"),
        (", paper: { ade: abc }", "", "line 5: a, row 1, paper: ade is 'abc'; expected a finite number"),
        (", paper: { ade: .nan }", "", "line 5: a, row 1, paper: ade is nan; expected a finite number"),
        (", paper: { ade: true }", "", "line 5: a, row 1, paper: ade is True; expected a finite number"),
        (", seeds: 0", "", "line 5: a, row 1: seeds is 0; expected a whole number from 1"),
        (", seeds: 1001", "", "line 5: a, row 1: seeds is 1001; expected a whole number from 1 to 1000"),
        (", set: { sampling_seed: 5 }", "", "row 'one': set has 'sampling_seed'; expected seeds, which says how many are drawn"),
        (", set: { seed: 5 }", "    trains: true\n", "line 5: a, row 'one': set has 'seed'; expected seeds, which"),
        ("", BUDGETS.format("until: 3, set: { sampling_seed: 1 }"), "line 7: a, budget 1: set has 'sampling_seed'; expected"),
        (", set: { 1: 2 }", "", "line 5: a, row 'one': set has 1; expected names of settings"),
        (" }\n      - { name: ' one'", "", "line 6: a, row 2: name is ' one'; expected a name, in one line without blanks"),
        (' }\n      - { name: "o\\ne"', "", "line 6: a, row 2: name is 'o\\ne'; expected a name, in one line"),
        (" }\n      - { name: two, set: {}", "", "line 6: a, row 'two': the same settings as 'one'; expected rows that differ"),
        (", sets: {}", "", "line 5: a, row 1 has ['name', 'sets']; expected ['name'], and any of"),
        (", set: { wavlet: haar }", "", "line 5: a, row 'one': unknown setting 'wavlet'; did you mean 'wavelet'?"),
        ("", "    base:\n      lr: 0.1\n      level: two\n", "line 8: a, row 'one': level is 'two'; expected a whole number"),
        ("", "    budget: []\n", "'trains', 'unmeasured'] (did you mean 'budgets'?)"),
        ("", "    reference: onne\n", "line 6: a: reference is 'onne'; expected the name of a row (did you mean 'one'?)"),
        ("", "    system: predicton\n", "line 6: a: system is 'predicton'; expected one of prediction"),
        ("", BUDGETS.format(""), "line 7: a, budget 1 has ['seeds']; expected ['seeds', 'until'], and any of"),
        ("", BUDGETS.format("until: 3, seeds: 2"), "line 7: 'seeds' is already in line 7"),
        ("", BUDGETS.format("until: .nan"), "line 7: a, budget 1: until is nan; expected a number above 0, finite"),
        ("", BUDGETS.format("until: .inf"), "line 7: a, budget 1: until is inf; expected a number above 0, finite"),
        ("", BUDGETS.format("until: 3, share: -1.0"), "line 7: a, budget 1: share is -1.0; expected a number above 0, finite"),
        ("", BUDGETS.format("until: 3, share: 0.0"), "line 7: a, budget 1: share is 0.0; expected a number above 0, finite"),
        ("", BUDGETS.format("until: 3, share: 0"), "line 7: a, budget 1: share is 0; expected a number above 0, finite"),
        ("", "    budgets: [{ until: 3, seeds: -1 }]\n", "line 6: a, budget 1: seeds is -1; expected a whole number from 1"),
        (
            "",
            BUDGETS.format("until: 3, set: { tranesteps: 3 }"),
            "line 7: a, budget 1: unknown setting 'tranesteps'; did you mean",
        ),
        ("", BUDGETS.format("until: 3, set: { batch: 0 }"), "line 7: a, budget 1: batch is 0; expected 1 to 65536"),
        (
            "",
            BUDGETS.format("until: 5000") + "      - { until: 5000, seeds: 1 }\n",
            "line 8: a, budget 2: until is 5000; expected more than the 5000 of the one before",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused_with_its_line(tmp_path, row, rest, message):
    file = tmp_path / "grids.yaml"
    file.write_text(IN_LINES.format(row=row, rest=rest))
    with pytest.raises(ValueError, match=re.escape(message)) as told:
        read_grids(file)
    assert str(told.value).startswith(str(file))


def test_the_papers_other_numbers_are_named(tmp_path):
    """What a grid's system does not measure is kept where the grid says so; a merged key may be said again."""
    file = tmp_path / "grids.yaml"
    row = ", set: { <<: &lower { level: 1, wavelet: haar }, level: 2 }, paper: { rmse: 0.5 }"
    file.write_text(IN_LINES.format(row=row, rest="    unmeasured: [rmse]\n"))
    (found,) = read_grids(file)["a"].rows
    assert (found.paper, found.changes) == ({"rmse": 0.5}, {"level": 2, "wavelet": "haar"})
    assert type(found.changes) is dict, "as YAML writes it"


def test_a_setting_of_a_budget_is_judged_with_the_rows(tmp_path):
    """Settings that must fit each other may stand in different places."""
    file = tmp_path / "grids.yaml"
    parts = ", set: { steps: 20, ddim_steps: 15 }", BUDGETS.format("until: 3, set: { steps: 10 }")
    file.write_text(IN_LINES.format(row=parts[0], rest=parts[1]))
    assert read_grids(file)["a"].budgets[0].changes == {"steps": 10}, "the row's own steps count"


@pytest.mark.parametrize("text", ["- table_4", "grids: [table_4]", "grids: ]", "{}", "x-a: 1", "[" * 3000])
def test_a_file_without_grids_is_told(tmp_path, text):
    (tmp_path / "grids.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"grids\.yaml(.*: the top.* expected \['grids'\]|.* expected a mapping| is not YAML)"):
        read_grids(tmp_path / "grids.yaml")


def test_budgets_cut_small_configurations_only(tmp_path):
    budgets = [{"until": 1000, "seeds": 2, "share": 0.5, "set": {"test_windows": 7}}]
    grid = read_grids(write(tmp_path, base={}, budgets=budgets))["bases"]
    small, large, row = Config.preset("tiny"), Config.preset("h36m"), grid.rows[1]
    shorter = {name: round(0.5 * small.get(name)) for name in ("train_steps", "lr_period", "warmup", "ema_start")}
    milestones = [round(0.5 * m) for m in small.training.lr_milestones]
    assert row_config(grid, row, small) == small.override(wavelet="db2", test_windows=7, lr_milestones=milestones, **shorter)
    assert row_config(grid, row, large) == large.override(wavelet="db2")
    assert (grid.budget(small).seeds, grid.budget(large).seeds) == (2, 3)
    assert row_config(grid, row, large, 2) == large.override(wavelet="db2", seed=2, sampling_seed=2)
    sampled = read_grids(write(tmp_path, base={}, trains=False))["bases"]
    assert row_config(sampled, row, large, 2) == large.override(wavelet="db2", sampling_seed=2)


def test_a_row_may_have_fewer_seeds_than_the_budget(tmp_path):
    grid = read_grids(
        write(tmp_path, rows=[{"name": "still", "set": {"method": "zero_velocity"}, "seeds": 1}, {"name": "model"}])
    )
    assert [len(grid["bases"].seeds(row, Config.preset("tiny"))) for row in grid["bases"].rows] == [1, 2]


def test_a_given_setting_wins_over_base_and_budget_and_is_refused_where_rows_differ(tmp_path):
    budgets = [{"until": 1000, "seeds": 2, "share": 0.5, "set": {"test_windows": 7}}]
    grid = read_grids(write(tmp_path, base={"guidance_weight": 0.3, "level": 2}, budgets=budgets))["bases"]
    cfg, row = Config.preset("tiny", test_windows=11, guidance_weight=0.9, train_steps=100), grid.rows[0]
    plain = row_config(grid, row, cfg)
    assert (plain.windows.test_windows, plain.sampling.guidance_weight, plain.training.train_steps) == (7, 0.3, 50)
    given = row_config(grid, row, cfg, given=["test_windows", "guidance_weight", "train_steps"])
    assert (given.windows.test_windows, given.sampling.guidance_weight, given.training.train_steps) == (11, 0.9, 100)
    assert given.model.level == 2 and given.model.wavelet == "haar", "what was not given, the grid sets"
    with pytest.raises(ValueError, match="wavelet is given, but the rows of bases differ in it"):
        changes(grid, row, cfg, given=["wavelet"])
    words = ["grid-table", "bases", "--grids", str(tmp_path / "grids.yaml"), "--out", str(tmp_path), "--set", "wavelet=db5"]
    assert main(words) == 1


def test_a_grid_is_measured_once(tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    grid, cfg = read_grids(write(tmp_path))["bases"], Config.preset("tiny")
    found = measure(grid, cfg)
    assert [row["name"] for row in found] == ["haar", "db2"] and all(row["seeds"] == 2 for row in found)
    assert all(row["seed_deviation"]["ade"] > 0 and row["windows"] == 3 for row in found)
    monkeypatch.setattr(Run, "measure", lambda *_: pytest.fail("measured again"))
    assert measure(grid, cfg) == found
    column = {"ade": METRICS["ade"]}
    line, second = lines(found, column, errors=True, first="basis")
    assert line["basis"] == "haar" and line["ADE, paper"] == 0.4
    assert line["ADE"] == (found[0]["mean"]["ade"], found[0]["seed_deviation"]["ade"])
    assert second["ADE, paper"] is None and line["ADE, standard error"] == found[0]["standard_error"]["ade"]
    about = json.loads(json.dumps(tables.provenance(grid, cfg, found)))
    assert about["seeds_of"] == "training and sampling" and about["rows"]["db2"]["wavelet"] == "db2"

    assert main(["grid-table", "bases", "--grids", str(tmp_path / "grids.yaml"), "--out", str(tmp_path / "out")]) == 0
    header, first = (tmp_path / "out" / "bases.csv").read_text().splitlines()[:2]
    assert "ADE, deviation" in header and "ADE, standard error" in header and first.startswith("haar")
    text = (tmp_path / "out" / "bases.md").read_text()
    assert text.startswith("| row") and "±" in text and "**" in text
    details = (tmp_path / "out" / "bases_details.csv").read_text().splitlines()
    assert "speed (m/s), standard error" in details[0] and len(details) == 3
    paired = (tmp_path / "out" / "bases_paired.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in paired] == ["row", "db2 - haar"] and "jerk" in paired[0]
    actions = (tmp_path / "out" / "bases_actions.csv").read_text().splitlines()
    assert actions[0].startswith("row,action,") and len(actions) > len(found)


def test_a_metric_that_no_row_has_is_left_out_of_the_table(tmp_path, monkeypatch):
    """A state of places has no rotations to score."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    rows = [{"name": "straight", "set": {"method": "interpolation"}}, {"name": "still", "set": {"method": "zero_velocity"}}]
    file = write(tmp_path, system="inbetweening", base={"test_windows": 3}, rows=rows, trains=False)
    assert main(["grid-table", "bases", "--grids", str(file), "--out", str(tmp_path)]) == 0
    text = (tmp_path / "bases.md").read_text()
    assert "L2P" in text and "L2Q" not in text


def test_one_window_part_is_measured_again_where_it_is_missing(tmp_path, monkeypatch):
    """Each row and seed is kept apart: what is deleted is computed anew, and nothing else."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    rows = [{"name": name, "set": {"method": f"{name}_velocity"}, "seeds": 1} for name in ("zero", "constant")]
    grid, cfg = read_grids(write(tmp_path, rows=rows))["bases"], Config.preset("tiny")
    found = measure(grid, cfg)
    parts = sorted((tmp_path / "runs" / "results").glob("*.json"))
    assert len(parts) == 2
    parts[0].unlink()
    kept = parts[1].stat().st_mtime_ns
    again = measure(grid, cfg)
    assert [row["mean"] for row in again] == [row["mean"] for row in found]
    assert parts[0].exists() and parts[1].stat().st_mtime_ns == kept


def test_the_committed_tables_come_back_as_lines(tmp_path, known):
    found = {"name": "a", "paper": {"ade": 0.4}, "windows": 3, "seeds": 2, "seconds": 1.0}
    found |= {"mean": dict.fromkeys(METRICS, 0.5), "standard_error": dict.fromkeys(METRICS, 0.1)}
    rows = [found | {"seed_deviation": dict.fromkeys(METRICS, 0.25)}]
    rows.append(found | {"name": "b", "paper": {}, "seed_deviation": dict.fromkeys(METRICS)})
    plots.save_table(lines(rows, METRICS, errors=True), tmp_path, "bases", provenance={"data": "synthetic"})
    some = {name: METRICS[name] for name in ("ade", "bone_length_jitter")}
    assert committed("bases", some, tmp_path) == lines(rows, some)
    with pytest.raises(FileNotFoundError, match="table_9"):
        committed("table_9", METRICS)
    figures = course_folder() / "figures"
    places = dict.fromkeys(("bridges", "bridges_50", "bridges_100", "bridge_longer"), figures / "lafan1")
    of_synthetic = "bridge_parts bridge_steps sentences_yardsticks free_t2m free_t2m_scratch free_t2m_readings".split()
    places |= dict.fromkeys(of_synthetic, figures / "synthetic") | {"bridge_feet": figures / "bandai_namco"}
    for name, grid in known.items():
        columns = system(grid.system).METRICS
        assert len(committed(name, columns, places.get(name, figures / "cmu"))) == len(grid.rows)
    of_people = committed("bridges", system("inbetweening").METRICS, figures / "bandai_namco")
    assert len(of_people) == len(known["bridges"].rows)


def test_the_committed_pairs_come_back_as_they_were_compared(tmp_path):
    rows = [{"row": "one - two - b", "ADE": 6e-19, "ADE, standard error": 0.1, "FDE": 2.0, "FDE, standard error": 0.2}]
    plots.save_table(rows, tmp_path, "bases_paired", provenance={"data": "synthetic"})
    some = {name: METRICS[name] for name in ("ade", "fde", "apd")}
    expected = {"row": "one - two", "against": "b", METRICS["ade"].heading: (0.0, 0.1), METRICS["fde"].heading: (2.0, 0.2)}
    assert committed_pairs("bases", some, tmp_path) == [expected]


def test_a_committed_motion_is_read_from_its_picture(tmp_path):
    (tmp_path / "board.csv").write_text("truth_0,truth_1,sample_1_0,sample_1_1,sample_10_0\n0.5,1,2,3,9\n4,5,6,7,9\n")
    np.testing.assert_array_equal(tables.committed_motion("board", folder=tmp_path), [[0.5, 1], [4, 5]])
    np.testing.assert_array_equal(tables.committed_motion("board", "sample_1", tmp_path), [[2, 3], [6, 7]])
    with pytest.raises(ValueError, match="expected one of truth, sample_1"):
        tables.committed_motion("board", "sample_2", tmp_path)


def test_a_budget_may_say_that_every_seed_is_a_training(tmp_path):
    """At a small size one training serves all seeds, at a large one each seed has its own; the grid itself trains nothing."""
    file = tmp_path / "grids.yaml"
    budgets = "[{ until: 1000, seeds: 2 }, { until: 10000, seeds: 2, trains: true }]"
    file.write_text(f"grids: {{ a: {{ title: t, budgets: {budgets}, rows: [{{ name: one }}] }} }}\n", encoding="utf-8")
    grid = read_grids(file)["a"]
    small, large = (Config.preset("tiny", train_steps=steps) for steps in (1000, 10000))
    assert [row_config(grid, grid.rows[0], small, seed).get("seed") for seed in range(2)] == [0, 0]
    assert [row_config(grid, grid.rows[0], large, seed).get("seed") for seed in range(2)] == [0, 1]
    assert [row_config(grid, grid.rows[0], small, seed).get("sampling_seed") for seed in range(2)] == [0, 1]
    assert (grid.trains_at(small), grid.trains_at(large)) == (False, True)
    file.write_text(file.read_text(encoding="utf-8").replace("trains: true", "trains: often"), encoding="utf-8")
    with pytest.raises(ValueError, match="trains is 'often'; expected true or false"):
        read_grids(file)


def test_a_training_that_is_cut_short_keeps_a_step():
    cfg = system("prediction").Config.preset("tiny")
    budget = Budget(1e9, 1, share=1e-9)
    grid = Grid("a", "prediction", "t", "", "", False, {}, (Row("one", {}, {}),), (budget,))
    assert row_config(grid, grid.rows[0], cfg).get("train_steps") == 1
