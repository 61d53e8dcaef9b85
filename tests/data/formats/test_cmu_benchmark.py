"""The CMU benchmark's text files."""

from __future__ import annotations

import json

import numpy as np

from mwlib import load_motions
from mwlib.data.formats.arrays import TREE
from tests.sample_motions import BENCHMARK


def read(folder, text):
    (folder / "walking").mkdir(exist_ok=True)
    (folder / "walking" / "walking_1.txt").write_text(text)
    (motion,) = load_motions(folder)
    return motion


def test_the_constants_are_those_of_the_skeleton_file(data_folder):
    known = json.loads((data_folder / "cmu_benchmark" / "skeleton.json").read_text())
    np.testing.assert_array_equal(TREE[:, 0], known["parent"])
    np.testing.assert_array_equal(TREE[:, 1:], known["offset"])


def test_every_row_but_the_t_pose_is_read(tmp_path):
    motion = read(tmp_path, BENCHMARK)
    assert (len(motion), motion.fps, motion.up, motion.skeleton.name, motion.action) == (2, 120.0, "y", "CMU", "walking")
    np.testing.assert_allclose(motion.positions[:, 0] * 0.45 / 0.0254, [[1.5, 17.7, -28], [1.5, 17.7, -27]], rtol=1e-6)
    assert len(read(tmp_path, BENCHMARK.split("\n", 1)[1])) == 2


def test_rotation_vectors_are_for_row_vectors(tmp_path):
    rows = np.zeros((2, 117))
    rows[:, 3 + 1] = np.pi / 2  # root, about y: z goes to x for column vectors, x goes to z for row vectors
    motion = read(tmp_path, "\n".join(",".join(map(str, row)) for row in rows))
    left = motion.positions[0, motion.skeleton.joints.index("left_humerus")] * 0.45 / 0.0254
    arm = TREE[21, 1:] + TREE[22, 1:] + TREE[14, 1:] + TREE[15, 1:]
    np.testing.assert_allclose(left, [-arm[2], arm[1], arm[0]], atol=1e-5)
