"""`mwlib inbetween` answers on the files' own skeleton: made ones, and real ones."""

from __future__ import annotations

import lzma
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mwlib as mw
from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import to_h36m17
from mwlib.cli import main
from mwlib.data.load import read_motion_file
from tests.body.sample import animators_motion, apart


def hierarchy(file: Path) -> tuple[str, np.ndarray]:
    """The words of a file's hierarchy, and its numbers."""
    opened = lzma.open(file, "rt") if file.suffix == ".xz" else file.open()
    with opened as stream:
        text = stream.read().partition("MOTION")[0]
    offsets = re.findall(r"OFFSET\s+(\S+)\s+(\S+)\s+(\S+)", text)
    return " ".join(re.sub(r"OFFSET\s+\S+\s+\S+\s+\S+", "OFFSET", text).split()).lower(), np.array(offsets, float)


def same_skeleton(one: Path, other: Path) -> None:
    """Names, tree and channels to the letter, offsets to the digits that are written."""
    (words, offsets), (other_words, other_offsets) = hierarchy(one), hierarchy(other)
    assert words == other_words
    np.testing.assert_allclose(offsets, other_offsets, atol=1e-6)


def walk(folder: Path, name: str, *, fps: float = 60.0, unit: str = "cm", seed: int = 0, turn: float = 0.0, **more) -> Path:
    motion = animators_motion(round(3 * fps) + 1, fps, seed, **more).turn(turn)
    mw.write_bvh(motion, folder / name, unit=unit)
    return folder / name


@pytest.mark.parametrize("unit, fps", [("cm", 60.0), ("m", 24.0), ("mm", 30.0)])
def test_a_made_file_comes_back_as_it_went_in(tmp_path, capsys, unit, fps):
    file = walk(tmp_path, "a.bvh", fps=fps, unit=unit)
    assert main(["inbetween", str(file), "--keyframes", "20", "50", "--samples", "2", "--out", str(tmp_path / "out")]) == 0
    (motion,), frames = mw.load_motions(file), [round(20 * fps / 30), round(50 * fps / 30)]
    for number in (1, 2):
        out = tmp_path / "out" / f"a_between_{number}.bvh"
        same_skeleton(file, out)
        (made,) = mw.load_motions(out)
        assert (made.fps, made.skeleton, len(made)) == (fps, motion.skeleton, frames[1] - frames[0] + 1)
        assert made.rig.metres == motion.rig.metres == {"cm": 0.01, "m": 1.0, "mm": 0.001}[unit]
        assert apart(made.rig.rotations[[0, -1]], motion.rig.rotations[frames]).max() < 1e-3
        np.testing.assert_allclose(made.positions[[0, -1]], motion.positions[frames], atol=1e-5)
    assert f"at {fps:g} Hz; skeleton as it was read" in capsys.readouterr().out


