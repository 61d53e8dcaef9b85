"""Poses of SMPL's bodies: joints by a second way and as the package smplx has them, what is refused, and nothing unpickled."""

from __future__ import annotations

import json
import os
import pickle
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mwlib as mw
from mwlib import MotionFormatError, load_motions
from mwlib.body.skeleton import H36M17, HUMANML22
from mwlib.data.check import check_data
from mwlib.data.sources import data_fingerprint
from mwlib.data.untrusted import BrokenFilesWarning
from tests.data.formats.sample_smpl import model, parents, poses, write_model
from tests.sample_motions import BVH

# Head, left foot and right wrist in the last frame of each sample, metres: smplx 0.1.28 on the same model and poses.
BY_SMPLX = {
    "smpl": [[0.714577, 1.477512, 0.383145], [1.07884, 0.629918, -0.667452], [0.488429, 1.853863, -0.009524]],
    "smplh": [[0.718379, 1.379687, 0.446916], [0.845445, 1.706516, -0.740841], [0.822776, 1.629708, -0.194977]],
    "smplx": [[1.135443, 0.902823, 0.40866], [0.744976, 1.664307, -0.616397], [0.426866, 0.988853, 0.220956]],
}
FAMILIES = ("smpl", "smplh", "smplx")


@pytest.fixture(autouse=True)
def no_other_models(tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path / "data"))


def read(folder, family="smplh", name="clip", **entries):
    """A clip of a family, with other entries (None: without), and how it is read."""
    arrays = {key: value for key, value in (poses(family) | entries).items() if value is not None}
    np.savez(folder / f"{name}.npz", **arrays)
    (motion,) = load_motions(folder / f"{name}.npz")
    return motion


def by_hand(family, clip, betas):
    """Joints of a clip, one frame and one joint after the other, each turn a matrix about the joint's own place."""
    body, tree = model(family), parents(family)
    rest = body["J_regressor"] @ (body["v_template"] + body["shapedirs"][..., : len(betas)] @ betas)
    found = np.zeros((len(clip["trans"]), len(tree), 3))
    for frame, (vectors, way) in enumerate(zip(clip["poses"], clip["trans"], strict=True)):
        world = [np.eye(4)] * len(tree)
        for joint, parent in enumerate(tree):
            local = np.eye(4)
            local[:3, :3] = Rotation.from_rotvec(vectors[3 * joint : 3 * joint + 3]).as_matrix()
            local[:3, 3] = rest[joint] - rest[parent] if joint else rest[0]
            world[joint] = world[parent] @ local if joint else local
            found[frame, joint] = world[joint][:3, 3] + way
    return found


@pytest.mark.parametrize("family", FAMILIES)
def test_joints_of_amass(tmp_path, family):
    write_model(tmp_path / "body_models", family)
    motion, clip = read(tmp_path, family), poses(family)
    expected = by_hand(family, clip, clip["betas"])
    np.testing.assert_allclose(motion.positions, expected[:, :22], atol=1e-6)
    np.testing.assert_allclose(motion.rig.world()[0], expected, atol=1e-6)
    np.testing.assert_allclose(motion.positions[-1, [15, 10, 21]], BY_SMPLX[family], atol=2e-6)
    assert (motion.skeleton, motion.fps, motion.up, motion.subject) == (HUMANML22, 120.0, "z", tmp_path.name)
    assert motion.retarget(H36M17).positions.shape == (40, 17, 3)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_body_comes_back_from_bvh_with_all_its_rotations(tmp_path, family):
    write_model(tmp_path / "body_models", family)
    motion = read(tmp_path, family).cut(0, 8)
    mw.write_bvh(motion, tmp_path / "out.bvh", unit=motion.rig.metres)
    (back,) = load_motions(tmp_path / "out.bvh")
    order = [motion.rig.skeleton.joints.index(name) for name in back.skeleton.joints]
    np.testing.assert_allclose(back.with_up("z").positions, motion.rig.world()[0][:, order], atol=1e-5)
    np.testing.assert_allclose(back.with_up("z").retarget(H36M17).positions, motion.retarget(H36M17).positions, atol=1e-5)


@pytest.mark.parametrize("kind", ["root_orient and pose_body", "global_orient and body_pose, each a vector a joint"])
def test_parts_of_a_pose(tmp_path, kind):
    write_model(tmp_path / "body_models", "smplx")
    whole = poses("smplx")
    turns = whole["poses"].reshape(40, 55, 3)
    parts = {"root_orient": turns[:, 0], "pose_body": turns[:, 1:22].reshape(40, -1), "pose_jaw": turns[:, 22]}
    if kind.startswith("global"):
        parts = {
            "global_orient": turns[:, :1],
            "body_pose": turns[:, 1:22],
            "surface_model_type": "smplx",
            "transl": whole["trans"],
        }
        parts |= {"trans": None}
    motion = read(tmp_path, "smplx", poses=None, **parts)
    np.testing.assert_allclose(motion.positions, by_hand("smplx", whole, whole["betas"])[:, :22], atol=1e-6)
    assert len(motion.rig.skeleton) == 22


