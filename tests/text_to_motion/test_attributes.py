"""Attributes measured from positions: right on synthetic people whose attributes are known, mirrored on their mirror images."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from mwlib.body.skeleton import HUMANML22
from mwlib.data.formats.humanml import HUMANML3D, joints_of
from mwlib.data.formats.humanml_encoding import features_of
from mwlib.synthetic.acts import act_out, captioned_positions
from mwlib.synthetic.person import draw_figure
from mwlib.text_to_motion.attributes import CLAIMS, measured_attributes

OTHER = {"left": "right", "right": "left"}


@pytest.fixture(scope="module")
def clips():
    return captioned_positions(180, seed=31)


def shares(positions, attributes):
    """By attribute, the share of clips that show what is claimed, of those of which it is claimed."""
    shown = {}
    for clip, claims in zip(positions, attributes, strict=True):
        found = measured_attributes(clip)
        for name, value in ((name, claims[name]) for name in CLAIMS if name in claims):
            shown.setdefault(name, []).append(found.get(name) == value)
    return {name: np.mean(values) for name, values in shown.items()}


def test_attributes_of_synthetic_people_are_measured_right(clips):
    right = shares([clip.positions for clip in clips], [clip.attributes for clip in clips])
    assert set(right) == set(CLAIMS) and min(right.values()) >= 0.95, right


def test_nothing_is_found_that_was_not_claimed(clips):
    more = [clip for clip in clips if "then" not in clip.attributes and "then" in measured_attributes(clip.positions)]
    assert len(more) <= 0.02 * len(clips)


def test_features_and_a_little_noise_change_nothing_much(clips):
    rng = np.random.default_rng(0)
    decoded = [joints_of(features_of(clip.positions), HUMANML3D) for clip in clips[:120]]
    noisy = [positions + rng.normal(0.0, 0.003, positions.shape) for positions in decoded]
    right = shares(noisy, [clip.attributes for clip in clips[:120]])
    assert min(right.values()) > 0.85, right


def test_the_other_side_in_the_mirror(clips):
    def mirrored(value):
        side, _, kind = str(value).partition("_")
        return "_".join([OTHER[side], *([kind] if kind else [])]) if side in OTHER else value

    for clip in clips[:60]:
        found = measured_attributes(clip.positions)
        image = measured_attributes(clip.positions[:, HUMANML22.mirror] * [-1.0, 1.0, 1.0])
        assert image == {name: mirrored(value) for name, value in found.items()}


def test_place_and_direction_do_not_matter(clips):
    cos, sin = np.cos(2.5), np.sin(2.5)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    for clip in clips[60:90]:
        assert measured_attributes(clip.positions) == measured_attributes(clip.positions @ turn.T + [3.0, 0.5, -7.0])


def test_a_left_hand_that_a_ruler_sees_is_a_left_hand():
    rng = np.random.default_rng(0)
    positions = act_out({"action": "stand"}, draw_figure(rng), rng).copy()
    left_wrist, left_elbow = (HUMANML22.joints.index(f"left_{joint}") for joint in ("wrist", "elbow"))
    assert (positions[:, left_wrist, 0] > 0).all()
    swing = 0.12 * np.sin(2 * np.pi * 2.0 * np.arange(len(positions)) / 20)
    shoulder = positions[:, HUMANML22.joints.index("left_shoulder")]
    positions[:, left_elbow] = shoulder + [0.27, 0.02, 0.0]
    positions[:, left_wrist] = positions[:, left_elbow] + np.stack([swing, np.sqrt(0.25**2 - swing**2), 0 * swing], axis=-1)
    found = measured_attributes(positions)
    assert (found["action"], found["hand"]) == ("wave", "left")


def test_clips_of_other_captions_score_near_chance(clips):
    actions = Counter(clip.attributes["action"] for clip in clips)
    right = shares([clip.positions for clip in clips[7:] + clips[:7]], [clip.attributes for clip in clips])
    assert right["action"] < actions.most_common(1)[0][1] / len(clips) + 0.05 and max(right.values()) < 0.6


@pytest.mark.parametrize("size", [0.0, 0.05, 3.0])
def test_what_is_no_body_is_measured_all_the_same(size):
    rng = np.random.default_rng(3)
    for frames in (10, 47, 196):
        positions = size * np.cumsum(rng.normal(size=(frames, 22, 3)), axis=0)
        assert "action" in measured_attributes(positions)


@pytest.mark.parametrize("positions, message", [
    (np.full((20, 22, 3), np.nan), "1320 values that are not finite; expected metres"),
    (np.zeros((40, 21, 3)), ".40, 21, 3.*; expected metres, .T, 22, 3. with at least 10 frames"),
    (np.zeros((9, 22, 3)), ".9, 22, 3.*; expected metres, .T, 22, 3. with at least 10 frames"),
])  # fmt: skip
def test_what_cannot_be_measured_is_refused(positions, message):
    with pytest.raises(ValueError, match=message):
        measured_attributes(positions)
