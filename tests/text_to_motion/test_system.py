"""Evaluation: baselines are what they say, metrics are those of mw.metrics, claims are read off the bodies."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib.data.captioned import captioned_people
from mwlib.data.formats.humanml import HUMANML3D, KIT, CaptionedClip
from mwlib.matching.evaluators import Matcher, Vocabulary
from mwlib.text_to_motion import system
from mwlib.text_to_motion.attributes import CLAIMS, claims_met, movement
from mwlib.text_to_motion.system import any_clip, evaluate, mean_pose, nearest_caption
from tests.text_to_motion.sample import clip, small, toy, untrained


class Judge(Matcher):
    """Embeds a motion by its mean, a sentence by where it goes."""

    def __init__(self, words: str = "a person goes up down someone rises falls") -> None:
        self.vocabulary = Vocabulary(words.split(), 20)

    def embed_motion(self, features, lengths):
        mask = torch.arange(features.shape[1]) < lengths[:, None]
        return (features[..., :6] * mask[..., None]).sum(1) / lengths[:, None]

    def embed_text(self, texts):
        return torch.tensor([[1.0 if "up" in text or "rises" in text else -1.0] * 6 for text in texts])


def scores(monkeypatch, **changes):
    monkeypatch.setattr(system, "open_matcher", lambda name, layout: Judge())
    return evaluate(small(**changes), lambda: pytest.fail("no model is needed"), toy())


def test_the_truth_is_right_and_others_captions_are_not(monkeypatch):
    truth, other, mean = (scores(monkeypatch, method=m)["mean"] for m in ("truth", "other_captions", "mean_pose"))
    assert truth["fid"] == pytest.approx(0, abs=1e-6) and other["fid"] == pytest.approx(0, abs=1e-6)
    assert truth["mm_dist"] < other["mm_dist"] and truth["top1"] >= other["top1"]
    assert mean["fid"] > 1 and mean["diversity"] < 0.01 < truth["diversity"] and mean["jerk"] < 0.2 < truth["jerk"]
    assert scores(monkeypatch, method="nearest_caption")["mean"]["mm_dist"] < other["mm_dist"]


def test_metrics_are_the_public_ones(monkeypatch):
    found = scores(monkeypatch, method="any_clip", sampling_seed=3)
    parts = toy()
    motions = [torch.from_numpy(parts.train[i].features) for i in any_clip(parts.train, 6, 3)]
    motions = [x[: len(x) // 4 * 4] for x in motions]
    real = [torch.from_numpy(c.features[: len(c.features) // 4 * 4]) for c in parts.test]
    made, true = Judge().embed_motions(motions), Judge().embed_motions(real)
    assert found["mean"]["fid"] == pytest.approx(mw.metrics.fid(made, true), rel=1e-6)
    assert found["windows"] == 6 and found["clips"] == [c.name for c in parts.test]
    assert found["values"]["way"] == pytest.approx([movement(x, HUMANML3D)["way"] for x in motions])
    assert not {*CLAIMS} & {*movement(motions[0], HUMANML3D)}  # a claim and a measure of one name would be mixed


def test_replicates_are_averaged_with_their_error_and_holes(monkeypatch):
    found = scores(monkeypatch, method="any_clip", replicates=3)
    single = [scores(monkeypatch, method="any_clip", sampling_seed=1000 * r)["mean"]["fid"] for r in range(3)]
    assert found["mean"]["fid"] == pytest.approx(np.mean(single))
    assert found["standard_error"]["fid"] == pytest.approx(np.std(single, ddof=1) / 3**0.5)
    values = np.array([[1.0, np.nan, np.nan], [3.0, 5.0, np.nan]])
    assert np.array_equal(system._over_replicates(values), [2.0, 5.0, np.nan], equal_nan=True)


def test_people_do_what_is_said_of_them_and_others_do_not():
    people = captioned_people(12)
    hits = [claims_met(torch.from_numpy(c.features), c, HUMANML3D) for c in people]
    values = [value for met in hits for value in met.values()]
    assert np.mean(values) > 0.9 and all("action" in met for met in hits)
    still = torch.from_numpy(people[0].features[:1]).repeat(60, 1)
    still[:, :3] = 0.0  # neither turning nor going
    assert claims_met(still, people[0], HUMANML3D)["action"] == 0.0
    assert claims_met(torch.from_numpy(people[0].features), clip(0), HUMANML3D) == {}


def test_movement_of_one_who_slides_on_toes_not_heels():
    x = torch.zeros(40, HUMANML3D.width)
    x[:, HUMANML3D.blocks["root_velocity"]] = torch.tensor([0.03, 0.04])  # 1 m/s, as a statue
    found = movement(x, HUMANML3D)
    assert found["way"] == pytest.approx(39 * 0.05, rel=1e-4) and found["joint_speed"] == pytest.approx(1.0, rel=1e-3)
    assert found["skate"] == pytest.approx(1.0, rel=1e-3) and found["jerk"] == pytest.approx(0, abs=0.2)
    assert math.isclose(found["bone_jitter"], 0, abs_tol=1e-6)
    """KIT's toes are joints beyond what it calls feet; a body without motion but for its toes."""
    x = torch.zeros(20, KIT.width)
    toes = [KIT.skeleton.joints.index(name) for name in ("left_toe", "right_toe")]
    for toe in toes:
        x[:, KIT.blocks["positions"]].unflatten(-1, (-1, 3))[:, toe - 1, 2] += 100 * torch.arange(20)
    found = movement(x, KIT)
    assert found["skate"] == pytest.approx(100 * KIT.metres_per_unit * KIT.fps, rel=1e-3)


