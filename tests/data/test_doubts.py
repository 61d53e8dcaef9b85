"""What is doubted until somebody states it: the axis of nameless bodies, CMU's rate, and jumps at the beginning."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mwlib import Motion, MotionFormatError, load_motions, write_bvh
from mwlib.body.skeleton import SCHEMES
from mwlib.cli import main
from mwlib.data.check import check_data
from mwlib.data.doubts import misnamed, other_axis, recorded_slower, unsettled
from mwlib.data.load import readings
from mwlib.data.meaning import Reading, Stated
from mwlib.data.untrusted import DoubtfulDataWarning
from mwlib.synthetic.motions import synthetic_motions

WALK = synthetic_motions(subjects=1, seconds=2.0)[0]
NAMELESS = replace(WALK.skeleton, joints=tuple(f"b{i}" for i in range(17)), name="b", left=(), right=(), parts={})


def arms_out(motion: Motion, axis: int) -> Motion:
    """The same with straight arms along an axis, which makes the body as wide as it is tall."""
    places, s = motion.positions.copy(), motion.skeleton
    for side, arm in ((1, s.parts["left_arm"]), (-1, s.parts["right_arm"])):
        for n, joint in enumerate(arm):
            places[:, joint] = places[:, 8] + np.eye(3)[axis] * side * (0.2 + 0.33 * n)
    return replace(motion, positions=places)


def nameless(motion: Motion, said_up: str, source: str = "the format") -> Reading:
    """A clip of nameless joints as a reader gives it that took an axis for up."""
    body = replace(motion, skeleton=NAMELESS, up=said_up, rig=None)
    return Reading(body, Stated(1.0, "m"), Stated(said_up, source), Stated(50.0, ""))


@pytest.mark.parametrize("pose", [WALK, arms_out(WALK, 0), arms_out(WALK, 1)], ids=["walk", "arms to the sides", "arms ahead"])
def test_nameless_bodies_are_doubted_along_another_axis_whatever_the_arms_do(pose):
    for up, other in (("z", "y"), ("y", "z")):
        stands = pose.with_up(up)
        assert other_axis(nameless(stands, other)) == up
        assert other_axis(nameless(stands, up)) == ""
        assert other_axis(nameless(stands, other, "clips.csv")) == "", "stated"
        named = nameless(stands, other)
        assert other_axis(replace(named, motion=replace(named.motion, skeleton=WALK.skeleton))) == "", "names tell"
    assert other_axis(nameless(replace(pose, positions=-pose.positions), "y")) == "-z"


def test_a_body_without_limbs_is_doubted_by_its_extent():
    flat = np.random.default_rng(0).normal(size=(20, 17, 3)) * [1, 0.3, 1]
    assert other_axis(nameless(replace(WALK, positions=flat), "y")) == "z"
    assert other_axis(nameless(replace(WALK, positions=flat), "z")) == ""


def test_a_nameless_z_up_bvh_is_read_with_a_warning_and_found_by_check_data(tmp_path, capsys):
    clip = replace(arms_out(WALK, 0), skeleton=NAMELESS, rig=None)
    write_bvh(replace(clip, up="y"), tmp_path / "a.bvh")  # as a program with z up would write it
    told = r"stands along z, and y up was assumed, as the format has it: a.bvh; say up=z \(of load_motions, .* column up"
    for source in (tmp_path / "a.bvh", tmp_path):
        with pytest.warns(DoubtfulDataWarning, match=told + r" in clips.csv.*\); if somebody lies there, up=y"):
            load_motions(source)
    assert main(["check-data", str(tmp_path)]) == 1
    assert re.search(told, capsys.readouterr().out.split("looks wrong:")[1])
    for up in "zy":
        assert main(["check-data", str(tmp_path), "--up", up]) == 0
        assert load_motions(tmp_path, up=up)[0].up == up
    (tmp_path / "clips.csv").write_text("file,up\na.bvh,z\n")
    assert load_motions(tmp_path)[0].up == "z"


def cgspeed(fingers: float = 0.0) -> str:
    """A BVH as cgspeed made them: CMU's tree, a T-pose in row 0 that jumps into the motion, 120 Hz."""
    above = SCHEMES[2].above
    below: dict[str, list[str]] = {}
    for child, parent in above.items():
        below.setdefault(parent, []).append(child)
    order: list[str] = []

    def node(name: str, word: str) -> str:
        order.append(name)
        side = {"l": 1, "r": -1}.get(name[0], 0) * (name[1].isupper())
        is_leg, is_arm = name[1:] in ("Thigh", "Shin", "Foot"), name[1:] in ("Shldr", "ForeArm", "Hand")
        offset = (0, -40, 0) if is_leg else (24 * side, 0, 0) if is_arm else (18 * side, 0, 0) if side else (0, 14, 0)
        channels = "6 Xposition Yposition Zposition " if word == "ROOT" else "3 "
        inner = "".join(node(child, "JOINT") for child in below.get(name, ()))
        inner = inner or "End Site\n{\nOFFSET 0 4 0\n}\n"
        place = " ".join(map(str, offset))
        return f"{word} {name}\n{{\nOFFSET {place}\nCHANNELS {channels}Zrotation Yrotation Xrotation\n{inner}}}\n"

    head = node("hip", "ROOT")
    rows = np.zeros((80, 3 + 3 * len(order)))
    rows[:, 1], rows[1:, 3] = 90, 1.0
    turns = 30 + 20 * np.sin(np.arange(80) / 12)
    for name, sign in (("lShldr", -1), ("rShldr", 1)):
        rows[1:, 3 + 3 * order.index(name)] = sign * turns[1:]
    rows[1, 3 + 3 * order.index("lForeArm")] = fingers
    table = "\n".join(" ".join(f"{value:g}" for value in row) for row in rows)
    return f"HIERARCHY\n{head}MOTION\nFrames: 80\nFrame Time: .0083333\n{table}\n"


