"""Named settings of in-betweening."""

from __future__ import annotations

from typing import Any

from mwlib.data.known import NAMED_SOURCES

# Own choice, by measurement: the network is told the keyframes, and says how a motion departs from interpolation.
_TOLD: dict[str, Any] = dict(
    keyframes="told", target="departure", tokens="sines", output="wiener", prediction="y0", level_weight="snr", scheme="none",
    lr=1e-3, lr_schedule="cosine", warmup=100, spacing="trailing", ddim_steps=20, bones="keyframes",
)  # fmt: skip
_LAPTOP: dict[str, Any] = _TOLD | dict(
    rows=16, width=128, layers=4, heads=4, feedforward=256, dropout=0.1,
    train_steps=4000, ema=0.998, ema_start=500, checkpoint_every=500,
)  # fmt: skip


def _source(name: str) -> dict[str, Any]:
    """Data of a preset of prediction."""
    return {"data": NAMED_SOURCES[name][0]}


PRESETS: dict[str, dict[str, Any]] = {
    # Half a minute on two cores; synthetic people.
    "tiny": _TOLD | dict(
        data="synthetic", fps=25.0, between=22, test_stride=12, test_windows=48, validation_subjects=("P6",),
        test_subjects=("P7", "P8"), width=64, layers=4, heads=4, feedforward=128, dropout=0.0, steps=200, train_steps=400,
        batch=32, lr=2e-3, warmup=50, ema=0.99, ema_start=100, checkpoint_every=200, ddim_steps=10,
    ),
    # A quarter of an hour on two cores; synthetic people.
    "laptop": _LAPTOP | dict(
        data="synthetic", fps=30.0, validation_subjects=("P6",), test_subjects=("P7", "P8"),
    ),
    # The CMU clips on 17 joints, found under MWLIB_DATA; whole people are held out. It is told its length, up to 1.5 s.
    "cmu": _LAPTOP | dict(
        data="cmu/asfamc", fps=30.0, between=45, shortest=8, validation_subjects=("1",), test_subjects=("2", "7", "29"),
    ),
    # Ten files of LaFAN1 as they lie under MWLIB_DATA: rotations of its 22 joints. Trained for minutes the model is too free;
    # the temperature was chosen on the validation person, by speed and jerk.
    "lafan1": _LAPTOP | dict(
        data="lafan1", fps=30.0, state="rotations", temperature=0.5, validation_subjects=("3",), test_subjects=("2", "5"),
    ),
    # The protocol of `mwlib lafan1-benchmark`: ten frames before, one after, up to 45 between; persons 1 to 4 train, 5 tests.
    "lafan1_official": _LAPTOP | dict(
        data="lafan1", fps=30.0, state="rotations", temperature=0.5, past=10, between=45, shortest=5, coast=8.0, sizes="each",
        train_subjects=("1", "2", "3", "4"), test_subjects=("5",),
    ),
    # 81 files of Bandai-Namco under MWLIB_DATA: rotations of 22 joints. They name no people; whole styles are held out.
    "bandai": _LAPTOP | dict(
        data="bandai_namco", fps=30.0, state="rotations", temperature=0.5, test_stride=10,
        validation_subjects=("angry",), test_subjects=("old", "youthful"),
    ),
    # Human3.6M's people by convention; the paper names no split, rate or window.
    "h36m": _LAPTOP | _source("h36m") | dict(
        fps=25.0, train_subjects=("S1", "S5", "S6", "S7", "S8"), test_subjects=("S9", "S11"),
    ),
    "humaneva": _LAPTOP | _source("humaneva") | dict(
        fps=30.0, train_subjects=("Train/S1", "Train/S2", "Train/S3"),
        test_subjects=("Validate/S1", "Validate/S2", "Validate/S3"),
    ),
}  # fmt: skip
PRESETS |= {"laptop_paper": PRESETS["laptop"], "cmu_paper": PRESETS["cmu"]}  # one name builds the figures of all systems
