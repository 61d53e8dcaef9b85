"""The data of a training: what is left out is named, and what cannot be trained on says why."""

from __future__ import annotations

import warnings

import pytest

from mwlib import write_bvh
from mwlib.prediction.system import load_data
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_settings import small

WALK = synthetic_motions(subjects=1, seconds=4.0)[0].resample(10.0)


def folder_of(tmp_path, **frames: int):
    for name, count in frames.items():
        write_bvh(WALK.cut(0, count), tmp_path / f"{name}.bvh")
    return small(data=str(tmp_path))


def test_short_clips_are_left_out_and_named(tmp_path):
    cfg = folder_of(tmp_path, a=40, b=20, c=21, d=10, e=40)
    expected = r"2 of 4 train clips are left out, no longer than 20 frames \(history \+ future\) at 10 Hz: b, d"
    with pytest.warns(UserWarning, match=expected) as caught:
        split = load_data(cfg)
    assert len(caught) == 1 and [m.name for m in split.test] == ["e"]


def test_long_clips_need_no_word(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_data(folder_of(tmp_path, a=40, b=40))


@pytest.mark.parametrize(
    ("clips", "message"),
    [
        (
            {"a": 40, "b": 10},
            "no test clip is longer than 20 frames .* the longest, 'b', has 10. Longer clips, a smaller history",
        ),
        ({"a": 10, "b": 40}, "no train clip is longer .*'a', has 10"),
        ({"a": 40}, "no training clips: .* has 1 clips .*Add a clip, or cut a long one into two files"),
    ],
)
def test_what_cannot_be_trained_on_says_what_would_help(tmp_path, clips, message):
    with pytest.raises(ValueError, match=message):
        load_data(folder_of(tmp_path, **clips))
