"""Densities that melt: the map shows them where they are, and points of the loop keep their lanes and colours."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib import plots
from mwlib.plots.chapters.diffusion import _moment
from mwlib.plots.loops import MOST_BYTES

TS = [30, 20, 10, 0]
VALUES = np.linspace(-3, 3, 61)
PATHS = np.linspace(1, 2, 4)[:, None] * np.array([[-1.0, -0.5, 0.5, 1.0]])
DENSITY = np.exp(-((VALUES - 1) ** 2) / np.linspace(2, 0.2, 4)[:, None])


def test_the_map_shows_the_density_and_colours_paths_by_their_end():
    _, ax = plots.density_map(TS, VALUES, DENSITY, paths=PATHS, ylabel="turn (rad)")
    np.testing.assert_allclose(ax.collections[0].get_array(), DENSITY.T)
    assert [line.get_color() for line in ax.lines] == [*plots.CYCLE[:1] * 2, *plots.CYCLE[1:2] * 2]
    assert len({str(line.get_linestyle()) for line in ax.lines}) == 2  # not by colour alone
    assert ax.get_xlim() == (30, 0)
    _, ax = plots.density_map(TS, VALUES, DENSITY, paths=PATHS, parting=1.5)
    assert [line.get_color() for line in ax.lines] == [*plots.CYCLE[:1] * 3, plots.CYCLE[1]]


def test_points_move_in_a_small_loop():
    loop = plots.particles(TS, PATHS, VALUES, DENSITY, alt="Four points part under a bell.", milliseconds=50)
    assert len(loop) == 4 and loop.milliseconds == [50, 50, 50, 1000] and loop.alt.startswith("Four points")
    assert len(loop.encoded()) < MOST_BYTES / 10 and loop.size[0] == 480
    with pytest.raises(ValueError, match="alternative text is empty"):
        plots.particles(TS, PATHS, VALUES, DENSITY, alt=" ")


def test_a_point_has_the_marker_of_the_side_on_which_it_ends():
    paths = np.array([[-0.5, 0.4, 0.9], [-0.8, -1.0, 1.0]])  # the second begins on the right and ends on the left
    fig = _moment(9, paths[0], np.ones(2), values=np.array([-2.0, 2.0]), top=1.0, side=paths[-1] > 0, xlabel="y", width=480)
    places = {line.get_marker(): line.get_xdata().tolist() for line in fig.axes[0].lines if line.get_marker() in "o^"}
    assert places == {"o": [-0.5, 0.4], "^": [0.9]}
