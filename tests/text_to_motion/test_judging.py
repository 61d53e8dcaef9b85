"""The papers' protocol: real motions as a model, each known deviation, padding read as words, refusals, intervals."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from unittest.mock import Mock

import pytest
import torch

from mwlib.cli import main
from mwlib.data.captioned import piece
from mwlib.data.formats.humanml import CaptionedClip
from mwlib.experiments import judging as running
from mwlib.matching.evaluators import Matcher, TaggedCaption, TaggedVocabulary, Vocabulary
from mwlib.text_to_motion.judging import REAL, Once, Protocol, deviations, scores
from mwlib.text_to_motion.model import TextToMotion
from tests.matching.sample import toy_clips, untrained

TEST = toy_clips(40, "test", seed=3)
HOW = Protocol(pool=8, repeated=3, repeats=4)


def copying(judge: Matcher, clips: Sequence[CaptionedClip], seed: int = 0) -> Mock:
    """A model that answers with the test clip whose number it is given: its piece, or from its first frame on."""
    full = torch.tensor([len(clip.features) for clip in clips])
    lengths, starts = piece(full, *torch.rand(2, len(clips), generator=torch.Generator().manual_seed(seed + 1)))

    def sample(texts, frames, seed, *, ids, progress):
        numbers = [i % len(clips) for i in ids]
        firsts = [int(starts[i]) if length == lengths[i] else 0 for i, length in zip(numbers, frames, strict=True)]
        cuts = zip(numbers, firsts, frames, strict=True)
        return [torch.from_numpy(clips[i].features[first : first + length]) for i, first, length in cuts]

    model = Mock(spec=TextToMotion, statistics=judge.statistics, lengths=(4, 196))
    model.sample.side_effect = sample
    return model


def asked(model: Mock) -> int:
    """How many motions a model was asked for."""
    return sum(len(call.args[0]) for call in model.sample.call_args_list)


def test_real_motions_score_as_real_motions():
    """By FID, R-precision, MM-Dist and Diversity; motions that never differ have no MultiModality."""
    judge = untrained()
    found = scores(Once(copying(judge, TEST), 0), judge, TEST, HOW)
    model = found["model"]
    assert model.pop("multimodality") == pytest.approx(0, abs=1e-5)
    assert model == pytest.approx(found[REAL], abs=1e-6) and model["fid"] > 0


def test_each_deviation_moves_the_model_and_not_the_measure_of_real_motions():
    judge = untrained()
    model = copying(judge, TEST)
    model.statistics = replace(judge.statistics, mean=judge.statistics.mean + 0.3)
    base = scores(Once(model, 0), judge, TEST, HOW)
    measured = {name: base["model"][name] for name in base[REAL]}
    assert measured == pytest.approx(base[REAL], abs=1e-6), "the judge has statistics of its own"
    changes = deviations(HOW, 24, 40)
    moved = {name: scores(Once(model, 0), judge, TEST, replace(HOW, **change)) for name, change in changes.items()}
    assert len(moved) == 7
    for name, found in moved.items():
        real, made = (found[who] != pytest.approx(base[who]) for who in (REAL, "model"))
        assert real == (name in ("clips whole", "pool of 4")), name
        assert made == (name != "best of 4 by the judge"), name  # four copies are one
    assert all(moved["pool of 4"][who]["top1"] >= base[who]["top1"] for who in base)


def test_the_best_by_the_judge_is_nearest_to_its_sentence():
    judge, model = untrained(), copying(untrained(), TEST)
    copy = model.sample.side_effect
    model.sample.side_effect = lambda texts, frames, seed, ids, progress: [
        x * (1 + i // len(TEST)) for x, i in zip(copy(texts, frames, seed, ids=ids, progress=progress), ids, strict=True)
    ]
    one, best = (scores(Once(model, 0), judge, TEST, replace(HOW, best_of=n))["model"]["mm_dist"] for n in (1, 4))
    assert best < one


def test_motions_of_a_seed_are_made_once():
    judge = untrained()
    model = copying(judge, TEST)
    once = Once(model, 0)
    first = scores(once, judge, TEST, HOW)
    assert asked(model) == 40 + 3 * 3  # one of the four of each repeated sentence is there
    again = scores(once, judge, TEST, replace(HOW, pool=4))
    assert asked(model) == 49 and again["model"]["fid"] == first["model"]["fid"]


def test_padding_is_read_as_unknown_words():
    words = TaggedVocabulary(["a", "unk", "sos", "eos"])
    words.padded = True
    numbers, counts, parts = words.ids([TaggedCaption("a", [("a", "DET")])])
    assert numbers.tolist() == [[2, 0, 3, *[1] * 19]] and counts.tolist() == [22]
    assert parts.shape == (1, 22, 15) and parts[0, 3:].argmax(1).tolist() == [14] * 19
    words = Vocabulary(["a", "man", "walks"], longest=5)
    words.padded = True
    numbers, counts = words.ids(["a man walks"])
    assert numbers.tolist() == [[1, 3, 4, 5, 2, 0, 0]] and counts.tolist() == [7]


@pytest.mark.parametrize("wrong", [{"pool": 2}, {"clips": 2}, {"frames": 42}, {"repeats": 1}])
def test_protocols_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} "):
        Protocol(**wrong)


def test_all_that_is_missing_is_told_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path))
    with pytest.raises(FileNotFoundError) as told:
        running.open_all(str(tmp_path / "latest.tar"), "HumanML3D", str(tmp_path / "judge"), str(tmp_path / "clip"))
    for part in ("h-y1heng/StableMoFusion links", "mwlib fetch humanml3d", "EricGuo5513/text-to-motion links"):
        assert part in str(told.value)


def test_intervals_are_of_paired_differences():
    rows, less = [{"fid": 1.0}, {"fid": 2.0}], [{"fid": 0.5}, {"fid": 1.5}]
    assert running.with_intervals(rows)["fid"] == pytest.approx((1.5, 0.98 / 2**0.5))
    assert running.with_intervals(rows, less)["fid"] == (0.5, 0.0)
    assert running.with_intervals(rows[:1])["fid"] == (1.0, None)


@pytest.mark.parametrize("count, said", [(1, "one replicate"), (2, "2 replicates")])
def test_one_replicate_has_no_interval(tmp_path, monkeypatch, capsys, count, said):
    rows = [{REAL: {"fid": 0.5 * i}, "model": {"fid": 1.25}} for i in range(count)]
    monkeypatch.setattr(running, "open_all", Mock())
    monkeypatch.setattr(running, "replicates", Mock(return_value=(tmp_path, rows)))
    assert main(["judge", "--replicates", str(count)]) == 0
    out, kept = capsys.readouterr().out, json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert said in out and "1.25" in out and ("±" in out) == (count > 1)
    assert kept["scores"]["model"]["fid"] == [1.25, None if count == 1 else 0.0]
