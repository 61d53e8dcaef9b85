"""Settings of text-to-motion that do not fit each other are refused."""

from __future__ import annotations

import pytest

from mwlib.inbetweening.config import PRESETS as INBETWEENING
from mwlib.matching import config
from mwlib.prediction.config import PRESETS as PREDICTION
from mwlib.text_to_motion.config import Config


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"width": 30, "heads": 4}, "width is 30; expected an even multiple of heads"),
        ({"text": "clip"}, "clip_folder empty; expected the folder of CLIP"),
        ({"statistics": "files"}, "statistics is files, data people; expected a folder with Mean.npy and Std.npy, or clips"),
        ({"sampling_steps": 51}, "sampling_steps is 51; expected at most steps"),
        ({"steps": 1}, "sampling_steps is 1 of 1, .*from noise at t = 0, where alpha_bar is 0.90.*; expected more steps, or an"),
        ({"longest": 30}, "longest is 30; expected at least shortest"),
        ({"lf_norm": "l2"}, "lf_norm is 'l2'"),
        ({"text_width": 30}, "text_width is 30; expected an even multiple of heads"),
        ({"network": "unet", "width": 6}, r"channels are \[12, 12, 12, 12\]; expected one number per level"),
        ({"shortest": 3}, "shortest is 3; expected at least 4 frames"),
        ({"pool": 2}, "pool is 2 and test_clips 96; expected at least 3"),
        ({"test_clips": 1}, "pool is 16 and test_clips 1; expected at least 3"),
        ({"stage": "late"}, "stage is 'late'"),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Config.preset("tiny", **changes)


def test_the_published_presets_have_the_published_settings():
    mdm, smf = Config.preset("mdm"), Config.preset("stablemofusion")
    assert (mdm.model.width, mdm.model.layers, mdm.model.heads, mdm.model.feedforward, mdm.forward.steps) == (512, 8, 4, 1024, 50)
    assert (mdm.training.lr, mdm.training.batch, mdm.sampling.guidance, mdm.objective.drop_text) == (1e-4, 64, 2.5, 0.1)
    assert (smf.forward.schedule, smf.forward.steps, smf.sampling.sampler, smf.sampling.sampling_steps) == (
        "linear",
        1000,
        "sde_dpm",
        10,
    )
    assert smf.training.ema**32 == pytest.approx(0.9932, abs=1e-4)  # published: every 32 steps
    assert (mdm.training.ema, mdm.training.ema_start) == (0, 0)  # its first release averages nothing
    for cfg in (mdm, smf):
        assert (cfg.model.text, cfg.model.mask_frames, cfg.forward.statistics, cfg.padded) == ("clip", False, "files", 196)
    assert Config.preset("mdm", text="words", mask_frames=True).padded == 0
    assert (smf.training.lr, smf.training.lr_gamma, smf.training.clip_gradient) == (2e-4, 0.9, 1.0)


def test_what_is_no_part_of_a_training_and_the_name_of_the_embedded_data():
    cfg = Config.preset("tiny")
    for changes in ({"evaluator": "other"}, {"guidance": 1.0}, {"sampler": "ddim"}, {"method": "truth"}):
        assert cfg.override(**changes).training_hash() == cfg.training_hash()
    assert cfg.override(critic="other").training_hash() != cfg.training_hash()
    assert Config.preset("tiny", data="synthetic") == Config.preset("tiny")


def test_one_preset_name_builds_the_figures_of_all_systems():
    shared = (set(PREDICTION) & set(INBETWEENING)) - {"lafan1"}
    assert {"h36m", "humaneva", "cmu_paper", "laptop_paper"} <= shared
    for kind in (Config, config.Config):
        assert shared <= set(kind.presets)
        for name in kind.presets:
            assert kind.from_yaml(kind.preset(name).to_yaml()) == kind.preset(name)
