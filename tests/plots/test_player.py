"""The player: what the browser gets is what was given, pages need nothing else, and what makes no sense is refused."""

from __future__ import annotations

import base64
import gzip
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import torch

from mwlib import plots
from mwlib.body.skeleton import CMU, H36M17
from mwlib.plots import playing
from mwlib.plots.bodies import COLOURS
from mwlib.plots.player_widget import PlayerWidget
from mwlib.synthetic.motions import synthetic_motions
from tests.plots.legible import contrast

FPS = 50.0
WALK = synthetic_motions(1, seconds=5.1)[0].resample(FPS).cut(0, 250)
X = torch.as_tensor(WALK.root_relative())


def places(body: dict) -> np.ndarray:
    """What the browser reads, metres."""
    numbers = np.frombuffer(base64.b64decode(body["data"]), "<i2")
    return (numbers * body["unit"]).reshape(-1, len(body["parents"]), 3)


def test_positions_come_back_to_half_a_millimetre_and_cost_little():
    (body,) = plots.player(WALK).payload["bodies"]
    found = places(body)
    moved = found - WALK.positions
    assert np.ptp(moved.reshape(-1, 3), axis=0).max() <= 0.001 + 1e-6  # the same step for all, and rounding
    assert np.allclose(found[0, 0, :2], 0, atol=0.0006)
    assert found[..., 2].min() == pytest.approx(0.02 * body["size"], abs=0.02)
    assert 1.5 < body["size"] < 2.2
    assert len(body["data"]) < 35_000
    assert tuple(body["parents"]) == H36M17.parents and body["heads"] == [10]
    sides = {"l": H36M17.left, "r": H36M17.right}
    assert all([i for i, side in enumerate(body["sides"]) if side == s] == sorted(joints) for s, joints in sides.items())


def test_what_reaches_far_is_kept_coarser_rather_than_wrapped_round():
    far = replace(WALK, positions=WALK.positions + np.linspace(0, 90, 250)[:, None, None] * [1.0, 0, 0], rig=None)
    (body,) = plots.player(far).payload["bodies"]
    step = places(body) - far.positions
    assert np.ptp(step.reshape(-1, 3), axis=0).max() <= body["unit"] * 1.001 < 0.004


def test_y_up_motions_and_other_rates_are_shown_as_z_up_at_one_rate():
    there, again = plots.player({"a": WALK, "b": WALK.with_up("y").resample(25.0)}).payload["bodies"]
    (count, first), (fewer, second) = ((len(places(body)), places(body)) for body in (there, again))
    assert count == 250 and fewer == 249
    assert np.abs(first[:249:2] - second[::2]).max() < 0.0015


def test_a_shorter_row_is_the_end_of_a_film_with_history_and_else_begins_with_it():
    rows = {"truth": X, "sample": X[25:]}
    starts = [body["start"] for body in plots.player(rows, H36M17, fps=FPS, history=25).payload["bodies"]]
    assert starts == [0, 25]
    assert [body["start"] for body in plots.player(rows, H36M17, fps=FPS).payload["bodies"]] == [0, 0]
    assert [body["kind"] for body in plots.player(rows, H36M17, fps=FPS).payload["bodies"]] == ["truth", "predicted"]


def test_several_motions_of_one_array_and_of_a_list_get_names():
    futures = torch.stack([X, X + 0.01, X])
    shown = plots.player({"truth": X, "future": futures}, H36M17, fps=FPS)
    assert [body["name"] for body in shown.payload["bodies"]] == ["truth", "future 1", "future 2", "future 3"]
    positions = np.stack([WALK.positions, WALK.positions])
    assert len(plots.player(positions, H36M17, fps=FPS).payload["bodies"]) == 2
    names = [body["name"] for body in plots.player([WALK, WALK, replace(WALK, name="", action="")]).payload["bodies"]]
    assert len(set(names)) == 3 and names[2] == "motion 3"


