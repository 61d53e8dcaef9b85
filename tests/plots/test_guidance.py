"""Pictures of guidance and attention: places, marks and numbers are those that were given."""

from __future__ import annotations

import itertools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib.patches import StepPatch

from mwlib import plots
from mwlib.body.skeleton import H36M17
from mwlib.plots.bodies import _extent
from mwlib.prediction.guidance import attention_mask, temporal_attention
from mwlib.transforms import WaveletTransform

TF = WaveletTransform(24, 48)
K = TF.shape[0]
ATTENTION = torch.rand(2, 4, K, K, generator=torch.Generator().manual_seed(0)).softmax(-1)


def test_row_support_draws_one_bar_per_row_that_sees_a_frame():
    _, axes = plots.row_support(TF.analysis_time, history=8, split=K)
    seen = (np.abs(TF.analysis_time) > 1e-12).any(1)
    bars = [[line for line in ax.lines if len(line.get_xdata())] for ax in axes]
    assert [len(b) for b in bars] == [seen[:K].sum(), seen[K:].sum()]
    first = np.flatnonzero(np.abs(TF.analysis_time[10]) > 1e-12)
    assert list(bars[0][10].get_xdata()) == [first[0] - 0.5, first[-1] + 0.5]


def test_attention_vectors_show_the_mean_and_the_middle_row():
    mean = ATTENTION.mean((0, 1))
    mask = attention_mask(temporal_attention(ATTENTION), 1.0, 3)[:, 0]
    _, (upper, lower) = plots.attention_vectors(mean, history_rows=4, mask=mask)
    drawn = [line.get_ydata() for line in upper.lines]
    assert any(len(y) == K and np.allclose(y, mean.mean(0)) for y in drawn)
    marked = next(line.get_xdata() for line in upper.lines if line.get_marker() == "s" and len(line.get_xdata()))
    assert list(marked) == list(np.flatnonzero(mask))
    assert any(np.allclose(line.get_ydata(), mean[K // 2]) for line in lower.lines if len(line.get_ydata()) == K)


def test_steps_heads_and_parts_are_drawn_whole():
    a = torch.stack([temporal_attention(ATTENTION)] * 3)
    _, axes = plots.attention_over_steps(a, a > 1, [20, 10, 1], history_rows=4)
    assert [ax.images[0].get_array().shape for ax in axes] == [(3, K)] * 2
    assert [tick.get_text() for tick in axes[0].get_yticklabels()] == ["20", "10", "1"]
    _, grid = plots.attention_heads(ATTENTION, history_rows=4)
    assert grid.shape == (2, 4) and np.allclose(grid[1, 2].images[0].get_array(), ATTENTION[1, 2])
    _, ax = plots.attention_part(ATTENTION[0, 0], history_rows=4, title="one")
    assert ax.images[0].get_array().shape == (K, K)


def test_diagrams_hold_the_data_they_are_given():
    generator = torch.Generator().manual_seed(1)
    x = torch.randn(24, 48, generator=generator)
    y = TF(x)
    _, ax = plots.overview(x, y, y + 1, torch.randn(5, 16, 48, generator=generator), H36M17, history=8)
    images = [np.asarray(child.images[0].get_array()) for child in ax.child_axes if child.images]
    assert any(i.shape == y.shape and np.allclose(i, y) for i in images)  # time runs downwards
    assert any(i.shape == y.shape and np.allclose(i, y + 1) for i in images)
    texts = " ".join(text.get_text() for text in ax.texts)
    assert all(word in texts for word in ("DWT", "iDWT", "WMSG", "TABG", "network"))
    a_t = temporal_attention(ATTENTION)
    mask = attention_mask(a_t, 1.0, 1)[:, 0]
    _, ax = plots.tabg_diagram(y, ATTENTION.mean((0, 1)), a_t, mask, y)
    curves = [line.get_ydata() for child in ax.child_axes for line in child.lines]
    assert any(len(c) == K and np.allclose(c, a_t) for c in curves)
    shown = [np.asarray(child.images[0].get_array()) for child in ax.child_axes if child.images]
    assert [i.shape for i in shown] == [y.T.shape, (K, K), y.T.shape]  # rows to the right, as along A_t
    [hits] = [patch for child in ax.child_axes for patch in child.patches if isinstance(patch, StepPatch)]
    heights, *_ = hits.get_data()
    assert np.array_equal(heights > 0, mask.numpy())  # single rows, too
    texts = " ".join(text.get_text() for text in ax.texts)
    assert "(Eq. 9)" in texts and r"\mathbf{y}^{(t)}$: the other rows" in texts  # what enters the noised rows


METRICS = ("apd", "ade", "fde", "mmade", "mmfde")


def test_claimed_and_measured_have_bars_of_two_errors():
    changes = {
        "on": {"APD (m)": (0.2, 0.05), "ADE": (-0.1, 0.3)},
        "not in the paper": {"APD (m)": (-0.1, 0.2), "ADE": (0.0, 0.1)},
    }
    fig, axes = plots.claimed_and_measured(changes, {"on": {"APD (m)": -0.5}})
    assert [ax.get_title(loc="left") for ax in axes] == ["APD", "ADE"] and not plt.get_fignums()
    assert [ax.get_xlabel() for ax in axes] == ["change (m)", "change"]
    lines = {line.get_label(): line.get_xdata() for line in axes[0].lines}
    np.testing.assert_allclose(np.array(lines["paper (Human3.6M)"], float), [-0.5])
    (bars,) = axes[0].containers
    np.testing.assert_allclose(np.array(bars[0].get_xdata(), float), [0.2, -0.1], atol=1e-12)
    np.testing.assert_allclose(bars[2][0].get_segments()[0][:, 0], [0.1, 0.3])


@pytest.mark.parametrize("metrics", [METRICS[:3], METRICS[3:]], ids=["three panels", "two panels"])
@pytest.mark.parametrize("error", [0.0039, 0.0054, 0.012, 0.03, 0.054, 0.37, 0.9])
def test_numbers_of_an_axis_do_not_run_into_each_other(metrics, error):
    fig, axes = plots.claimed_and_measured({"s 1.5, sigma 2.5, WMSG": dict.fromkeys(metrics, (0.0, error))})
    with plots.style():
        fig.draw_without_rendering()
    for ax in axes:
        low, high = ax.get_xlim()
        labels = [label.get_window_extent() for label in ax.get_xticklabels() if low <= label.get_position()[0] <= high]
        assert len(labels) == 3 and all(left.x1 + 2 < right.x0 for left, right in itertools.pairwise(labels))


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
