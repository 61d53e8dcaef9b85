"""Evaluation: yardsticks are what they say, metrics are those of mw.metrics, claims are read off the bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib.data.formats.humanml import HUMANML3D
from mwlib.data.synthetic.captioned import captioned_people
from mwlib.text_to_motion import evaluation
from mwlib.text_to_motion.baselines import any_clip, mean_pose, nearest_caption
from mwlib.text_to_motion.dataset import CaptionsConfig, Parts, fingerprint, load_clips
from mwlib.text_to_motion.evaluation import embed, evaluate, thinned
from mwlib.text_to_motion.matching import Matcher
from mwlib.text_to_motion.realism import CLAIMS, claims_met, movement
from tests.text_to_motion.sample import clip, small, toy


class Judge(Matcher):
    """Embeds a motion by its mean, a sentence by where it goes."""

    def __init__(self) -> None: ...

    def embed_motion(self, features, lengths):
        mask = torch.arange(features.shape[1]) < lengths[:, None]
        return (features[..., :6] * mask[..., None]).sum(1) / lengths[:, None]

    def embed_text(self, texts):
        return torch.tensor([[1.0 if "up" in text or "rises" in text else -1.0] * 6 for text in texts])


def scores(monkeypatch, **changes):
    monkeypatch.setattr(evaluation, "open_matcher", lambda name, layout: Judge())
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
    made, true = embed(Judge(), motions), embed(Judge(), real)
    assert found["mean"]["fid"] == pytest.approx(mw.metrics.fid(made, true), rel=1e-6)
    assert found["windows"] == 6 and found["clips"] == [c.name for c in parts.test]
    assert found["values"]["way"] == pytest.approx([movement(x, HUMANML3D)["way"] for x in motions])
    assert not {*CLAIMS} & {*movement(motions[0], HUMANML3D)}  # a claim and a measure of one name would be mixed


def test_replicates_are_averaged_with_their_error(monkeypatch):
    found = scores(monkeypatch, method="any_clip", replicates=3)
    single = [scores(monkeypatch, method="any_clip", sampling_seed=1000 * r)["mean"]["fid"] for r in range(3)]
    assert found["mean"]["fid"] == pytest.approx(np.mean(single))
    assert found["standard_error"]["fid"] == pytest.approx(np.std(single, ddof=1) / 3**0.5)


def test_embedding_in_chunks_changes_nothing():
    motions = [torch.from_numpy(c.features) for c in toy().train]
    torch.testing.assert_close(embed(Judge(), motions), embed(Judge(), motions, chunk=7))


def test_people_do_what_is_said_of_them_and_others_do_not():
    people = captioned_people(12)
    hits = [claims_met(torch.from_numpy(c.features), c, HUMANML3D) for c in people]
    values = [value for met in hits for value in met.values()]
    assert np.mean(values) > 0.9 and all("action" in met for met in hits)
    still = torch.from_numpy(people[0].features[:1]).repeat(60, 1)
    still[:, :3] = 0.0  # neither turning nor going
    assert claims_met(still, people[0], HUMANML3D)["action"] == 0.0
    assert claims_met(torch.from_numpy(people[0].features), clip(0), HUMANML3D) == {}


def test_movement_of_one_who_slides():
    x = torch.zeros(40, HUMANML3D.width)
    x[:, HUMANML3D.blocks["root_velocity"]] = torch.tensor([0.0, 0.05])  # 1 m/s ahead, as a statue
    found = movement(x, HUMANML3D)
    assert found["way"] == pytest.approx(39 * 0.05, rel=1e-4) and found["joint_speed"] == pytest.approx(1.0, rel=1e-3)
    assert found["skate"] == pytest.approx(1.0, rel=1e-3) and found["jerk"] == pytest.approx(0, abs=0.2)
    assert math.isclose(found["bone_jitter"], 0, abs_tol=1e-6)


def test_thinned_clips_are_spread_evenly():
    clips = toy().train
    assert thinned(clips, 0) == clips == thinned(clips, 99)
    assert [c.name for c in thinned(clips, 3)] == [clips[0].name, clips[14].name, clips[29].name]


def test_words_are_counted_and_lengths_kept():
    train = toy().train
    assert train[nearest_caption(train, ["a person goes down"])[0]].captions[0] == "a person goes down"
    assert [len(x) for x in mean_pose(train, [8, 12])] == [8, 12]


def test_people_are_parted_and_known_again():
    parts = load_clips(CaptionsConfig(clips=80))
    people = [{c.name.split("_")[0] for c in part} for part in parts]
    assert not (people[0] & people[1] or people[0] & people[2] or people[1] & people[2])
    assert parts.layout == HUMANML3D and parts.fingerprints() == load_clips(CaptionsConfig(clips=80)).fingerprints()
    few = load_clips(CaptionsConfig(clips=80, few=5, longest=60))
    assert len(few.train) == 5 and max(len(c.features) for part in few for c in part) <= 60
    assert fingerprint(parts.train) != fingerprint(parts.train[1:])
    with pytest.raises(ValueError, match="people has 0 clips to train and 0 to test on, of 150 frames"):
        load_clips(CaptionsConfig(clips=80, shortest=150))
    assert isinstance(parts, Parts)
