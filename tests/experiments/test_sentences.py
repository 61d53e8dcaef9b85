"""Motions from sentences: as many as were asked for, in order, each by its own noise; and as files."""

from __future__ import annotations

import re

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib.cli import main
from mwlib.data.formats.humanml import joints_of
from mwlib.experiments import sampling
from mwlib.networks.text import TextEncoder
from mwlib.text_to_motion.motions import fused_joints, steady_bones
from tests.text_to_motion.sample import untrained

pytestmark = pytest.mark.usefixtures("unchecked")

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


def test_places_are_read_with_steps_and_contacts_and_bones_keep_their_lengths_unless_told_otherwise(model):
    (features,) = model.sample(["someone falls"], [20], 3, ids=[0])
    steady = steady_bones(fused_joints(features.double(), model.layout), model.layout.skeleton)
    for options, expected in (({}, steady), ({"fused": True}, steady), ({"fused": False}, joints_of(features, model.layout))):
        (motion,) = mw.generate("someone falls", 1.0, seed=3, run=model, **options)
        np.testing.assert_allclose(motion.positions, expected.numpy(), atol=1e-5)


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


RANGE = "expected 0.4 to 1.2, 8 to 24 frames at 20 Hz, as the model was trained"
NO_WORDS = [(5, "5"), (None, "None"), (["someone falls"], ".*list."), ("", "''"), ("  ", "'  '")]
WORDLESS = [("...", "'...'"), ("!!!", "'!!!'"), ("\x00", r"'\\x00'")]
SPOILT = {  # argument -> values, how the message shows them, and what it expects
    "seconds": (
        *[(value, found, RANGE) for value, found in (
            (4.0, "4"), (0.2, "0.2"), (0, "0"), (-1, "-1"), (1e30, r"1e\+30"), (np.array(4.0), "4"), (torch.tensor(4.0), "4"))],
        *[(value, found, "expected a finite number") for value, found in (
            (float("nan"), "nan"), (float("inf"), "inf"), (True, "True"), (10**400, "10*"), (np.array("1"), "ndarray of .*"))],
        *[(value, found, "expected several numbers, or one") for value, found in (
            ("1", "'1'"), (1j, "1j .complex."), ({}, ".*"))],
    ),
    "samples": [(value, found, "expected") for value, found in (
        (0, "0"), (-1, "-1"), (1001, "1001"), (10**30, r"1e\+30"), (True, "True"), (1.0, "1.0"), ("2", "'2'"), (None, "None"))],
    "seed": [(value, found, "expected") for value, found in (
        (-1, "-1"), (1.5, "1.5"), ("1", "'1'"), (True, "True"), (float("nan"), "nan"))],
    "run": [(value, found, "expected a run of text_to_motion: its folder, its name or its model") for value, found in (
        (None, "None"), (5, "5"), (object(), "<object .*"))],
    "texts": [
        *[(value, found, "expected several sentences, or one") for value, found in (
            (None, "None"), (5, "5"), (b"someone falls", "b'someone falls'.*"), ({}, ".*"), (torch.ones(()), "Tensor of .*"))],
    ],
}  # fmt: skip
OTHERS = [
    *[({"texts": [TEXTS[0], text]}, rf"texts\[1\] is {found}; expected a sentence") for text, found in NO_WORDS],
    *[({"texts": [TEXTS[0], text]}, rf"texts\[1\] is {found}, without a word; expected a sentence") for text, found in WORDLESS],
    *[({"texts": text}, rf"texts\[0\] is '{text}', of which the model knows no word; expected some of its 8 words")
      for text in ("走る", "zxqv blorp", "Ein Mensch tanzt Tango")],
    ({"texts": []}, "0 lengths for 0 sentences; expected one each, and at least one sentence"),
    ({"texts": TEXTS, "seconds": [1, "1"]}, r"seconds\[1\] is '1'; expected a finite number"),
    ({"texts": TEXTS, "seconds": [1, [1]]}, r"seconds\[1\] is \[1\] .list.; expected a finite number"),
    ({"texts": TEXTS, "seconds": [0.6]}, "1 lengths for 2 sentences; expected one each"),
    ({"seconds": np.ones(2)}, "2 lengths for 1 sentences"),
]  # fmt: skip
OTHERS += [({name: value}, f"{name} is {found}; {expected}") for name, rows in SPOILT.items() for value, found, expected in rows]


@pytest.mark.parametrize("options, message", OTHERS)
def test_what_no_motion_can_follow_from_is_refused(model, options, message):
    with pytest.raises(ValueError, match=message):
        mw.generate(**{"texts": TEXTS[0], "seconds": 1.0, "run": model, **options})


