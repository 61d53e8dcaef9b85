"""Pictures of motions from sentences: left is left, lines are the values that were given, nothing is cut off."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib import Motion, plots
from mwlib.body.skeleton import HUMANML22
from tests.plots.legible import legible

FRAMES = 12
CAPTION = "somebody first walks in a straight line at a normal pace and afterwards kicks one time with the right leg"


def body(to_left: float, ahead: float, heading: float = 0.0, up: str = "y") -> Motion:
    """Goes so far, in metres, as it sees it; at heading 0 it looks along +z."""
    joints = np.zeros((FRAMES, 22, 3))
    joints[..., 1] = np.linspace(0.1, 1.6, 22)
    joints[:, list(HUMANML22.left), 0], joints[:, list(HUMANML22.right), 0] = 0.1, -0.1
    joints += np.linspace(0, 1, FRAMES)[:, None, None] * [to_left, 0, ahead]
    cos, sin = np.cos(heading), np.sin(heading)
    turned = joints @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).T + [3.0, 0, -5.0]
    return Motion(turned, 20.0, HUMANML22, up="y").with_up(up)


def _apart(fig, texts) -> None:
    """No two of these texts overlap."""
    with plots.style():
        fig.draw_without_rendering()
        boxes = [text.get_window_extent() for text in texts]
    assert not [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi, -1.9])
def test_left_is_left_and_ahead_is_up_the_page(heading, up):
    _, axes = plots.ways({"left": [body(2.0, 0.5, heading, up), body(-1.0, -0.25, heading, up)]})
    first, second, dot = axes[0, 0].lines
    np.testing.assert_allclose(first.get_xydata()[[0, -1]], [[0, 0], [-2, 0.5]], atol=1e-6)
    np.testing.assert_allclose(second.get_xydata()[-1], [1, -0.25], atol=1e-6)
    assert dot.get_xydata().tolist() == [[0, 0]]


def test_each_sentence_has_a_panel_of_its_own_scale():
    titles = ["someone turns around to the left", "a person walks forward slowly", "a man waves with the right hand", CAPTION]
    fig, axes = plots.ways({title: [body(2.0 * n, 1.0)] for n, title in enumerate(titles)})
    shown = [ax for ax in axes.flat if ax.get_visible()]
    assert axes.shape == (2, 3) and len(shown) == 4
    assert [ax.get_title(loc="left").replace("\n", " ") for ax in shown[:3]] == titles[:3]
    assert shown[3].get_title(loc="left").endswith("…")
    for number, ax in enumerate(shown):
        reach = max(0.6, 0.54 * max(1, 2 * number))  # a path from the dot to 2 n to one side, and 1 ahead
        assert [float(np.diff(ends)[0]) for ends in (ax.get_xlim(), ax.get_ylim())] == pytest.approx([2 * reach] * 2)
        assert np.mean(ax.get_ylim()) == pytest.approx(0.5) and abs(np.mean(ax.get_xlim())) == pytest.approx(number)
    assert [ax.get_xlabel() for ax in shown] == ["", "to the right (m)", "to the right (m)", "to the right (m)"]
    assert [ax.get_ylabel() for ax in shown] == ["ahead (m)", "", "", "ahead (m)"]
    assert all(ax.xaxis.get_tick_params()["labelbottom"] for ax in shown[1:])
    legible(fig)
    _apart(fig, [ax._left_title for ax in shown])


def test_who_stays_is_not_blown_up():
    _, axes = plots.ways({"stays": [body(0.0, 0.01)]})
    assert np.diff(axes[0, 0].get_xlim()) == pytest.approx(1.2)


def test_an_emerging_way_grows_darker_step_by_step():
    paths = [torch.rand(FRAMES, 2) * n for n in range(1, 7)]
    limbs = [np.linspace(0, n, FRAMES) for n in range(1, 7)]
    steps = [1, 10, 20, 30, 40, 50]
    fig, axes = plots.emerging_way(paths, steps, limbs=limbs, fps=20)
    way, height = axes.flat
    for line, curve, path, limb in zip(way.lines, height.lines, paths, limbs, strict=True):
        np.testing.assert_allclose(line.get_xydata(), path)
        np.testing.assert_allclose(curve.get_xydata(), np.stack([np.arange(FRAMES) / 20, limb], axis=1))
        assert line.get_color() == curve.get_color()
    light = [sum(line.get_color()[:3]) for line in way.lines]
    assert light == sorted(light, reverse=True) and len(set(light)) == 6
    (legend,) = fig.legends
    assert [text.get_text() for text in legend.get_texts()] == [f"step {step}" for step in steps]
    legible(fig)


@pytest.mark.parametrize("text", [CAPTION, f"{CAPTION}, and sits down, and stands up again, and waves"])
def test_the_overview_shows_the_clip_its_noise_and_three_losses(text):
    features, noisy = torch.randn(FRAMES, 263), 9 * torch.ones(FRAMES, 263)
    fig, ax = plots.free_overview(features, noisy, body(0.0, 1.0), text)
    pictures = [picture.get_array() for inner in ax.child_axes for picture in inner.images]
    np.testing.assert_allclose(pictures[0], features.clamp(-3, 3).T)
    assert pictures[1].shape == (263, FRAMES) and pictures[1].max() == 3
    words = [found.get_text() for found in ax.texts]
    assert sum(": " in said and "loss" in said for said in words) == 3
    (caption,) = [found for found in ax.texts if found.get_text().startswith("“")]
    said = caption.get_text().strip("“”").replace("\n", " ")
    assert said == text or (said.endswith(" …") and text.startswith(said.removesuffix(" …")))
    legible(fig, least=3)  # what stands beside the losses is grey
    frames = [patch.get_window_extent() for patch in ax.patches]
    assert any(frame.containsx(e.x0) and frame.containsx(e.x1) and frame.containsy(e.y0) and frame.containsy(e.y1)
               for e in [caption.get_window_extent()] for frame in frames)  # fmt: skip
    _apart(fig, [found for found in ax.texts if found.get_text()])  # an arrow is a text without words
