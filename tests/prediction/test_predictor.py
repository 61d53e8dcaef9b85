"""What a predictor can do: take anybody's motions, predict reproducibly, with every option of the sampling."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from scipy.stats import kstest, norm

import mwlib as mw
import mwlib.prediction.predictor as predictor_module
from mwlib import metrics
from mwlib.body.kinematics import bones_of, turn_heading
from mwlib.body.skeleton import H36M17, Skeleton
from mwlib.data.windows import Bodies, prepare, windows
from mwlib.diffusion import Step, WindowNoise
from mwlib.experiments import load_run
from mwlib.prediction.config import SamplingConfig
from mwlib.prediction.predictor import Predictor, predicted_motions, temperatures
from mwlib.synthetic import synthetic_motions
from tests.body.sample import animators_motion, apart
from tests.sample_settings import two_people, untrained


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return untrained()


@pytest.fixture(scope="module")
def originals():
    return synthetic_motions(subjects=1)[:3]


@pytest.fixture
def past() -> torch.Tensor:
    people = two_people()
    return windows([*people.train, *people.validation], 6, 14, 9).x_history[:5]


def test_samples_and_seed_are_the_settings_own_unless_given(predictor, past):
    assert predictor.predict(past).shape[1] == predictor.sampling.samples == 3
    changed = predictor.with_sampling(samples=2, sampling_seed=8)
    torch.testing.assert_close(changed.predict(past), predictor.predict(past, 2, 8), atol=0, rtol=0)


def spied(predictor: Predictor, past: torch.Tensor, monkeypatch, **changes) -> dict:
    """What a predictor with these settings asks of guidance and sampler, neither of which runs."""
    seen = {}

    def sampler(name):
        def run(denoise, start, alpha_bar, indices, **options):
            seen.update(sampler=name, start=start, indices=list(indices), **options)
            yield Step(0, start, start, start)

        return run

    for name in ("ddim", "dpm_solver", "posterior_mean"):
        monkeypatch.setattr(predictor_module, name, sampler(name))
    monkeypatch.setattr(predictor_module, "guided", lambda branches, *_, **options: seen.update(options, branches=branches))
    list(predictor.with_sampling(**changes).steps(past))
    return seen


def shaping(seen: dict, predictor: Predictor) -> str:
    """Where the projection on the manifold is applied."""
    y = torch.randn(seen["start"].shape, generator=torch.Generator().manual_seed(0))
    shaped = predictor.transform.project(y)
    assert not torch.allclose(shaped, y, atol=0.1)
    after, estimate = seen["after_step"], seen["on_y0_hat"]
    places = {"every_step": after and after(y, 0.5), "y0_hat": estimate and estimate(y)}
    return next((place for place, found in places.items() if found is not None and torch.allclose(found, shaped)), "off")


SETTINGS = {  # of each setting of the sampling another value than the preset's, and where it is found
    "samples": (7, lambda seen, _: seen["start"].shape[1]),
    "sampler": ("dpmpp", lambda seen, _: {"dpm_solver": "dpmpp"}.get(seen["sampler"])),
    "ddim_steps": (7, lambda seen, _: len(seen["indices"])),
    "spacing": ("leading", lambda seen, _: "leading" if seen["indices"] == [41, 31, 21, 11, 1] else None),
    "eta": (0.4, lambda seen, _: seen["eta"]),
    "guidance_form": ("alg1", lambda seen, _: seen["form"]),
    "guidance_weight": (0.7, lambda seen, _: seen["weight"]),
    "tabg_scale": (1.7, lambda seen, _: seen["tabg"].scale),
    "tabg_sigma": (0.6, lambda seen, _: seen["tabg"].sigma),
    "tabg_threshold": (1.2, lambda seen, _: seen["tabg"].threshold),
    "tabg_window": (5, lambda seen, _: seen["tabg"].window),
    "tabg_noise": ("shared", lambda seen, _: seen["tabg"].noise),
    "tabg_sigma_place": ("alg1", lambda seen, _: seen["tabg"].sigma_place),
    "tabg_space": ("eps", lambda seen, _: seen["tabg"].space),
    "tabg_steps": (0.4, lambda seen, _: [seen["tabg"].acts(t) for t in seen["indices"]] == [True] * 2 + [False] * 3 and 0.4),
    "wmsg": ("y0_hat", shaping),
    "bound": (0.4, lambda seen, predictor: bound_of(seen, predictor)),
    "complete_history": (True, lambda seen, _: seen["after_step"] is not None),
    "precision": ("bf16", lambda seen, _: seen["branches"].precision),
    "temperature": (0.7, lambda seen, predictor: round(float((seen["start"] / predictor.noise(0, range(5), 3)()).mean()), 4)),
    "temperature_spread": (0.3, lambda seen, predictor: spread_of(seen, predictor)),
    "sampling_seed": (4, lambda seen, predictor: torch.equal(seen["start"], predictor.noise(4, range(5), 3)()) and 4),
}


def spread_of(seen: dict, predictor: Predictor) -> float:
    """Of the temperatures of three samples, the median's, that of a quarter and that of three quarters."""
    median, quarter, three = (seen["start"] / predictor.noise(0, range(5), 3)()).mean((0, 2, 3)).tolist()
    assert math.isclose(quarter * three, median**2, rel_tol=1e-5)
    return round(math.log(three / quarter) / (norm.ppf(0.75) - norm.ppf(0.25)), 4)


