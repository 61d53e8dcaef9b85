"""ASF/AMC: forward kinematics against an independent one, which skeleton is taken, and files that are no good."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mwlib import MotionFormatError, load_motions
from tests.sample_motions import AMC, ASF

INCHES = 0.0254 / 0.45


def read(folder: Path, amc: str | bytes = AMC, asf: str | bytes = ASF, name: str = "05_01.amc", **arguments: object):
    for file, text in ((folder / "05.asf", asf), (folder / name, amc)):
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
    (motion,) = load_motions(folder / name, **arguments)
    return motion


def turn(x=0.0, y=0.0, z=0.0) -> np.ndarray:
    """Rz Ry Rx, degrees."""
    return Rotation.from_euler("xyz", [x, y, z], degrees=True).as_matrix()


def test_bones_end_where_a_calculation_by_hand_puts_them(tmp_path):
    motion = read(tmp_path)
    root, axis, arm_axis = turn(10, 20, 30), turn(10, 20, 30), turn(-90, 0, 20)
    start = np.array([1, 17, 2])
    top = start + root @ [0, 10, 0]
    expected = {
        "root": start,
        "lleg": start + root @ axis @ turn(1, 2, 3) @ axis.T @ [0, -16, 0],
        "rleg": start + root @ turn(4, 0, 5) @ [9.6, -12.8, 0],
        "chest": top,
        "larm": top + root @ arm_axis @ turn(0, -6, 0) @ arm_axis.T @ [15, 0, 0],
    }
    assert set(motion.skeleton.joints) == set(expected)
    for name, place in expected.items():
        found = motion.positions[0, motion.skeleton.joints.index(name)]
        np.testing.assert_allclose(found, np.asarray(place) * INCHES, atol=1e-6, err_msg=name)
    assert (len(motion), motion.fps, motion.up, motion.subject, motion.name) == (2, 120.0, "y", "5", "05_01")


def test_what_is_stated_about_the_root_and_the_angles_is_obeyed(tmp_path):
    expected = read(tmp_path).positions
    shifted = read(tmp_path, asf=ASF.replace("position 0 0 0", "position 0 3 0")).positions
    np.testing.assert_allclose(shifted, expected + [0, 3 * INCHES, 0], atol=1e-6)
    ordered = read(
        tmp_path,
        AMC.replace("1 17 2 10 20 30", "30 20 10 2 17 1").replace("1.5 17.1 2 11 21 31", "31 21 11 2 17.1 1.5"),
        ASF.replace("TX TY TZ RX RY RZ", "RZ RY RX TZ TY TX"),
    )
    np.testing.assert_allclose(ordered.positions, expected, atol=1e-6)
    orientation = turn(40, 50, 60)
    tilted = read(tmp_path, asf=ASF.replace("orientation 0 0 0", "orientation 40 50 60")).positions
    chest = np.array([1, 17, 2]) + orientation @ turn(10, 20, 30) @ orientation.T @ [0, 10, 0]
    np.testing.assert_allclose(tilted[0, 3], chest * INCHES, atol=1e-6)
    head, frames = AMC.split(":DEGREES")
    words = [line.split() for line in frames.strip().split("\n")]
    for line in words:
        moves = 4 if line[0] == "root" else 1
        line[moves:] = [str(np.deg2rad(float(w))) for w in line[moves:]]
    radians = head + ":RADIANS\n" + "\n".join(map(" ".join, words))
    np.testing.assert_allclose(read(tmp_path, radians).positions, expected, atol=1e-6)


def test_line_ends_and_packing_do_not_matter(tmp_path):
    expected = read(tmp_path).positions
    found = read(tmp_path, AMC.replace("\n", "\r\n"), ASF.replace("\n", "\r\n")).positions
    np.testing.assert_array_equal(found, expected)


def test_the_unit_is_the_files_own_unless_given(tmp_path):
    expected = read(tmp_path).positions
    np.testing.assert_allclose(read(tmp_path, asf=ASF.replace("length 0.45", "length 0.9")).positions, expected / 2, rtol=1e-6)
    np.testing.assert_allclose(read(tmp_path, unit=1.0).positions, expected / INCHES, rtol=1e-6)
    np.testing.assert_allclose(read(tmp_path, asf=ASF.replace("  length 0.45\n", "")).positions, expected, rtol=1e-6)


def test_the_skeleton_is_the_subjects_or_the_only_one(tmp_path):
    read(tmp_path)
    (tmp_path / "06.asf").write_text(ASF.replace("length 16", "length 17"))
    assert read(tmp_path).positions.shape == (2, 5, 3)
    with pytest.raises(MotionFormatError, match="05.asf, 06.asf"):
        read(tmp_path, name="walk.amc")
    (tmp_path / "05.asf").unlink()
    (tmp_path / "06.asf").unlink()
    with pytest.raises(MotionFormatError, match="no .asf file"):
        load_motions(tmp_path / "05_01.amc")
