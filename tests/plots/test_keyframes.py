"""Pictures of keyframe schemes: bands, curves and dots are those of the numbers given."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from mwlib import plots

T = 6
MEAN, DEVIATION = torch.linspace(-1, 1, T), torch.tensor([0, 0.5, 1, 1, 0.5, 0])


def test_each_panel_has_the_law_some_samples_and_their_mean(generator):
    panels = {f"scheme {n}": torch.randn(20, T, generator=generator) for n in range(4)}
    fig, axes = plots.keyframe_samples(MEAN, DEVIATION, panels, keyframes=[0, -1], lines=5)
    assert axes.shape == (2, 3) and not plt.get_fignums()
    shown = [ax for ax in axes.ravel() if ax.get_visible()]
    assert [ax.get_title(loc="left") for ax in shown] == list(panels)
    for ax, samples in zip(shown, panels.values(), strict=True):
        *drawn, truth, mean, keyframes = ax.lines
        np.testing.assert_allclose([line.get_ydata() for line in drawn], samples[:5])
        np.testing.assert_allclose(truth.get_ydata(), MEAN)
        np.testing.assert_allclose(mean.get_ydata(), samples.mean(0), rtol=1e-5)
        np.testing.assert_allclose(keyframes.get_ydata(), [-1, 1])
        wide, narrow = (band.get_paths()[0].vertices for band in ax.collections)
        middle = narrow[narrow[:, 0] == 2][:, 1]
        assert np.ptp(middle) == pytest.approx(2) and np.ptp(wide[wide[:, 0] == 2][:, 1]) == pytest.approx(4)
    fig.draw_without_rendering()