def bound_of(seen: dict, predictor: Predictor) -> float | None:
    """The largest coordinate that is let through."""
    if seen["on_y0_hat"] is None:
        return None
    motion = predictor.transform.inverse(seen["on_y0_hat"](9 * seen["start"]))
    return round(float(motion.abs().max()), 3)


@pytest.mark.parametrize("name", SETTINGS)
def test_every_setting_of_the_sampling_arrives(past, monkeypatch, name):
    predictor, (value, look) = untrained(), SETTINGS[name]
    assert look(spied(predictor, past, monkeypatch), predictor) != value, "the preset's own value would prove nothing"
    assert look(spied(predictor, past, monkeypatch, **{name: value}), predictor) == value


def test_temperatures_are_log_normal_and_do_not_depend_on_how_many_there_are():
    found = temperatures(255, 1.1, 0.3).log()
    torch.testing.assert_close(
        found[:6], math.log(1.1) + 0.3 * torch.tensor(norm.ppf([1 / 2, 1 / 4, 3 / 4, 1 / 8, 5 / 8, 3 / 8]))
    )
    assert torch.equal(temperatures(7, 1.1, 0.3), temperatures(255, 1.1, 0.3)[:7])
    assert kstest(found.numpy(), "norm", (math.log(1.1), 0.3)).statistic < 0.01
    assert torch.equal(temperatures(4, 1.1, 0.0), torch.full((4,), 1.1, dtype=torch.float64))


def test_no_setting_of_the_sampling_is_left_out():
    others = {"method", "noise_on", "bones", "decoding", "seam"}  # the evaluation's; a device's; tested below
    assert {*SETTINGS, *others} == {field.name for field in fields(SamplingConfig)}


def test_futures_continue_the_history_if_the_settings_say_so(past):
    """The same coefficients, decoded twice."""
    predictor = untrained(transform="dct", representation="displacement", bones="observed")
    continued = predictor.with_sampling(decoding="continued")
    *_, last = predictor.steps(past, 2)
    futures = [model.decode(last.y, past) for model in (predictor, continued)]
    for model, future in zip((predictor, continued), futures, strict=True):
        torch.testing.assert_close(model.predict(past, 2), future)
    cut, smooth = (metrics.first_step(future, past).mean() for future in futures)
    assert smooth < cut and not torch.equal(*futures)
    free = [continued.with_sampling(bones="free", seam=seam).decode(last.y, past) for seam in (0.0, 1.0)]
    before, after = (metrics.first_step(future, past).mean() for future in free)
    assert after < 0.1 * before
    lengths = [bones_of(x, predictor.bodies.skeleton).norm(dim=-1) for x in (futures[1], past[:, None, -1:])]
    torch.testing.assert_close(lengths[0], lengths[1].expand_as(lengths[0]), rtol=1e-4, atol=1e-5)


def test_every_sampler_and_place_of_the_projection_is_reached(past, monkeypatch):
    predictor = untrained()
    for name, function in (("ddim", "ddim"), ("dpmpp", "dpm_solver"), ("eq6", "posterior_mean")):
        assert spied(predictor, past, monkeypatch, sampler=name)["sampler"] == function
    for place in ("off", "every_step", "y0_hat"):
        assert shaping(spied(predictor, past, monkeypatch, wmsg=place), predictor) == place


@pytest.mark.parametrize("kind", ["pose", "displacement", "relaxing"])
def test_the_bound_is_one_of_poses_whatever_is_modelled(past, kind):
    predictor = untrained(representation=kind, bound=0.4)
    motion = predictor.predict(past, 2)
    assert 0.35 < motion.abs().max() <= 0.4 + 1e-3


