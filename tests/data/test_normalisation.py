"""Normalisation of features: three kinds, measured and read."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from jaxtyping import TypeCheckError

from mwlib import MotionFormatError
from mwlib.data.formats.humanml import HUMANML3D, KIT
from mwlib.data.normalisation import Statistics

# Of the statistics that MDM evaluates with (t2m_std.npy): yaw rate, root velocity, height, contacts.
EVALUATORS = {"yaw_rate": 0.00051467, "root_velocity": 0.00067693, "height": 0.00612082}
# Of HumanML3D's Std.npy.
PUBLISHED = {
    "yaw_rate": 0.01283, "root_velocity": 0.01693, "height": 0.15377, "positions": 0.12224, "rotations": 0.29969,
    "velocities": 0.01947, "contacts": 0.35593,
}  # fmt: skip


@pytest.fixture
def statistics() -> Statistics:
    """Of no data."""
    generator = torch.Generator().manual_seed(0)
    mean, deviation = torch.randn(263, generator=generator), torch.rand(263, generator=generator) + 0.1
    return Statistics("mdm", mean, deviation, HUMANML3D)


def test_measured_deviations_are_averaged_within_each_block():
    rng = np.random.default_rng(0)
    scale = rng.uniform(0.1, 3, 251)
    clips = [(rng.normal(size=(n, 251)) * scale + 5).astype(np.float32) for n in (50, 120)]
    clips = [np.concatenate([clip[:, :-4], np.ones((len(clip), 4), np.float32)], axis=1) for clip in clips]
    found = Statistics.measured(clips, KIT)
    frames = np.concatenate(clips).astype(float)
    np.testing.assert_allclose(found.mean, frames.mean(axis=0), rtol=1e-5)
    for name, block in KIT.blocks.items():
        expected = 1.0 if name == "contacts" else np.mean([np.std(frames[:, i]) for i in range(251)[block]])
        np.testing.assert_allclose(found.deviation[block], expected, rtol=1e-5, err_msg=name)
    assert found.kind == "mdm" and found.mean.dtype == found.deviation.dtype == torch.float32
    np.testing.assert_array_equal(Statistics.measured(clips, KIT, "evaluator").deviation, found.of_kind("evaluator").deviation)
    with pytest.raises(ValueError, match="there are no clips; expected some"):
        Statistics.measured([], KIT)


def test_published_statistics_and_the_evaluators_that_follow_from_them(data_folder):
    own = Statistics.read(data_folder / "humanml3d" / "Mean.npy", data_folder / "humanml3d" / "Std.npy")
    for name, block in HUMANML3D.blocks.items():
        np.testing.assert_allclose(own.deviation[block], PUBLISHED[name], rtol=5e-4, err_msg=name)
    evaluator = own.of_kind("evaluator")
    for name, block in HUMANML3D.blocks.items():
        ratio = (own.deviation / evaluator.deviation)[block]
        weight = 25.0 if name in ("yaw_rate", "root_velocity", "height", "contacts") else 1.0
        np.testing.assert_allclose(ratio, weight, rtol=1e-5, err_msg=name)
        if name in EVALUATORS:
            np.testing.assert_allclose(own.deviation[block] / EVALUATORS[name], 25.1, atol=0.25)
    assert float(own.mean[3]) == pytest.approx(0.9386, abs=1e-4)


@pytest.mark.parametrize("kind, weight", [("mdm", 1.0), ("stablemofusion", 5.0), ("evaluator", 25.0)])
def test_kinds_differ_in_root_and_contacts(statistics, kind, weight):
    other = statistics.of_kind(kind)
    ratio = statistics.deviation / other.deviation
    np.testing.assert_allclose(ratio[[0, 1, 2, 3, 259, 260, 261, 262]], weight, rtol=1e-6)
    np.testing.assert_allclose(ratio[4:259], 1.0, rtol=1e-6)
    np.testing.assert_array_equal(other.mean, statistics.mean)
    for there in ("mdm", "stablemofusion", "evaluator"):
        np.testing.assert_allclose(other.of_kind(there).of_kind(kind).deviation, other.deviation, rtol=1e-6)


def test_there_and_back(statistics):
    raw, other = torch.randn(2, 7, 263), statistics.of_kind("stablemofusion")
    x = other.normalise(raw)
    np.testing.assert_allclose(x, (raw - statistics.mean) / other.deviation, rtol=1e-5)
    np.testing.assert_allclose(other.denormalise(x), raw, atol=1e-5)
    assert x.dtype == torch.float32 and other.normalise(raw.double()).dtype == torch.float64
    made = torch.randn(1, 3, 263, requires_grad=True)
    statistics.of_kind("evaluator").normalise(statistics.denormalise(made)).sum().backward()
    np.testing.assert_allclose(made.grad[0, 0, 0], 25.0, rtol=1e-5)


def test_statistics_go_with_a_model(statistics):
    same = Statistics.from_tensors("evaluator", statistics.of_kind("evaluator").tensors())
    assert same.layout is HUMANML3D and same.kind == "evaluator"
    assert torch.equal(same.mean, statistics.mean) and torch.equal(same.deviation, statistics.of_kind("evaluator").deviation)


def test_statistics_that_make_no_sense_are_refused(statistics, tmp_path):
    with pytest.raises(ValueError, match=r"mean has shape \(251,\); expected \(263,\) for HumanML3D"):
        Statistics("mdm", torch.zeros(251), torch.ones(263), HUMANML3D)
    with pytest.raises(ValueError, match="the smallest deviation is 0; expected positive numbers"):
        Statistics("mdm", torch.zeros(263), torch.zeros(263), HUMANML3D)
    for make in (statistics.of_kind, lambda kind: Statistics(kind, statistics.mean, statistics.deviation, HUMANML3D)):
        with pytest.raises((ValueError, TypeCheckError), match="expected one of mdm, stablemofusion, evaluator|'guo'"):
            make("guo")
    files = tmp_path / "Mean.npy", tmp_path / "Std.npy"
    with pytest.raises(MotionFormatError, match="Mean.npy, file: found No such file"):
        Statistics.read(*files)
    np.save(files[0], np.zeros(263))
    for deviations, message in (
        (np.zeros(263), "263 means, 263 deviations from 0; expected 263 or 251 of each, .* above 0"),
        (np.ones((263, 1)), r"Std.npy, array: found float64 of shape \(263, 1\)"),
    ):
        np.save(files[1], deviations)
        with pytest.raises(MotionFormatError, match=message):
            Statistics.read(*files)
