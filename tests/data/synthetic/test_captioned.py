"""The captioned set: deterministic, split by person, in features that decode to the positions they came from."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.data.captioned_people import PEOPLE, captioned_people, captioned_positions
from mwlib.data.formats.humanml import HUMANML3D, joints_of


@pytest.fixture(scope="module")
def clips():
    return captioned_positions(PEOPLE + 4, seed=2)


def test_nobody_is_in_two_splits_and_the_shares_are_those_of_humanml3d(clips):
    shares = {split: np.mean([clip.split == split for clip in clips[:PEOPLE]]) for split in ("train", "val", "test")}
    assert shares == {"train": 0.8, "val": 0.05, "test": 0.15}
    split_of = {}
    for clip in clips:
        assert split_of.setdefault(clip.name.split("_")[0], clip.split) == clip.split
    assert len(split_of) == PEOPLE and len({clip.name for clip in clips}) == len(clips)


def test_a_clip_depends_on_seed_and_number_only(clips):
    again, other = captioned_positions(3, seed=2), captioned_positions(3, seed=3)
    for a, b, c in zip(clips, again, other, strict=False):
        np.testing.assert_array_equal(a.positions, b.positions)
        assert (a.captions, a.attributes, a.name) == (b.captions, b.attributes, b.name)
        assert a.positions.shape != c.positions.shape or not np.allclose(a.positions, c.positions)


def test_a_person_keeps_its_bones_and_acts_anew(clips):
    first, later = clips[1], clips[PEOPLE + 1]
    assert first.name.split("_")[0] == later.name.split("_")[0]
    shin = [np.linalg.norm(clip.positions[:, 7] - clip.positions[:, 4], axis=-1) for clip in (first, later, clips[2])]
    np.testing.assert_allclose(shin[0][0], shin[1], atol=1e-12)
    assert abs(shin[0][0] - shin[2][0]) > 1e-4 and (first.captions, first.attributes) != (later.captions, later.attributes)


def test_features_hold_the_positions(clips):
    for acted, clip in zip(clips, captioned_people(4, seed=2), strict=False):
        assert clip.features.dtype == np.float32 and clip.features.shape == (len(acted.positions) - 1, HUMANML3D.width)
        assert 40 <= len(clip.features) <= 120 and len(clip.features) % 4 == 0
        assert (clip.captions, clip.name, clip.split) == (acted.captions, acted.name, acted.split)
        assert dict(clip.attributes) == acted.attributes
        decoded = joints_of(clip.features, HUMANML3D)
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(decoded[:, 0], axis=0), axis=-1),
            np.linalg.norm(np.diff(acted.positions[:-1, 0], axis=0), axis=-1),
            atol=1e-4,
        )
        np.testing.assert_allclose(decoded[..., 1], acted.positions[:-1, :, 1], atol=2e-2)


@pytest.mark.parametrize("make", [captioned_people, captioned_positions])
def test_impossible_sizes_are_refused(make):
    with pytest.raises(ValueError, match="clips is 0; expected at least 1"):
        make(0)
