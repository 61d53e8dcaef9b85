"""In-betweening: curves are the values that were given, marks stand at the keyframes, broken bones are coloured."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from scipy.fft import dct, idct

from mwlib import plots
from mwlib.synthetic.motions import synthetic_motions
from tests.plots.legible import legible

FRAMES, FPS = 41, 20.0
TIME = np.arange(FRAMES) / FPS
TRUTH = np.sin(3 * TIME)
NOISE = np.random.default_rng(0).normal(size=(3, FRAMES))


WALK = synthetic_motions(1, seconds=2)[0].resample(25.0).cut(0, 41)


def _labels(ax):
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def test_bridged_coordinate_shows_truth_baselines_samples_and_keyframes():
    line = np.linspace(TRUTH[0], TRUTH[-1], FRAMES)
    fig, ax = plots.bridged_coordinate(TRUTH, {"linear": line}, TRUTH + NOISE, fps=FPS)
    found = _labels(ax)
    assert {*found} == {"truth", "linear", "3 samples", "keyframe"}
    assert np.array_equal(found["truth"].get_ydata(), TRUTH) and np.array_equal(found["linear"].get_ydata(), line)
    assert found["keyframe"].get_xdata() == pytest.approx([0, 2.0])
    assert found["keyframe"].get_ydata() == pytest.approx(TRUTH[[0, -1]])
    drawn = [curve.get_ydata() for curve in ax.lines if curve.get_color() == plots.CYCLE[0] and len(curve.get_ydata())]
    assert np.array_equal(drawn, TRUTH + NOISE)
    legible(fig)


@pytest.mark.parametrize("frames", [40, 41])
def test_spectra_stand_at_their_frequencies(frames):
    wave = np.sin(2 * np.pi * 5 * np.arange(frames) / frames)  # 5 turns in the clip
    power = np.abs(np.fft.rfft(wave)) ** 2 + 1e-6
    fig, axes = plots.spectra({"truth": power, "louder": 4 * power}, fps=FPS, frames=frames)
    truth = _labels(axes[0])["truth"]
    assert truth.get_xdata()[truth.get_ydata().argmax()] == pytest.approx(5 * FPS / frames)
    ratios = [line.get_ydata() for line in axes[1].lines]
    assert any(np.allclose(ratio, 4.0) for ratio in ratios) and axes[0].get_yscale() == "log"
    legible(fig)


def test_imposed_steps_mark_noisy_and_clean_keyframes():
    levels = [1.0, 0.5, 0.0]
    x = TRUTH + np.array(levels)[:, None] * NOISE
    fig, axes = plots.imposed_steps(x, levels, fps=FPS)
    assert [ax.get_title(loc="left") for ax in axes.flat] == ["noise 1.00", "noise 0.50", "clean"]
    for ax, values in zip(axes.flat, x, strict=True):
        found = _labels(ax)
        assert found["keyframe at this noise"].get_ydata() == pytest.approx(values[[0, -1]])
        assert found["clean keyframe"].get_ydata() == pytest.approx(TRUTH[[0, -1]])
    legible(fig)
    four, _ = plots.imposed_steps(np.stack([*x, TRUTH]), [*levels, 0.0], fps=FPS)
    legible(four)


def test_training_view_goes_to_cosines_and_back():
    y = dct(TRUTH, norm="ortho")
    noisy = y + 0.1 * NOISE[0]
    fig, axes = plots.training_view(TRUTH, y, {"noise 0.10": (noisy, idct(noisy, norm="ortho"))}, fps=FPS)
    assert axes.shape == (2, 2)
    assert np.array_equal(axes[0, 0].lines[0].get_ydata(), TRUTH)
    assert axes[1, 0].lines[-1].get_ydata() == pytest.approx(TRUTH + 0.1 * idct(NOISE[0], norm="ortho"))
    stems = np.array(axes[1, 1].collections[0].get_segments())
    assert stems[:, 1, 1] == pytest.approx(noisy) and stems[:, 0, 0] == pytest.approx(np.arange(FRAMES) * FPS / (2 * FRAMES))
    legible(fig)


T = 6
MEAN, DEVIATION = torch.linspace(-1, 1, T), torch.tensor([0, 0.5, 1, 1, 0.5, 0])


def test_each_panel_has_the_law_some_samples_and_their_mean(generator):
    panels = {f"scheme {n}": torch.randn(20, T, generator=generator) for n in range(4)}
    fig, axes = plots.keyframe_samples(MEAN, DEVIATION, panels, keyframes=[0, -1])
    assert axes.shape == (2, 3) and not plt.get_fignums()
    shown = [ax for ax in axes.ravel() if ax.get_visible()]
    assert [ax.get_title(loc="left") for ax in shown] == list(panels)
    for ax, samples in zip(shown, panels.values(), strict=True):
        *drawn, truth, mean, keyframes = ax.lines
        np.testing.assert_allclose([line.get_ydata() for line in drawn], samples[:12])
        np.testing.assert_allclose(truth.get_ydata(), MEAN)
        np.testing.assert_allclose(mean.get_ydata(), samples.mean(0), rtol=1e-5)
        np.testing.assert_allclose(keyframes.get_ydata(), [-1, 1])
        wide, narrow = (band.get_paths()[0].vertices for band in ax.collections)
        middle = narrow[narrow[:, 0] == 2][:, 1]
        assert np.ptp(middle) == pytest.approx(2) and np.ptp(wide[wide[:, 0] == 2][:, 1]) == pytest.approx(4)
    fig.draw_without_rendering()


def test_bridging_overview_stays_on_its_sheet():
    y = np.random.default_rng(0).normal(size=(41, 51))
    fig, _ = plots.bridging_overview(WALK.positions, y, 2 * y, WALK.positions[None].repeat(3, axis=0), WALK.skeleton)
    legible(fig)
