"""The commands about a finished run: predict, export-bvh and loop."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from PIL import Image

import mwlib as mw
from mwlib.cli import main
from tests.body.sample import animators_motion
from tests.data.formats.test_glb_writing import opened, played
from tests.sample_settings import SMALL


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MWLIB_RUNS", str(folder))
        words = [f"--set={name}={value}" for name, value in {**SMALL, "train_steps": 2}.items()]
        assert main(["train", "--preset", "tiny", *words]) == 0
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


def test_export_bvh_goes_on_with_the_skeleton_of_the_file(run, tmp_path, capsys):
    clip = animators_motion(181, 60.0)
    mw.write_bvh(clip, tmp_path / "in" / "clip.bvh", unit="mm")
    assert main(["export-bvh", str(run), str(tmp_path / "in"), "--samples", "2", "--out", str(tmp_path / "out")]) == 0
    assert f"{tmp_path / 'out'}: 2 files with the skeleton and rate of their clips" in capsys.readouterr().out
    for made in mw.load_motions(tmp_path / "out"):
        assert (made.fps, made.skeleton, made.rig.channels) == (60.0, clip.skeleton, clip.rig.channels)
        assert made.rig.metres == 0.001 and len(made) == 115  # 1.9 s
        np.testing.assert_allclose(made.positions[:31], clip.positions[-31:], atol=1e-5)
    bodies = tmp_path / "bodies"
    words = ["--samples", "2", "--format", "glb", "--out", str(bodies)]
    assert main(["export-bvh", str(run), str(tmp_path / "in"), *words]) == 0
    for made in mw.load_motions(tmp_path / "out"):
        times, world = played(bodies / f"{made.name}.glb")
        names = [about["name"] for about in opened(bodies / f"{made.name}.glb")[0]["nodes"]]
        joints = [names.index(name) for name in made.skeleton.joints]
        np.testing.assert_allclose(world[:, joints][..., :3, 3], made.positions, atol=1e-5)


def test_loop_writes_a_moving_picture_that_says_what_it_is(run, tmp_path, capsys):
    out = tmp_path / "walk.webp"
    words = ["loop", str(run), "synthetic", "--samples", "2", "--width", "300", "--out", str(out)]
    assert main([*words, "--clip", "P2_walk", "--start", "5"]) == 0
    with Image.open(out) as image:
        assert image.is_animated and image.n_frames == 20 and image.info["loop"] == 0 and image.width <= 300
    assert "P2_walk (walk)" in out.with_suffix(".txt").read_text() and "20 pictures" in capsys.readouterr().out
    about = json.loads(out.with_suffix(".json").read_text())
    assert (about["clip"], about["start_frame"], about["samples"], about["seeds"]) == ("P2_walk", 5, 2, {"sampling": 0})
    film, has_ffmpeg = tmp_path / "walk.mp4", shutil.which("ffmpeg") is not None
    assert main([*words[:-1], str(film)]) == int(not has_ffmpeg) and film.exists() == has_ffmpeg
    assert has_ffmpeg or "there is no ffmpeg" in capsys.readouterr().err
    assert main([*words, "--clip", "nobody"]) == 1 and main([*words, "--start", "9999"]) == 1
    told = capsys.readouterr().err
    assert "clip is 'nobody'; synthetic has P1_walk" in told and "start is 9999; P1_walk has" in told


def test_mistakes_are_told(run, tmp_path, capsys):
    assert main(["predict", str(tmp_path), "synthetic"]) == 1
    assert main(["predict", str(run), "synthetic", "--samples", "0"]) == 1
    (tmp_path / "config.yaml").write_text("data:\n  data: synthetic\nmodel:\n  latent: 64\n")
    assert main(["predict", str(tmp_path), "synthetic"]) == 1
    told = capsys.readouterr().err
    assert "config.yaml is missing" in told and "samples is 0" in told and "before 0.2" in told and "Traceback" not in told


def test_a_run_that_samples_otherwise_says_so(run, monkeypatch, capsys):
    monkeypatch.setenv("MWLIB_RUNS", str(run.parent))
    words = [f"--set={name}={value}" for name, value in {**SMALL, "train_steps": 2}.items()]
    assert main(["train", "--preset", "tiny", *words, "--set=temperature=3"]) == 0
    said = capsys.readouterr()
    assert said.out == f"{run}\n" and "keeps the settings of sampling and testing that it had: temperature 1.0, not 3" in said.err
    assert main(["train", "--preset", "tiny", *words]) == 0 and "keeps" not in capsys.readouterr().err


def test_no_clip_is_lost_to_its_name(run, tmp_path, capsys):
    """Names of entries of the archive, of NumPy's own arguments, and names that meet once they are told apart."""
    clip = animators_motion(181, 60.0)
    for name in ("up", "file", "p1/take", "p1/take_4", "p2/take"):
        mw.write_bvh(clip, tmp_path / "in" / f"{name}.bvh")
    out = tmp_path / "futures.npz"
    assert main(["predict", str(run), str(tmp_path / "in"), "--samples", "1", "--out", str(out)]) == 0
    with np.load(out) as archive:
        clips = [name for name in archive.files if archive[name].ndim == 4]
        assert len(clips) == 5 == len({*clips} - {"up", "file"}) and str(archive["up"]) == "z"


def test_a_short_clip_does_not_stop_the_others(run, tmp_path, capsys):
    mw.write_bvh(animators_motion(181, 60.0), tmp_path / "in" / "long.bvh")
    mw.write_bvh(animators_motion(20, 60.0), tmp_path / "in" / "short.bvh")
    words = ["predict", str(run), str(tmp_path / "in"), "--out", str(tmp_path / "futures.npz")]
    with pytest.warns(UserWarning, match="1 of 2 clips are left out, shorter than the 6 frames that the model continues: short"):
        assert main(words) == 0
    assert "3 futures of 1 clips" in capsys.readouterr().out


def test_a_home_folder_is_meant_where_it_is_written(run, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["predict", str(run), "synthetic", "--clips", "1", "--out=~/futures.npz"]) == 0
    mw.write_bvh(animators_motion(20, 60.0), "~/clip.bvh")
    assert {file.name for file in tmp_path.iterdir()} == {"futures.npz", "clip.bvh"}
