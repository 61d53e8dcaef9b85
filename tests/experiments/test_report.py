"""Pictures of a run: storyboards of people never seen and loss curves, with what a reader must know."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from mwlib.cli import main, measure
from mwlib.experiments import get_model, report
from mwlib.experiments.report import write_curves, write_ends, write_storyboards
from tests.sample_settings import small, two_people


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    data = two_people()._replace(test=two_people().validation)
    cfg = small(samples=4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MWLIB_RUNS", str(folder / "runs"))
        write_curves(cfg, data, folder / "out")
        model = get_model(cfg, data)
        write_storyboards(cfg, data, model, folder / "out", count=2)
        write_storyboards(cfg, data, model, folder / "out", [data.test[2].name])
        write_ends(cfg, data, model, folder / "out", count=2)
        for write in (write_storyboards, write_ends):
            with pytest.raises(ValueError, match="clips are nobody; expected some of the test people: P2_"):
                write(cfg, data, model, folder / "out", ["nobody"])
    return folder / "out"


def test_pictures_are_there_with_words_and_origin(out):
    for stem in ("curves", "storyboard_1", "storyboard_2", "end_poses", "ten"):
        assert (out / f"{stem}.png").stat().st_size > 5000 and len((out / f"{stem}.txt").read_text()) > 40
        about = json.loads((out / f"{stem}.json").read_text())
        assert {"training_hash", "test_subjects", "settings", "seeds", "machine", "data"} <= set(about)
        assert about["test_subjects"] == ["P2"] and about["settings"]["samples"] == 4
    assert not (out / "storyboard_3.png").exists()


def test_storyboards_say_which_clip_they_show(out):
    first, second = (json.loads((out / f"storyboard_{n}.json").read_text()) for n in (1, 2))
    assert first["window"] != second["window"] and first["clip"].startswith("P2_")


def test_ends_are_those_of_the_windows_that_storyboards_show(out):
    def column(stem, start):
        with open(out / f"{stem}.csv", encoding="utf-8") as file:
            lines = [[line[name] for name in line if name.startswith(start)] for line in csv.DictReader(file)]
        return np.array([line for line in lines if line[0]], float)

    same = {"rtol": 0, "atol": 1e-4}  # windows sampled together, and one by one
    for n in (1, 2):
        np.testing.assert_allclose(column("end_poses", f"truth_{n}")[:, 0], column(f"storyboard_{n}", "truth")[-1], **same)
        for k in (1, 2):
            drawn = column(f"storyboard_{n}", f"sample_{k}")[-1]
            np.testing.assert_allclose(column("end_poses", f"samples_{n}")[:, k - 1], drawn, **same)
    np.testing.assert_array_equal(column("ten", "samples"), column("end_poses", "samples_1"))
    np.testing.assert_array_equal(column("ten", "truth"), column("end_poses", "truth_1"))
    assert json.loads((out / "ten.json").read_text())["clip"] == json.loads((out / "storyboard_1.json").read_text())["clip"]


def test_a_finished_run_is_drawn_instead_of_a_preset(tmp_path, monkeypatch, capsys):
    drawn = []
    monkeypatch.setattr(measure, "load_data", lambda cfg: cfg.data.data)
    for name in ("write_storyboards", "write_ends"):
        monkeypatch.setattr(report, name, lambda cfg, split, model, out, clips: drawn.append((split, model, clips)))
    assert main(["storyboards", "--run", "synthetic", "--out", str(tmp_path)]) == 0
    assert [(split, clips) for split, _, clips in drawn] == 2 * [("synthetic", ())] and not [*tmp_path.iterdir()]
    assert main(["storyboards", "--run", "sentences"]) == 1
    assert "run of another system" in capsys.readouterr().err
    assert main(["storyboards", "--run", "synthetic", "--set", "samples=3"]) == 1
    assert "expected one of them" in capsys.readouterr().err


def test_a_clip_is_drawn_by_its_name(out):
    clip = two_people().validation[2].name
    assert json.loads((out / f"storyboard_{clip}.json").read_text())["clip"] == clip