def test_bodies_with_and_without_a_root_stand_on_one_floor():
    with_root, without = plots.player({"a": WALK, "b": X}, H36M17, fps=FPS).payload["bodies"]
    lowest = [np.quantile(places(body)[..., 2].min(axis=1), 0.01) for body in (with_root, without)]
    assert lowest == pytest.approx([0.02 * with_root["size"]] * 2, abs=0.002)
    assert np.ptp(places(without)[:, 0], axis=0).max() == 0 and np.ptp(places(with_root)[:, 0, :2], axis=0).max() > 1


def test_ghosts_stand_where_the_bodies_are_at_the_keyframes():
    payload = plots.player({"a": WALK, "b": WALK, "c": WALK.cut(0, 100)}, keyframes=[99, 10, -1]).payload
    assert payload["keyframes"] == [10, 99, 249]
    first = [(ghost["frame"], ghost["of"]) for ghost in payload["ghosts"]]
    assert sorted(first) == [(10, [0, 1, 2]), (99, [0, 1, 2]), (249, [0, 1])]
    body = places(payload["bodies"][0])
    for ghost in payload["ghosts"]:
        assert np.array_equal(places(ghost)[0], body[ghost["frame"]])


def test_given_poses_stand_as_ghosts_in_every_form():
    for poses, motion in (({10: WALK.positions[99]}, WALK), ({10: WALK.cut(99, 100)}, WALK), ({10: X[99]}, X)):
        payload = plots.player(motion, H36M17, fps=FPS, keyframes=poses).payload
        (ghost,) = payload["ghosts"]
        assert ghost["frame"] == 10 and np.array_equal(places(ghost)[0], places(payload["bodies"][0])[99])


@pytest.mark.parametrize(
    ("motions", "options", "message"),
    [
        ({}, {}, "motions are empty"),
        (X[:, :47], {}, r"motion has shape \(250, 47\); H36M17 takes \(T, 48\) or \(T, 17, 3\)"),
        ({"a": X[:0]}, {}, r"motion 'a' has shape \(0, 48\)"),
        ({"a": X}, {"skeleton": None}, "motion 'a' is an array; expected skeleton="),
        ({"a": X}, {"fps": None}, "fps is None; expected the frames per second"),
        (X, {"fps": -1.0}, "fps is -1"),
        (torch.where(torch.arange(X.numel()).view(X.shape) == 7 * 48 + 5, torch.nan, X), {}, "at frame 7, right_knee"),
        (X, {"history": 251}, "history is 251 frames; expected 0 to 250"),
        (X, {"keyframes": [250]}, "keyframe 250 is outside of the film; expected 0 to 249, or down to -250"),
        (X, {"keyframes": {3: WALK.positions[3]}}, "given with its root, the motions without"),
        (X, {"keyframes": {3: X[3, :6]}}, r"has shape \(1, 6\)"),
        (X, {"layout": "stack"}, "layout is 'stack'; expected 'side' or 'overlay'"),
        (X, {"shown_as": "gif"}, "shown_as is 'gif'"),
        (X, {"speed": 0.0}, "speed is 0.0; expected a number above 0"),
        (X, {"alt": " "}, "alternative text is empty"),
        ({"a": "walk"}, {}, r"motions\['a'\] is 'walk'; expected a Motion or an array of real numbers"),
    ],
)
def test_what_makes_no_sense_is_refused(motions, options, message):
    with pytest.raises(ValueError, match=message):
        plots.player(motions, **{"skeleton": H36M17, "fps": FPS, **options})


