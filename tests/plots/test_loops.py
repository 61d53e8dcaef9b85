"""Loops: they move, they end where they began, they are small, and they say what they show."""

from __future__ import annotations

import base64
import io
import math
import shutil
import subprocess

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from PIL import Image, ImageSequence

from mwlib import plots
from mwlib.body.skeleton import H36M17
from mwlib.course.execute import filter_notebook
from mwlib.synthetic.motions import synthetic_motions
from tests.notebook_rules import described, moving, outputs

FPS, HISTORY = 25.0, 5
WALK = synthetic_motions(1, seconds=2)[0].resample(FPS).cut(0, 26)
X = WALK.root_relative()
ALT = "Two walkers side by side: the truth in black and a prediction in colour."


@pytest.fixture(scope="module")
def walkers() -> plots.Loop:
    return plots.loop({"truth": X, "sample": X[HISTORY:][::-1]}, H36M17, fps=FPS, history=HISTORY, alt=ALT)


def frames_of(content: bytes) -> list[np.ndarray]:
    return [np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(Image.open(io.BytesIO(content)))]


@pytest.mark.parametrize("ending", [".png", ".webp", ".gif"])
def test_files_hold_all_pictures_loop_for_ever_and_keep_time(walkers, ending, tmp_path):
    content = walkers.save(tmp_path / f"walk{ending}").read_bytes()
    image = Image.open(io.BytesIO(content))
    assert image.format == ending[1:].upper() and image.is_animated and image.info["loop"] == 0
    pictures, durations = [], []
    for frame in ImageSequence.Iterator(image):
        pictures.append(np.asarray(frame.convert("RGB")).astype(int))
        durations.append(frame.info["duration"])
    assert len(pictures) == len(walkers) == 13 and image.size == walkers.size
    assert all(np.abs(b - a).max() > 100 for a, b in zip(pictures, pictures[1:], strict=False))
    assert durations == [80] * 12 + [1000]


def test_the_pictures_are_the_bodies_in_the_colours_of_the_house(walkers):
    pictures = frames_of(walkers.encoded())
    blue, black = np.array([0, 0x4B, 0x7B]), np.zeros(3, int)
    half = walkers.size[0] // 2

    def near(picture, colour):
        return (np.abs(picture[30:-30] - colour).max(axis=-1) < 40).sum()

    assert (pictures[0][-1, -1] == 255).all()
    assert near(pictures[0][:, half:], blue) == 0 and near(pictures[0][:, :half], black) < 60  # the past is grey; names are not
    assert near(pictures[-1][:, half:], blue) > 100 and near(pictures[-1][:, :half], black) > 300


def test_a_wide_body_beside_a_narrow_one_is_drawn_whole():
    narrow, wide = (WALK.positions * np.array([stretch, 1, stretch], np.float32) for stretch in (0.3, 2))
    for picture in frames_of(plots.loop({"narrow": narrow, "wide": wide}, H36M17, fps=FPS, alt=ALT).encoded()):
        assert picture[30:-30, -2:].min() > 200, "a limb reaches the right border"


def test_a_loop_of_three_seconds_stays_below_its_limit():
    long = synthetic_motions(1, seconds=4)[0].resample(FPS).cut(0, 75)
    made = plots.loop({name: long for name in ("truth", "a", "b", "c")}, history=12, alt=ALT)
    assert len(made.encoded()) <= 300_000 and made.size[0] > 400
    short = WALK.cut(0, 5)
    large = plots.loop(short, alt=ALT)
    assert plots.loop(short, alt=ALT, most_bytes=len(large.encoded()) - 1).size[0] < large.size[0]
    with pytest.raises(ValueError, match="240 pixels wide; expected 200: show a shorter motion"):
        plots.loop(short, alt=ALT, most_bytes=200)


def test_a_readers_own_settings_do_not_leak_in():
    short = WALK.cut(0, 3)
    expected = plots.loop(short, alt=ALT).encoded()
    with mpl.rc_context({"font.size": 30, "lines.linewidth": 9, "text.color": "red"}):
        assert plots.loop(short, alt=ALT).encoded() == expected


def test_the_same_motions_give_the_same_bytes(walkers):
    again = plots.loop({"truth": X, "sample": X[HISTORY:][::-1]}, H36M17, fps=FPS, history=HISTORY, alt=ALT)
    assert again.encoded() == walkers.encoded()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"alt": " "}, "alternative text is empty"),
        ({"pictures_per_second": 0}, "pictures_per_second is 0"),
        ({"history": 99}, "history is 99 frames"),
    ],
)
def test_what_makes_no_sense_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        plots.loop(X, H36M17, **{"fps": FPS, "alt": ALT, **options})


def test_other_endings_are_refused(walkers, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="ending is '.avi'; expected one of .png, .webp, .gif, .mp4"):
        walkers.save(tmp_path / "walk.avi")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ValueError, match="ending is '.mp4', and there is no ffmpeg; expected it on PATH, or .png"):
        walkers.save(tmp_path / "walk.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is a program of its own")
def test_a_film_shows_all_pictures_at_their_rate(walkers, tmp_path):
    film = walkers.save(tmp_path / "walk.mp4")
    width, height = (2 * math.ceil(length / 2) for length in walkers.size)
    raw = subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-i", film, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    ).stdout
    seen = np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3).astype(int)
    pictures = frames_of(walkers.encoded())
    assert len(seen) == 12 + 12, "a second of the last one, which counts among the pictures"
    for one, other in zip(seen, pictures, strict=False):
        assert np.abs(one[: other.shape[0], : other.shape[1]] - other).mean() < 4


def shown(thing) -> nbformat.NotebookNode:
    """A notebook whose only cell ended with the thing."""
    data, metadata = DisplayFormatter().format(thing)
    cell = nbformat.v4.new_code_cell("it", execution_count=1, outputs=[
        nbformat.v4.new_output("execute_result", data, metadata=metadata, execution_count=1)
    ])  # fmt: skip
    notebook = nbformat.v4.new_notebook(cells=[cell, nbformat.v4.new_markdown_cell("**What you should see.** A walk.")])
    filter_notebook(notebook)
    return notebook


def test_a_notebook_keeps_the_moving_picture_with_its_text(walkers):
    notebook = shown(walkers)
    assert [*outputs(notebook), *described(notebook), *moving(notebook)] == []
    (kept,) = notebook.cells[0].outputs
    assert kept.metadata["image/png"]["alt"] == kept.data["text/plain"] == ALT
    assert len(frames_of(base64.b64decode(kept.data["image/png"]))) == 13


def test_a_moving_picture_that_is_too_large_or_stops_is_found(walkers):
    first, *others = walkers._pictures
    once, large = io.BytesIO(), walkers.encoded() + bytes(300_000)
    first.save(once, "PNG", save_all=True, append_images=others, loop=1)
    for content, message in ((once.getvalue(), "stops after 1"), (large, "bytes; expected at most 300000")):
        notebook = shown(walkers)
        notebook.cells[0].outputs[0].data["image/png"] = base64.b64encode(content).decode()
        (problem,) = moving(notebook)
        assert message in problem