def test_the_rate_of_trials_that_cmu_recorded_at_60_hz_is_doubted(tmp_path, capsys):
    (tmp_path / "60_01.bvh").write_text(cgspeed())
    (found,) = readings(tmp_path / "60_01.bvh")
    for name in ("60_01", "060_1", "136_19", "136_18", "07_01", "60_01b", "salsa"):
        said = recorded_slower(replace(found, motion=replace(found.motion, name=name)))
        assert said == ("120 Hz" if name in ("60_01", "060_1", "136_19") else ""), name
    told = "CMU recorded them at 60 Hz, and their files say otherwise: 60_01.bvh (120 Hz); say fps 60 in clips.csv"
    with pytest.warns(DoubtfulDataWarning, match=f"^{re.escape(told)}, or file_fps=60$"):
        assert load_motions(tmp_path)[0].fps == 120.0
    assert main(["check-data", str(tmp_path)]) == 1 and told in capsys.readouterr().out
    for rate in ("60", "120"):
        assert main(["check-data", str(tmp_path), "--file-fps", rate]) == 0
    (tmp_path / "clips.csv").write_text("file,fps\n60_01.bvh,60\n")
    assert load_motions(tmp_path)[0].fps == 60.0
    (tmp_path / "60_01.bvh").rename(tmp_path / "07_01.bvh")
    (tmp_path / "clips.csv").unlink()
    assert main(["check-data", str(tmp_path)]) == 0 and load_motions(tmp_path)[0].fps == 120.0


def test_an_added_t_pose_is_left_out_told_and_kept_on_request(tmp_path):
    (tmp_path / "07_01.bvh").write_text(cgspeed())
    (found,) = readings(tmp_path / "07_01.bvh")
    assert (len(found.motion), found.first.value) == (79, 1)
    told = "T-pose    row 0 of 07_01.bvh is an added T-pose and left out; first_frame 0 in clips.csv keeps it"
    assert told in check_data(tmp_path).report
    for first in (0, 1, 7, 79):
        (tmp_path / "clips.csv").write_text(f"file,first_frame,frames\n07_01.bvh,{first},80\n")
        (cut,) = readings(tmp_path / "07_01.bvh")
        assert (len(cut.motion), cut.first.value, cut.first.source) == (80 - first, first, "clips.csv")
        np.testing.assert_array_equal(cut.motion.positions[-1], found.motion.positions[-1])
        report = check_data(tmp_path).report
        assert "T-pose" not in report and "frames as clips.csv says in 1 of 1 clips" in report


@pytest.mark.parametrize(("first", "message"), [
    ("80", "07_01.bvh, first_frame: found 80 in clips.csv; expected a row of the file, 0 to 79"),
    ("-1", "row of 07_01.bvh: found first_frame '-1'; expected a row of the file, from 0"),
    ("one", "row of 07_01.bvh: found first_frame 'one'"),
])  # fmt: skip
def test_a_first_frame_that_is_no_row_is_refused(tmp_path, first, message):
    (tmp_path / "07_01.bvh").write_text(cgspeed())
    (tmp_path / "clips.csv").write_text(f"file,first_frame\n07_01.bvh,{first}\n")
    with pytest.raises(MotionFormatError, match=re.escape(message)):
        load_motions(tmp_path)


def test_a_jump_at_the_beginning_is_named_with_its_row_and_cut_on_request(tmp_path):
    (tmp_path / "a.bvh").write_text(cgspeed(fingers=60.0))
    said = "they begin with a jump, as after an added T-pose: a.bvh (from row 1, to row 2: first_frame 2); such a column"
    assert said in check_data(tmp_path).report
    (tmp_path / "clips.csv").write_text("file,first_frame\na.bvh,0\n")
    assert "begin with a jump" not in check_data(tmp_path).report, "whoever keeps it has seen it"
    (tmp_path / "clips.csv").write_text("file,first_frame\na.bvh,2\n")
    assert "begin with a jump" not in check_data(tmp_path).report
    assert unsettled(load_motions(tmp_path)[0]) == 0
    turned = cgspeed().replace("\n0 90 0 0 ", "\n0 90 0 0.5 ", 1)  # no T-pose by the letter: its root is turned
    (tmp_path / "a.bvh").write_text(turned)
    (tmp_path / "clips.csv").unlink()
    assert "a.bvh (from row 0, which is the rest pose, to row 1: first_frame 1)" in check_data(tmp_path).report


