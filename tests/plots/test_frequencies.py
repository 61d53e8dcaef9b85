"""Pictures by frequency: curves are the values that were given, marks stand where they should, the page is wide enough."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib import plots
from tests.plots.legible import legible

POWER = 100.0 * np.arange(1, 65) ** -2.0
A_BAR = np.cos(np.linspace(0.05, 1.5, 100)) ** 2


def _curves(ax):
    return {line.get_label().split(":")[0].split(",")[0]: line for line in ax.lines if not line.get_label().startswith("_")}


def test_energy_is_drawn_with_and_without_its_mean():
    fig, (left, right) = plots.energy_by_coefficient({"positions": POWER, "rates": np.ones(40)}, few=8)
    assert _curves(right)["positions"].get_label() == f"positions: {100 * POWER[:8].sum() / POWER.sum():.0f} %"
    assert _curves(right)["rates"].get_ydata() == pytest.approx(100 * np.arange(1, 41) / 40)
    assert _curves(right)["rates"].get_label() == "rates: 20 %"
    first, _, mean, _ = left.lines[:4]
    assert np.array_equal(first.get_ydata(), POWER[1:]) and first.get_xdata()[0] == 1
    assert mean.get_ydata() == [POWER[0]] and mean.get_xdata()[0] < 1
    assert [tick.get_text() for tick in left.get_xticklabels()] == ["0", "1", "10"]
    legible(fig)


def test_snr_curves_are_parallel_and_end_at_the_threshold():
    fig, ax = plots.parallel_snr(POWER, A_BAR, [1, 4, 60])
    found = _curves(ax)
    assert found["k = 1"].get_ydata() - found["k = 4"].get_ydata() == pytest.approx(10 * np.log10(POWER[1] / POWER[4]))
    assert found["SNR = 1"].get_ydata()[0] == 0
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    last = [int(np.flatnonzero(A_BAR * POWER[k] / (1 - A_BAR) >= 1)[-1]) for k in (1, 4, 60)]
    assert [int(dot.get_xdata()[0]) for dot in dots] == last
    heights = [10 * np.log10(A_BAR[t] * POWER[k] / (1 - A_BAR[t])) for k, t in zip((1, 4, 60), last, strict=True)]
    assert [float(dot.get_ydata()[0]) for dot in dots] == pytest.approx(heights)
    assert f"k = 4, until t = {last[1]}" in [line.get_label() for line in ax.lines]
    legible(fig)


def test_a_coefficient_that_is_always_under_the_noise_has_no_dot():
    _, ax = plots.parallel_snr(np.array([1.0, 1e-9]), A_BAR, [1])
    assert not [line for line in ax.lines if line.get_marker() == "o"]
    assert "k = 1" in [line.get_label() for line in ax.lines]


def test_what_comes_back_out_of_order_is_marked():
    times = 100 - np.arange(20.0)
    peak = times.copy()
    peak[7], peak[12] = 99.5, 89.4  # the second is no more than chance
    fig, ax = plots.recovery_by_coefficient({"falling": times, "with a peak": peak}, steps=120)
    assert _curves(ax)["falling"].get_ydata() == pytest.approx(times[1:])
    marks = [line.get_xdata().tolist() for line in ax.lines if line.get_marker() == "o"]
    assert marks == [[], [7]]
    assert ax.get_ylim() == (0, 120)
    legible(fig)


def test_known_shares_are_percent():
    fig, ax = plots.known_share({f"t = {t}": A_BAR[t] * POWER / (A_BAR[t] * POWER + 1 - A_BAR[t]) for t in (20, 60)})
    expected = 100 * A_BAR[20] * POWER[3] / (A_BAR[20] * POWER[3] + 1 - A_BAR[20])
    assert _curves(ax)["t = 20"].get_ydata()[2] == pytest.approx(expected)
    legible(fig)


def test_kept_power_has_a_panel_for_each_number_of_steps():
    few, many = np.linspace(0.8, 0.5, 30), np.linspace(1, 0.95, 30)
    fig, axes = plots.kept_power({"T = 50": {"DDPM": few, "DDIM": many}, "T = 1000": {"DDPM": many, "DDIM": many}})
    assert [ax.get_title(loc="left") for ax in axes] == ["T = 50", "T = 1000"]
    assert np.array_equal(_curves(axes[0])["DDPM"].get_ydata(), few[1:])
    assert np.array_equal(_curves(axes[1])["DDPM"].get_ydata(), many[1:])
    legible(fig)


def test_coupling_is_a_bar_for_each_noise():
    rows = {"alone": [30.0, 64.0], "with the low band": [7.0, 25.0]}
    fig, axes = plots.coupling_bars(
        {"bound": rows, "free": {"alone": [30.0, 64.0], "with the low band": [30.0, 64.0]}}, [0.2, 0.4]
    )
    assert [bar.get_height() for bar in axes[0].patches] == [30, 64, 7, 25]
    assert [tick.get_text() for tick in axes[0].get_xticklabels()] == ["0.2", "0.4"]
    middles = [bar.get_x() + bar.get_width() / 2 for bar in axes[0].patches]
    assert middles == pytest.approx([-0.2, 0.8, 0.2, 1.2])
    legible(fig)