class Page(HTMLParser):
    """Every element of a page, and the text of its scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict]] = []
        self.scripts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data):
        if self.lasttag == "script":
            self.scripts[-1] += data


def test_a_page_needs_nothing_else_and_holds_the_program_once(tmp_path):
    hostile = '</script><img src=x onerror="alert(1)"> & "quotes"'
    first, second = plots.player({hostile: WALK}), plots.player([WALK], alt='A "walk" & <b>more</b>.')
    text = first.save_html(tmp_path / "page.html", second, title="<Walks>").read_text(encoding="utf-8")
    page = Page(text)
    assert not [tag for tag, _ in page.elements if tag in ("img", "link", "iframe", "b")]
    assert not [value for _, attributes in page.elements for name, value in attributes.items() if name in ("src", "href")]
    program = gzip.decompress(base64.b64decode(playing.packed()[1])).decode()
    assert text.count(playing.packed()[1]) == 1 and program == playing.BUNDLE.read_text(encoding="utf-8")
    assert not re.search(r"https?://", text) and not re.search(r"\b(fetch|import)\(\s*[\"'`]http|XMLHttpRequest\(\)", text)
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))  # none: the script looks for a class
    told = [json.loads(script) for script in page.scripts if script.lstrip().startswith("{")]
    assert [payload["alt"] for payload in told] == [first.alt, second.alt] and told[0]["bodies"][0]["name"] == hostile
    labels = [attributes["aria-label"] for _, attributes in page.elements if "aria-label" in attributes]
    assert labels == [first.alt, second.alt]
    assert len(first.html()) < 300_000 and len(first.html(embed=False)) < 45_000


def test_a_notebook_gets_a_widget_html_or_a_loop(monkeypatch):
    seen: list = []
    monkeypatch.setattr("IPython.display.display", lambda *what, **how: seen.extend(what))
    monkeypatch.delenv("MW_STATIC", raising=False)
    short = WALK.cut(0, 11)
    for shown_as in ("widget", "html", "loop", None):
        plots.player(short, shown_as=shown_as)._ipython_display_()
    widget, html, loop, without_kernel = seen
    assert isinstance(widget, PlayerWidget) and isinstance(loop, plots.Loop)
    assert html == without_kernel and set(html) == {"text/html", "text/plain"} and "mwlib-player" in html["text/html"]
    monkeypatch.setenv("MW_STATIC", "1")
    plots.player(short, shown_as="html")._ipython_display_()
    assert isinstance(seen[-1], plots.Loop) and seen[-1].alt == plots.player(short).alt


def test_the_widget_takes_all_that_a_page_takes():
    shown = plots.player(WALK, speed=0.5)
    widget = shown.widget()
    assert (widget.frame, widget.playing, widget.speed) == (0, False, 0.5)
    assert {"frame", "playing", "speed", "payload", "bundle", "key"} <= set(widget.keys)
    assert (widget.key, widget.bundle) == playing.packed()
    assert widget.payload == json.loads(json.dumps(shown.payload))


def test_the_bundle_is_built_of_todays_sources():
    text = playing.BUNDLE.read_text(encoding="utf-8")
    assert text.splitlines()[0] == playing.RECORD + playing.sources_hash(), "a source has changed: run 'make player'"
    assert len(text.encode()) < 600_000
    package = json.loads((playing.ASSETS / "package.json").read_text())
    lock = json.loads((playing.ASSETS / "package-lock.json").read_text())
    for name, version in (package["dependencies"] | package["devDependencies"]).items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version) and lock["packages"][f"node_modules/{name}"]["version"] == version
    assert "three.js authors" in (playing.ASSETS / "LICENSE.three").read_text() and "SPDX-License-Identifier: MIT" in text


def test_colours_are_those_of_the_other_pictures_and_legible_on_dark_pages():
    light, dark = (plots.player(WALK).payload["colours"][theme] for theme in ("light", "dark"))
    assert {name: tuple(light[name]) for name in COLOURS} == COLOURS
    for kind in COLOURS:
        assert min(contrast(colour, dark["paper"]) for colour in dark[kind]) >= 4.5


def test_other_skeletons_and_single_frames_are_shown():
    still = np.random.default_rng(0).normal(size=(1, len(CMU), 3))
    payload = plots.player({"walk": WALK, "pose": still}, CMU, fps=FPS).payload
    assert [len(body["parents"]) for body in payload["bodies"]] == [17, 31] and payload["frames"] == 250
    assert plots.player(still, CMU, fps=FPS).payload["frames"] == 1