def test_a_file_whose_z_points_up_stays_so(tmp_path):
    mw.write_bvh(animators_motion(91), file := tmp_path / "z.bvh", up="z")
    words = ["inbetween", str(file), "--keyframes", "20", "50", "--samples", "1", "--up", "z", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    same_skeleton(file, tmp_path / "out/z_between_1.bvh")
    (made,), (motion,) = (mw.load_motions(f, up="z") for f in (tmp_path / "out/z_between_1.bvh", file))
    np.testing.assert_allclose(made.positions[0], motion.positions[20], atol=1e-5)


def test_two_files_are_joined_where_the_first_ends(tmp_path):
    one, other = walk(tmp_path, "a.bvh"), walk(tmp_path, "b.bvh", seed=1, turn=2.0)
    words = ["inbetween", str(one), str(other), "--between", "20", "--samples", "1", "--out", str(tmp_path)]
    assert main([*words, "--align", "--join"]) == 0
    same_skeleton(one, tmp_path / "a_between_1.bvh")
    (made,), (start,), (end,) = (mw.load_motions(file) for file in (tmp_path / "a_between_1.bvh", one, other))
    assert len(made) == len(start) + 41 + len(end)
    np.testing.assert_allclose(made.positions[: len(start)], start.positions, atol=1e-5)
    np.testing.assert_allclose(made.positions[-len(end), 0, [0, 2]], start.positions[-1, 0, [0, 2]], atol=1e-4)
    own = np.arange(len(made.rig.skeleton))[1:]
    assert apart(made.rig.rotations[-len(end) :][:, own], end.rig.rotations[:, own]).max() < 1e-3


def test_what_no_answer_can_be_given_to_is_refused(tmp_path, capsys):
    one, other = walk(tmp_path, "a.bvh"), walk(tmp_path, "b.bvh", size=1.1)
    out = ["--out", str(tmp_path / "out")]
    assert main(["inbetween", str(one), str(other), *out]) == 1
    assert "start and end are of different bodies: from " in capsys.readouterr().err
    motion = animators_motion(10, 60.0)
    far = replace(motion.rig, root=motion.rig.root + [30, 0, 0])
    mw.write_bvh(replace(motion, positions=far.positions().astype(np.float32), rig=far), tmp_path / "far.bvh")
    assert main(["inbetween", str(one), str(tmp_path / "far.bvh"), "--between", "30", *out]) == 1
    told = capsys.readouterr().err
    assert re.search(r"needs \d+(\.\d+)? m/s; expected at most 12 m/s", told) and "align" in told
    assert main(["inbetween", str(one), str(tmp_path / "far.bvh"), "--between", "30", "--align", "--samples", "1", *out]) == 0
    assert main(["inbetween", str(one), "--keyframes", "20", "50", "--align", *out]) == 1
    assert "expected two files" in capsys.readouterr().err
    text = one.read_text().splitlines()
    text[-40] = "nan " + text[-40].partition(" ")[2]
    (tmp_path / "nan.bvh").write_text("\n".join(text))
    assert main(["inbetween", str(tmp_path / "nan.bvh"), "--keyframes", "20", "50", *out]) == 1
    assert "nan" in capsys.readouterr().err and not list((tmp_path / "out").glob("nan*"))


REAL = {
    "lafan1/walk4_subject1.bvh.xz": 2.0, "lafan1/dance1_subject2.bvh.xz": 2.0, "cmu/bvh/01_01.bvh.xz": 2.0,
    "cmu/bvh/94_06.bvh.xz": 3.0, "bandai_namco/dataset-1_walk_normal_001.bvh.xz": 1.5,
}  # fmt: skip


@pytest.mark.parametrize("name, centimetres", REAL.items())
def test_a_real_file_comes_back_as_it_went_in(data_folder, tmp_path, name, centimetres):
    """The fitted joints are on average within a few centimetres of the model's: its trunk is not the file's."""
    file = data_folder / name
    motion = read_motion_file(file)[0]
    keys = [10, 40]
    assert main(["inbetween", str(file), "--keyframes", *map(str, keys), "--samples", "1", "--out", str(tmp_path)]) == 0
    (out,) = tmp_path.iterdir()
    same_skeleton(file, out)
    (made,), step = mw.load_motions(out, unit=motion.rig.metres), motion.fps / 30
    frames = [round(n * step) for n in keys]
    assert made.fps == motion.fps and len(made) == frames[1] - frames[0] + 1
    assert apart(made.rig.rotations[[0, -1]], motion.rig.rotations[frames]).max() < 0.1
    assert np.abs(made.rig.world()[0][[0, -1]] - motion.rig.world()[0][frames]).max() < 1e-4
    lengths = [bone_lengths(m.rig.world()[0], m.rig.skeleton) for m in (made, motion.cut(0, 1))]
    if motion.rig.points[0]:  # the way from a joint on the floor to the hips is no bone
        lengths = [found[:, 1:] for found in lengths]
    np.testing.assert_allclose(lengths[0], np.tile(lengths[1], (len(made), 1)), atol=1e-3)
    (model,) = mw.inbetween(motion, keys)
    shown = made.positions[:: round(step)][:, to_h36m17(motion.skeleton)]
    away = np.linalg.norm(shown - model.with_up("y").positions, axis=-1)
    assert 100 * away.mean() < centimetres and away[[0, -1]].max() < 1e-4
