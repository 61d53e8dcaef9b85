"""MotionWavelet's settings: the paper's values, presets, and what does not fit together."""

from __future__ import annotations

import pytest

from mwlib.prediction.config import PRESETS, Config


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_yaml_round_trip_and_hash(name, tmp_path):
    cfg = Config.preset(name)
    file = tmp_path / "config.yaml"
    file.write_text(cfg.to_yaml())
    assert Config.from_yaml(file) == cfg and Config.from_yaml(file).hash() == cfg.hash()


def test_the_papers_values():
    h36m, humaneva = Config.preset("h36m"), Config.preset("humaneva")
    m = h36m.model
    assert (m.width, m.layers, m.heads, m.feedforward) == (768, 12, 8, 1536) and m.wavelet == "bior2.8" and m.mode == "zero"
    assert (humaneva.model.layers, humaneva.model.feedforward) == (6, 1024)
    assert h36m.diffusion.prediction == "eps" and m.coefficient_scale == "none" and m.representation == "pose"
    assert h36m.training.lr_milestones == tuple(781 * e for e in (120, 180, 240, 300)) and h36m.training.train_steps == 781 * 500
    cuts = (h36m.windows.history, h36m.windows.future, humaneva.windows.history, humaneva.windows.future)
    assert cuts == (25, 100, 15, 60) and h36m.windows.frames == 125
    assert h36m.sampling.tabg_steps == 0.9 and humaneva.sampling.tabg_scale == 0 and humaneva.sampling.wmsg == "off"


def test_hashes_cover_what_they_should():
    cfg = Config.preset("tiny")
    later = dict(guidance_weight=0.9, mm_threshold=0.4, precision="bf16", test_windows=3, test_stride=7, checkpoint_every=1)
    later |= dict(sampling_seed=4)
    assert cfg.training_hash() == cfg.override(**later).training_hash()
    for name, value in later.items():
        assert cfg.hash() != cfg.override(**{name: value}).hash(), name
    trained = dict(lr=1e-5, wavelet="haar", history=12, seed=4, steps=100, data="elsewhere", drop_per="batch", train_stride=2)
    for name, value in trained.items():
        assert cfg.training_hash() != cfg.override(**{name: value}).training_hash(), name


def test_other_data_have_other_people():
    assert Config.preset("tiny").data.test_subjects == ("P7", "P8")
    other = Config.preset("tiny", data="my/folder")
    assert (other.data.train_subjects, other.data.validation_subjects, other.data.test_subjects) == ((), (), ())
    assert Config.preset("tiny", data="my/folder", test_subjects=["A"]).data.test_subjects == ("A",)
    assert Config.preset("tiny", data="synthetic").data.test_subjects == ("P7", "P8")


@pytest.mark.parametrize(
    "changes, message",
    [
        (dict(level=6), "level is 6 of 40 frames; expected at most 5"),
        (dict(transform="time_wavelet", level=99), "level is 99 of 40 frames; expected at most 5"),
        (dict(batch=10**12), "batch is 1000000000000; expected 1 to 65536"),
        (dict(steps=99999999999999999999999), "steps is 99999999999999999999999; expected 1 to 100000"),
        (dict(ema=1), "ema is 1.0; expected 0 to below 1"),
        (dict(drop_condition=1), "drop_condition is 1.0; expected 0 to below 1"),
        (dict(lr_milestones=[-5]), "lr_milestones is -5; expected at least 1"),
        (dict(guidance_wieght=0.3), "did you mean 'guidance_weight'"),
        (dict(lr="quick"), "lr is 'quick'; expected a finite number"),
        (dict(layers=5), "layers is 5"),
        (dict(heads=7), "multiple of heads"),
        (dict(tabg_window=4), "odd"),
        (dict(ddim_steps=1000), "ddim_steps is 1000"),
        (
            dict(steps=1000, ddim_steps=600, spacing="leading"),
            "t = 600, where alpha_bar is 0.34.*expected 500 steps, or spacing=t",
        ),
        (dict(steps=1000, ddim_steps=700, spacing="trailing"), "ddim_steps is 700.* t = 0, for which.*expected 666 steps$"),
        (dict(transform="phase", wmsg="every_step"), "wmsg is 'every_step' with phase codes; expected 'off' or 'y0_hat'"),
        (dict(mm_singletons="drop"), "mm_singletons is 'drop'"),
        (dict(wavelet="bior9.9"), "bior9.9"),
        (dict(wavelet="bior28"), "did you mean 'bior2.8'"),
        (dict(complete_history=1), "complete_history"),
        (dict(history=True), "history"),
        (dict(test_subjects="S9"), "expected a list"),
        (dict(dropout=1.5), "0 to below 1"),
        (dict(dropout=1.0), "0 to below 1"),
        (dict(tabg_steps=1.5), "0 to 1"),
        (dict(fps=0.0), "more than 0"),
        (dict(transform="dct", dct_rows=999), "dct_rows is 999"),
        (dict(prediction="x0"), "expected one of eps, y0, v"),
    ],
)
def test_bad_values_are_named(changes, message):
    with pytest.raises(ValueError, match=message):
        Config.preset("tiny", **changes)


@pytest.mark.parametrize(
    "old, now",
    [("latent", "width"), ("target", "representation"), ("cfg_weight", "guidance_weight"), ("cfg_form", "guidance_form")],
)
def test_names_of_former_versions_say_what_they_are_called_now(old, now):
    with pytest.raises(ValueError, match=f"'{old}' is not a setting any more; it is now called '{now}'"):
        Config.preset("tiny", **{old: 1})
    assert now in Config.owners()
