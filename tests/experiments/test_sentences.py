"""Motions from sentences: as many as were asked for, in order, each by its own noise; and as files."""

from __future__ import annotations

import re

import numpy as np
import pytest

import mwlib as mw
from mwlib.cli import main
from mwlib.data.formats.humanml import joints_of
from mwlib.experiments import sampling
from mwlib.text_to_motion.motions import fused_joints
from tests.text_to_motion.sample import untrained

TEXTS = ["a person goes up", "someone falls"]


@pytest.fixture(scope="module")
def model():
    return untrained()


def test_motions_come_sentence_by_sentence(model):
    found = mw.generate(TEXTS, seconds=[0.4, 1.0], samples=2, run=model)
    assert [motion.name for motion in found] == [TEXTS[0], TEXTS[0], TEXTS[1], TEXTS[1]]
    assert [motion.positions.shape for motion in found] == [(8, 22, 3), (8, 22, 3), (20, 22, 3), (20, 22, 3)]
    assert all((motion.fps, motion.up, motion.skeleton.name) == (20.0, "y", "HUMANML22") for motion in found)
    assert not np.allclose(found[0].positions, found[1].positions, atol=1e-2)


def test_places_are_read_with_steps_and_contacts_unless_told_otherwise(model):
    (features,) = model.sample(["someone falls"], [20], 3, ids=[0])
    for fused, expected in (
        (True, fused_joints(features.double(), model.layout)),
        (False, joints_of(features.double(), model.layout)),
    ):
        (motion,) = mw.generate("someone falls", 1.0, seed=3, run=model, fused=fused)
        np.testing.assert_allclose(motion.positions, expected.numpy(), atol=1e-6)
    (usual,) = mw.generate("someone falls", 1.0, seed=3, run=model)
    np.testing.assert_allclose(usual.positions, fused_joints(features.double(), model.layout).numpy(), atol=1e-6)


def test_lengths_are_rounded_to_four_frames(model):
    lengths = {0.53: 12, 0.49: 8, 1: 20, 1.2: 24}
    found = mw.generate(["someone falls"] * 4, seconds=[*lengths], run=model)
    assert [len(motion) for motion in found] == [*lengths.values()]


@pytest.mark.parametrize("seconds", [1, 1.0, np.float32(1), np.int64(1), [1.0], np.ones(1)])
def test_seconds_may_be_any_number(model, seconds):
    (found,) = mw.generate("someone falls", seconds, run=model)
    assert len(found) == 20 and found.name == "someone falls"


def test_a_motion_does_not_depend_on_how_many_are_asked_for(model):
    many = mw.generate(TEXTS, seconds=0.6, samples=3, seed=5, run=model)
    few = mw.generate(TEXTS, seconds=0.6, seed=5, run=model)
    (first,) = mw.generate(TEXTS[0], seconds=0.6, seed=5, run=model)
    for one, other in ((many[0], few[0]), (many[3], few[1]), (many[0], first)):
        np.testing.assert_allclose(one.positions, other.positions, atol=2e-3)
    (another,) = mw.generate(TEXTS[0], seconds=0.6, seed=6, run=model)
    assert not np.allclose(another.positions, first.positions, atol=1e-2)


@pytest.mark.parametrize(
    "texts, options, message",
    [
        (TEXTS, {"seconds": [0.6]}, "1 lengths and 1 samples; expected one length for each of 2 sentences, and 1 to 1000"),
        (TEXTS, {"seconds": 0.6, "samples": 0}, "2 lengths and 0 samples; expected .* 1 to 1000 samples"),
        ([], {"seconds": 0.6}, "0 lengths for 0 sentences; expected one each, and at least one sentence"),
        (["someone falls", "  "], {"seconds": 0.6}, "sentence 1 is empty; expected words"),
        ("someone falls", {"seconds": 4.0}, "frames is 80; expected 8 to 24 at 20 Hz"),
        ("someone falls", {"seconds": 0.2}, "frames is 4; expected 8 to 24 at 20 Hz"),
        ("someone falls", {"seconds": float("nan")}, "seconds is nan; expected a finite number"),
        ("someone falls", {"seconds": float("inf")}, "seconds is inf; expected a finite number"),
        ("someone falls", {"seconds": [1.0, 1.0]}, "2 lengths"),
        ("someone falls", {"seconds": 1.0, "samples": 1001}, "1001 samples; expected"),
    ],
)
def test_what_no_motion_can_follow_from_is_refused(model, texts, options, message):
    with pytest.raises(ValueError, match=message):
        mw.generate(texts, run=model, **options)


def test_runs_that_are_missing_or_of_another_system_are_refused(monkeypatch, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"config.yaml is missing: no training run in this folder.*sentences"):
        mw.generate("someone falls", run=tmp_path / "nowhere")
    monkeypatch.setattr(sampling, "load_run", lambda run: object())
    with pytest.raises(ValueError, match="synthetic is a run of another system; expected one of text_to_motion"):
        mw.generate("someone falls", run="synthetic")


def test_the_command_writes_what_the_function_makes(monkeypatch, tmp_path, capsys, model):
    monkeypatch.setattr(sampling, "load_run", {"my/run": model}.__getitem__)
    asked = ["A person goes up!", "走"]
    words = ["generate", *asked, "--seconds", "0.6", "--samples", "2", "--seed", "3", "--run", "my/run", "--out", str(tmp_path)]
    assert main(words) == 0
    said = capsys.readouterr().out.splitlines()
    names = ["01_a_person_goes_up.bvh", "02_a_person_goes_up.bvh", "03_motion.bvh", "04_motion.bvh"]
    assert sorted(file.name for file in tmp_path.iterdir()) == names
    for line, name, motion in zip(said, names, mw.generate(asked, 0.6, 2, 3, model), strict=True):
        (again,) = mw.load_motions(tmp_path / name, unit="cm", up="y")
        assert (len(again), again.fps, again.skeleton.joints) == (12, 20.0, motion.skeleton.joints)
        away = 1000 * np.linalg.norm(again.with_up("y").positions - motion.positions, axis=-1).mean()
        told = re.fullmatch(rf".*{name}: 12 frames at 20 Hz; joints ([\d.]+) mm from the sampled ones", line)
        assert told is not None and float(told[1]) == pytest.approx(away, rel=0.05, abs=0.2)