@pytest.mark.parametrize("changes", [{"sampler": "ddim"}, {"sampler": "sde_dpm", "sampling_steps": 3}, {}])
def test_guidance_that_overflows_is_refused_with_the_settings(model, changes):
    hot = model.with_sampling(guidance=1e38, **changes)
    with pytest.raises(ValueError, match=r"samples are not finite: .*guidance=1e\+38.*; expected such as keep them finite"):
        mw.generate(TEXTS[0], 1.0, run=hot)


def test_words_that_the_model_does_not_know_are_told_with_near_ones(model):
    told = (
        r"not know 'rise' \(near: rises\), 'tango', 'he': it takes each .*; expected its 8 words, which `mwlib generate --words`"
    )
    with pytest.warns(UserWarning, match=told):
        found = mw.generate(["A person, rise! Tango", "he goes up"], 0.6, run=model)
    assert len(found) == 2
    with pytest.warns(UserWarning, match="'b', 'c', 'd', 'e', 'f' and 2 more: it takes"):
        mw.generate("a b c d e f g h", 0.6, run=model)


def test_a_model_that_makes_something_of_any_word_is_not_held_to_a_list(model):
    open_ended = untrained(text="ngrams")
    assert len(mw.generate(["走る", "zxqv blorp"], 0.6, run=open_ended)) == 2
    with pytest.raises(ValueError, match=r"texts\[0\] is '...', without a word; expected a sentence"):
        mw.generate("...", 0.6, run=open_ended)
    assert TextEncoder.read(open_ended.net.text, "🏃 up!\u200b \x00") == ["🏃", "up!"]  # as CLIP's features are asked
    assert TextEncoder.read(open_ended.net.text, " \u200b\x00\n") == []


def test_runs_that_are_missing_or_of_another_system_are_refused(monkeypatch, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"config.yaml is missing: no training run in this folder.*sentences"):
        mw.generate("someone falls", run=tmp_path / "nowhere")
    monkeypatch.setattr(sampling, "load_run", lambda run: object())
    with pytest.raises(ValueError, match="run is synthetic, a run of another system; expected one of text_to_motion"):
        mw.generate("someone falls", run="synthetic")


def test_the_command_writes_what_the_function_makes(monkeypatch, tmp_path, capsys, model):
    monkeypatch.setattr(sampling, "load_run", {"my/run": model}.__getitem__)
    asked = ["A person goes up!", "走 up"]
    words = ["generate", *asked, "--seconds", "0.6", "--samples", "2", "--seed", "3", "--run", "my/run", "--out", str(tmp_path)]
    with pytest.warns(UserWarning, match="does not know '走': it takes"):
        assert main(words) == 0
    said = capsys.readouterr().out.splitlines()
    names = ["01_a_person_goes_up.bvh", "02_a_person_goes_up.bvh", "03_up.bvh", "04_up.bvh"]
    assert sorted(file.name for file in tmp_path.iterdir()) == names
    with pytest.warns(UserWarning, match="does not know '走'"):
        expected = mw.generate(asked, 0.6, 2, 3, model)
    for line, name, motion in zip(said, names, expected, strict=True):
        (again,) = mw.load_motions(tmp_path / name, unit="cm", up="y")
        assert (len(again), again.fps, again.skeleton.joints) == (12, 20.0, motion.skeleton.joints)
        away = 1000 * np.linalg.norm(again.with_up("y").positions - motion.positions, axis=-1).mean()
        told = re.fullmatch(rf".*{name}: 12 frames at 20 Hz; joints ([\d.]+) mm from the sampled ones", line)
        assert told is not None and float(told[1]) == pytest.approx(away, rel=0.05, abs=0.2)


def test_the_command_lists_what_a_model_knows(monkeypatch, tmp_path, capsys, model):
    assert main(["generate", "--words"]) == 0
    said = capsys.readouterr().out
    assert "sentences has learnt 14 actions of synthetic people, such as" in said and "sentences knows 175 words:" in said
    actions, words = said.split("sentences knows 175 words:")
    told = re.findall(r"^  (\w+): (.+)$", actions, re.M)
    known = re.findall(r"[a-z]+", words)
    assert len(told) == 14 and len(known) == 175 and {"walks", "bow"} <= {*known}
    assert all({*sentence.split()} <= {*known} for _, sentence in told)
    models = {"toys": model, "any": untrained(text="ngrams")}
    monkeypatch.setattr(sampling, "load_run", models.__getitem__)
    assert main(["generate", "--words", "--run", "toys"]) == 0
    assert capsys.readouterr().out == (
        "toys has learnt from the captions of toy.\ntoys knows 8 words:\n  a, down, falls, goes, person, rises, someone, up\n"
    )
    assert main(["generate", "--words", "--run", "any"]) == 0
    assert capsys.readouterr().out.endswith("It reads any word (text=ngrams).\n")
    for words in (["someone falls", "--words"], []):
        assert main(["generate", *words, "--out", str(tmp_path)]) == 1
        assert "expected either sentences or --words" in capsys.readouterr().err
