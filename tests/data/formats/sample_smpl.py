"""Made-up bodies of SMPL's families: models of few vertices, and poses for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mwlib.data.formats.smpl import FAMILIES

# A person at rest in a T-pose, y up, facing +z: HumanML3D's joints, metres.
REST = np.array([
    [0, 0.92, 0], [0.07, 0.83, 0], [-0.07, 0.83, 0], [0, 1.04, -0.02], [0.1, 0.46, 0.01], [-0.1, 0.46, 0.01], [0, 1.17, 0],
    [0.09, 0.06, -0.03], [-0.09, 0.06, -0.03], [0, 1.23, 0.02], [0.11, 0.0, 0.1], [-0.11, 0.0, 0.1], [0, 1.44, -0.02],
    [0.08, 1.36, -0.01], [-0.08, 1.36, -0.01], [0, 1.52, 0.03], [0.19, 1.38, -0.03], [-0.19, 1.38, -0.03], [0.45, 1.37, -0.05],
    [-0.45, 1.37, -0.05], [0.7, 1.38, -0.05], [-0.7, 1.38, -0.05],
])  # fmt: skip
VERTICES = 4  # around each joint
BETAS = 16  # numbers of a shape


def parents(family: str) -> list[int]:
    """Of all joints: fingers hang one from the other, and from the wrists."""
    body = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
    if family == "smpl":
        return [*body, 20, 21]
    more = [15, 15, 15] if family == "smplx" else []
    fingers = len(body) + len(more)
    return body + more + [(20 + i // 15) if i % 3 == 0 else fingers + i - 1 for i in range(30)]


def model(family: str, seed: int = 0) -> dict[str, np.ndarray]:
    """A body model as its owners lay it out, of so few vertices that joints are weighted means of some around them."""
    rng, tree = np.random.default_rng(seed), parents(family)
    rest = np.zeros((len(tree), 3))
    rest[:22] = REST
    for joint in range(22, len(tree)):
        side = np.array([np.sign(rest[tree[joint], 0]) or 0, 0, 0])
        rest[joint] = rest[tree[joint]] + 0.03 * side + [0, 0, 0.01 * (joint % 5)]
    template = (rest[:, None] + rng.uniform(-0.05, 0.05, (len(tree), VERTICES, 3))).reshape(-1, 3)
    regressor = np.zeros((len(tree), len(template)))
    for joint in range(len(tree)):
        own = slice(VERTICES * joint, VERTICES * (joint + 1))
        shares = rng.uniform(0.1, 1, VERTICES)
        regressor[joint, own] = shares / shares.sum()
        template[own] += rest[joint] - regressor[joint, own] @ template[own]
    ways = rng.uniform(-0.006, 0.006, (len(template), 3, 400 if family == "smplx" else BETAS))  # the last 100 of 400 move a face
    root = np.array(tree, np.int64).astype(np.uint32)  # as their owners write -1
    return {
        "v_template": template, "shapedirs": ways, "J_regressor": regressor,
        "kintree_table": np.stack([root, np.arange(len(tree), dtype=np.uint32)]),
        "weights": np.repeat(np.eye(len(tree)), VERTICES, axis=0), "f": np.zeros((1, 3), np.int64),
        "posedirs": np.zeros((len(template), 3, 9 * (len(tree) - 1))),
    }  # fmt: skip


def write_model(folder: Path, family: str, gender: str = "male", seed: int = 0) -> Path:
    """That model where it is looked for."""
    file = folder / family / f"{family.upper()}_{gender.upper()}.npz"
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez(file, **model(family, seed=seed))
    return file


def poses(family: str, frames: int = 40, seed: int = 0, bend: float = 0.5) -> dict[str, np.ndarray]:
    """A clip as AMASS lays it out: somebody who sways, z up."""
    rng, joints = np.random.default_rng(seed), len(FAMILIES[family].joints)
    time = np.linspace(0, 1, frames)[:, None, None]
    turns = bend * np.sin(2 * np.pi * rng.uniform(0.3, 1.5, (joints, 3)) * time + rng.uniform(0, 6, (joints, 3)))
    turns[:, 0] = [np.pi / 2, 0, 0]
    turns[:, 0, 1:] += 0.1 * np.sin(3 * time[:, 0])
    path = np.stack([time[:, 0, 0], 0.3 * time[:, 0, 0] ** 2, 0.02 * np.sin(9 * time[:, 0, 0])], axis=1)
    return {
        "poses": turns.reshape(frames, -1), "trans": path, "betas": rng.uniform(-1.5, 1.5, BETAS), "gender": np.array("male"),
        "mocap_framerate": np.array(120.0), "dmpls": np.zeros((frames, 8)),
    }  # fmt: skip
