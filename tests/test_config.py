"""Configuration: presets, validation, YAML, hashes."""

from __future__ import annotations

import pytest

from mwlib.config import Config, field_owners
from mwlib.presets import PRESETS


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_yaml_round_trip_and_hash(name, tmp_path):
    cfg = Config.preset(name)
    file = tmp_path / "config.yaml"
    file.write_text(cfg.to_yaml())
    assert Config.from_yaml(file) == cfg and Config.from_yaml(file).hash() == cfg.hash()


def test_the_papers_values():
    h36m, humaneva = Config.preset("h36m"), Config.preset("humaneva")
    m = h36m.model
    assert (m.latent, m.layers, m.heads, m.feedforward) == (768, 12, 8, 1536) and m.wavelet == "bior2.8" and m.mode == "zero"
    assert (humaneva.model.layers, humaneva.model.feedforward) == (6, 1024)
    assert h36m.diffusion.prediction == "eps" and m.coefficient_scale == "none"
    assert h36m.training.lr_milestones == tuple(781 * e for e in (120, 180, 240, 300)) and h36m.training.train_steps == 781 * 500
    assert (h36m.data.history, h36m.data.future, humaneva.data.history, humaneva.data.future) == (25, 100, 15, 60)
    assert h36m.sampling.tabg_steps == 0.9 and humaneva.sampling.tabg_scale == 0 and humaneva.sampling.wmsg == "off"


def test_hashes_cover_what_they_should():
    cfg = Config.preset("tiny")
    assert cfg.training_hash() == cfg.override(cfg_weight=0.9, test_windows=3).training_hash()
    assert cfg.hash() != cfg.override(cfg_weight=0.9).hash()
    for name, value in dict(lr=1e-5, wavelet="haar", history=12, seed=4, steps=100, data="elsewhere").items():
        assert cfg.training_hash() != cfg.override(**{name: value}).training_hash(), name


def test_field_names_are_unique():
    assert len(field_owners()) == sum(
        len(vars(getattr(Config(), g))) for g in ("data", "model", "diffusion", "training", "sampling")
    )


@pytest.mark.parametrize(
    "changes, message",
    [
        (dict(cfg_wieght=0.3), "did you mean 'cfg_weight'"),
        (dict(lr="1e-3"), "lr is '1e-3'"),
        (dict(layers=5), "layers is 5"),
        (dict(heads=7), "multiple of heads"),
        (dict(tabg_window=4), "odd"),
        (dict(ddim_steps=1000), "ddim_steps is 1000"),
        (dict(wavelet="bior9.9"), "bior9.9"),
        (dict(complete_history=1), "complete_history"),
        (dict(history=True), "history"),
        (dict(test_subjects="S9"), "expected a list"),
        (dict(dropout=1.5), "0 to 1"),
        (dict(fps=0.0), "more than 0"),
        (dict(transform="dct", dct_rows=999), "dct_rows is 999"),
    ],
)
def test_bad_values_are_named(changes, message):
    with pytest.raises(ValueError, match=message):
        Config.preset("tiny", **changes)


def test_bad_yaml_and_preset(tmp_path):
    with pytest.raises(ValueError, match="groups"):
        Config.from_yaml("speed: 3")
    with pytest.raises(ValueError, match="'huge'"):
        Config.preset("huge")