def test_words_are_counted_for_any_sentences(monkeypatch):
    train = toy().train
    assert train[nearest_caption(train, ["a person goes down"])[0]].captions[0] == "a person goes down"
    assert [len(x) for x in mean_pose(train, [8, 12])] == [8, 12]
    train = toy().train
    assert nearest_caption(train, ["...", "!"]) == [0, 0]
    texts = ["someone falls", "a person goes up", "..."] * 3
    whole = nearest_caption(train, texts)
    monkeypatch.setattr(system, "ROWS", 2)
    assert nearest_caption(train, texts) == whole


def test_what_cannot_be_judged_is_refused_or_doubted(monkeypatch):
    monkeypatch.setattr(system, "open_matcher", lambda name, layout: Judge())
    parts = toy()
    with pytest.raises(ValueError, match="there are 2 test clips; expected at least 3"):
        evaluate(small(method="truth"), lambda: None, parts._replace(test=parts.test[:2]))
    monkeypatch.setattr(system, "open_matcher", lambda name, layout: Judge("a person goes"))
    with pytest.warns(UserWarning, match="evaluator does not know .* words of the test captions, such as"):
        evaluate(small(method="truth"), lambda: None, toy())


def test_the_mean_pose_of_many_frames_is_exact():
    many = CaptionedClip(np.full((200_000, HUMANML3D.width), 0.1, np.float32) + np.float32(0.9), ("a",))
    assert torch.allclose(mean_pose([many], [1])[0], torch.from_numpy(many.features[:1]), rtol=0, atol=1e-7)


def test_actions_are_counted_one_by_one_and_unknown_ones_left_out():
    shown = {"a": "wave", "b": "wave", "c": "kick", "d": None, "e": "kick", "f": "sit"}
    test = [
        dataclasses.replace(clip(0), name=name, attributes={"action": action} if action else {}) for name, action in shown.items()
    ]
    found = {"clips": ["a", "b", "c", "d", "e"], "values": {"action": [1.0, 0.0, 1.0, 1.0, math.nan]}}
    rows = system.right_by_action(untrained(), test, found)
    assert rows == {"kick": {"right": 1.0, "clips": 1}, "wave": {"right": 0.5, "clips": 2}}
    assert "| wave | 0.50 | 2 |" in system.card_of_actions(rows)[0]
