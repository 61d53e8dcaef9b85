"""Pictures of phase codes and predicted curves: what is drawn is what was given."""

from __future__ import annotations

import numpy as np

from mwlib import plots

GENERATOR = np.random.default_rng(0)


def test_windows_and_sinusoids():
    panels = {name: (GENERATOR.normal(size=25), np.zeros(25)) for name in ("a", "b")}
    fig, axes = plots.windows_and_sinusoids(panels, fps=25.0, ylabel="m")
    fig.draw_without_rendering()
    assert [ax.get_title(loc="left") for ax in axes] == ["a", "b"]
    window = axes[0].lines[0]
    assert np.array_equal(window.get_ydata(), panels["a"][0]) and window.get_xdata()[12] == 0


def test_phase_circles_puts_the_cosine_across():
    turn = np.linspace(0, 6, 30)[:, None]
    code = np.concatenate([np.sin(turn), 0 * turn, np.cos(turn), 0 * turn], axis=1)
    fig, axes = plots.phase_circles({"a": code, "b": 0.5 * code}, channels=[0, 1])
    fig.draw_without_rendering()
    assert axes.shape == (2, 2)
    path = axes[0, 0].lines[1]
    assert np.allclose(path.get_xdata(), np.cos(turn[:, 0])) and np.allclose(path.get_ydata(), np.sin(turn[:, 0]))
    assert axes[0, 0].get_xlim() == axes[1, 1].get_ylim()


def test_error_by_size():
    lines = {"one": ([32], [0.1]), "many": ([1, 2, 3], [0.3, 0.2, 0.1])}
    fig, axes = plots.error_by_size({"all": lines, "some": lines}, xlabel="numbers", ylabel="RMSE (m)")
    fig.draw_without_rendering()
    assert len(axes) == 2 and [len(line.get_xdata()) for line in axes[0].lines] == [1, 3]
    assert axes[0].get_yscale() == "log"


def test_predicted_curves_line_up_with_the_future():
    truth = np.arange(12.0)
    fig, axes = plots.predicted_curves({"walk": {"truth": truth, "model": truth[4:]}}, fps=10.0, history=4)
    fig.draw_without_rendering()
    drawn, predicted = axes[0, 0].lines
    assert drawn.get_xdata()[3] == 0 and np.allclose(drawn.get_xdata()[4:], predicted.get_xdata())
    assert np.allclose(axes[0, 1].lines[0].get_ydata(), 10) and np.isclose(axes[0, 1].lines[1].get_xdata()[-1], 0.8)
