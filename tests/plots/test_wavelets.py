"""Pictures of wavelets: curves stand where the numbers say, tiles have one area, every basis has a card."""

from __future__ import annotations

import io

import numpy as np
import pytest
import pywt
import torch
from PIL import Image

from mwlib import plots
from mwlib.plots.chapters.wavelets import _slid
from tests.plots.legible import legible

X = torch.randn(40, 12, generator=torch.Generator().manual_seed(0)).cumsum(0)
VALUES = {"paper": {"haar": 7e-5, "dmey": 1e-3}, "measured": {"dmey": 1.1e-3}}
SIGNAL = np.sin(np.arange(4))
ALT = "A filter slides over a curve and leaves a coefficient at each place."


def test_two_signals_are_drawn_with_their_magnitudes_and_their_tiles():
    early = np.zeros(64)
    early[8:16] = 1.0
    fig, axes = plots.same_spectrum({"early": early, "late": np.roll(early, 32)}, "haar", fps=32)
    legible(fig)
    left, right = (axes[1, column].lines[0].get_ydata() for column in (0, 1))
    assert np.allclose(left, right) and np.allclose(left, np.abs(np.fft.rfft(early)) / 32)
    slow, *fast = (mesh.get_array().ravel() for mesh in axes[2, 0].collections)
    details = pywt.wavedec(early, "haar", "periodization", 4)
    assert np.allclose(slow, np.abs(details[0])) and all(
        np.allclose(a, np.abs(b)) for a, b in zip(fast, details[1:], strict=True)
    )
    assert [label.get_text() for label in axes[2, 0].get_yticklabels()] == ["0 to 1", "1 to 2", "2 to 4", "4 to 8", "8 to 16"]


def test_tiles_have_one_area():
    fig, axes = plots.tilings()
    legible(fig)
    for ax in axes:
        uprights = {tuple(np.round([*low, *high], 9)) for lines in ax.collections for low, high in lines.get_segments()}
        inner = [(x, y, top) for x, y, end, top in uprights if x == end and x > 0]
        widths = {}
        for x, y, top in inner:
            widths.setdefault((y, top), []).append(x)
        areas = [(top - y) * step for (y, top), xs in widths.items() for step in np.diff([0, *sorted(xs)])]
        assert len(areas) == 16 and np.allclose(areas, 1 / 16)


def test_responses_stand_over_the_spectrum():
    hertz = np.linspace(0, 10, 21)
    pair = np.cos(hertz / 7) * np.sqrt(2), np.sin(hertz / 7)
    fig, axes = plots.responses({"haar": pair, "db4": (pair[1], pair[0])}, hertz, np.exp(-hertz))
    legible(fig)
    assert np.allclose(axes[0, 0].lines[0].get_ydata(), pair[0]) and np.allclose(axes[0, 1].lines[0].get_ydata(), pair[1])
    assert axes[0, 0].lines[2].get_xdata()[0] == 5.0


def test_stairs_are_half_as_wide_in_each_round():
    fig, axes = plots.cascade([np.ones(1), np.ones(2), np.ones(5)], support=3)
    legible(fig)
    edges = [ax.patches[0].get_data().edges for ax in axes.flat]
    assert [edge[1] for edge in edges] == [1.0, 0.5, 0.25] and [len(edge) for edge in edges] == [2, 3, 6]


def test_the_loop_has_a_picture_for_each_coefficient():
    moving = plots.sliding_filter(SIGNAL, "db2", alt=ALT)
    assert len(moving) == len(pywt.dwt(SIGNAL, "db2", "zero")[0]) and moving.milliseconds == [350] * 2 + [1000]
    content = moving.encoded()
    image = Image.open(io.BytesIO(content))
    assert len(content) < 300_000 and image.info["loop"] == 0 and image.convert("RGB").getpixel((599, 0)) == (255, 255, 255)
    with pytest.raises(ValueError, match="alt"):
        plots.sliding_filter(SIGNAL, "db2", alt=" ")


def test_the_taps_stand_where_their_inner_product_is_the_coefficient():
    signal, taps = np.random.default_rng(0).normal(size=20), np.asarray(pywt.Wavelet("db3").dec_lo)
    longer, (coefficients, _) = pywt.pad(signal, 5, "zero"), pywt.dwt(signal, "db3", "zero")
    top, middle, _ = _slid(longer, taps, coefficients, 4).axes
    shown = dict(zip(*top.lines[1].get_data(), strict=True))
    points = next(line for line in middle.lines if line.get_marker() == "o")
    assert sum(shown[frame] * tap for frame, tap in zip(*points.get_data(), strict=True)) == pytest.approx(coefficients[4])


def _marks(ax) -> dict[str, list[tuple[float, float]]]:
    """Series -> (value, row) of its marks."""
    return {line.get_label(): [*zip(*line.get_data(), strict=True)] for line in ax.lines}


def test_dots_stand_at_their_values_in_the_row_of_their_name():
    fig, ax = plots.dots(VALUES, xlabel="RMSE (m)", log=True)
    marks = _marks(ax)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["haar", "dmey"]
    assert ax.get_xscale() == "log" and ax.yaxis_inverted()
    legible(fig)
    assert [value for value, _ in marks["paper"]] == [7e-5, 1e-3] and [value for value, _ in marks["measured"]] == [1.1e-3]
    assert all(round(row) == place for place, (_, row) in enumerate(marks["paper"]))
    assert round(marks["measured"][0][1]) == 1 and marks["measured"][0][1] != marks["paper"][1][1]


def test_coefficients_stand_over_the_frames_they_see():
    impulse = np.zeros(64)
    impulse[31] = 1.0
    _, axes = plots.signal_and_coefficients(impulse, "bior2.8", fps=1.0)
    for ax in axes[1:]:
        places, values = ax.lines[-1].get_data()
        assert np.average(places, weights=values**2) == pytest.approx(31, abs=0.6)


def test_padding_modes_draw_what_pywavelets_does():
    _, axes = plots.padding_modes(X[:, 8], modes=["reflect"], pad=5)
    before, after, inside = (curve.get_ydata() for curve in axes[0, 0].lines)
    assert np.allclose(np.concatenate([before[:-1], inside, after[1:]]), pywt.pad(X[:, 8].numpy(), 5, "reflect"))
