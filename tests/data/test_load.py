"""load_motions: where sources are looked for, what a folder gives, what clips.csv adds, and the arguments."""

from __future__ import annotations

import lzma
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.body.skeleton import CMU, H36M17
from tests.sample_motions import AMC, ASF, BENCHMARK, BVH


@pytest.fixture
def folder(tmp_path) -> Path:
    """A little of everything, and things that are no motion."""
    for name, text in {
        "b/05.asf": ASF, "b/05_02.amc": AMC, "b/05_01.amc": AMC, "a/clip.bvh": BVH, "c/walking/walking_1.txt": BENCHMARK,
        "README.md": "# no motion", "c/notes.txt": "1, 2, 3", "a/LICENSE.txt": "words, words", "a/._clip.bvh": "resource fork",
    }.items():  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "clip.bvh.xz").write_bytes(lzma.compress(BVH.encode()))
    np.save(tmp_path / "d" / "mean.npy", np.zeros(7))
    np.savez(tmp_path / "d" / "poses.npz", poses=np.zeros(7))
    return tmp_path


def test_a_folder_is_read_whole_in_the_order_of_its_paths(folder):
    assert [m.name for m in load_motions(folder)] == ["clip", "05_01", "05_02", "walking_1", "clip"]


def test_relative_sources_are_looked_up_here_and_then_under_mwlib_data(folder, tmp_path_factory, monkeypatch):
    here = tmp_path_factory.mktemp("here")
    monkeypatch.chdir(here)
    monkeypatch.delenv("MWLIB_DATA", raising=False)
    monkeypatch.setattr("pooch.os_cache", lambda name: here / "cache" / name)
    with pytest.raises(
        FileNotFoundError, match=f"no motions at {here}/b nor {here}/cache/mwlib/b; MWLIB_DATA, .*, is not set; mwlib fetch lists"
    ):
        load_motions("b")
    monkeypatch.setenv("MWLIB_DATA", str(folder))
    assert len(load_motions("b")) == 2
    assert len(load_motions(Path("b/05_01.amc"))) == 1
    (here / "b").mkdir()
    (here / "b" / "one.bvh").write_text(BVH)
    assert [m.name for m in load_motions("b")] == ["one"]
    with pytest.raises(
        FileNotFoundError, match=f"no motions at {here}/e nor {folder}/e; mwlib fetch .*; expected a path, 'synthetic'"
    ):
        load_motions("e")


def test_a_folder_or_file_without_motions_is_refused(folder):
    (folder / "a" / "clip.bvh").unlink()
    with pytest.raises(MotionFormatError, match=r"a, folder: found 1 files without motions; expected at least one .*\.bvh"):
        load_motions(folder / "a")
    with pytest.raises(MotionFormatError, match="README.md.*expected a motion file"):
        load_motions(folder / "README.md")
    with pytest.raises(MotionFormatError, match="found a skeleton"):
        load_motions(folder / "b" / "05.asf")
    with pytest.raises(MotionFormatError, match="notes.txt, table: found 3 columns|notes.txt"):
        load_motions(folder / "c" / "notes.txt")


def test_clips_csv_knows_better_than_the_file(folder):
    assert (load_motions(folder / "a")[0].fps, load_motions(folder / "a")[0].action) == (120.0, "")
    (folder / "clips.csv").write_text("file,fps,subject,action\na/clip.bvh.xz,60,Ann,walk\nb/05_02.amc,,,run\n")
    (motion,) = load_motions(folder / "a" / "clip.bvh")
    assert (motion.fps, motion.subject, motion.action) == (60.0, "Ann", "walk")
    first, second = load_motions(folder / "b")
    assert (first.fps, first.subject, first.action) == (120.0, "5", "")
    assert (second.fps, second.subject, second.action) == (120.0, "5", "run")
    assert load_motions(folder / "d")[0].fps == 120.0  # another clip of the same name
    (folder / "clips.csv").write_text(f"file,fps,content\n{folder.name}/a/clip.bvh,25,bow\n")  # as seen from a folder above
    (motion,) = load_motions(folder / "a")
    assert (motion.fps, motion.action) == (25.0, "bow")
    assert len(load_motions(folder / "a", fps=50)[0]) == 5


@pytest.mark.parametrize("text", ["name,fps\na,1\n", "file,fps\na/clip.bvh,fast\n", "file,fps\na/clip.bvh,0\n", b"file\n\xff\n"])
def test_a_clips_csv_that_makes_no_sense_is_refused(folder, text):
    (folder / "clips.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(MotionFormatError, match="clips.csv"):
        load_motions(folder / "a")


def test_file_names_tell_subject_and_action_if_nothing_else_does(tmp_path):
    for name in ("walk4_subject2", "dataset-1_walk-left_normal_001", "07_11", "whatever"):
        (tmp_path / f"{name}.bvh").write_text(BVH)
    found = {m.name: (m.subject, m.action) for m in load_motions(tmp_path)}
    assert found == {
        "walk4_subject2": ("2", "walk"),
        "dataset-1_walk-left_normal_001": ("normal", "walk-left"),
        "07_11": ("7", ""),
        "whatever": ("", ""),
    }


def test_arguments_resample_carry_over_and_scale(folder):
    file = folder / "c" / "walking" / "walking_1.txt"
    (motion,) = load_motions(file)
    assert motion.skeleton == CMU
    (thin,) = load_motions(file, skeleton="H36M17", fps=60.0)
    assert (thin.skeleton, thin.fps, len(thin)) == (H36M17, 60.0, 1)
    assert load_motions(file, skeleton=H36M17)[0].positions.shape == (2, 17, 3)
    np.testing.assert_allclose(load_motions(file, unit="inch")[0].positions, motion.positions * 0.45, rtol=1e-6)
    np.testing.assert_allclose(load_motions(file, unit=0.0254)[0].positions, motion.positions * 0.45, rtol=1e-6)
    for arguments in ({"skeleton": "OWL9"}, {"unit": "ell"}, {"unit": -1.0}, {"unit": float("nan")}, {"fps": 0}, {"fps": -5.0}):
        with pytest.raises(ValueError, match=f"{next(iter(arguments))} is .*; expected"):
            load_motions(file, **arguments)
    with pytest.raises(ValueError, match="cannot carry"):
        load_motions(folder / "a", skeleton="H36M17")
    with pytest.raises(ValueError, match="fps is 1e\\+09; expected up to 10000"):
        load_motions(file, fps=1e9)


def test_synthetic_motions_and_presets_need_no_file():
    tiny = load_motions("tiny")
    assert {(m.skeleton.name, m.fps, m.up) for m in tiny} == {("H36M17", 25.0, "z")}


def test_a_folder_with_the_name_of_a_preset_is_not_passed_over(tmp_path, monkeypatch):
    (tmp_path / "tiny").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="'tiny' names a preset's data and .*for the latter say ./tiny"):
        load_motions("tiny")
    with pytest.raises(MotionFormatError, match="tiny, folder: found 0 files"):
        load_motions("./tiny")
