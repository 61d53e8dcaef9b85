"""Named settings: five that train in minutes, on synthetic people or on real clips, and the paper's two."""

from __future__ import annotations

from typing import Any

from mwlib.data.known import NAMED_SOURCES

# Own choice, stable when trained for minutes: predict clean coefficients, scaled to unit deviation, with the loss
# weighed back to metres. The paper's noise prediction on raw coefficients needs hundreds of thousands of steps. Guidance is
# off: models trained so briefly gain a centimetre or two from it, at two to three times the time of sampling (the grid `main`).
_STABLE: dict[str, Any] = dict(
    prediction="y0", coefficient_scale="coefficient", loss_weight="metric",
    lr=5e-4, lr_schedule="cosine", warmup=100, attention_dropout=0.0,
    spacing="trailing", tabg_sigma=1.0, tabg_space="y0_hat", guidance_weight=0.0, wmsg="off",
    validation_subjects=("P6",), test_subjects=("P7", "P8"),
)  # fmt: skip
_LAPTOP: dict[str, Any] = _STABLE | dict(
    width=128, layers=4, heads=4, feedforward=256, dropout=0.1, representation="displacement",
    train_steps=4000, ema=0.998, ema_start=500, checkpoint_every=500, ddim_steps=20,
)  # fmt: skip

# What measurements on people held out chose instead (RESULTS.md, "A predictor with our own departures"). Few tokens make a step
# cheap, and a wide network affordable; the body's heading and all that training windows vary in make ten minutes of motion go
# further; a little more noise to start from makes up for the speed that few denoising steps lose.
_CHOSEN: dict[str, Any] = _LAPTOP | dict(
    transform="time_wavelet", wavelet="bior6.8", level=3, omit=1, coefficient_scale="none", loss_weight="uniform",
    level_weight="snr", heading="body", other_speeds=0.6, other_bones=0.08, backwards=0.3, slowed=0.15, other_arms=0.3,
    blank_condition=0.2, width=256, heads=8, feedforward=512, train_steps=7000, bones="observed", temperature=1.1,
)  # fmt: skip
_CMU_PEOPLE: dict[str, Any] = dict(validation_subjects=("1",), test_subjects=("2", "7", "29"))


def _source(name: str) -> dict[str, Any]:
    """Data and frame rate of a preset, as load_motions knows it."""
    return dict(zip(("data", "fps"), NAMED_SOURCES[name], strict=True))


PRESETS: dict[str, dict[str, Any]] = {
    # The paper's coefficients, which the chapters explain. Half a minute on two cores: fewer frames, joints' rates and steps;
    # synthetic people.
    "tiny": _STABLE | _source("tiny") | dict(
        history=10, future=30, test_stride=10, width=64, layers=4, heads=4, feedforward=128, dropout=0.0,
        steps=200, train_steps=1000, batch=32, lr=1.5e-3, warmup=50, ema=0.99, ema_start=100, checkpoint_every=200,
        samples=20, ddim_steps=10, test_windows=48,
    ),
    # The paper's windows, and what measurements chose: a quarter to half an hour on two cores; synthetic people.
    "laptop": _CHOSEN | _source("laptop"),
    # The same on the CMU clips in ASF/AMC, found under MWLIB_DATA; whole people are held out.
    "cmu": _CHOSEN | _source("cmu") | _CMU_PEOPLE,
    # The same two at about the same cost, with the paper's coefficients.
    "laptop_paper": _LAPTOP | _source("laptop"),
    "cmu_paper": _LAPTOP | _source("cmu") | _CMU_PEOPLE,
    # MotionWavelet, Appendix A.
    "h36m": _source("h36m") | dict(
        augment="humanmac", window_sampling="subject_action",
        train_subjects=("S1", "S5", "S6", "S7", "S8"), test_subjects=("S9", "S11"),
    ),
    "humaneva": _source("humaneva") | dict(
        history=15, future=60, test_stride=15, augment="humanmac",
        window_sampling="subject_action", layers=6, feedforward=1024, lr_schedule="cosine_restarts", lr_gamma=0.9,
        train_subjects=("Train/S1", "Train/S2", "Train/S3"),
        test_subjects=("Validate/S1", "Validate/S2", "Validate/S3"),
        tabg_scale=0.0, wmsg="off",
    ),
}  # fmt: skip

# Names of settings before version 0.2, and today's.
RENAMED = {
    "latent": "width", "target": "representation", "cfg_weight": "guidance_weight", "cfg_form": "guidance_form",
}  # fmt: skip
