"""Pictures of diffusion and of codes: what is drawn is what was given."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib import plots
from mwlib.plots.chapters.diffusion import _moment
from mwlib.plots.loops import MOST_BYTES
from tests.plots.legible import legible

TS = [30, 20, 10, 0]
VALUES = np.linspace(-3, 3, 61)
PATHS = np.linspace(1, 2, 4)[:, None] * np.array([[-1.0, -0.5, 0.5, 1.0]])
DENSITY = np.exp(-((VALUES - 1) ** 2) / np.linspace(2, 0.2, 4)[:, None])
NORMAL = (VALUES, np.exp(-(VALUES**2) / 2) / np.sqrt(2 * np.pi))


def test_the_map_shows_the_density():
    _, ax = plots.density_map(TS, VALUES, DENSITY, ylabel="turn (rad)")
    np.testing.assert_allclose(ax.collections[0].get_array(), DENSITY.T)
    assert ax.get_xlim() == (30, 0)


def test_paths_are_told_apart_by_their_end():
    _, (ax, _) = plots.sampling_paths(TS, PATHS - 1.25)  # all begin below 0, and the last one ends above
    lines = ax.lines[:4]
    assert [line.get_color() for line in lines] == [*plots.CYCLE[:1] * 3, plots.CYCLE[1]]
    assert len({str(line.get_linestyle()) for line in lines}) == 2  # not by colour alone


def test_points_move_in_a_small_loop():
    loop = plots.particles(TS, PATHS, VALUES, DENSITY, alt="Four points part under a bell.")
    assert len(loop) == 4 and loop.milliseconds == [90, 90, 90, 1000] and loop.alt.startswith("Four points")
    assert len(loop.encoded()) < MOST_BYTES / 10 and loop.size[0] == 480
    with pytest.raises(ValueError, match="alternative text is empty"):
        plots.particles(TS, PATHS, VALUES, DENSITY, alt=" ")


def test_a_point_has_the_marker_of_the_side_on_which_it_ends():
    # the second begins on the right and ends on the left
    now, side = np.array([-0.5, 0.4, 0.9]), np.array([False, False, True])
    fig = _moment(9, now, np.ones(2), values=np.array([-2.0, 2.0]), top=1.0, side=side, xlabel="y")
    places = {line.get_marker(): line.get_xdata().tolist() for line in fig.axes[0].lines if line.get_marker() in "o^"}
    assert places == {"o": [-0.5, 0.4], "^": [0.9]}


def test_histogram_has_area_one_and_paths_end_at_the_samples(generator):
    numbers = torch.randn(2000, generator=generator)
    _, (ax,) = plots.histograms({"noise": numbers}, density=NORMAL)
    heights, edges, _ = ax.patches[0].get_data()
    assert (heights * np.diff(edges)).sum() == pytest.approx(1, abs=0.01)
    _, (left, _) = plots.sampling_paths([3, 0], torch.stack([numbers, 2 * numbers]), density=NORMAL)
    assert [line.get_ydata()[-1] for line in left.lines[:5]] == pytest.approx((2 * numbers[:5]).tolist())
    assert [line.get_color() for line in left.lines[:5]] == [plots.CYCLE[int(number > 0)] for number in numbers[:5]]


def test_windows_and_sinusoids(generator):
    panels = {name: (torch.randn(25, generator=generator), np.zeros(25)) for name in ("a", "b")}
    fig, axes = plots.windows_and_sinusoids(panels, fps=25.0, ylabel="m")
    legible(fig)
    assert [ax.get_title(loc="left") for ax in axes] == ["a", "b"]
    window = axes[0].lines[0]
    assert np.array_equal(window.get_ydata(), panels["a"][0]) and window.get_xdata()[12] == 0


def test_error_by_size():
    lines = {"one": ([32], [0.1]), "many": ([1, 2, 3], [0.3, 0.2, 0.1])}
    fig, axes = plots.error_by_size({"all": lines, "some": lines}, xlabel="numbers", ylabel="RMSE (m)")
    legible(fig)
    assert len(axes) == 2 and [len(line.get_xdata()) for line in axes[0].lines] == [1, 3]
    assert axes[0].get_yscale() == "log"


def test_predicted_curves_line_up_with_the_future():
    truth = np.arange(12.0)
    fig, axes = plots.predicted_curves({"walk": {"truth": truth, "model": truth[4:]}}, fps=10.0, history=4)
    legible(fig)
    drawn, predicted = axes[0, 0].lines
    assert drawn.get_xdata()[3] == 0 and np.allclose(drawn.get_xdata()[4:], predicted.get_xdata())
    assert np.allclose(axes[0, 1].lines[0].get_ydata(), 10) and np.isclose(axes[0, 1].lines[1].get_xdata()[-1], 0.8)
