"""Pictures for print: as wide as a column, whole, with texts that can be read, in the font that was asked for."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context

from mwlib.cli import main
from mwlib.plots.look import canvas, style
from mwlib.plots.printing import column, fonts
from mwlib.plots.saving import save


def page(folder: Path, monkeypatch, said: str, font: str = "", width: float = 6.4) -> tuple[list[float], bytes]:
    """Width and height in inches of a saved PDF, and its text uncompressed."""
    monkeypatch.setenv("MWLIB_COLUMN", said)
    monkeypatch.setenv("MWLIB_FONT", font)
    with style(), rc_context({"pdf.compression": 0}):
        figure, axes = canvas(height=2, width=width)
        axes[0, 0].plot(np.arange(3), label="a line")
        axes[0, 0].set_title("a title")
        monkeypatch.setattr("mwlib.plots.look.STYLE", {"pdf.compression": 0})
        save(figure, folder, "a", data={"y": [0, 1, 2]}, alt="A line.", provenance={})
        assert figure.get_size_inches().tolist() == [width, 2.0] and figure.dpi > 72
    file = (folder / "a.pdf").read_bytes()
    box = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", file)[0]
    return [float(number) / 72 for number in box], file


@pytest.mark.parametrize(
    "said, width, expected",
    [
        ("", 6.4, 6.4), ("3.3in", 6.4, 3.3), ("3.3", 6.4, 3.3), ("84mm", 6.4, 84 / 25.4), ("12 cm", 6.4, 12 / 2.54),
        ("7in", 6.4, 6.4), ("3.3in", 3.0, 3.0),
    ],
)  # fmt: skip
def test_a_picture_is_as_wide_as_the_column_and_no_wider_than_it_was_drawn(tmp_path, monkeypatch, said, width, expected):
    (wide, high), _ = page(tmp_path, monkeypatch, said, width=width)
    assert wide == pytest.approx(expected, abs=1e-3) and 0.9 < high <= 2


def test_the_whole_picture_is_drawn_in_texts_of_seven_points_at_least_and_in_the_font(tmp_path, monkeypatch):
    _, plain = page(tmp_path, monkeypatch, "3.3in")
    _, file = page(tmp_path, monkeypatch, "3.3in", "STIXGeneral")
    assert re.search(rb"/FontName /\S*DejaVuSans", plain) and re.search(rb"/FontName /\S*STIXGeneral", file)
    scale = float(re.findall(rb"([\d.]+) 0 0 ([\d.]+) 0 0 cm", file)[0][0])
    assert scale == 0.7 and min(map(float, re.findall(rb"/F\d+ ([\d.]+) Tf", file))) * scale >= 7
    assert not re.search(rb"/FontName /\S*DejaVuSans", file)
    places = [float(x) for x in re.findall(rb"^([\d.]+) [\d.]+ [lm]$", plain, re.M)]
    assert max(places) > 0.9 * 72 * 3.3 / 0.7, "a line to the right edge of the axes is cut at the edge of the smaller page"


@pytest.mark.parametrize("said", ["wide", "3.3 feet", "1in", "13in", "-3in", "nan"])
def test_what_is_no_width_is_refused(monkeypatch, said):
    monkeypatch.setenv("MWLIB_COLUMN", said)
    with pytest.raises(ValueError, match=r"MWLIB_COLUMN is .*; expected the width of a column such as 3.3in"):
        column()


def test_a_font_that_is_not_there_is_refused_before_a_notebook_runs(monkeypatch, capsys):
    monkeypatch.setenv("MWLIB_FONT", "")
    monkeypatch.setenv("MWLIB_COLUMN", "")
    assert fonts() == {} and column() is None
    assert main(["run-notebook", "02", "--font", "No Such Font"]) == 1
    assert "MWLIB_FONT is 'No Such Font', which is not installed; expected a font" in capsys.readouterr().err
