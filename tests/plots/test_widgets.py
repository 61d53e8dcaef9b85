"""Widgets: controls call the figure function, errors are told in a line, nothing appears when MW_STATIC=1."""

from __future__ import annotations

import re

import numpy as np
import pytest
from ipywidgets import Dropdown, FloatSlider, IntSlider, Text

from mwlib import plots
from mwlib.body.skeleton import H36M17
from mwlib.plots import widgets
from mwlib.synthetic.motions import synthetic_motions


@pytest.fixture
def calls(monkeypatch) -> list[dict]:
    """What the figure function was asked to draw; showing is left out."""
    monkeypatch.delenv("MW_STATIC", raising=False)
    monkeypatch.setattr(widgets, "show", lambda fig, alt: print(alt))
    return []


@pytest.fixture
def waveform(calls):
    """A figure function that keeps account."""

    def waveform(**values):
        calls.append(values)
        if values.get("level") == 5:
            raise ValueError("level is 5; expected at most 4")
        return plots.energy_bars({"aa": 1.0})

    return waveform


def test_explore_builds_controls_and_redraws_on_change(waveform, calls, capsys):
    box = widgets.explore(waveform, level=(1, 5), scale=(0.0, 1.0, 0.25), wavelet=["haar", "db2"])
    level, scale, wavelet, _ = box.children
    assert (type(level), type(scale), type(wavelet)) == (IntSlider, FloatSlider, Dropdown)
    assert (level.min, level.max, scale.step, wavelet.options) == (1, 5, 0.25, ("haar", "db2"))
    assert not level.continuous_update and not scale.continuous_update
    assert calls == [{"level": 3, "scale": 0.5, "wavelet": "haar"}]
    level.value = 2
    wavelet.value = "db2"
    level.value = 2
    assert calls[1:] == [{"level": 2, "scale": 0.5, "wavelet": "haar"}, {"level": 2, "scale": 0.5, "wavelet": "db2"}]
    assert capsys.readouterr().out.splitlines()[-1] == "waveform with level = 2, scale = 0.5, wavelet = db2"


def test_errors_are_told_in_one_line_and_the_next_value_works(waveform, calls, capsys):
    box = widgets.explore(waveform, level=(1, 5))
    capsys.readouterr()
    box.children[0].value = 5
    assert _told(capsys) == "ValueError: level is 5; expected at most 4"
    box.children[0].value = 4
    assert len(calls) == 3 and _told(capsys) == "waveform with level = 4"


def _told(capsys) -> str:
    """What was printed, without the terminal's codes for clearing the output."""
    return re.sub(r"\x1b\[2K|\r", "", capsys.readouterr().out).strip()


def test_a_button_draws_when_it_is_pressed(waveform, calls):
    level, button, _ = widgets.explore(waveform, button="Draw", level=(1, 5)).children
    assert not calls and button.description == "Draw"
    level.value = 2
    assert not calls
    button.click()
    assert calls == [{"level": 2}] and not button.disabled


def test_a_box_asks_for_a_player(monkeypatch, calls):
    shown = []
    monkeypatch.setattr(widgets, "display", shown.append)
    walk = synthetic_motions(1, seconds=1)[0]
    box, button, _ = widgets.explore(lambda text: plots.player({text: walk}), button="Ask", text=Text("walk")).children
    box.value = "go on"  # a return in the box asks, and so does leaving it
    button.click()
    assert [player.payload["bodies"][0]["name"] for player in shown] == ["go on"]


def test_explore_refuses_what_is_no_control(waveform):
    with pytest.raises(ValueError, match="cannot be transformed to a widget"):
        widgets.explore(waveform, level=object())


@pytest.fixture
def still(calls):
    """A function that makes players of a body that stands, and keeps account."""

    def still(first, last, between):
        calls.append((first, last, between))
        if first == 0:
            raise ValueError("first is 0; expected at least 1")
        return plots.player(np.ones((between + 2, 17, 3)), H36M17, fps=10.0)

    return still


def test_keyframes_are_dragged_and_the_player_is_made_anew(still, calls):
    box = widgets.keyframes(still, frames=60, between=(8, 20), start=(10, 21))
    stage, pair, row, told = box.children
    follows, number = row.children
    assert calls == [(10, 21, 10)] and (pair.min, pair.max, number.min, number.max) == (0, 59, 8, 20)
    [first] = stage.children
    assert first.payload["frames"] == 12 and told.value.startswith("frames 10 and 21, 10 between: made in ")
    pair.value = (10, 25)
    [second] = stage.children
    assert second.payload["frames"] == 16 and first.comm is None and second.comm is not None  # the old one is closed
    pair.value = (10, 55)  # farther apart than the model can
    pair.value = (10, 56)  # whose number is the same
    assert calls[1:] == [(10, 25, 14), (10, 55, 20), (10, 56, 20)] and number.disabled
    follows.value = False
    number.value = 9
    assert calls[-1] == (10, 56, 9) and not number.disabled
    pair.value = (12, 30)
    assert calls[-1] == (12, 30, 9)
    follows.value = True
    assert calls[-1] == (12, 30, 17) and len(calls) == 8


def test_keyframes_that_do_not_fit_are_told_and_the_last_player_stays(still, calls):
    stage, pair, _, told = widgets.keyframes(still, frames=60, between=(8, 20), start=(10, 21)).children
    [before] = stage.children
    pair.value = (0, 11)
    assert told.value == "ValueError: first is 0; expected at least 1" and stage.children == (before,)
    pair.value = (1, 12)
    assert told.value.startswith("frames 1 and 12, 10 between") and stage.children != (before,)


def test_static_mode_shows_nothing_and_draws_nothing(waveform, calls, monkeypatch):
    monkeypatch.setenv("MW_STATIC", "1")
    assert widgets.explore(waveform, level=(1, 5)) is None
    assert widgets.keyframes(waveform, 60, (8, 20), (10, 21)) is None
    assert not calls
