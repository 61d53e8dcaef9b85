"""Settings of in-betweening: presets, hashes, and what does not fit together."""

from __future__ import annotations

import pytest

from mwlib.inbetweening.config import PRESETS, Config
from tests.inbetweening.sample import PAPER, small

UNSEEN = "but condition_on_keyframes is false; expected condition_on_keyframes=true"


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_yaml_round_trip_and_hash(name, tmp_path):
    cfg = Config.preset(name)
    file = tmp_path / "config.yaml"
    file.write_text(cfg.to_yaml())
    assert Config.from_yaml(file) == cfg and Config.from_yaml(file).hash() == cfg.hash()
    assert cfg.system == "inbetweening"


def test_frames_count_the_keyframes():
    assert small(between=6).task.frames == small(between=6).task.fewest == 8
    assert small(between=9, shortest=4).task.frames == 11 and small(between=9, shortest=4).task.fewest == 6
    task = small(between=9, shortest=4, past=10).task
    assert (task.frames, task.fewest, task.gap) == (20, 15, 11) and task.smallest_gap == 6


def test_settings_that_came_later_leave_the_hashes_of_old_results_alone():
    """Those of the results and models that were made without them."""
    cfg = Config.preset("laptop")
    assert (cfg.hash(), cfg.training_hash()) == ("8fd043dd", "001306ba")
    assert "past: 1\n" in cfg.to_yaml() and Config.from_yaml(cfg.to_yaml().replace("  past: 1\n", "")) == cfg
    later = dict(past=2, future=2, coast=1.0, hide=0.1, departure_scale="each", other_speeds=0.1, mean_width=8, more_data=("x",))
    assert {*later} == {*Config.newer}
    seen = cfg.override(past=3, future=3)
    for name, value in later.items():
        before = seen.override(departure_scale="window") if name == "mean_width" else seen
        assert before.hash() != before.override(**{name: value}).hash(), name
        assert before.training_hash() != before.override(**{name: value}).training_hash(), name


def test_hashes_cover_what_they_should():
    cfg = small()
    later = dict(
        method="truth", samples=7, ddim_steps=4, temperature=0.5, spacing="trailing", sampling_seed=4, scheme="paste", repeats=2,
        eta=1.0, keyframe_noise="fixed", reconstruction_weight=1.0, test_stride=3, test_windows=2, checkpoint_every=1,
    )  # fmt: skip
    assert cfg.training_hash() == cfg.override(**later).training_hash()
    for name, value in later.items():
        assert cfg.hash() != cfg.override(**{name: value}).hash(), name
    trained = dict(
        between=7, shortest=3, state="rotations", mirror=True, tokens="sines", rows=5, more_keyframes=1, width=32, lr=1e-5,
        seed=4, steps=60, diversity_weight=0.1, draws=3, smoothness_weight=0.1, smoothness="velocity", length_weight=0.1,
        angle_weight=0.1, level_weight="uniform", data="elsewhere", fps=9.0, target="motion",
    )  # fmt: skip
    for name, value in trained.items():
        assert cfg.training_hash() != cfg.override(**{name: value}).training_hash(), name


def test_other_data_have_other_people():
    assert Config.preset("tiny").data.test_subjects != ()
    other = Config.preset("tiny", data="my/folder")
    assert (other.data.train_subjects, other.data.validation_subjects, other.data.test_subjects) == ((), (), ())
    assert Config.preset("tiny", data="my/folder", test_subjects=["A"]).data.test_subjects == ("A",)


@pytest.mark.parametrize(
    "changes, message",
    [
        (dict(betwen=3), "did you mean 'between'"),
        (dict(keyframes="told"), "'keyframes' is not a setting any more; it is now called 'condition_on_keyframes'"),
        (dict(sizes="each"), "'sizes' is not a setting any more; it is now called 'departure_scale'"),
        (dict(between=0), "between is 0; expected 1 or more|between is 0"),
        (dict(between=1), "between is 1; expected at least 2"),
        (dict(width=15), "width is 15; expected an even multiple of heads"),
        (dict(heads=3), "width is 16; expected an even multiple of heads"),
        (dict(width=3, heads=1), "width is 3; expected an even multiple"),
        (dict(layers=3), "layers is 3; expected an even number"),
        (dict(rows=9), "rows is 9; expected at most 8, as many cosines as there are"),
        (dict(rows=9, shortest=3), "rows is 9; expected at most 8"),
        (dict(tokens="sines", rows=7), "rows is 7; expected at most 6, as many sines"),
        (dict(tokens="sines", target="motion"), "tokens are sines, but target is motion; expected departure"),
        (dict(tokens="frames", rows=4), "rows is 4 with frames as tokens; expected 0"),
        (dict(shortest=7), r"shortest is 7; expected at most between \(6\)"),
        (dict(output="wiener", prediction="eps"), "output is wiener with prediction eps; expected prediction=y0"),
        (dict(level_weight="unit"), "level_weight is unit, but output is direct; expected output=wiener"),
        (
            dict(PAPER, more_keyframes=1),
            "more_keyframes is 1, " + UNSEEN,
        ),
        (
            dict(condition_on_keyframes=False),
            "target is departure, " + UNSEEN,
        ),
        (dict(PAPER, past=3), "past is 3, " + UNSEEN),
        (dict(coast=2.0), "coast is 2 with past 1; expected a past of 2 or more"),
        (dict(past=0), "past is 0"),
        (dict(PAPER, future=2), "future is 2, " + UNSEEN),
        (dict(hide=0.3), "hide is 0.3, but past and future are 1; expected 2 or more of one"),
        (dict(departure_scale="window"), "departure_scale is window with cosines and output direct; expected sines and wiener"),
        (
            dict(departure_scale="window", tokens="sines", output="wiener", more_keyframes=1),
            "departure_scale is window; expected scheme=none and no more_keyframes",
        ),
        (dict(mean_width=8), "mean_width is 8 with departure_scale longest; expected window, whose mean it says"),
        (dict(departure_scale="each", target="motion"), "departure_scale is each, but target is motion; expected departure"),
        (dict(rows=9, past=3), "rows is 9; expected at most 8, as many cosines as there are"),
        (dict(PAPER, shortest=3), "shortest is 3, " + UNSEEN),
        (dict(ddim_steps=50), r"ddim_steps is 50; expected fewer than steps \(50\)"),
        (dict(ddim_steps=40, spacing="trailing"), "ddim_steps is 40 of 50, .* t = 0, for .*; expected 33 steps$"),
        (dict(ddim_steps=17, spacing="leading"), "t = 33, where alpha_bar is 0.23.*; expected 16 steps, or spacing=trailing"),
        (dict(tokens="wavelets"), "tokens is 'wavelets'; expected one of cosines, sines, frames"),
        (dict(state="poses"), "state is 'poses'; expected one of positions, rotations"),
        (dict(method="guess"), "method is 'guess'"),
        (dict(temperature=0.0), "temperature is 0"),
        (dict(angle_weight=-1.0), "angle_weight is -1"),
        (dict(dropout=1.0), "0 to below 1"),
    ],
)
def test_what_does_not_fit_is_named(changes, message):
    with pytest.raises(ValueError, match=message):
        small(**changes)


@pytest.mark.parametrize("changes", [dict(rows=8), dict(tokens="sines", rows=6), dict(between=2), dict(shortest=6), PAPER])
def test_what_just_fits_is_taken(changes):
    assert small(**changes).get("between") == changes.get("between", 6)
