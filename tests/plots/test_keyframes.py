"""Pictures of keyframe schemes: bands, curves and dots are those of the numbers given."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from mwlib import plots

T = 6
MEAN, DEVIATION = torch.linspace(-1, 1, T), torch.tensor([0, 0.5, 1, 1, 0.5, 0])


def _row(scheme, error, seam, spread, diverged=False):
    return {"scheme": scheme, "mean_error_limit": error, "seam": seam, "spread": spread, "diverged": diverged}


ROWS = [
    _row("true law", 0.0, 0.94, 1.0),
    _row("paper", 0.46, 3.2, 1.3),
    _row("bold", 1e9, 40.0, 1e9, True),
    _row("shy", 0.1, 0.5, 0.9),
]


def test_each_panel_has_the_law_some_samples_and_their_mean(generator):
    panels = {f"scheme {n}": torch.randn(20, T, generator=generator) for n in range(4)}
    fig, axes = plots.keyframe_samples(MEAN, DEVIATION, panels, keyframes=[0, -1], lines=5)
    assert axes.shape == (2, 3) and not plt.get_fignums()
    shown = [ax for ax in axes.ravel() if ax.axison]
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


def test_every_scheme_has_a_dot_where_its_number_is():
    fig, axes = plots.scheme_errors(ROWS)
    assert [ax.get_title(loc="left") for ax in axes] == ["error of the mean", "seam ratio", "spread ratio"]
    assert [label.get_text() for label in axes[0].get_yticklabels()] == ["paper", "bold", "shy"]
    for ax, measure in zip(axes, ("mean_error_limit", "seam", "spread"), strict=True):
        dots = {float(line.get_ydata()[0]): float(line.get_xdata()[0]) for line in ax.lines if line.get_marker() == "o"}
        assert dots == {2.0: ROWS[1][measure], 0.0: ROWS[3][measure]}
        assert [text.get_text() for text in ax.texts] == [f"{ROWS[1][measure]:.2f}", "diverges", f"{ROWS[3][measure]:.2f}"]
        assert ax.lines[0].get_xdata()[0] == ROWS[0][measure] and ax.get_xlim()[1] < 10
    fig.draw_without_rendering()
    with pytest.raises(ValueError, match="one row"):
        plots.scheme_errors(ROWS[:1])
