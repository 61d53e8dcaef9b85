"""Blender sees the joints that are in our BVH and GLB files. `make test-blender` runs this, else it is passed over.

MWLIB_BLENDER is a Python that has bpy. It is no dependency: a gigabyte, and it wants a NumPy of its own.
"""

from __future__ import annotations

import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mwlib.body.fitting import fit_rig
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.formats.bvh import write_bvh
from mwlib.data.formats.glb_writing import write_glb
from mwlib.data.load import load_motions, motion_files, read_motion_file
from mwlib.experiments import inbetween
from mwlib.synthetic.motions import synthetic_motions

LOOK = Path(__file__).with_name("look.py")
pytestmark = pytest.mark.skipif("MWLIB_BLENDER" not in os.environ, reason="make test-blender runs it")


def look(file: Path, picture: Path | None = None):
    """What Blender has after importing a file: positions (metres, y up), names and rate."""
    out = file.with_suffix(".npz")
    command = [os.environ["MWLIB_BLENDER"], str(LOOK), str(file), str(out), *([str(picture)] if picture else [])]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    seen = np.load(out)
    return seen["positions"], list(seen["names"]), float(seen["fps"]), seen["heights"]


def agrees(motion: Motion, folder: Path, picture: Path | None = None) -> None:
    """Write, let Blender read, compare joint by joint with our own reader."""
    write_bvh(motion, folder / "a.bvh")
    (ours,) = load_motions(folder / "a.bvh", unit="cm")
    positions, names, fps, _ = look(folder / "a.bvh", picture)
    rig = ours.rig
    moving = [joint for joint, channels in enumerate(rig.channels) if channels is not None]
    at = [names.index(rig.skeleton.joints[joint].replace(" ", "_")) for joint in moving]
    assert len(names) == len(moving) and len(positions) == len(ours) and fps == pytest.approx(motion.fps, rel=1e-6)
    np.testing.assert_allclose(positions[:, at], rig.world()[0][:, moving], atol=1e-5)  # Blender: single precision, in cm


def test_a_synthetic_motion_without_rotations(tmp_path):
    picture = tmp_path / "a.png"
    agrees(synthetic_motions(subjects=1, seconds=1.0)[0], tmp_path, picture)
    ink = (np.asarray(Image.open(picture).convert("L")) < 250).mean()
    assert 0.01 < ink < 0.3


def test_names_with_spaces_and_another_rate(tmp_path):
    skeleton = Skeleton("chain", ("the root", "left upper arm", "left fore arm"), (-1, 0, 1))
    turn = np.linspace(0, 3, 20)
    arm = 0.6 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    positions = np.stack([0 * arm + [0, 1, 0], 0 * arm + [0, 1.6, 0], arm + [0, 1.6, 0]], axis=1)
    motion = Motion(positions, 60.0, skeleton, up="y")
    agrees(Motion(positions, 60.0, skeleton, up="y", rig=fit_rig(motion).rig), tmp_path)


@pytest.mark.parametrize("folder", ["lafan1", "cmu/asfamc", "cmu/bvh", "bandai_namco"])
def test_real_motions(tmp_path, data_folder, folder):
    (motion,) = read_motion_file(motion_files(data_folder / folder)[0])
    agrees(motion.cut(0, min(60, len(motion))), tmp_path)
    if motion.skeleton == LAFAN1:
        agrees(motion.turn(1.0).mirror().cut(100, 130).with_up("z"), tmp_path)


def test_an_in_between(tmp_path):
    walk = load_motions("synthetic", fps=30)[0]
    picture = tmp_path / "between.png"
    (motion,) = inbetween(walk.cut(0, 1), walk.cut(31, 32), frames=30)
    agrees(motion, tmp_path, picture)
    heights = np.ptp(look(tmp_path / "a.bvh")[0][..., 1], axis=1)
    assert 1.0 < heights.min() < heights.max() < 2.5, "a person is as tall as one, in Blender's units"
    assert 0.01 < (np.asarray(Image.open(picture).convert("L")) < 250).mean() < 0.3


@pytest.mark.parametrize("fps", [25.0, 60.0])
def test_a_body_in_a_glb(tmp_path, fps):
    walk = replace(synthetic_motions(subjects=1, seconds=1.0)[0].with_up("y"), fps=fps)
    write_glb(walk, tmp_path / "a.glb")
    positions, names, seen, heights = look(tmp_path / "a.glb")
    assert len(positions) == len(walk) and seen == pytest.approx(fps, rel=1e-6)
    at = [names.index(joint) for joint in walk.skeleton.joints]
    np.testing.assert_allclose(positions[:, at], walk.positions, atol=1e-4)
    tips = walk.positions[..., 1]
    assert np.abs(heights - np.stack([tips.min(1), tips.max(1)], axis=1)).max() < 0.2, "the body follows its skeleton"