def test_a_bound_from_outside_has_the_last_word(past):
    """What is imposed on a clean estimate is not changed again by the bound of the settings."""
    predictor = untrained(bound=0.1)
    y = torch.full((5, 2, *predictor.transform.shape), 2.0)
    *_, last = predictor.steps(past, 2, on_y0_hat=lambda _: y)
    torch.testing.assert_close(last.y, y)


def test_futures_begin_after_the_last_observed_frame(past):
    predictor = untrained(representation="displacement")
    *_, last = predictor.steps(past, 2, 3)
    whole = predictor.representation.decode(last.y, past)
    assert whole.shape[2] == 20
    torch.testing.assert_close(predictor.predict(past, 2, 3), whole[:, :, 6:], atol=1e-5, rtol=1e-5)


def test_the_window_numbers_go_with_their_windows(past):
    """The noise of a window is that of its number, in whichever chunk it is sampled."""
    predictor = untrained()
    same = past[:1].expand(5, -1, -1)
    ids = [3, 9, 4, 3, 0]
    futures = predictor.predict(same, 2, 1, window_ids=ids, chunk=2)
    torch.testing.assert_close(futures[0], futures[3], atol=1e-5, rtol=1e-5)
    apart = [predictor.predict(same[:1], 2, 1, window_ids=[i]) for i in ids]
    torch.testing.assert_close(futures, torch.cat(apart), atol=1e-5, rtol=1e-5)
    assert (futures[0] - futures[1]).abs().max() > 1e-2


def test_with_sampling_changes_the_sampling_alone(predictor, past):
    other = predictor.with_sampling(guidance_weight=0.9, samples=7)
    assert (other.sampling.guidance_weight, other.sampling.samples) == (0.9, 7)
    assert predictor.sampling.guidance_weight == 0.0, "the first one is left alone"
    assert other.with_sampling(guidance_weight=0.0, samples=3).sampling == predictor.sampling
    for name in ("net", "representation", "alpha_bar", "bodies"):
        assert getattr(other, name) is getattr(predictor, name), name
    for changes in (dict(steps=100), dict(samples=2, schedule="linear"), dict(history=3)):
        with pytest.raises(ValueError, match="settings of the sampling"):
            predictor.with_sampling(**changes)
    with pytest.raises(ValueError, match="did you mean 'eta'"):
        predictor.with_sampling(etta=0.1)


@pytest.mark.parametrize("kind", ["pose", "displacement", "relaxing"])
def test_a_person_who_faces_another_way_is_predicted_alike(past, kind):
    """With motions turned by their heading, a turned history has turned futures; else it has others."""
    angle = torch.linspace(0.3, 5.0, 5)
    for heading, same in (("body", True), ("world", False)):
        for changes in ({}, {"complete_history": True, "wmsg": "off"}):
            predictor = untrained(representation=kind, heading=heading, **changes)
            turned = predictor.predict(turn_heading(past, angle), 2, 0)
            expected = turn_heading(predictor.predict(past, 2, 0), angle[:, None].expand(5, 2))
            assert ((turned - expected).abs().max() < 1e-3) == same


def test_bones_keep_the_length_that_was_seen_and_their_direction(past):
    skeleton, predictor = two_people().train[0].skeleton, untrained()
    past = past * torch.linspace(0.8, 1, 6)[:, None]  # a body that grows: the last frame counts
    free, kept = (bones_of(predictor.with_sampling(bones=bones).predict(past, 3), skeleton) for bones in ("free", "observed"))
    seen = bones_of(past[:, -1], skeleton).norm(dim=-1)
    torch.testing.assert_close(kept.norm(dim=-1), seen[:, None, None].expand(kept.shape[:-1]), atol=1e-5, rtol=1e-4)
    assert ((free.norm(dim=-1) - seen[:, None, None]).abs() > 1e-2).any()
    cosine = (kept * free).sum(-1) / (kept.norm(dim=-1) * free.norm(dim=-1))
    torch.testing.assert_close(cosine, torch.ones_like(cosine), atol=1e-4, rtol=0)


@pytest.mark.parametrize("kind", ["pose", "displacement", "relaxing"])
def test_complete_history_puts_the_history_back(past, kind):
    predictor = untrained(complete_history=True, wmsg="off", representation=kind)
    *_, last = predictor.steps(past[:2], 2)
    whole = predictor.representation.decode(last.y, past[:2])
    torch.testing.assert_close(whole[:, :, :6], past[:2, None].expand(-1, 2, -1, -1), atol=1e-4, rtol=1e-3)


