"""A model on the LaFAN1 benchmark: the truth goes through the conversion and back without an error; what the rows say."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

import mwlib as mw
from mwlib.body.rotation import multiply
from mwlib.data.sources import Split
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.lafan1 import PAST, Frames, lafan1_benchmark, score, score_frames
from mwlib.inbetweening.lafan1_model import check_model, fill, model_table, to_frames, to_states
from mwlib.inbetweening.lafan1_table import LENGTHS, interpolation
from mwlib.inbetweening.objective import InbetweeningObjective
from mwlib.inbetweening.space import RotationSpace
from mwlib.inbetweening.windows import Clips, make_space, ready
from tests.inbetweening.sample import shaken, small
from tests.inbetweening.sample_lafan1 import TASK, small_set


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    """As read from files, in which End Sites stand among the joints."""
    folder = tmp_path_factory.mktemp("lafan1")
    for motion in small_set():
        mw.write_bvh(motion, folder / f"{motion.name}.bvh")
    return mw.load_motions(folder)


@pytest.fixture(scope="module")
def benchmark(motions):
    return lafan1_benchmark(motions)


def bridge_of(motions, **changes) -> Bridge:
    """A model that was not trained."""
    cfg = small(**{**TASK, **changes})
    split = Split(ready([m for m in motions if m.subject != "5"], cfg.data.fps), [], [])
    made = InbetweeningObjective(cfg, split, {})
    return Bridge(shaken(made.network, 0.02), made.representation, made.space, cfg)


@pytest.fixture(scope="module")
def bridge(motions):
    return bridge_of(motions)


def test_windows_of_the_benchmark_are_those_cut_from_the_clips(benchmark, motions, bridge):
    """By two ways: the benchmark's own frame of reference and back, and the model's reader; turned joint by joint."""
    space = bridge.space
    clips = Clips(ready([m for m in motions if m.subject == "5"], 30.0), space)
    cut = clips.cut(65, 40, PAST)
    x = to_states(space, benchmark.frames).float()
    place = space.placement(x, cut.offsets, PAST - 1)
    torch.testing.assert_close(space.seen_from(x, place), cut.x, atol=1e-5, rtol=0)
    there = space.positions(x, cut.offsets)
    assert there[..., 2].mean() > 0.5 and (there[:, 9, 0, :2].norm(dim=-1) > 1e-3).any()  # upright, and not at the origin


def test_the_joints_of_the_files_stand_in_another_order(bridge):
    """Else an order that is taken for another would not be seen here."""
    assert bridge.space.points != tuple(range(22)) and sorted(bridge.space.turning) == sorted(bridge.space.points)


def test_states_are_frames_again_and_score_nothing(benchmark, bridge):
    again = to_frames(bridge.space, to_states(bridge.space, benchmark.frames))
    assert again.rotations.dtype == torch.float64
    torch.testing.assert_close(again.root, benchmark.frames.root)
    back = multiply(again.rotations, benchmark.frames.rotations * torch.tensor([1.0, -1, -1, -1]))
    torch.testing.assert_close(back[..., 0].abs(), torch.ones(again.root.shape[:2] + (22,)).double(), atol=1e-9, rtol=0)
    found = score_frames(benchmark, again.cut(PAST, PAST + 30), 30)
    assert max(found.l2q.max(), found.l2p.max(), found.npss) < 1e-6


def test_interpolation_scores_the_same_when_it_was_there_before(benchmark):
    frames = benchmark.frames
    made = interpolation(frames.cut(0, PAST), frames.cut(PAST + 15, PAST + 16), 15)
    found, expected = score_frames(benchmark, made, 15), score(benchmark, interpolation, 15)
    torch.testing.assert_close(found.l2q, expected.l2q)
    assert found.npss == pytest.approx(expected.npss)


@pytest.mark.usefixtures("unchecked")
def test_what_was_filled_by_other_means_must_fit_too(benchmark):
    made = interpolation(benchmark.frames.cut(0, PAST), benchmark.frames.cut(PAST + 15, PAST + 16), 15)
    with pytest.raises(ValueError, match=r"rotations of the predictor are \(4, 14, 22, 4\), finite; expected \(4, 15, 22, 4\)"):
        score_frames(benchmark, made.cut(0, 14), 15)


@pytest.mark.parametrize("past", [1, 4, 10])
def test_a_model_that_knows_the_windows_makes_no_error(benchmark, motions, past, monkeypatch):
    """It is asked of what it is given alone, seen from the last frame of its past, and answers in the same place."""
    made = bridge_of(motions, past=past, coast=0.0)
    clips = Clips(ready([m for m in motions if m.subject == "5"], 30.0), made.space)
    clip, start = clips.starts(65, 40)

    def knows(x, mask, samples, seed, progress):
        whole = clips.take(clip, start + PAST - past, x.shape[1], past).x
        torch.testing.assert_close(x[:, :past], whole[:, :past], atol=1e-5, rtol=0)
        torch.testing.assert_close(x[:, -1], whole[:, -1], atol=1e-5, rtol=0)
        assert mask is None and not x[:, past:-1].diff(dim=1).any()  # nothing of what is to be found
        return whole[:, None].expand(-1, samples, -1, -1)

    monkeypatch.setattr(made, "sample", knows)
    for row in model_table(made, benchmark, "mine", samples=3, lengths=(5, 45)):
        assert row["windows"] == 4 and max(row["L2Q"], row["L2P"], row["NPSS"]) < 2e-5, row


def test_rows_are_single_samples_and_their_average(benchmark, bridge):
    rows = model_table(bridge, benchmark, "mine", samples=3, seed=5)
    names = ["mine, single samples"] * 4 + ["mine, average of 3"] * 4
    assert [(row["method"], row["N"]) for row in rows] == [*zip(names, [*LENGTHS, *LENGTHS], strict=True)]
    x = fill(bridge, bridge.space, benchmark, 15, 3, 5)
    scores = [score_frames(benchmark, to_frames(bridge.space, x[:, i]), 15) for i in range(3)]
    assert rows[1]["L2P"] == pytest.approx(sum(float(s.l2p.mean()) for s in scores) / 3, rel=1e-5)
    assert rows[1]["NPSS"] == pytest.approx(sum(s.npss for s in scores) / 3, rel=1e-5)
    middle = to_frames(bridge.space, x.mean(1))
    assert rows[5]["L2Q"] == pytest.approx(float(score_frames(benchmark, middle, 15).l2q.mean()), rel=1e-5)
    assert all(0.01 < row["L2P"] < 100 for row in rows) and rows[5]["L2P"] < rows[1]["L2P"]
    other = model_table(bridge, benchmark, "mine", samples=3, seed=6, lengths=[15])
    assert other[0]["L2P"] != rows[1]["L2P"]


def test_lengths_that_it_was_not_trained_for_stay_empty(benchmark, motions):
    short = bridge_of(motions, between=20)
    rows = model_table(short, benchmark, "mine", samples=1)
    assert [row["L2P"] is None for row in rows] == [False, False, True, True] * 2
    with pytest.raises(ValueError, match=r"the model is for 5 to 20 frames between; expected some of \[30, 45\]"):
        model_table(short, benchmark, "mine", lengths=[30, 45])


def test_models_that_do_not_fit_are_refused(bridge, motions):
    assert check_model(bridge.cfg, bridge.space) is bridge.space
    bodies = bridge.space.bodies
    places = make_space(ready(motions[:1], 30.0), "positions")
    other = replace(bodies.skeleton, joints=tuple(f"joint{i}" for i in range(22)))
    for changes, space, message in (
        ({}, replace(bridge.space, bodies=replace(bodies, fps=25.0)), "has 25 frames per second"),
        ({}, replace(bridge.space, bodies=replace(bodies, skeleton=other)), "is of skeleton .* with 22 joints"),
        ({}, places, "has places or other rotations"),
        (dict(past=11), bridge.space, "is given 11 frames of the past"),
        (dict(train_subjects=("1", "5"), test_subjects=("2",)), bridge.space, "was trained on subject 5"),
        (dict(train_subjects=(), test_subjects=("2",)), bridge.space, "was trained on subject 5"),
    ):
        with pytest.raises(ValueError, match=f"the model {message}; expected one of LaFAN1's 22 joints .* at most 10 frames"):
            check_model(bridge.cfg.override(**changes), space)
    for changes in (dict(train_subjects=()), dict(train_subjects=(), test_subjects=())):
        check_model(bridge.cfg.override(**changes), bridge.space)  # then it is tested on, or among the last quarter
    assert isinstance(to_frames(bridge.space, torch.zeros(1, 2, 135)), Frames)


def test_real_files(data_folder):
    """The truth of the benchmark's windows as states is what the model's own reader gives, and scores nothing."""
    motions = [m for m in mw.load_motions(data_folder / "lafan1") if m.name in ("ground1_subject5", "walk4_subject1")]
    assert len(motions) == 2
    found = lafan1_benchmark(motions)
    train, test = (ready([m for m in motions if (m.subject == "5") == tested], 30.0) for tested in (False, True))
    space = make_space(train, "rotations")
    assert isinstance(space, RotationSpace)
    cut = Clips(test, space).cut(65, 40, PAST)
    x = to_states(space, found.frames).float()
    seen = space.seen_from(x, space.placement(x, cut.offsets, PAST - 1))
    torch.testing.assert_close(seen, cut.x, atol=2e-5, rtol=0)
    errors = score_frames(found, to_frames(space, x).cut(PAST, PAST + 45), 45)
    assert max(errors.l2q.max(), errors.l2p.max(), errors.npss) < 1e-4
