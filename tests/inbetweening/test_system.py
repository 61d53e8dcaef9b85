"""In-betweening as the experiments see it: trained once, found again, scored, with places and with rotations."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.data.formats.bvh_writing import write_bvh
from mwlib.experiments import get_model, get_result, get_run, load_run, system
from mwlib.inbetweening import system as module
from mwlib.inbetweening.bridge import Bridge
from mwlib.synthetic.motions import synthetic_motions
from mwlib.training import MODEL
from tests.inbetweening.sample import data_of, lafan_motion, small, windows_for


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_a_run_is_trained_once_and_scored(state, monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = small(state=state, train_steps=3, test_windows=4)
    data = data_of(cfg)
    folder = get_run(cfg, data)
    made = (folder / MODEL).stat().st_mtime_ns
    result = get_result(cfg, data)
    assert (folder / MODEL).stat().st_mtime_ns == made and result["windows"] == 4
    assert {name for name in module.METRICS if name in result["mean"]} >= {*module.METRICS} - {"l2q"}
    assert ("l2q" in result["mean"]) == (state == "rotations")
    assert get_result(cfg, data)["values"]["ade"] == result["values"]["ade"]
    other = get_result(cfg.override(sampling_seed=1, scheme="paste"), data)
    assert (folder / MODEL).stat().st_mtime_ns == made and other["mean"]["ade"] != result["mean"]["ade"]
    truth = get_result(cfg.override(method="truth"), data)
    assert truth["training"] is None and truth["mean"]["l2p"] == pytest.approx(0, abs=1e-5)
    bridge = load_run(folder)
    assert isinstance(bridge, Bridge) and get_run(cfg.override(width=32), data) != folder
    x = windows_for(bridge).x[:2]
    assert torch.equal(bridge.sample(x), get_model(cfg, data).sample(x))


def test_it_is_known_by_name():
    assert system("inbetweening") is module and module.Config.system == "inbetweening"


def test_data_are_loaded_with_rotations_or_on_seventeen_joints(tmp_path):
    for number, subject in enumerate("AABBCC"):
        motion = lafan_motion(30, seed=number, fps=30.0, subject=subject)
        write_bvh(motion, tmp_path / f"walk{number}_subject{number // 2 + 1}.bvh")
    nobody = dict.fromkeys(("train_subjects", "validation_subjects", "test_subjects"), ())
    cfg = small(data=str(tmp_path), state="rotations", unit="cm", up="y", **nobody)
    found = module.load_data(cfg)
    clips = [*found.train, *found.validation, *found.test]
    assert all(m.rig is not None and m.up == "z" and m.fps == 10.0 and len(m.skeleton) == 22 for m in clips) and len(clips) == 6
    places = module.load_data(cfg.override(state="positions"))
    assert all(m.rig is None and len(m.skeleton) == 17 for m in places.train)
    np.testing.assert_allclose(places.train[0].positions[:, 0], found.train[0].positions[:, 0], atol=1e-3)


def test_positions_alone_are_refused_where_rotations_are_asked_for(monkeypatch):
    motions = synthetic_motions(subjects=2, seconds=2.0)
    monkeypatch.setattr("mwlib.data.sources.load_motions", lambda source, **stated: motions)
    cfg = small(state="rotations", validation_subjects=(), test_subjects=())
    with pytest.raises(ValueError, match="has positions only; expected rotations, .*state=positions"):
        module.make_objective(cfg, module.load_data(cfg), {})
