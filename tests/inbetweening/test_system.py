"""In-betweening as a system: trained once, found again; the truth has no error, every column has its number."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from mwlib.body.skeleton import CMU, H36M17, HUMANML22, Skeleton
from mwlib.data import sources
from mwlib.data.collections.bandai_namco import BANDAI21
from mwlib.data.collections.h36m import HUMANEVA15
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.formats.bvh import write_bvh
from mwlib.data.sources import fingerprint
from mwlib.experiments import get_model, get_result, get_run, load_run, system
from mwlib.inbetweening import system as module
from mwlib.inbetweening.baselines import PACES, between
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.losses import feet
from mwlib.inbetweening.system import DETAILS, METRICS, Score, evaluate, make_fill
from mwlib.inbetweening.windows import Clips, make_space
from mwlib.synthetic.motions import synthetic_motions
from mwlib.training import MODEL
from tests.inbetweening.sample import data_of, lafan_motion, small, untrained, windows_for


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_a_run_is_trained_once_and_scored(state, monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = small(state=state, train_steps=3, test_windows=4)
    data = data_of(cfg)
    folder = get_run(cfg, data)
    made = (folder / MODEL).stat().st_mtime_ns
    result = get_result(cfg, data)
    assert (folder / MODEL).stat().st_mtime_ns == made and result["windows"] == 4
    assert {name for name in module.METRICS if name in result["mean"]} >= {*module.METRICS} - {"l2q"}
    assert ("l2q" in result["mean"]) == (state == "rotations")
    assert get_result(cfg, data)["values"]["ade"] == result["values"]["ade"]
    other = get_result(cfg.override(sampling_seed=1, scheme="paste"), data)
    assert (folder / MODEL).stat().st_mtime_ns == made and other["mean"]["ade"] != result["mean"]["ade"]
    truth = get_result(cfg.override(method="truth"), data)
    assert truth["training"] is None and truth["mean"]["l2p"] == pytest.approx(0, abs=1e-5)
    bridge = load_run(folder)
    assert isinstance(bridge, Bridge) and get_run(cfg.override(width=32), data) != folder
    x = windows_for(bridge).x[:2]
    assert torch.equal(bridge.sample(x), get_model(cfg, data).sample(x))


def test_it_is_known_by_name():
    assert system("inbetweening") is module and module.Config.system == "inbetweening"


def test_who_is_held_out_is_left_out_of_more_data(monkeypatch):
    """The same people under other sources: those for training come twice more, those for validation and test nowhere."""
    asked, motions = [], synthetic_motions(subjects=8, seconds=2.0)
    monkeypatch.setattr(sources, "load_motions", lambda source, **how: asked.append(source) or motions)
    plain, more = (module.load_data(small(more_data=names)) for names in ((), ("here", "there")))
    held_out = {m.subject for m in (*plain.validation, *plain.test)}
    assert asked == ["synthetic", "synthetic", "here", "there"] and fingerprint(more.validation + more.test) == fingerprint(
        plain.validation + plain.test
    )
    assert len(more.train) == 3 * len(plain.train) and not held_out & {m.subject for m in more.train}
    assert {(m.fps, m.skeleton.name) for m in more.train} == {(10.0, "H36M17")}


def test_data_are_loaded_with_rotations_or_on_seventeen_joints(tmp_path):
    for number, subject in enumerate("AABBCC"):
        motion = lafan_motion(30, seed=number, fps=30.0, subject=subject)
        write_bvh(motion, tmp_path / f"walk{number}_subject{number // 2 + 1}.bvh")
    nobody = dict.fromkeys(("train_subjects", "validation_subjects", "test_subjects"), ())
    cfg = small(data=str(tmp_path), state="rotations", unit="cm", up="y", **nobody)
    found = module.load_data(cfg)
    clips = [*found.train, *found.validation, *found.test]
    assert all(m.rig is not None and m.up == "z" and m.fps == 10.0 and len(m.skeleton) == 22 for m in clips) and len(clips) == 6
    places = module.load_data(cfg.override(state="positions"))
    assert all(m.rig is None and len(m.skeleton) == 17 for m in places.train)
    np.testing.assert_allclose(places.train[0].positions[:, 0], found.train[0].positions[:, 0], atol=1e-3)


def test_positions_alone_are_refused_where_rotations_are_asked_for(monkeypatch):
    motions = synthetic_motions(subjects=2, seconds=2.0)
    monkeypatch.setattr("mwlib.data.sources.load_motions", lambda source, **stated: motions)
    cfg = small(state="rotations", validation_subjects=(), test_subjects=())
    with pytest.raises(ValueError, match="has positions only; expected rotations, .*state=positions"):
        module.make_objective(cfg, module.load_data(cfg), {})


STATES = ("positions", "rotations")


def nobody():
    raise AssertionError("a baseline asks for no model")


def score(**changes) -> dict:
    cfg = small(**changes)
    return evaluate(cfg, nobody, data_of(cfg))


@pytest.mark.parametrize("state", STATES)
def test_the_truth_has_no_error(state):
    found = score(state=state, method="truth")["mean"]
    for name in ("l2p", "l2p_best", "npss", "ade", "ade_mean", "keyframe_error", "bone_error", *["l2q"][: state == "rotations"]):
        assert found[name] == pytest.approx(0, abs=1e-5), name
    assert found["nearer"] > 0.9 and 0.5 < found["seam"] < 2 and found["speed"] > 0.1 and math.isnan(found["apd"])


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("method", [*PACES, "gaussian"])
def test_baselines_need_no_model_and_meet_the_keyframes(state, method):
    found = score(state=state, method=method)
    assert found["mean"]["keyframe_error"] == pytest.approx(0, abs=1e-5) and found["mean"]["l2p"] > 0.01
    if (method, state) == ("interpolation", "positions"):
        assert found["mean"]["nearer"] == 0  # than itself
    if state == "rotations":
        assert found["mean"]["bone_error"] < 1e-5


@pytest.mark.parametrize("state", STATES)
def test_every_column_has_a_number_for_every_window(state):
    bridge = untrained(state=state)
    cfg = small(state=state, test_windows=5)
    found = evaluate(cfg, lambda: bridge, data_of(cfg))
    names = {*METRICS, *DETAILS} - ({"l2q"} if state == "positions" else set())
    assert set(found["mean"]) == names and set(found["values"]) == set(found["standard_error"]) == names - {"npss"}
    assert found["windows"] == 5 == len(found["clips"]) and {len(v) for v in found["values"].values()} == {5}
    assert found["mean"]["ade"] <= found["mean"]["ade_mean"] and found["mean"]["l2p_best"] <= found["mean"]["l2p"]
    assert all(math.isfinite(found["mean"][name]) for name in names - {"skate"})
    assert found["mean"]["apd"] > 0 and found["mean"]["keyframe_error"] == 0


@pytest.mark.parametrize("method", ["truth", "interpolation", "hermite", "gaussian", "diffusion"])
def test_with_a_past_what_is_between_is_scored_alone(method):
    """All numbers are those of the same windows without their past; but the keyframe error is of all that is given."""
    cfg, bridge = small(state="rotations", past=4, method=method), untrained(state="rotations", past=4)
    data = data_of(cfg)
    if method == "diffusion":
        found = evaluate(cfg, lambda: bridge, data)["mean"]
        assert found["keyframe_error"] == 0 and found["l2p"] > 0.1
        return
    assert evaluate(cfg, nobody, data)["mean"]["keyframe_error"] == pytest.approx(0, abs=1e-5)
    space = make_space(data.train, "rotations")
    whole = Clips(data.test, space).windows(11, 8, past=4)
    late = Clips(data.test, space).at(whole.clip, whole.start + 3, 8)
    deviation = Score.of(data, space, 11, 4).deviation
    one, other = Score(space, deviation, 4), Score(space, deviation)
    fill = make_fill(cfg, lambda: bridge, data, space)
    x = fill(whole, [*range(len(whole.x))])
    assert x.shape[2] == 11
    first, second = one(x, whole), other(x[:, :, 3:], late)
    for name in first:
        torch.testing.assert_close(first[name], second[name], atol=1e-4, rtol=1e-4, equal_nan=True)
    assert one.npss.value() == pytest.approx(other.npss.value(), abs=1e-5)
    x = x.clone()
    x[:, :, 1] += 0.5
    assert one(x, whole)["keyframe_error"].min() > 0.1 and other(x[:, :, 3:], late)["keyframe_error"].max() < 1e-5


def test_a_quaternion_and_its_negative_are_one_turn(monkeypatch):
    cfg, data = small(state="rotations", method="interpolation"), data_of(small(state="rotations"))
    space = make_space(data.train, "rotations")
    windows = Clips(data.test, space).windows(8, 8)
    x, deviation = make_fill(cfg, nobody, data, space)(windows, [*range(len(windows.x))]), Score.of(data, space, 8, 1).deviation
    found, draws, turns = [], torch.Generator().manual_seed(0), type(space).rotations
    for odds in (0.0, 0.5):

        def flipped(*given, odds=odds):
            found = turns(*given)
            return torch.where((torch.rand(found.shape[:-1], generator=draws) < odds)[..., None], -found, found)

        monkeypatch.setattr(type(space), "rotations", flipped)
        score = Score(space, deviation)
        found.append((score(x, windows)["l2q"], score.npss.value()))
    torch.testing.assert_close(found[0][0], found[1][0])
    assert found[0][1] == pytest.approx(found[1][1]) and found[0][0].max() > 0.01


class Lifted(Score):
    """The joints of some samples, of several, are lifted above the floor."""

    lifted: slice

    def joints(self, x, offsets):
        places = super().joints(x, offsets).clone()
        if places.shape[1] > 1:
            places[:, self.lifted, :, 2::3] += 0.3
        return places


def test_feet_skate_on_the_floor_of_the_truth_and_in_samples_that_touch_it():
    data = data_of(small())
    space = make_space(data.train, "positions")
    windows = Clips(data.test, space).windows(8, 8)
    score, x = Lifted(space, Score.of(data, space, 8).deviation), windows.x[:, None].expand(-1, 2, -1, -1)
    found = {}
    for name, score.lifted in (("none", slice(0)), ("one", slice(1, 2)), ("all", slice(2))):
        found[name] = score(x, windows)["skate"]
    assert found["all"].isnan().all() and found["none"].isfinite().any() and found["none"].nansum() > 0
    torch.testing.assert_close(found["one"], found["none"], equal_nan=True)


def test_scores_do_not_depend_on_how_many_are_scored_together(monkeypatch):
    whole = score(method="hermite")
    monkeypatch.setattr("mwlib.inbetweening.system.CHUNK", 3)
    parts = score(method="hermite")
    assert parts["clips"] == whole["clips"]
    for name, value in whole["mean"].items():
        assert parts["mean"][name] == pytest.approx(value, rel=1e-4, abs=1e-6, nan_ok=True), name


def test_zero_velocity_is_worst_and_jumps_at_the_end_alone():
    zero, straight = (score(method=m) for m in ("zero_velocity", "interpolation"))
    assert zero["mean"]["l2p"] > straight["mean"]["l2p"] and math.isnan(zero["mean"]["seam"])
    assert straight["mean"]["seam"] == pytest.approx(1, abs=1e-4) and straight["mean"]["jerk"] < 1e-2


def test_statistics_are_those_of_the_training_people_about_their_roots():
    cfg = small()
    split = data_of(cfg)
    space = make_space(split.train, "positions")
    made = Score.of(split, space, 8)
    assert torch.equal(made.deviation, Score.of(split._replace(test=[]), space, 8).deviation)
    seen = Clips(split.train, space).windows(8, 20)
    places = space.positions(seen.x, seen.offsets)
    places = places - torch.cat([places[:, :, :1, :2].mean(1, keepdim=True), torch.zeros(len(places), 1, 1, 1)], dim=-1)
    torch.testing.assert_close(made.deviation, places.flatten(2).flatten(0, 1).std(0, correction=0).clamp_min(1e-4))
    x = Clips(split.test, space).windows(8, 8)
    line = between(space, x.x, "interpolation")[:, None]
    p, g = (space.positions(v, x.offsets).flatten(-2)[:, 1:-1] for v in (line[:, 0], x.x))
    expected = ((p - g) / made.deviation).norm(dim=-1).mean(-1)
    torch.testing.assert_close(made(line, x)["l2p"], expected, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize(
    "skeleton, names",
    [
        (LAFAN1, {"LeftToe", "RightToe"}), (CMU, {"left_toes", "right_toes"}), (BANDAI21, {"Toes_L", "Toes_R"}),
        (H36M17, {"left_foot", "right_foot"}), (HUMANML22, {"left_foot", "right_foot"}),
        (HUMANEVA15, {"left_ankle", "right_ankle"}), (Skeleton("arm", ("a", "b"), (-1, 0)), set()),
    ],
)  # fmt: skip
def test_feet_are_what_touches_the_floor(skeleton, names):
    assert {skeleton.joints[i] for i in feet(skeleton)} == names


@pytest.mark.parametrize("between, fps", [(2, 30.0), (4, 30.0), (5, 30.0)])
def test_gaps_too_short_for_a_speed_are_measured_without_it(between, fps):
    cfg = small(between=between, fps=fps, test_windows=4)
    found = evaluate(cfg.override(method="interpolation"), lambda: pytest.fail("no model is needed"), module.load_data(cfg))
    assert np.isfinite(found["mean"]["l2p"]) and np.isnan(found["mean"]["speed"]) == (between < 5)
