"""The seam: a second system of one small file trains, resumes to the bit, is found by its hash and fills rows of a grid."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
import yaml

from mwlib.experiments import get_model, get_run, load_run, measure, read_grids, register, system, train_run
from mwlib.experiments.tables import lines
from mwlib.training import CHECKPOINT, MODEL
from mwlib.training.checkpoint import load_tensors
from tests.experiments import curves_system
from tests.experiments.curves_system import Config

GRID = {
    "grids": {
        "curves": {
            "system": "curves",
            "title": "Curves of two sizes",
            "trains": True,
            "budgets": [{"until": 100, "seeds": 2, "share": 0.5}],
            "rows": [
                {"name": "small", "set": {"amplitude": 0.5}},
                {"name": "large", "set": {"amplitude": 2}, "paper": {"energy": 2}},
            ],
        }
    }
}


def test_it_is_small_and_nobody_knows_it():
    file = Path(curves_system.__file__)
    assert len(file.read_text().splitlines()) < 80
    package = Path(system.__code__.co_filename).parents[1]
    assert not [path for path in package.rglob("*.py") if "experiments.curves_system" in path.read_text()]


def test_it_learns_and_resumes_to_the_bit(tmp_path):
    cfg = Config.preset("tiny")
    data = curves_system.load_data(cfg)
    losses = [step.loss for step in train_run(cfg, data, tmp_path / "whole")]
    assert sum(losses[-5:]) < 0.8 * sum(losses[:5])
    for step in train_run(cfg, data, tmp_path / "stopped"):
        if step.step == 23:
            break
    assert [step.step for step in train_run(cfg, data, tmp_path / "stopped")] == list(range(21, 41))
    for name in (CHECKPOINT, MODEL):
        found, expected = (load_tensors(tmp_path / run / name)[0] for run in ("stopped", "whole"))
        assert all(torch.equal(found[k], expected[k]) for k in expected)


def test_its_runs_are_found_again(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = Config.preset("tiny")
    folder = get_run(cfg)
    made = (folder / MODEL).stat().st_mtime_ns
    assert get_run(cfg.override(sampling_seed=3)) == folder and (folder / MODEL).stat().st_mtime_ns == made
    assert get_run(cfg.override(width=16)) != folder
    x = torch.ones(2, 17)
    torch.testing.assert_close(load_run(folder)(x), get_model(cfg)(x))


def test_it_fills_a_grid(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    (tmp_path / "grids.yaml").write_text(yaml.safe_dump(GRID))
    found = measure(read_grids(tmp_path / "grids.yaml")["curves"], Config.preset("tiny"))
    small, large = lines(found, curves_system.METRICS)
    assert small["row"] == "small" and small["energy, paper"] is None and large["energy, paper"] == 2
    assert small["energy"][0] < large["energy"][0] and small["energy"][1] > 0
    assert len(list((tmp_path / "runs").glob("*/model.safetensors"))) == 4


def test_names_are_kept_apart():
    class Impostor:
        Config, METRICS, load_data, make_objective, open_model, evaluate = (None,) * 6

    class Named:
        system = "prediction"

    Impostor.Config = Named
    with pytest.raises(ValueError, match="system is 'prediction', which is taken"):
        register(Impostor)
    with pytest.raises(ValueError, match="has no Config, METRICS"):
        register(Named)
    with pytest.raises(ValueError, match="expected one of prediction"):
        system("nothing")
