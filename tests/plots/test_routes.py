"""Bodies that go somewhere: they stand where and when they are, from the side that shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from mwlib import plots
from mwlib.synthetic.motions import synthetic_motions
from tests.plots.legible import legible

WALK = synthetic_motions(1, seconds=2)[0].resample(25.0).cut(0, 41)


def _going(speed: float, angle: float = 0.0):
    """The first pose of a walk, slid over the floor, metres per second."""
    time = np.arange(len(WALK)) / WALK.fps
    slide = time[:, None] * speed * np.array([np.cos(angle), np.sin(angle), 0.0])
    return replace(WALK, positions=(WALK.positions[:1] + slide[:, None]).astype(np.float32), rig=None)


def _bodies(ax):
    return [group for group in ax.collections if isinstance(group, LineCollection)]


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -1.6])
def test_the_way_runs_to_the_right_of_the_page_in_metres(angle):
    fig, ax = plots.passages(_going(2.0, angle), every=10)
    (path,) = (line for line in ax.lines if len(line.get_xdata()) == len(WALK))
    assert np.diff(path.get_xdata()) == pytest.approx(np.full(len(WALK) - 1, 2.0 / 25), rel=1e-3)
    assert np.ptp(path.get_ydata()) < 1e-3
    assert ax.get_xlim()[1] - ax.get_xlim()[0] == pytest.approx(
        (ax.get_ylim()[1] - ax.get_ylim()[0]) * np.divide(*fig.get_size_inches())
    )
    legible(fig)


def test_keyframes_are_black_and_what_lies_between_is_light():
    _, ax = plots.passages({"truth": _going(2.0), "sample": _going(2.0)}, every=10, keyframes=(0, 20, -1))
    bones = len(WALK.skeleton.bones)
    found = [(group.get_alpha(), len(group.get_segments())) for group in _bodies(ax)]
    assert sum(count for alpha, count in found if alpha == 1.0) == 2 * 3 * bones  # frames 0, 20, 40
    assert sum(count for alpha, count in found if alpha < 1.0) == 2 * 2 * bones  # frames 10, 30
    colours = [{tuple(c[:3]) for group in _bodies(ax) if group.get_alpha() == a for c in group.get_color()} for a in (1.0, 0.65)]
    assert colours[0] == {(0.0, 0.0, 0.0)} and len(colours[1]) == 3
    words = [text.get_text() for text in ax.texts]
    assert words.count("0.80") == 2 and {"truth", "sample", "1 m"} <= set(words)


def test_bodies_that_would_pile_up_are_spread_by_time_and_it_says_so():
    fig, ax = plots.passages(
        {"still": _going(0.0), "going": replace(_going(2.0), positions=_going(2.0).positions + np.float32(1))},
        every=10,
        keyframes=(0, 15, -1),
    )
    words = {text.get_text() for text in ax.texts}
    assert {"going", "still (spread by time)"} <= words
    fig, ax = plots.passages(_going(0.0), every=10, keyframes=(0, 15, -1))
    assert any("spread by time" in text.get_text() for text in ax.texts)
    numbers = sorted((text.get_position()[0], float(text.get_text())) for text in ax.texts if text.get_text()[:1].isdigit())
    x, seconds = np.array(numbers).T
    assert seconds.tolist() == [0.0, 0.6, 1.2, 1.6] and np.allclose(np.diff(x) / np.diff(seconds), np.diff(x)[0] / 0.6)
    legible(fig)


def test_rows_of_one_start_share_their_camera_and_others_have_their_own():
    together, apart = _going(2.0), _going(2.0, 1.5)
    aside = replace(together, positions=together.positions + np.float32([1.0, 0, 0]))
    _, ax = plots.passages({"a": together, "b": apart}, every=10)
    spans = [np.ptp(line.get_xdata()) for line in ax.lines if len(line.get_xdata()) == len(WALK)]
    assert max(spans) < 3.0
    _, ax = plots.passages({"a": aside, "b": apart}, every=10)
    spans = [np.ptp(line.get_xdata()) for line in ax.lines if len(line.get_xdata()) == len(WALK)]
    assert spans == pytest.approx([3.2, 3.2], rel=1e-3)


def test_eight_rows_and_other_axes_fit_the_page():
    rows = {f"sample {row}": WALK.with_up("y") for row in range(8)}
    fig, ax = plots.passages(rows, spread=True)
    upright, _ = plots.passages(dict.fromkeys(rows, WALK), spread=True)
    assert fig.get_size_inches() == pytest.approx(upright.get_size_inches())
    assert {*rows} <= {text.get_text() for text in ax.texts}
    legible(fig)


def test_no_half_of_the_picture_is_empty():
    for rows, spread in (({"a": _going(0.5), "b": _going(0.5)}, False), (dict.fromkeys("abcdefgh", WALK), True)):
        fig, ax = plots.passages(rows, every=10, spread=spread)
        points = np.concatenate([segment[:, 0] for group in _bodies(ax) for segment in group.get_segments()])
        assert np.ptp(points) > 0.5 * np.ptp(ax.get_xlim()) or fig.get_figwidth() < 5  # what the words at its foot take
