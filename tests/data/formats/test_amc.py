"""ASF/AMC: forward kinematics against an independent one, which skeleton is taken, and files that are no good."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mwlib import MotionFormatError, load_motions
from tests.sample_motions import AMC, ASF, mutate

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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("larm -6\n", "", "frame 1: found no larm"),
        ("larm -6\n", "larm -6 7\n", "larm with 2 numbers; expected 1"),
        ("larm -6\n", "tail -6\n", "tail with 1 numbers"),
        ("larm -6\n", "lleg 1 2 3\n", "again"),
        ("larm -6\n", "larm nan\n", "finite"),
        ("larm -6.5e-1\n", "", "not a multiple"),
        ("larm -6.5e-1\n", "barm -6.5e-1\n", "line of larm: found 'barm'"),
        ("larm -6.5e-1\n", "larm x\n", "larm ry"),
        ("larm -6.5e-1\n", "larm 1e300\n", "finite number up to"),
        ("\n2\nroot", "\n3\nroot", "after frame 1: found frame 3"),
        ("\n2\nroot", "\nroot", "frame 1: found root with 6 numbers again"),
        (AMC.split(":DEGREES")[1], "", "no frame"),
        (AMC, "", "no frame"),
    ],
)
def test_a_spoilt_amc_is_refused_by_name_and_place(tmp_path, old, new, message):
    assert old in AMC
    with pytest.raises(MotionFormatError, match=message) as caught:
        read(tmp_path, AMC.replace(old, new, 1))
    assert "05_01.amc" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name rleg", "name lleg", "bone lleg: found it twice"),
        ("name rleg", "name root", "bone root"),
        ("     name rleg\n", "", "no name"),
        ("direction 0.6 -0.8 0", "direction 0.6 -0.8", "2 words; expected three"),
        ("direction 0.6 -0.8 0", "direction 6 -8 0", "unit vector"),
        ("length 10", "length -10", "expected 0 or more"),
        ("length 10", "length inf", "'inf'"),
        ("length 0.45", "length 0", "0.001 to 1000"),
        ("angle deg", "angle turns", "deg or rad"),
        ("-90 0 20 XYZ", "-90 0 20 ZYX", "'ZYX'; expected XYZ"),
        ("dof ry", "dof ry ry", "different ones"),
        ("dof ry", "dof rx ry", "larm with 1 numbers; expected 2"),
        ("dof ry", "dof tx", "different ones of rx"),
        ("order TX TY TZ", "order TX TY TY", "tx ty ty"),
        ("    chest larm\n", "", "larm does not hang"),
        ("    chest larm\n", "    chest larm\n    lleg larm\n", "larm under lleg"),
        ("    chest larm\n", "    larm larm\n", "larm does not hang"),
        ("    chest larm\n", "    chest tail\n", "tail under chest"),
        (":hierarchy", ":bonedata", "this section twice"),
        ("  begin\n     id 2", "     id 2", "begin to end"),
        (ASF, "", "0 whole bones"),
    ],
)
def test_a_spoilt_asf_is_refused_by_name_and_place(tmp_path, old, new, message):
    assert old in ASF
    with pytest.raises(MotionFormatError, match=message):
        read(tmp_path, asf=ASF.replace(old, new, 1))


@pytest.mark.parametrize("which", ["amc", "asf"])
def test_no_injury_gets_past_the_reader(tmp_path, which):
    rng = random.Random(1)
    outcomes = set()
    for _ in range(800):
        texts = {"amc": AMC.encode(), "asf": ASF.encode()}
        texts[which] = mutate(texts[which], rng)
        try:
            motion = read(tmp_path, **texts)
        except MotionFormatError:
            outcomes.add("refused")
        else:
            outcomes.add("read")
            assert np.isfinite(motion.positions).all()
    assert outcomes == {"refused", "read"}
