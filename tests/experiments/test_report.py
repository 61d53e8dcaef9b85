"""Pictures of a run: storyboards of people never seen and loss curves, with what a reader must know."""

from __future__ import annotations

import json

import pytest

from mwlib.__main__ import main
from mwlib.experiments.report import write_curves, write_storyboards
from tests.sample_settings import small, two_people


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    data = two_people()._replace(test=two_people().validation)
    cfg = small(samples=4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MWLIB_RUNS", str(folder / "runs"))
        write_curves(cfg, data, folder / "out")
        write_storyboards(cfg, data, folder / "out", count=2)
        write_storyboards(cfg, data, folder / "out", [data.test[2].name])
        with pytest.raises(ValueError, match="clips are nobody; expected some of the test people: P2_"):
            write_storyboards(cfg, data, folder / "out", ["nobody"])
    return folder / "out"


def test_pictures_are_there_with_words_and_origin(out):
    for stem in ("curves", "storyboard_1", "storyboard_2"):
        assert (out / f"{stem}.png").stat().st_size > 5000 and len((out / f"{stem}.txt").read_text()) > 40
        about = json.loads((out / f"{stem}.json").read_text())
        assert {"training_hash", "test_subjects", "settings", "seeds", "machine", "data"} <= set(about)
        assert about["test_subjects"] == ["P2"] and about["settings"]["samples"] == 4
    assert not (out / "storyboard_3.png").exists()


def test_storyboards_say_which_clip_they_show(out):
    first, second = (json.loads((out / f"storyboard_{n}.json").read_text()) for n in (1, 2))
    assert first["window"] != second["window"] and first["clip"].startswith("P2_")


def test_a_clip_is_drawn_by_its_name(out):
    clip = two_people().validation[2].name
    assert json.loads((out / f"storyboard_{clip}.json").read_text())["clip"] == clip


def test_unknown_settings_are_refused(capsys):
    assert main(["train", "--preset", "tiny", "--set", "test_window=3"]) == 1
    assert "did you mean 'test_windows'" in capsys.readouterr().err