def test_half_precision_is_of_the_networks_products_only(predictor, past):
    """The transform, the schedule and the guidance stay as they are: what comes out is near, and in float32."""
    exact, rough = (predictor.with_sampling(precision=p).predict(past, 2) for p in ("float32", "bf16"))
    assert rough.dtype == torch.float32 and not torch.equal(rough, exact)
    assert (rough - exact).abs().mean() < 0.05 * exact.abs().mean()
    assert torch.equal(predictor.with_sampling(precision="tf32").predict(past, 2), exact)  # a processor has none
    assert torch.get_float32_matmul_precision() == "highest"


def test_noise_is_drawn_on_the_processor_or_where_the_network_is(predictor, past, monkeypatch):
    there = predictor.with_sampling(noise_on="device")
    assert torch.equal(there.predict(past, 2), predictor.predict(past, 2))  # on a processor the same place

    class Recorded(WindowNoise):
        def __init__(self, *arguments):
            self.places = arguments[3:]

    monkeypatch.setattr(predictor_module, "WindowNoise", Recorded)
    monkeypatch.setattr(Predictor, "device", torch.device("meta"))
    assert predictor.noise(0, [0], 2).places == (torch.device("meta"), "cpu")
    assert there.noise(0, [0], 2).places == (torch.device("meta"), torch.device("meta"))


def test_a_graphics_card_takes_as_many_windows_as_its_memory_holds(predictor, monkeypatch):
    assert predictor.chunk(50) == 8
    monkeypatch.setattr(Predictor, "device", torch.device("cuda"))
    chunks = []
    for free in (2**30, 2**34):
        monkeypatch.setattr(torch.cuda, "mem_get_info", lambda device, free=free: (free, free))
        chunks.append(predictor.chunk(50))
    assert 1 <= chunks[0] < chunks[1] and chunks[1] == pytest.approx(16 * chunks[0], rel=0.1)
    assert predictor.chunk(100) == chunks[1] // 2


def test_every_window_has_one_identity_and_at_least_one_sample(predictor, past):
    with pytest.raises(ValueError, match="window_ids has 5 entries for 1 windows"):
        predictor.predict(past[:1], window_ids=range(5))
    with pytest.raises(ValueError, match="samples is 0"):
        predictor.predict(past, 0)
    with pytest.raises(ValueError, match="there are no windows"):
        predictor.predict(past[:0])
    assert torch.equal(predictor.predict(past.numpy(), 2), predictor.predict(past, 2))


def test_gradients_flow_through_a_transform_that_has_predicted(predictor, past):
    predictor.predict(past[:1], 1)
    x = torch.zeros(1, 20, 48, requires_grad=True)
    predictor.transform(x).sum().backward()
    assert x.grad.isfinite().all()