def test_glitches_are_named_with_row_and_joint(tmp_path):
    places = WALK.positions.copy()
    places[70:, 16] += 1.0
    np.savez(tmp_path / "a.npz", positions=places, fps=50.0, skeleton="H36M17", up="z", unit="m")
    told = r"perhaps glitches: a.npz \(8\d m/s, right_wrist in row 70\). The column first_frame"
    assert re.search(told, check_data(tmp_path).report)


def test_the_unit_that_would_make_an_adult_is_named_beside_the_stated_one(tmp_path):
    np.savez(tmp_path / "a.npz", positions=WALK.positions / 0.0254 * 0.45, fps=50.0, skeleton="H36M17", up="z", unit="inch")
    assert re.search(r"no adult's height: a.npz \(0.\d+ m, 1.\d+ m in cmu\)", check_data(tmp_path).report)


def test_files_of_cgspeed_are_doubted_as_they_were_found(data_folder, tmp_path):
    for name in ("60_01", "10_01", "01_01"):  # alone, without the table beside the originals
        shutil.copy(data_folder / "cmu" / "bvh" / f"{name}.bvh.xz", tmp_path)
    check = check_data(tmp_path)
    assert not check.is_whole and "at 60 Hz, and their files say otherwise: 60_01.bvh.xz (120 Hz)" in check.report
    assert ", ".join(f"{n}_01.bvh.xz (from row 1, to row 4: first_frame 4)" for n in (10, 60)) + ";" in check.report
    assert "10_01.bvh.xz (28 m/s, lMid2 in row 2)" in check.report


def test_none_of_the_real_clips_is_doubted(data_folder):
    for source in ("lafan1", "bandai_namco", "cmu/bvh"):
        file = next(file for file in sorted(Path(data_folder / source).rglob("*.bvh.xz")))
        (found,) = readings(file)
        skeleton = replace(found.motion.skeleton, joints=tuple(f"b{i}" for i in range(len(found.motion.skeleton))), h36m17=())
        assert other_axis(replace(found, motion=replace(found.motion, skeleton=skeleton, rig=None))) == ""
        assert found.first.value or not unsettled(found.motion)


OTHER_ORDERS = {
    "names in reverse": ({"joints": WALK.skeleton.joints[::-1]}, slice(None), 1, r"bones to left_\w+ and right_\w+ are 0\.\d"),
    "columns in reverse": ({}, slice(None, None, -1), 1, r"bones to left_\w+ and right_\w+ are [\d.]+ and [\d.]+ m long"),
    "left for right": ({}, WALK.skeleton.mirror, 1, "knees bend backwards"),
    "left-handed axes": ({}, slice(None), [-1, 1, 1], "knees bend backwards"),
    "upside down": ({}, slice(None), [-1, 1, -1], "the head is below the feet along z, which skeleton.json says is up"),
}


@pytest.mark.parametrize("said, order, signs, reason", OTHER_ORDERS.values(), ids=OTHER_ORDERS)
def test_joints_with_names_of_others_are_doubted(tmp_path, capsys, said, order, signs, reason):
    about = {"name": "mine", "joints": WALK.skeleton.joints, "parents": WALK.skeleton.parents, "fps": 50, "unit": "m", "up": "z"}
    (tmp_path / "skeleton.json").write_text(json.dumps(about | said))
    np.save(tmp_path / "a.npy", WALK.positions[:, order] * signs)
    told = rf"^joints likely have each other's names: a.npy \({reason}.*\); expected joint n"
    with pytest.warns(DoubtfulDataWarning, match=told):
        load_motions(tmp_path)
    assert main(["check-data", str(tmp_path)]) == 1 and "each other's names" in capsys.readouterr().out
    (tmp_path / "skeleton.json").write_text(json.dumps(about))
    np.save(tmp_path / "a.npy", WALK.positions)
    load_motions(tmp_path)
    assert main(["check-data", str(tmp_path)]) == 0


def test_sides_of_other_lengths_are_doubted():
    places = WALK.positions.copy()
    for joint in WALK.skeleton.parts["left_arm"][1:]:  # a forearm for a hand, as where names are one too far
        places[:, joint] += 2 * (places[:, joint] - places[:, WALK.skeleton.parents[joint]])
    reading = Reading(replace(WALK, positions=places, rig=None), Stated(1.0, ""), Stated("z", ""), Stated(50.0, ""))
    assert re.fullmatch(r"bones to left_\w+ and right_\w+ are 0\.\d+ and 0\.\d+ m long", misnamed(reading))
    assert misnamed(replace(reading, motion=WALK)) == ""