def test_directions_of_a_face_are_no_shapes(tmp_path):
    write_model(tmp_path / "body_models", "smplx")
    with pytest.raises(MotionFormatError, match="betas: found 301 numbers, and 300 directions of shape"):
        read(tmp_path, "smplx", betas=np.ones(301))


def test_what_nobody_says_is_the_mean_neutral_body_with_y_up(tmp_path):
    write_model(tmp_path / "body_models", "smpl", "neutral")
    clip = poses("smpl") | {"poses": poses("smpl")["poses"] - [np.pi / 2, *[0] * 71]}
    motion = read(tmp_path, "smpl", poses=clip["poses"], betas=None, gender=None, mocap_framerate=None, fps=np.array(30))
    np.testing.assert_allclose(motion.positions, by_hand("smpl", clip, np.zeros(16))[:, :22], atol=1e-6)
    assert (motion.up, motion.fps) == ("y", 30.0)
    with pytest.raises(MotionFormatError, match="stands along z; expected y up, as the default has it; say up=z"):
        read(tmp_path, "smpl", gender=None, mocap_framerate=None, fps=np.array(30))


def test_the_gender_decides_and_words_of_python_2_are_read(tmp_path):
    for seed, gender in enumerate(("male", "female")):
        write_model(tmp_path / "body_models", "smplh", gender, seed)
    man, woman = (read(tmp_path, gender=np.array(word)) for word in ("male", b"female"))
    assert np.abs(man.positions - woman.positions).max() > 0.01
    with pytest.raises(MotionFormatError, match="gender: found 'other'; expected male or female or neutral"):
        read(tmp_path, gender=np.array("other"))


@pytest.mark.parametrize("place", ["beside", "above", "data", "AMASS's names", "flat"])
def test_where_body_models_are_found(tmp_path, place):
    (folder := tmp_path / "CMU" / "01").mkdir(parents=True)
    model_of = {"beside": folder, "data": tmp_path / "data"}.get(place, tmp_path) / "body_models"
    file = write_model(model_of, "smplh")
    names = {"AMASS's names": "smplh/male/model.npz", "flat": "SMPLH_MALE.npz"}
    if place in names:
        (model_of / names[place]).parent.mkdir(exist_ok=True)
        file.rename(model_of / names[place])
    assert read(folder).subject == "01"


def test_without_a_body_model_it_says_which_and_where_people_get_it(tmp_path):
    with pytest.raises(MotionFormatError) as error:
        read(tmp_path)
    place = re.escape(str(tmp_path / "data" / "body_models"))
    assert re.match(
        f"{place}, body model: found no male one of SMPL-H; expected smplh/male/model.npz or smplh/SMPLH_MALE.npz there, or in "
        "body_models beside the motions .*whoever registers gets it at https://mano.is.tue.mpg.de",
        str(error.value),
    )
    file = write_model(tmp_path / "body_models", "smplh")
    file.rename(file.with_suffix(".pkl"))
    with pytest.raises(
        MotionFormatError, match="SMPLH_MALE.pkl, body model: found a pickle, which can run code; expected the same"
    ):
        read(tmp_path)


def refused(found, *entries, **changes):
    return pytest.param({**dict.fromkeys(entries), **changes}, found, id=found[:30])


WILD = np.zeros((40, 156))
WILD[3, 7] = np.nan


@pytest.mark.parametrize(
    "changes, found",
    [
        refused("archive: found entries betas.*; expected trans among them", "trans"),
        refused("frame rate: found none; expected an entry mocap_framerate", "mocap_framerate"),
        refused("poses: found rotations of 51 joints", poses=np.zeros((40, 153))),
        refused("poses: found float64 of shape \\(40, 155\\); expected numbers of", poses=np.zeros((40, 155))),
        refused("poses: found float64 of shape \\(0, 156\\)", poses=np.zeros((0, 156))),
        refused("poses, entry \\(3, 7\\): found nan", poses=WILD),
        refused("poses: found <U1 of shape", poses=np.full((6, 156), "a")),
        refused("trans: found float64 of shape \\(39, 3\\); expected numbers of shape \\(40, 3\\)", trans=np.zeros((39, 3))),
        refused("trans: found float64 of shape \\(40, 6\\)", trans=np.zeros((40, 6))),
        refused("betas: found float64 of shape \\(40, 16\\), which change", betas=np.arange(640.0).reshape(40, 16)),
        refused("betas: found <U1 of shape", betas=np.array(["a"])),
        refused("betas: found 17 numbers, and 16 directions of shape", betas=np.ones(17)),
        refused("surface_model_type smplx; expected as many", surface_model_type=np.array("smplx")),
        refused("mocap_framerate: found shape \\(2,\\); expected a single", mocap_framerate=np.ones(2)),
        refused("up: found 'x'; expected", up=np.array("x")),
        refused("body size: found a body of", betas=np.full(16, 900.0)),
    ],
)  # fmt: skip
def test_malformed_poses(tmp_path, changes, found):
    write_model(tmp_path / "body_models", "smplh")
    with pytest.raises(MotionFormatError, match=found):
        read(tmp_path, **changes)


