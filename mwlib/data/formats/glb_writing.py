"""Writing GLB: an animated skeleton in a plain body of capsules, for Blender, three.js and viewers.

Source: glTF 2.0. By hand, as a rigid skin needs one mesh, one skin and one animation: no library makes that shorter.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Shaped
from scipy.spatial.transform import Rotation

from mwlib.body.fitting import FitError, distance
from mwlib.body.motion import Motion
from mwlib.body.rig import Rig
from mwlib.data.formats.bvh import asked_for
from mwlib.data.untrusted import LARGEST
from mwlib.files import write_atomic
from mwlib.version import __version__

AROUND, RINGS = 12, 3  # vertices around a capsule, and rings of each of its caps
THICKNESS = 0.2  # radius of a capsule by its length
THIN, THICK, SKULL = 0.008, 0.06, 0.09  # metres; the radius of a head
KINDS = {"float32": 5126, "uint16": 5123, "uint32": 5125}  # glTF's numbers for types of components
Arrays = list[Shaped[np.ndarray, "..."]]  # of the binary part, each told by a view and an accessor of its number
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
    file, motion, rig = asked_for(motion, file, ".glb", "y")
    if not np.all(np.abs(rig.world()[0]) <= LARGEST):  # False for nan
        raise ValueError(f"a place in the motion is not finite or too large; expected metres up to {LARGEST:g}")
    write_atomic(file, _packed(rig, motion))
    return distance(rig, motion)


def _add(values: Shaped[np.ndarray, "..."], arrays: Arrays) -> int:
    """The number of values among the arrays."""
    arrays.append(values)
    return len(arrays) - 1


def _packed(rig: Rig, motion: Motion) -> bytes:
    """The whole file: a header, JSON, and the binary part."""
    arrays: Arrays = []
    joints = len(rig.skeleton)
    rest = np.array(rig.spans[0], np.float64)
    rest[0] = rig.root[0]
    places, matrices = rest.copy(), np.tile(np.eye(4, dtype=np.float32), (joints, 1, 1))
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": place.tolist()} for name, place in zip(rig.skeleton.joints, rest, strict=True)
    ]
    for parent, child in rig.skeleton.bones:
        places[child] += places[parent]
        nodes[parent].setdefault("children", []).append(child)
    matrices[:, 3, :3] = -places  # from the rest pose to each joint's own frame, which is not turned; column after column
    nodes.append({"name": "body", "mesh": 0, "skin": 0})
    material = {"name": "body", "pbrMetallicRoughness": {"baseColorFactor": [0.55, 0.62, 0.72, 1], "metallicFactor": 0.0}}
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"mwlib {__version__}", "extras": {"fps": motion.fps}},
        "scene": 0, "scenes": [{"nodes": [0, joints]}], "nodes": nodes, "materials": [material],
        "meshes": [{"primitives": [_mesh(rig, places, arrays) | {"material": 0}]}],
        "skins": [{"joints": [*range(joints)], "skeleton": 0, "inverseBindMatrices": _add(matrices, arrays)}],
        "animations": [{"name": motion.name or "motion"} | _animation(rig, motion.fps, arrays)],
        "accessors": [], "bufferViews": [],
    }  # fmt: skip
    content = b""
    for number, values in enumerate(arrays):
        rows, raw = values.reshape(len(values), -1), values.tobytes()
        tree["bufferViews"].append({"buffer": 0, "byteOffset": len(content), "byteLength": len(raw)})
        tree["accessors"].append({
            "bufferView": number, "componentType": KINDS[values.dtype.name], "count": len(values),
            "type": SHAPES[values.shape[1:]], "min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist(),
        })  # fmt: skip
        content += raw
    tree["buffers"] = [{"byteLength": len(content)}]
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    parts = b"".join(struct.pack("<I4s", len(c), kind) + c for c, kind in ((text, b"JSON"), (content, b"BIN\0")))
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def _animation(rig: Rig, fps: float, arrays: Arrays) -> dict[str, Any]:
    """Rotations of all joints with children, and places of those that move."""
    times = _add((np.arange(len(rig.root)) / fps).astype(np.float32), arrays)
    tracks = {
        (joint, "rotation"): np.roll(rig.rotations[:, joint], -1, axis=-1) for joint in sorted({*rig.skeleton.parents} - {-1})
    }
    tracks[0, "translation"] = rig.root
    if rig.moves is not None:
        for joint in np.flatnonzero(np.ptp(rig.moves[:, 1:], axis=0).any(axis=-1)) + 1:
            tracks[int(joint), "translation"] = rig.moves[:, joint]
    samplers = [{"input": times, "output": _add(values.astype(np.float32), arrays)} for values in tracks.values()]
    channels = [{"sampler": i, "target": {"node": joint, "path": path}} for i, (joint, path) in enumerate(tracks)]
    return {"samplers": samplers, "channels": channels}


def _mesh(rig: Rig, places: Float[np.ndarray, "rig 3"], arrays: Arrays) -> dict[str, Any]:
    """A capsule from each joint to each of its children, which follows that joint; a head without a bone gets a ball."""
    capsules = []
    for parent, child in rig.skeleton.bones:
        length = float(np.linalg.norm(places[child] - places[parent]))
        if length > 1e-3 and (parent or rig.points[0] == 0):  # nothing to a root on the floor
            capsules.append((parent, places[child], min(max(THICKNESS * length, THIN), THICK)))
    heads = [joint for joint, name in enumerate(rig.skeleton.joints) if name.lower().rpartition(":")[2] == "head"]
    capsules += [(joint, places[joint] + [0, 1e-3, 0], SKULL) for joint in heads]
    parts = [_capsule(places[joint], end, radius) for joint, end, radius in capsules]
    points, normals = (np.concatenate(values).astype(np.float32) for values in zip(*parts, strict=True))
    vertices = np.arange(len(points), dtype=np.uint32).reshape(len(parts), -1, AROUND)
    a, c = vertices[:, :-1], vertices[:, 1:]
    b, d = (np.roll(ring, -1, axis=-1) for ring in (a, c))
    weights = np.tile(np.eye(1, 4, dtype=np.float32), (len(points), 1))
    owners = weights * np.repeat([joint for joint, _, _ in capsules], len(points) // len(parts))[:, None]
    found = {
        "POSITION": _add(points, arrays), "NORMAL": _add(normals, arrays),
        "JOINTS_0": _add(owners.astype(np.uint16), arrays), "WEIGHTS_0": _add(weights, arrays),
    }  # fmt: skip
    return {"attributes": found, "indices": _add(np.stack([a, b, c, b, d, c], axis=-1).ravel(), arrays)}


def _capsule(
    start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"], radius: float
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Vertices and normals of a capsule, ring by ring from its start."""
    tilt = np.concatenate([np.linspace(-np.pi / 2, 0, RINGS + 1), np.linspace(0, np.pi / 2, RINGS + 1)])[:, None]
    turn = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    normals = np.stack(np.broadcast_arrays(np.cos(tilt) * np.cos(turn), np.sin(tilt), -np.cos(tilt) * np.sin(turn)), axis=-1)
    way = end - start
    along = Rotation.align_vectors([way / np.linalg.norm(way)], [[0, 1, 0]])[0]
    normals = along.apply(normals.reshape(-1, 3))
    return np.repeat([start, end], (RINGS + 1) * AROUND, axis=0) + radius * normals, normals
