"""Models that come with the package: found by name, true to their cards, made again by the same recipe."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
import torch

import mwlib as mw
from mwlib.data.windows import windows
from mwlib.experiments import get_run, load_run
from mwlib.experiments.grids import read_config
from mwlib.experiments.shipped import CARD, FIRST, METRICS, RECIPES, card, recipe, ship
from mwlib.paths import CONFIG, MODELS, shipped
from mwlib.prediction.system import load_data, score, test_windows
from mwlib.training import MODEL
from mwlib.training.checkpoint import load_tensors
from tests.sample_settings import small, two_people

CARRIED = sorted({*RECIPES} - {Path(FIRST).name})


@pytest.mark.parametrize("name", CARRIED)
def test_what_comes_along_is_what_the_recipe_makes(name):
    title, cfg = recipe(name)
    assert read_config(MODELS / name / CONFIG) == cfg and shipped() == CARRIED
    metrics = json.loads((MODELS / name / METRICS).read_text(encoding="utf-8"))
    again = card(title, f"mwlib ship {name}", cfg, metrics)
    assert (MODELS / name / CARD).read_text(encoding="utf-8") == again and metrics["about"]["settings"] == cfg.hash()
    assert ("mocap.cs.cmu.edu" in again) == (name in ("cmu", "inbetween", "cmu_critic", "cmu_evaluator"))
    weights, _ = load_tensors(MODELS / name / MODEL)
    numbers = {t.dtype for key, t in weights.items() if key.startswith("net.") and t.is_floating_point()}
    assert numbers == {torch.float16}
    assert (MODELS / name / MODEL).stat().st_size < 9e6


def test_the_synthetic_model_is_as_good_as_its_card_says():
    """Ten samples of 24 windows, errors within what so few can tell; people walk on, as fast as the truth."""
    _, cfg = recipe("synthetic")
    split, model = load_data(cfg), mw.load_run("synthetic")
    every = test_windows(split, cfg.windows)
    some = every.thin(24)
    found = score(lambda x, ids: model.predict(x, 10, 0, window_ids=ids), some, every, cfg.evaluation)["mean"]
    said = json.loads((MODELS / "synthetic" / METRICS).read_text(encoding="utf-8"))
    still = (some.x_future - some.x_history[:, -1:]).norm(dim=-1).mean()
    assert found["ade"] < 0.8 * still and found["ade"] == pytest.approx(said["model"]["mean"]["ade"], abs=0.15)
    assert found["speed"] == pytest.approx(said["truth"]["mean"]["speed"], rel=0.3)
    assert found["bone_length_jitter"] < 1e-6


def test_a_name_stands_for_the_model_that_comes_along_unless_a_folder_is_called_so(tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    monkeypatch.chdir(tmp_path)
    assert load_run("cmu").representation.frames == 125
    get_run(small()).rename(tmp_path / "cmu")
    assert load_run("cmu").representation.frames == 20
    with pytest.raises(
        FileNotFoundError,
        match=r"kmu/config.yaml is missing.*models that come with mwlib: cmu, cmu_critic, cmu_evaluator, critic, evaluator, "
        "inbetween, sentences, sentences_early, synthetic",
    ):
        load_run("kmu")
    with pytest.raises(ValueError, match="'kmu'; expected one of synthetic, cmu, inbetween, evaluator, critic, cmu_evaluator, "):
        recipe("kmu")


def test_a_shipped_model_is_its_run_in_half_precision(tmp_path, monkeypatch):
    """Trained once, found again; what is written loads, and predicts what the run predicts but for rounding."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    cfg = small(data="synthetic", test_windows=6)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / f".{MODEL}.1.part").write_text("cut by a kill")
    metrics = ship(cfg, tmp_path / "out", "Somebody", "mwlib ship somebody")
    assert {file.name for file in (tmp_path / "out").iterdir()} == {CONFIG, MODEL, CARD, METRICS}
    assert metrics["model"]["mean"]["ade"] > 0 == metrics["truth"]["mean"]["ade"] and metrics["training"]["steps"] == 12
    text = (tmp_path / "out" / CARD).read_text(encoding="utf-8")
    assert text.startswith("# Somebody\n") and f"| ADE | {metrics['model']['mean']['ade']:.3g} | 0 |" in text
    assert {t.dtype for key, t in load_tensors(tmp_path / "out" / MODEL)[0].items() if key.startswith("net.")} == {torch.float16}
    run, written = load_run(get_run(cfg)), load_run(tmp_path / "out")
    history = windows(two_people().validation, 6, 14, 9).x_history[:3]
    torch.testing.assert_close(written.predict(history, 2), run.predict(history, 2), atol=0.02, rtol=0.02)
    changes = {name: small().get(name) for name in ("history", "future")}
    monkeypatch.setitem(RECIPES, "synthetic", ("Somebody", "prediction", "tiny", changes))
    assert recipe("synthetic")[1].get("history") == 6


def test_no_card_speaks_of_another_model(tmp_path, monkeypatch):
    """Shipped again with other settings, and killed at any rename: a card with metrics beside it is the model's own."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    wholes, out, rename = [], tmp_path / "out", os.replace
    ways = [(small(data="synthetic", test_windows=3, seed=seed), out, f"Number {seed}", "mwlib ship somebody") for seed in (0, 1)]
    for way in ways:
        ship(*way)
        wholes.append({file.name: file.read_bytes() for file in out.iterdir()})
    assert all(wholes[0][name] != wholes[1][name] for name in (CONFIG, MODEL, CARD, METRICS))
    for place in (1, 3):
        left = iter(range(place))

        def deadly(old, new, left=left):
            if Path(new).parent == out and next(left, None) is None:
                raise KeyboardInterrupt
            rename(old, new)

        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(os, "replace", deadly)
            ship(*ways[0])
        assert not (out / METRICS).exists(), "which would prove that the others belong to each other"
    ship(*ways[0])
    assert {file.name: file.read_bytes() for file in out.iterdir()} == wholes[0]
