"""Pictures of wavelet bases: marks stand where the numbers say, and every basis has a card."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
import pywt
import torch

from mwlib import plots
from mwlib.transforms import WaveletTransform

X = torch.randn(40, 12, generator=torch.Generator().manual_seed(0)).cumsum(0)
VALUES = {"paper": {"haar": 7e-5, "dmey": 1e-3}, "measured": {"dmey": 1.1e-3}}


def _fits(fig) -> bool:
    with plots.style():
        fig.draw_without_rendering()
        box = fig.get_tightbbox()
    width, height = fig.get_size_inches()
    return (
        width <= 6.4 + 1e-9 and height <= 8.5 and min(box.x0, box.y0) > -0.02 and box.x1 < width + 0.02 and box.y1 < height + 0.02
    )


def _marks(ax) -> dict[str, list[tuple[float, float]]]:
    """Series -> (value, row) of its marks."""
    return {bars.get_label(): [*zip(*bars[0].get_data(), strict=True)] for bars in ax.containers}


def test_dots_stand_at_their_values_in_the_row_of_their_name():
    fig, ax = plots.dots(VALUES, xlabel="RMSE (m)", log=True)
    marks = _marks(ax)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["haar", "dmey"]
    assert ax.get_xscale() == "log" and ax.yaxis_inverted() and _fits(fig) and not plt.get_fignums()
    assert [value for value, _ in marks["paper"]] == [7e-5, 1e-3] and [value for value, _ in marks["measured"]] == [1.1e-3]
    assert all(round(row) == place for place, (_, row) in enumerate(marks["paper"]))
    assert round(marks["measured"][0][1]) == 1 and marks["measured"][0][1] != marks["paper"][1][1]


def test_dots_draw_a_spread_where_there_is_one():
    _, ax = plots.dots(VALUES, xlabel="RMSE (m)", spread={"measured": {"dmey": 1e-4}})
    paper, measured = ax.containers
    assert not paper.has_xerr and measured.has_xerr
    ((low, _), (high, _)) = measured[2][0].get_segments()[0]
    assert (low, high) == pytest.approx((1e-3, 1.2e-3))


@pytest.mark.parametrize("wavelet", ["haar", "bior2.8", "bior3.1", "dmey", "rbio6.8", "db38", "sym20", "coif17"])
def test_a_card_holds_the_filters_and_sub_bands_of_its_basis(wavelet):
    fig, axes = plots.basis_card(wavelet, X)
    tf, bank = WaveletTransform(40, 12, wavelet), pywt.Wavelet(wavelet)
    assert _fits(fig) and not plt.get_fignums()
    assert np.allclose(axes[1, 0].lines[1].get_ydata(), bank.dec_lo) and np.allclose(axes[1, 1].lines[1].get_ydata(), bank.dec_hi)
    assert len(axes[0, 0].lines) == (2 if bank.orthogonal else 3)  # with the line at 0
    drawn = np.concatenate([ax.images[0].get_array().T for ax in (axes[2, 0], axes[3, 0], axes[2, 1], axes[3, 1])], axis=1)
    assert np.allclose(drawn, tf(X.double()))
    assert " × ".join(map(str, tf.shape)) in fig.get_suptitle()


def test_a_card_refuses_what_pywavelets_does_not_know():
    with pytest.raises(ValueError, match="wavelet is 'bior9'"):
        plots.basis_card("bior9", X)
