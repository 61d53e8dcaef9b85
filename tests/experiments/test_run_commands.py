"""The commands about a finished run: predict and export-bvh."""

from __future__ import annotations

import numpy as np
import pytest

import mwlib as mw
from mwlib.__main__ import main
from tests.sample_settings import SMALL


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MWLIB_RUNS", str(folder))
        words = [f"--set={name}={value}" for name, value in SMALL.items()]
        assert main(["train", "--preset", "tiny", *words, "--set=train_steps=2"]) == 0
    (path,) = [path.parent for path in folder.glob("*/model.safetensors")]
    return path


def test_predict_writes_one_archive(run, tmp_path, capsys):
    out = tmp_path / "new folder" / "futures.npz"
    assert main(["predict", str(run), "synthetic", "--clips", "2", "--samples", "4", "--out", str(out)]) == 0
    with np.load(out) as archive:
        clips = [name for name in archive.files if name not in ("joints", "parents", "fps", "up", "history")]
        assert len(clips) == 2 and archive[clips[0]].shape == (4, 20, 17, 3) and archive["fps"] == 10 and archive["history"] == 6
    assert "4 futures of 2 clips, 1.90 s each" in capsys.readouterr().out


def test_export_bvh_writes_files_that_read_back(run, tmp_path, capsys):
    assert main(["export-bvh", str(run), "synthetic", "--clips", "2", "--samples", "1", "--out", str(tmp_path)]) == 0
    motions = mw.load_motions(tmp_path)
    assert len(motions) == 2 and all(len(m) == 20 and m.fps == 10 and m.up == "y" for m in motions)
    assert "mm from the predicted ones" in capsys.readouterr().out


def test_mistakes_are_told(run, tmp_path, capsys):
    assert main(["predict", str(tmp_path), "synthetic"]) == 1
    assert main(["predict", str(run), "synthetic", "--samples", "0"]) == 1
    (tmp_path / "config.yaml").write_text("data:\n  data: synthetic\nmodel:\n  latent: 64\n")
    assert main(["predict", str(tmp_path), "synthetic"]) == 1
    told = capsys.readouterr().err
    assert "config.yaml is missing" in told and "samples is 0" in told and "before 0.2" in told and "Traceback" not in told
