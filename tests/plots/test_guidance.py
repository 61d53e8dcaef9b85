"""Pictures of guidance: places, marks and numbers are those that were given."""

from __future__ import annotations

import itertools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from mwlib import plots
from mwlib.body.skeleton import H36M17
from mwlib.plots.bodies import _extent

METRICS = ("apd", "ade", "fde", "mmade", "mmfde")


def _row(name, value, paper):
    return {
        "name": name,
        "paper": dict.fromkeys(METRICS, paper) if paper else {},
        "mean": dict.fromkeys(METRICS, value),
        "seed_deviation": dict.fromkeys(METRICS, 0.01),
        "standard_error": dict.fromkeys(METRICS, 0.05),
    }


def test_claimed_and_measured_are_changes_from_the_reference():
    found = [_row("off", 1.0, 6.0), _row("on", 1.2, 5.5), _row("not in the paper", 0.9, None)]
    fig, axes = plots.claimed_and_measured(found)
    assert [ax.get_title(loc="left") for ax in axes] == ["APD (m)", "ADE (m)", "FDE (m)"] and not plt.get_fignums()
    lines = {line.get_label(): line.get_xdata() for line in axes[0].lines if len(line.get_xdata()) > 1}
    np.testing.assert_allclose(np.array(lines["paper (Human3.6M)"], float), [0, -0.5])
    (bars,) = axes[0].containers
    np.testing.assert_allclose(np.array(bars[0].get_xdata(), float), [0, 0.2, -0.1], atol=1e-12)
    with pytest.raises(ValueError, match="expected some of"):
        plots.claimed_and_measured(found, ("rmse",))


@pytest.mark.parametrize("metrics", [METRICS[:3], METRICS[3:]], ids=["three panels", "two panels"])
@pytest.mark.parametrize("error", [0.0039, 0.0054, 0.012, 0.03, 0.054, 0.37, 0.9])
def test_numbers_of_an_axis_do_not_run_into_each_other(metrics, error):
    row = _row("s 1.5, sigma 2.5, WMSG", 1.0, 1.0) | {"standard_error": dict.fromkeys(METRICS, error)}
    fig, axes = plots.claimed_and_measured([row | {"seed_deviation": dict.fromkeys(METRICS, 0.0)}], metrics)
    with plots.style():
        fig.draw_without_rendering()
    for ax in axes:
        low, high = ax.get_xlim()
        labels = [label.get_window_extent() for label in ax.get_xticklabels() if low <= label.get_position()[0] <= high]
        assert len(labels) == 3 and all(left.x1 + 2 < right.x0 for left, right in itertools.pairwise(labels))


def test_noised_rows_marks_the_mask_in_every_panel(generator):
    y = torch.randn(12, 30, generator=generator)
    mask = torch.zeros(12, dtype=bool)
    mask[2:5] = True
    _, axes = plots.noised_rows({"before": y, "after": y * 2}, mask, history_rows=3, columns=20)
    for ax in axes:
        (marks,) = (line for line in ax.lines if line.get_marker() == "s")
        assert marks.get_ydata().tolist() == [2, 3, 4]
        assert ax.images[0].get_array().shape == (12, 20)
    assert axes[0].images[0].get_clim() == axes[1].images[0].get_clim()


def test_pose_grid_has_a_place_for_every_pair(generator):
    joints = len(H36M17)
    samples = torch.randn(2, 3, 3 * (joints - 1), generator=generator)
    futures = {(row, column): samples for row in ("w 0", "w 1") for column in ("s 0", "s 1", "s 2")}
    fig, ax = plots.pose_grid(futures, H36M17, truth=samples[0])
    words = [text.get_text() for text in ax.texts]
    assert words == ["s 0", "s 1", "s 2", "w 0", "w 1"]
    fig.draw_without_rendering()


def test_arrows_end_where_they_are_told_to():
    panels = {"one": {"up": ([0, 0], [0, 1])}, "two": {"right": ([0, 0], [1, 0]), "back": ([1, 0], [0.5, 0])}}
    fig, axes = plots.arrows(panels, ([-1, -1], [1, 1]), {"walk": [0.2, 0.2]})
    assert [ax.get_title(loc="left") for ax in axes] == ["one", "two"]
    lines = {line.get_label(): line.get_xydata().tolist() for line in axes[1].lines}
    assert lines["right"] == [[0, 0], [1, 0]] and lines["back"] == [[1, 0], [0.5, 0]]
    styles = [line.get_linestyle() for line in axes[1].lines if line.get_label() in ("right", "back")]
    assert len({*styles}) == 2 and [text.get_text() for text in axes[0].texts] == ["walk"]
    fig.draw_without_rendering()


def test_people_who_stand_are_whole_beside_one_who_crouches():
    standing = [np.array([[[0.0, -0.9], [0.1, 0.8]]])] * 5
    crouching, burst = np.array([[[0.0, -0.4], [0.1, 0.2]]]), np.array([[[-40.0, -50.0], [30.0, 60.0]]])
    half, bottom, top = _extent([*standing, crouching])
    assert bottom <= -0.9 and top >= 0.8
    half, bottom, top = _extent([*standing, crouching, burst])
    assert bottom > -2 and top < 2 and half < 1, "a motion that explodes does not shrink the others"
