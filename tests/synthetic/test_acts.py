"""Actions do what their attributes say, by geometry written out; clips are deterministic and split by person."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from mwlib.body.skeleton import HUMANML22
from mwlib.data.captioned import captioned_people
from mwlib.synthetic.acts import PEOPLE, RANGES, act_out, captioned_positions
from mwlib.synthetic.person import draw_figure
from mwlib.synthetic.sentences import PAIRS, RECIPES, draw_attributes

JOINT = {name: joint for joint, name in enumerate(HUMANML22.joints)}
OTHER = {"left": "right", "right": "left"}


def acted(seed=0, **attributes):
    rng = np.random.default_rng(seed)
    return act_out(attributes, draw_figure(rng), rng)


def turned_to_the_left(positions):
    """Degrees by which the line from the right to the left hip turns from +z (forward) towards +x (left)."""
    across = positions[:, JOINT["left_hip"]] - positions[:, JOINT["right_hip"]]
    angle = np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))
    return np.rad2deg(angle[-1] - angle[0])


def speed_of(positions):
    root = positions[:, 0, [0, 2]]
    return np.linalg.norm(root[10:] - root[:-10], axis=-1).mean() / 0.5


@pytest.mark.parametrize("action, speed", [*product(("walk", "run"), ("slow", "normal", "fast"))])
def test_speeds(action, speed):
    low, high = map(float, RANGES[f"{speed} {action}"].split())
    for seed in range(3):
        positions = acted(seed, action=action, speed=speed, path="straight")
        assert low - 0.06 < speed_of(positions) < high + 0.06
        assert positions[-1, 0, 2] > 5 * abs(positions[-1, 0, 0])


def test_steps_back_and_jumps_ahead_get_there():
    positions = acted(action="walk", direction="backward")
    assert positions[-1, 0, 2] < -1.0 and abs(turned_to_the_left(positions)) < 25
    here, there = (acted(action="jump", height="normal", count=2, direction=d)[-1, 0, 2] for d in ("in_place", "forward"))
    assert there > 1.0 and there > here + 0.7


@pytest.mark.parametrize("action, side", [*product(("walk", "run"), OTHER)])
def test_circles_and_turns_go_to_their_side(action, side):
    sign = 1 if side == "left" else -1
    circle, turn = (acted(4, action=action, speed="normal", path=f"{side}_{kind}") for kind in ("circle", "turn"))
    assert 190 < sign * turned_to_the_left(circle) < 380 and 45 < sign * turned_to_the_left(turn) < 130
    steps = np.diff(circle[::10, 0], axis=0)
    bends = np.cross(steps[:-1], steps[1:])[:, 1]  # about the up-axis: positive where z goes to x
    assert (sign * bends > 0).mean() > 0.9
    around = circle[:, 0] - circle[:, 0].mean(axis=0)
    assert sign * around[0, 0] < 0  # the centre is on that side
    assert sign * (turn[-1, 0, 0] - turn[0, 0, 0]) > 0.5


@pytest.mark.parametrize("side, degrees", [*product(OTHER, (90, 180))])
def test_turns_on_the_spot(side, degrees):
    positions = acted(2, action="turn", turn=side, degrees=float(degrees), pace="normal")
    change = turned_to_the_left(positions) * (1 if side == "left" else -1)
    assert 0.85 * degrees < change < 1.15 * degrees
    assert np.linalg.norm(positions[:, 0, [0, 2]], axis=-1).max() < 0.5


@pytest.mark.parametrize("hand", ["left", "right", "both"])
def test_waving_hands_are_up(hand):
    positions = acted(action="wave", hand=hand, pace="normal")
    for side in OTHER:
        wrist, shoulder = positions[:, JOINT[f"{side}_wrist"], 1], positions[:, JOINT[f"{side}_shoulder"], 1]
        if hand in (side, "both"):
            assert (wrist > shoulder + 0.15).mean() > 0.4
        else:
            assert (wrist < shoulder - 0.2).all()


@pytest.mark.parametrize("foot, count", [*product(OTHER, (1, 2, 3))])
def test_kicks_by_foot_and_number(foot, count):
    positions = acted(action="kick", foot=foot, count=count, height="normal")
    height, other = positions[:, JOINT[f"{foot}_ankle"], 1], positions[:, JOINT[f"{OTHER[foot]}_ankle"], 1]
    ahead = positions[:, JOINT[f"{foot}_ankle"], 2] - positions[:, 0, 2] > 0.3
    up = np.concatenate([[False], (height > 0.4) & ahead])
    assert np.count_nonzero(np.diff(up.astype(int)) == 1) == count and other.max() < 0.25


@pytest.mark.parametrize("height, count", [*product(("low", "normal", "high"), (1, 2, 3))])
def test_jumps_by_height_and_number(height, count):
    positions = acted(action="jump", height=height, count=count, direction="in_place")
    toes = positions[:, [JOINT["left_foot"], JOINT["right_foot"]], 1].min(axis=1)
    flies = np.concatenate([[False], toes > 0.01])
    assert np.count_nonzero(np.diff(flies.astype(int)) == 1) == count
    ankles = positions[:, [JOINT["left_ankle"], JOINT["right_ankle"]], 1].min(axis=1)
    low, high = map(float, RANGES[f"{height} jump"].split())
    assert low - 0.03 < ankles.max() - ankles.min() < high + 0.03
    falls = np.flatnonzero(flies)[0] - 1
    seconds = np.count_nonzero(flies) / count / 20
    assert abs(seconds - 2 * np.sqrt(2 * (ankles.max() - ankles.min()) / 9.81)) < 0.12 and falls > 5


@pytest.mark.parametrize("hand", list(OTHER))
def test_hands_that_reach_punch_and_pick_up(hand):
    own, other = JOINT[f"{hand}_wrist"], JOINT[f"{OTHER[hand]}_wrist"]
    up, ahead = (acted(action="reach", hand=hand, target=target) for target in ("up", "forward"))
    assert up[:, own, 1].max() > up[:, JOINT["head"], 1].max() + 0.1 and up[:, other, 1].max() < 1.1
    assert (ahead[:, own, 2] - ahead[:, 0, 2]).max() > 0.55 > 0.4 > (ahead[:, other, 2] - ahead[:, 0, 2]).max()
    fallen = acted(action="pick_up", hand=hand)
    assert fallen[:, own, 1].min() < 0.36 and fallen[:, own, 1].min() < fallen[:, other, 1].min() - 0.05
    for count in (1, 2, 3):
        punch = acted(action="box", hand=hand, count=count)
        ahead = (punch[:, own] - punch[:, JOINT[f"{hand}_shoulder"]])[:, 2] > 0.42
        assert np.count_nonzero(np.diff(np.r_[0, ahead.astype(int)]) == 1) == count
        assert (punch[:, other] - punch[:, JOINT[f"{OTHER[hand]}_shoulder"]])[:, 2].max() < 0.4


def test_low_postures():
    for seated, ends in ((True, "seated"), (False, "standing")):
        height = acted(action="sit", ends=ends)[:, 0, 1]
        assert height.min() < 0.62 * height.max() and (height[-1] < 0.65 * height[0]) == seated
    for count in (1, 2, 3):
        low = acted(action="squat", count=count)[:, 0, 1]
        assert np.count_nonzero(np.diff((low < 0.7 * low.max()).astype(int)) == 1) == count
    bow = acted(action="bow")
    assert bow[:, JOINT["head"], 1].min() < 0.8 * bow[0, JOINT["head"], 1] and bow[:, 0, 1].min() > 0.88 * bow[0, 0, 1]
    still = acted(action="stand")
    assert np.linalg.norm(np.diff(still, axis=0), axis=-1).max() * 20 < 0.5


def test_two_actions_come_in_order():
    walk_first = acted(action="walk", then="wave", hand="left", speed="normal", path="straight")
    wave_first = acted(action="wave", then="walk", hand="left", speed="normal", path="straight")
    for positions, first in ((walk_first, True), (wave_first, False)):
        frames = np.arange(len(positions))
        up = positions[:, JOINT["left_wrist"], 1] > positions[:, JOINT["left_shoulder"], 1] + 0.1
        goes = np.gradient(positions[:, 0, 2]) * 20 > 0.5
        assert (frames[goes].mean() < frames[up].mean()) == first


def test_recipes_draw_what_they_list():
    rng = np.random.default_rng(0)
    drawn = [draw_attributes(rng) for _ in range(3000)]
    assert {a["action"] for a in drawn} == set(RECIPES) - {"backward"}
    assert {(a["action"], a["then"]) for a in drawn if "then" in a} == set(PAIRS)
    assert 0.2 < np.mean(["then" in a for a in drawn]) < 0.3
    for action, recipe in RECIPES.items():
        for name, values in recipe.items():
            found = {a[name] for a in drawn if a["action"] == action and "then" not in a and name in a}
            number = name in ("count", "degrees")
            assert found == {float(v) if number else v for v in values.split()} or action == "backward"
    sided = {"left", "right", "both"}
    assert all(sum(a.get(n) in sided for n in ("hand", "foot")) <= 1 for a in drawn)


@pytest.fixture(scope="module")
def clips():
    return captioned_positions(PEOPLE + 4, seed=2)


def test_clips_depend_on_seed_and_number_only_and_split_by_person(clips):
    shares = {split: np.mean([clip.split == split for clip in clips[:PEOPLE]]) for split in ("train", "val", "test")}
    assert shares == {"train": 0.8, "val": 0.05, "test": 0.15}
    split_of = {}
    for clip in clips:
        assert split_of.setdefault(clip.name.split("_")[0], clip.split) == clip.split
    assert len(split_of) == PEOPLE and len({clip.name for clip in clips}) == len(clips)
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


@pytest.mark.parametrize("make", [captioned_people, captioned_positions])
def test_impossible_sizes_are_refused(make):
    with pytest.raises(ValueError, match="clips is 0; expected at least 1"):
        make(0)
