"""Writing GLB: an animated skeleton in a plain body of capsules, for Blender, three.js and viewers.

Source: glTF 2.0. By hand, as a rigid skin needs one mesh, one skin and one animation: no library makes that shorter.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped
from scipy.spatial.transform import Rotation

from mwlib.body.fitting import FitError, distance, fit_rig
from mwlib.body.motion import Motion
from mwlib.body.rig import Rig
from mwlib.data.formats.bvh_writing import asked_for
from mwlib.data.untrusted import LARGEST
from mwlib.files import write_atomic
from mwlib.version import __version__

AROUND, RINGS = 12, 3  # vertices around a capsule, and rings of each of its caps
THICKNESS = 0.2  # radius of a capsule by its length
THIN, THICK, SKULL = 0.008, 0.06, 0.09  # metres; the radius of a head
KINDS = {
    np.dtype(np.float32): 5126,
    np.dtype(np.uint16): 5123,
    np.dtype(np.uint32): 5125,
}  # glTF's numbers for types of components
SHAPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}


def write_glb(motion: Motion, file: str | Path) -> FitError:
    """Write a motion as a GLB file: its skeleton, animated at its rate, in metres with y up, and a body of capsules around it.

    A motion with positions only gets rotations by `fit_rig`, as in `write_bvh`. The rest pose is that of the rig's offsets. The
    file holds times in seconds; its rate stands in `asset.extras.fps`. Own choice: a capsule for each bone, which follows one
    joint, and a ball for a head; a fifth of a bone's length is its radius, 6 cm at most. Whole or not at all.

    Args:
        file: a name that ends in .glb; missing folders are made.

    Returns:
        Mean and largest distance, metres, of the joints in the file from `motion.positions`.

    Raises:
        ValueError: an argument is of another kind, positions are not finite or absurdly large, or the name of the file ends
            otherwise. Nothing is written then.

    >>> import tempfile
    >>> from mwlib.synthetic.motions import synthetic_motions
    >>> walk = synthetic_motions(subjects=1, seconds=1.0)[0]
    >>> write_glb(walk, Path(tempfile.mkdtemp()) / "walk.glb").max < 1e-5
    True
    """
    file, motion = asked_for(motion, file, ".glb"), motion.with_up("y")
    rig = motion.rig or fit_rig(motion).rig
    if not all(np.all(np.abs(part) <= LARGEST) for part in (rig.root, rig.offsets, *([] if rig.moves is None else [rig.moves]))):
        raise ValueError(f"a place in the motion is not finite or too large; expected metres up to {LARGEST:g}")
    write_atomic(file, _packed(rig, motion))
    return distance(rig, motion)


class _Buffer:
    """The binary part: arrays one after another, each told in JSON by a view and an accessor."""

    def __init__(self) -> None:
        self.content = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Shaped[np.ndarray, "..."], bounds: bool = False, target: int | None = None) -> int:
        """The number of the accessor of these values."""
        raw = np.ascontiguousarray(values).tobytes()
        view = {"buffer": 0, "byteOffset": len(self.content), "byteLength": len(raw)} | ({"target": target} if target else {})
        about: dict[str, Any] = {"bufferView": len(self.views), "componentType": KINDS[values.dtype], "count": len(values)}
        if bounds:
            about |= {name: np.atleast_1d(f(values, axis=0)).tolist() for name, f in (("min", np.min), ("max", np.max))}
        self.views.append(view)
        self.accessors.append(about | {"type": SHAPES[values.shape[1:]]})
        self.content += raw + bytes(-len(raw) % 4)
        return len(self.accessors) - 1


def _packed(rig: Rig, motion: Motion) -> bytes:
    """The whole file: a header, JSON, and the binary part."""
    buffer, joints = _Buffer(), len(rig.skeleton)
    rest = np.array(rig.offsets if rig.moves is None else rig.moves[0], np.float64)
    rest[0] = rig.root[0]
    places, matrices = rest.copy(), np.tile(np.eye(4, dtype=np.float32), (joints, 1, 1))
    for parent, child in rig.skeleton.bones:
        places[child] += places[parent]
    matrices[:, 3, :3] = -places  # from the rest pose to each joint's own frame, which is not turned; column after column
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": rest[joint].tolist()} for joint, name in enumerate(rig.skeleton.joints)
    ]
    for parent, child in rig.skeleton.bones:
        nodes[parent].setdefault("children", []).append(child)
    nodes.append({"name": "body", "mesh": 0, "skin": 0})
    material = {"name": "body", "pbrMetallicRoughness": {"baseColorFactor": [0.55, 0.62, 0.72, 1], "metallicFactor": 0.0}}
    tree = {
        "asset": {"version": "2.0", "generator": f"mwlib {__version__}", "extras": {"fps": motion.fps}},
        "scene": 0, "scenes": [{"nodes": [0, joints]}], "nodes": nodes, "materials": [material],
        "meshes": [{"primitives": [_mesh(rig, places, buffer) | {"material": 0}]}],
        "skins": [{"joints": [*range(joints)], "skeleton": 0, "inverseBindMatrices": buffer.add(matrices)}],
        "animations": [{"name": motion.name or "motion"} | _animation(rig, motion.fps, buffer)],
        "accessors": buffer.accessors, "bufferViews": buffer.views, "buffers": [{"byteLength": len(buffer.content)}],
    }  # fmt: skip
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    parts = b"".join(struct.pack("<I4s", len(c), kind) + c for c, kind in ((text, b"JSON"), (buffer.content, b"BIN\0")))
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def _animation(rig: Rig, fps: float, buffer: _Buffer) -> dict[str, Any]:
    """Rotations of all joints with children, and places of those that move."""
    times = buffer.add((np.arange(len(rig.root)) / fps).astype(np.float32), bounds=True)
    tracks = {
        (joint, "rotation"): np.roll(rig.rotations[:, joint], -1, axis=-1) for joint in sorted({*rig.skeleton.parents} - {-1})
    }
    tracks[0, "translation"] = rig.root
    moving = [] if rig.moves is None else np.flatnonzero(np.ptp(rig.moves[:, 1:], axis=0).any(axis=-1)) + 1
    tracks |= {(int(joint), "translation"): rig.moves[:, joint] for joint in moving if rig.moves is not None}
    samplers = [{"input": times, "output": buffer.add(values.astype(np.float32))} for values in tracks.values()]
    channels = [{"sampler": i, "target": {"node": joint, "path": path}} for i, (joint, path) in enumerate(tracks)]
    return {"samplers": samplers, "channels": channels}


def _mesh(rig: Rig, places: Float[np.ndarray, "rig 3"], buffer: _Buffer) -> dict[str, Any]:
    """A capsule from each joint to each of its children, which follows that joint; a head without a bone gets a ball."""
    parts = []
    for parent, child in rig.skeleton.bones:
        length = float(np.linalg.norm(places[child] - places[parent]))
        if length > 1e-3 and (parent or rig.points[0] == 0):  # nothing to a root on the floor
            radius = float(np.clip(THICKNESS * length, THIN, THICK))
            parts.append((parent, *_capsule(places[parent], places[child], radius)))
    heads = [joint for joint, name in enumerate(rig.skeleton.joints) if name.lower().rpartition(":")[2] == "head"]
    parts += [(joint, *_capsule(places[joint], places[joint] + [0, 1e-3, 0], SKULL)) for joint in heads]
    points, normals, faces = (np.concatenate([part[i] for part in parts]) for i in (1, 2, 3))
    sizes = [len(part[1]) for part in parts]
    starts = np.repeat(np.cumsum([0, *sizes[:-1]]), [len(part[3]) for part in parts])
    owners = np.zeros((len(points), 4), np.uint16)
    owners[:, 0] = np.repeat([part[0] for part in parts], sizes)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(points), 1))
    indices = (faces + starts[:, None]).ravel()
    found = {
        "POSITION": buffer.add(points.astype(np.float32), bounds=True, target=34962),
        "NORMAL": buffer.add(normals.astype(np.float32), target=34962),
        "JOINTS_0": buffer.add(owners, target=34962), "WEIGHTS_0": buffer.add(weights, target=34962),
    }  # fmt: skip
    return {"attributes": found, "indices": buffer.add(indices.astype(np.uint32), target=34963)}


def _capsule(
    start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"], radius: float
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], Int[np.ndarray, "faces 3"]]:
    """Vertices, normals and triangles of a capsule."""
    tilt = np.concatenate([np.linspace(-np.pi / 2, 0, RINGS + 1), np.linspace(0, np.pi / 2, RINGS + 1)])[:, None]
    turn = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    normals = np.stack(np.broadcast_arrays(np.cos(tilt) * np.cos(turn), np.sin(tilt), -np.cos(tilt) * np.sin(turn)), axis=-1)
    way = end - start
    along = Rotation.align_vectors([way / np.linalg.norm(way)], [[0, 1, 0]])[0]
    normals = along.apply(normals.reshape(-1, 3))
    ends = np.repeat([start, end], (RINGS + 1) * AROUND, axis=0)
    at = np.arange(len(tilt) * AROUND).reshape(-1, AROUND)
    here, there = at, np.roll(at, -1, axis=1)
    quads = [here[:-1], there[:-1], here[1:], there[1:]]
    a, b, c, d = (quad.ravel() for quad in quads)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    return ends + radius * normals, normals, faces