class Harm:
    """What runs when it is unpickled."""

    def __reduce__(self):
        return (os.mkdir, ("harmed",))


@pytest.mark.parametrize(
    "changes, found",
    [
        ({"J_regressor": None}, "archive: found no entry J_regressor; expected the entries"),
        ({"J_regressor": np.ones((24, 208))}, "J_regressor: found float64 of shape \\(24, 208\\); expected"),
        ({"shapedirs": np.zeros(3)}, "shapedirs: found float64 of shape \\(3,\\)"),
        ({"v_template": np.array(1.0)}, "v_template: found float64 of shape"),
        ({"v_template": np.full((208, 3), np.inf)}, "v_template, entry \\(0, 0\\): found inf"),
        ({"kintree_table": np.zeros((2, 52), int)}, "kintree_table: found parents .*; expected those of SMPL-H"),
        ({"J_regressor": np.array(Harm(), dtype=object)}, "J_regressor: found an array of dtype object; expected numbers"),
    ],
)  # fmt: skip
def test_malformed_body_models(tmp_path, monkeypatch, changes, found):
    monkeypatch.chdir(tmp_path)
    file = write_model(tmp_path / "body_models", "smplh")
    np.savez(file, **{key: value for key, value in (model("smplh") | changes).items() if value is not None})
    with pytest.raises(MotionFormatError, match=f"SMPLH_MALE.npz, {found}"):
        read(tmp_path)
    file.write_bytes(pickle.dumps(Harm()))
    with pytest.raises(MotionFormatError, match="SMPLH_MALE.npz, archive"):
        read(tmp_path, betas=np.array(Harm(), dtype=object) if "betas" in changes else np.zeros(16))
    assert not (tmp_path / "harmed").exists()


def test_a_folder_as_amass_lays_it_out(tmp_path):
    write_model(tmp_path / "body_models", "smplh")
    for subject in ("01", "02"):
        (folder := tmp_path / "CMU" / subject).mkdir(parents=True)
        for trial in range(2):
            read(folder, name=f"{subject}_{trial}_poses", trans=poses("smplh", seed=trial)["trans"])
        np.savez(folder / "shape.npz", betas=np.zeros(16), gender=np.array("male"))
    np.savez(tmp_path / "camera.npz", poses=np.zeros((5, 4, 4)), images=np.zeros(3))
    motions = load_motions(tmp_path, strict=True)
    assert [(m.subject, m.name) for m in motions][1:3] == [("01", "01_1_poses"), ("02", "02_0_poses")]
    check = check_data(tmp_path)
    assert check.is_whole and "entries dmpls of " in check.report
    before = data_fingerprint(str(tmp_path / "CMU"))
    write_model(tmp_path / "body_models", "smplh", seed=1)
    assert data_fingerprint(str(tmp_path / "CMU")) != before, "other joints at rest are other data"


def test_what_the_caller_says_goes_first(tmp_path):
    write_model(tmp_path / "body_models", "smplh")
    plain = read(tmp_path)
    (tmp_path / "clips.csv").write_text("file,fps,subject,first_frame\nclip.npz,60,Ann,5\n")
    (told,) = load_motions(tmp_path / "clip.npz", unit=0.9)
    assert (told.fps, told.subject, len(told)) == (60.0, "Ann", 35)
    np.testing.assert_allclose(told.positions, 0.9 * plain.positions[5:], atol=1e-6)
    (tmp_path / "skeleton.json").write_text(json.dumps({"name": "H36M17", "up": "y"}))  # of arrays, not of these
    assert load_motions(tmp_path / "clip.npz")[0].up == "z"


def test_a_missing_body_model_is_told_once(tmp_path):
    for name in "abc":
        np.savez(tmp_path / f"{name}.npz", **poses("smplh"))
    (tmp_path / "stick.bvh").write_text(BVH)
    with pytest.warns(BrokenFilesWarning, match="3 of 4 files") as told:
        assert len(load_motions(tmp_path)) == 1
    assert str(told[0].message).count("found no male one of SMPL-H") == 1