def test_a_finished_run_predicts(finished, past):
    predictor = load_run(finished)
    futures = predictor.predict(past, samples=3, seed=1)
    assert futures.shape == (5, 3, 14, 48) and futures.isfinite().all()
    torch.testing.assert_close(predictor.predict(past, 3, 1, chunk=2), futures, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(predictor.predict(past[3:], 3, 1, window_ids=[3, 4]), futures[3:], atol=1e-5, rtol=1e-5)
    assert not torch.allclose(predictor.predict(past, 3, 2), futures, atol=1e-3)
    with pytest.raises(ValueError, match="6, 48"):
        predictor.predict(past[:, :5])


def test_loading_a_run_leaves_the_callers_randomness_alone(finished):
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    load_run(finished)
    assert torch.equal(torch.rand(1), expected)


def test_motions_windows_and_arrays_agree(predictor, originals):
    ready = prepare(originals, 10.0)
    x = torch.stack([torch.from_numpy(m.root_relative()[-6:]) for m in ready]).float()
    expected = predictor.predict(x, 2, 1)
    torch.testing.assert_close(predictor.predict(originals, 2, 1), expected, rtol=0, atol=0)
    cut = [m.cut(len(m) - 21, len(m)) for m in ready]  # a clip of H + F + 1 frames has one window, which starts at 0
    windows = mw.windows(cut, 6, 14, 5)
    torch.testing.assert_close(predictor.predict(windows, 2, 1), predictor.predict(windows.x_history, 2, 1), rtol=0, atol=0)


def test_axis_and_rate_do_not_matter(predictor, originals):
    """The same recording with y up and at another rate gives the same history, so the same futures."""
    other = [m.with_up("y") for m in originals]
    torch.testing.assert_close(predictor.predict(other, 2, 1), predictor.predict(originals, 2, 1), rtol=0, atol=1e-4)
    assert predictor.bodies == Bodies(H36M17, 10.0, "z")


def test_what_cannot_fit_is_refused_with_the_way_out(predictor, originals):
    ready = prepare(originals, 10.0)
    with pytest.raises(ValueError, match=r"has 3 frames at 10 Hz; expected at least 6"):
        predictor.predict([replace(ready[0].cut(0, 3))], 1)
    foreign = Skeleton("snake", ("head", "tail"), (-1, 0))
    snake = mw.Motion(np.zeros((50, 2, 3), np.float32), 10.0, foreign, name="hiss")
    with pytest.raises(ValueError, match=r"hiss: the skeleton is snake \(2 joints\).*trained on H36M17 \(17 joints\)"):
        predictor.predict([snake], 1)
    with pytest.raises(ValueError, match=r"expected \(N, 6, 48\).*Give predict the motions"):
        predictor.predict(torch.zeros(2, 6, 63), 1)
    with pytest.raises(ValueError, match=r"windows are of H36M17 at 50 Hz, z up; the model was trained on H36M17 at 10 Hz"):
        predictor.predict(mw.windows(originals, 6, 14, 50), 1)
    bad = torch.zeros(2, 6, 48)
    bad[1, 2, 3] = torch.nan
    with pytest.raises(ValueError, match="window 1 is not finite"):
        predictor.predict(bad, 1)
    with pytest.raises(ValueError, match=r"source holds nothing; expected Motions"):
        predictor.predict([], 1)


def test_continued_motions_begin_with_what_was_seen(predictor, originals):
    found = predicted_motions(predictor, originals, 2, 1)
    seen = prepare(originals, 10.0)
    assert [len(row) for row in found] == [2, 2, 2] and {len(m) for row in found for m in row} == {20}
    for m, row in zip(seen, found, strict=True):
        for future in row:
            np.testing.assert_array_equal(future.positions[:6], m.positions[-6:])
            assert (future.positions[6:, 0] == m.positions[-1, 0]).all() and future.fps == 10.0
    expected = predictor.predict(originals, 2, 1)
    np.testing.assert_allclose(found[1][0].cut(6, 20).root_relative(), expected[1, 0].numpy(), atol=1e-5)


@pytest.mark.parametrize("fps", [10.0, 24.0, 120.0])
def test_a_clip_with_a_rig_is_continued_on_it(predictor, originals, fps):
    """Observed frames stay, what the model does not know is held, and clips without a rig are as ever."""
    clip = animators_motion(round(2.03 * fps), fps)
    found = predicted_motions(predictor, [clip, originals[0]], 2, 1, own_rig=True)
    plain = predicted_motions(predictor, [clip, originals[0]], 2, 1)
    np.testing.assert_array_equal(found[1][0].positions, plain[1][0].positions)
    last = int((int((len(clip) - 1) / fps * 10 + 1e-6) + 1e-6) * fps / 10 + 1e-6)  # the last frame that the model saw
    first = last - int(5 * fps / 10)
    for made, model in zip(found[0], plain[0], strict=True):
        assert (made.fps, made.skeleton, made.up) == (fps, clip.skeleton, "y") and made.rig.channels == clip.rig.channels
        seen = last - first + 1
        np.testing.assert_allclose(made.positions[:seen], clip.positions[first : last + 1], atol=1e-5)
        assert abs(len(made) / fps - 1.9) < 2 / fps + 1e-6
        finger = made.rig.skeleton.joints.index("mixamorig:LeftHandIndex1")
        assert apart(made.rig.rotations[seen:, finger], clip.rig.rotations[last, finger]).max() < 1e-2
        shown = made.retarget(H36M17).positions
        assert np.abs(shown[-1, 0] - model.with_up("y").positions[-1, 0]).max() < 1e-2
        foot = H36M17.joints.index("left_foot")
        bones = [p[-1, foot] - p[-1, foot - 1] for p in (shown, model.with_up("y").positions)]
        assert np.dot(*bones) > 0.9 * np.linalg.norm(bones[0]) * np.linalg.norm(bones[1])


def test_clips_of_one_training_share_a_form(originals):
    a, b = prepare(originals[:1], 10.0)[0], prepare(originals[1:2], 5.0)[0]
    with pytest.raises(ValueError, match=r"has fps 5.0, .* has 10.0; expected one and the same"):
        Bodies.of([a, b])
    bodies = Bodies.of([a])
    assert Bodies.from_json(bodies.to_json()) == bodies and bodies.skeleton.mirror.tolist() == H36M17.mirror.tolist()
    with pytest.raises(ValueError, match="there are no motions"):
        Bodies.of([])
