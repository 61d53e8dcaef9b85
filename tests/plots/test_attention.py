"""Pictures of attention and the two diagrams: what is drawn is what was given."""

from __future__ import annotations

import numpy as np
import torch
from matplotlib.patches import StepPatch

from mwlib import plots
from mwlib.body.skeleton import H36M17
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
    assert any(i.shape == y.T.shape and np.allclose(i, y.T) for i in images)  # time runs to the right
    assert any(i.shape == y.T.shape and np.allclose(i, y.T + 1) for i in images)
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
