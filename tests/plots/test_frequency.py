"""Pictures of time and frequency: curves stand where the numbers say, tiles have one area, the loop makes every coefficient."""

from __future__ import annotations

import io

import numpy as np
import pytest
import pywt
from PIL import Image

from mwlib import plots
from mwlib.plots.chapters.wavelets import _slid
from tests.plots.legible import legible

SIGNAL = np.sin(np.arange(16) / 3)
ALT = "A filter slides over a curve and leaves a coefficient at each place."


def test_two_signals_are_drawn_with_their_magnitudes_and_their_tiles():
    early = np.zeros(64)
    early[8:16] = 1.0
    fig, axes = plots.same_spectrum({"early": early, "late": np.roll(early, 32)}, "haar", fps=32, level=3)
    legible(fig)
    left, right = (axes[1, column].lines[0].get_ydata() for column in (0, 1))
    assert np.allclose(left, right) and np.allclose(left, np.abs(np.fft.rfft(early)) / 32)
    slow, *fast = (mesh.get_array().ravel() for mesh in axes[2, 0].collections)
    details = pywt.wavedec(early, "haar", "periodization", 3)
    assert np.allclose(slow, np.abs(details[0])) and all(
        np.allclose(a, np.abs(b)) for a, b in zip(fast, details[1:], strict=True)
    )
    assert [label.get_text() for label in axes[2, 0].get_yticklabels()] == ["0 to 2", "2 to 4", "4 to 8", "8 to 16"]


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
    moving = plots.sliding_filter(SIGNAL, "db2", alt=ALT, milliseconds=100)
    assert len(moving) == len(pywt.dwt(SIGNAL, "db2", "zero")[0]) and moving.milliseconds == [100] * 8 + [1000]
    content = moving.encoded()
    image = Image.open(io.BytesIO(content))
    assert len(content) < 300_000 and image.info["loop"] == 0 and image.convert("RGB").getpixel((599, 0)) == (255, 255, 255)
    with pytest.raises(ValueError, match="alt"):
        plots.sliding_filter(SIGNAL, "db2", alt=" ")


def test_the_taps_stand_where_their_inner_product_is_the_coefficient():
    signal, taps = np.random.default_rng(0).normal(size=20), np.asarray(pywt.Wavelet("db3").dec_lo)
    longer, (coefficients, _) = pywt.pad(signal, 5, "zero"), pywt.dwt(signal, "db3", "zero")
    top, middle, _ = _slid(longer, taps, coefficients, 4, 600).axes
    shown = dict(zip(*top.lines[1].get_data(), strict=True))
    points = next(line for line in middle.lines if line.get_marker() == "o")
    assert sum(shown[frame] * tap for frame, tap in zip(*points.get_data(), strict=True)) == pytest.approx(coefficients[4])
