"""The papers' protocol: padding read as words, refusals, what is missing, intervals."""

from __future__ import annotations

import pytest

from mwlib.experiments import judging as running
from mwlib.matching.clips import TaggedCaption, TaggedVocabulary
from mwlib.text_to_motion.judging import PaddedWords, Protocol


def test_padding_is_read_as_unknown_words():
    words = PaddedWords(TaggedVocabulary(["a", "unk", "sos", "eos"]))
    numbers, counts, parts = words.ids([TaggedCaption("a", [("a", "DET")])])
    assert numbers.tolist() == [[2, 0, 3, *[1] * 19]] and counts.tolist() == [22]
    assert parts.shape == (1, 22, 15) and parts[0, 3:].argmax(1).tolist() == [14] * 19


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
