"""GLB files, taken apart here: what their skeletons do is what the motions do."""

from __future__ import annotations

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mwlib as mw
from mwlib.synthetic.motions import synthetic_motions
from tests.body.sample import animators_motion

WALK = synthetic_motions(subjects=1, seconds=1.0)[0]


def opened(file):
    """The JSON of a file, and a function that gives the values of an accessor."""
    raw = file.read_bytes()
    magic, version, size, length, kind = struct.unpack_from("<4sIII4s", raw)
    assert (magic, version, size, kind) == (b"glTF", 2, len(raw), b"JSON") and length % 4 == 0
    tree = json.loads(raw[20 : 20 + length])
    more, kind = struct.unpack_from("<I4s", raw, 20 + length)
    assert kind == b"BIN\0" and 28 + length + more == len(raw) and tree["buffers"] == [{"byteLength": more}]

    def values(number):
        about = tree["accessors"][number]
        view = tree["bufferViews"][about["bufferView"]]
        dtype = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[about["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[about["type"]]
        found = np.frombuffer(raw, dtype, about["count"] * width, 28 + length + view["byteOffset"]).reshape(-1, width)
        assert found.nbytes == view["byteLength"] and view["byteOffset"] % 4 == 0
        if "min" in about:
            assert about["min"] == found.min(axis=0).tolist() and about["max"] == found.max(axis=0).tolist()
        return found

    return tree, values


def played(file):
    """Times, and for each frame the matrix of each joint (frames, joints, 4, 4), by the rules of glTF."""
    tree, values = opened(file)
    (animation,), (skin,) = tree["animations"], tree["skins"]
    tracks = {}
    for channel in animation["channels"]:
        sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
        times = values(sampler["input"])[:, 0]
        tracks[target["node"], target["path"]] = values(sampler["output"])
    parents = {child: node for node, about in enumerate(tree["nodes"]) for child in about.get("children", ())}
    world = np.tile(np.eye(4), (len(times), len(skin["joints"]), 1, 1))
    for joint in skin["joints"]:
        local = np.tile(np.eye(4), (len(times), 1, 1))
        if (joint, "rotation") in tracks:
            local[:, :3, :3] = Rotation.from_quat(tracks[joint, "rotation"]).as_matrix()
        local[:, :3, 3] = tracks.get((joint, "translation"), tree["nodes"][joint]["translation"])
        world[:, joint] = world[:, parents[joint]] @ local if joint in parents else local
    return times, world


@pytest.mark.parametrize(
    "motion",
    [WALK, animators_motion(), animators_motion().with_up("z"), WALK.cut(0, 1)],
    ids=["positions", "rig", "z up", "pose"],
)
def test_joints_go_where_forward_kinematics_has_them(tmp_path, motion):
    away = mw.write_glb(motion, tmp_path / "new" / "a.glb")
    times, world = played(tmp_path / "new" / "a.glb")
    np.testing.assert_allclose(times, np.arange(len(motion)) / motion.fps, atol=1e-6)
    points = [*motion.rig.points] if motion.rig else slice(None)
    np.testing.assert_allclose(world[:, points][..., :3, 3], motion.with_up("y").positions, atol=1e-5)
    assert away.max < 1e-5 and opened(tmp_path / "new" / "a.glb")[0]["asset"]["extras"] == {"fps": motion.fps}


def test_joints_with_a_place_of_their_own_in_each_frame(tmp_path):
    motion = animators_motion()
    rig = motion.rig
    moves = np.tile(rig.offsets, (len(motion), 1, 1))
    moves[:, 3] += 0.05 * np.sin(np.arange(len(motion)))[:, None]
    rig = replace(rig, moves=moves)
    motion = replace(motion, rig=rig, positions=rig.positions().astype(np.float32))
    mw.write_glb(motion, tmp_path / "a.glb")
    np.testing.assert_allclose(played(tmp_path / "a.glb")[1][..., :3, 3], rig.world()[0], atol=1e-5)


def test_the_body_lies_around_its_bones(tmp_path):
    motion = animators_motion()
    mw.write_glb(motion, tmp_path / "a.glb")
    tree, values = opened(tmp_path / "a.glb")
    (primitive,) = tree["meshes"][0]["primitives"]
    points, normals, owners, weights = (
        values(primitive["attributes"][n]) for n in ("POSITION", "NORMAL", "JOINTS_0", "WEIGHTS_0")
    )
    bind = values(tree["skins"][0]["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    matrices = played(tmp_path / "a.glb")[1][7] @ bind
    assert np.all(weights == [1, 0, 0, 0]) and not owners[:, 1:].any()
    skin = np.einsum("nij,nj->ni", matrices[owners[:, 0]][:, :3], np.pad(points, ((0, 0), (0, 1)), constant_values=1))
    joints = motion.rig.world()[0][7]
    starts, ends = joints[[p for p, _ in motion.rig.skeleton.bones]], joints[[c for _, c in motion.rig.skeleton.bones]]
    share = np.einsum("nbc,bc->nb", skin[:, None] - starts, ends - starts) / np.square(ends - starts).sum(axis=-1)
    away = np.linalg.norm(skin[:, None] - starts - share.clip(0, 1)[..., None] * (ends - starts), axis=-1).min(axis=1)
    assert away.max() < 0.095 and np.quantile(away, 0.9) < 0.061
    corners = points[values(primitive["indices"]).reshape(-1, 3)]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = np.linalg.norm(outward, axis=1) > 1e-9  # those at the tips have no area
    facing = (outward * normals[values(primitive["indices"]).reshape(-1, 3)].sum(axis=1)).sum(axis=1)
    assert shown.mean() > 0.7 and np.all(facing[shown] > 0), "triangles run counter-clockwise, seen from outside"


@pytest.mark.parametrize("spoilt", ["name", "nan", "far"])
def test_what_cannot_be_written_leaves_nothing(tmp_path, spoilt):
    motion = animators_motion()
    if spoilt != "name":
        root = motion.rig.root.copy()
        root[3] = np.nan if spoilt == "nan" else 1e9
        motion = replace(motion, rig=replace(motion.rig, root=root))
    with pytest.raises(ValueError, match="ends in .glb" if spoilt == "name" else "expected metres up to"):
        mw.write_glb(motion, tmp_path / ("a.gltf" if spoilt == "name" else "a.glb"))
    assert not [*tmp_path.iterdir()]
