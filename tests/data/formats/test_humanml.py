"""Features of HumanML3D and KIT-ML: where what stands, and the joints that they describe."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.body.kinematics import bone_lengths
from mwlib.body.skeleton import HUMANML22
from mwlib.data.collections import SKELETONS
from mwlib.data.collections.humanml import KIT21
from mwlib.data.formats.humanml import HUMANML3D, KIT, LAYOUTS, joints_of
from tests.data.formats.sample_features import about_y


@pytest.fixture(scope="module")
def example(data_folder):
    """Features and joints of the published example."""
    return tuple(np.load(data_folder / "humanml3d" / kind / "012314.npy") for kind in ("new_joint_vecs", "new_joints"))


@pytest.mark.parametrize(
    "layout, starts",
    [(HUMANML3D, (0, 1, 3, 4, 67, 193, 259, 263)), (KIT, (0, 1, 3, 4, 64, 184, 247, 251))],
    ids=["HumanML3D", "KIT"],
)
def test_blocks_stand_where_the_published_code_has_them(layout, starts):
    assert [(b.start, b.stop) for b in layout.blocks.values()] == [*zip(starts, starts[1:], strict=False)]
    assert layout.width == starts[-1] == 12 * len(layout.skeleton) - 1 and LAYOUTS[layout.width] is layout


@pytest.mark.parametrize("layout", [HUMANML3D, KIT], ids=["HumanML3D", "KIT"])
def test_chains_are_the_tree_and_sides_are_sides(layout):
    skeleton = layout.skeleton
    pairs = [pair for chain in layout.chains for pair in zip(chain, chain[1:], strict=False)]
    assert sorted(pairs, key=lambda pair: pair[1]) == [*skeleton.bones]
    names = [skeleton.joints[joint].split("_") for joint in layout.contact_joints + layout.face_joints]
    assert [side for side, _ in names] == ["left", "left", "right", "right", "right", "left", "right", "left"]
    assert [what for _, what in names][4:] == ["hip", "hip", "shoulder", "shoulder"]
    assert [what for _, what in names][::2][:2] == ["ankle", "ankle"] or layout is KIT
    assert set(skeleton.mirror[list(skeleton.left)]) == set(skeleton.right) and SKELETONS[skeleton.name] is skeleton
    rests = layout.rests("correct")
    assert np.all(rests[list(skeleton.left), 0] >= 0) and np.all(rests[list(skeleton.right), 0] <= 0)
    np.testing.assert_array_equal(rests[skeleton.mirror], rests * [-1, 1, 1])


def test_the_published_example_is_decoded(example):
    features, joints = example
    assert np.abs(joints_of(features, HUMANML3D) - joints).max() < 3e-7
    np.testing.assert_allclose(bone_lengths(joints, HUMANML22), np.tile(HUMANML3D.bone_lengths[1:], (170, 1)), atol=6e-5)


def test_by_hand():
    x = np.zeros((3, 263))
    x[0, 0], x[:, 2], x[:, 3] = np.pi / 4, 1.0, 1.0
    x[1, 10:13] = 0.0, 1.5, 0.2  # joint 3
    joints = joints_of(x, HUMANML3D)
    np.testing.assert_allclose(joints[:, 0], [[0, 1, 0], [-1, 1, 0], [-2, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(joints[1, 3], [-1.2, 1.5, 0.0], atol=1e-12)


def test_a_constant_yaw_rate_is_a_circle():
    x = np.zeros((41, 251))
    x[:, 0], x[:, 2], x[:, 3] = np.pi / 40, 100.0, 560.0
    root = joints_of(x, KIT)[:, 0]
    np.testing.assert_allclose(root[40], root[0], atol=1e-9)
    across = np.linalg.norm(root[20] - root[0])
    np.testing.assert_allclose(across, 100 / np.sin(np.pi / 40), rtol=1e-9)


def test_numpy_torch_and_leading_axes_agree_with_a_slow_decoder():
    x = np.random.default_rng(0).normal(size=(2, 3, 7, 251)) * 0.3
    decoded = joints_of(x, KIT)
    assert decoded.shape == (2, 3, 7, 21, 3) and decoded.dtype == np.float64
    np.testing.assert_array_equal(joints_of(torch.from_numpy(x), KIT).numpy(), decoded)
    turn, root = 0.0, np.zeros(3)
    for t, row in enumerate(x[1, 2]):
        back = about_y(-2 * turn)
        if t:
            root = root + back.apply([x[1, 2, t - 1, 1], 0, x[1, 2, t - 1, 2]])
        local = row[4:64].reshape(20, 3)
        slow = np.concatenate([[root + [0, row[3], 0]], back.apply(local) + root])
        np.testing.assert_allclose(decoded[1, 2, t], slow, atol=1e-12)
        turn += row[0]


def test_gradients_pass_to_what_is_used_and_to_nothing_else():
    x = torch.randn(2, 5, 263, dtype=torch.float64, requires_grad=True)
    weights = torch.randn(2, 5, 22, 3, dtype=torch.float64)
    (joints_of(x, HUMANML3D) * weights).sum().backward()
    assert x.grad is not None
    used = x.grad.abs().sum(dim=0) > 0
    assert bool(used[:4, :67].all()) and not bool(used[:, 67:].any()) and not bool(used[4, :3].any())


def test_features_of_another_width_are_refused():
    with pytest.raises(ValueError, match="features have width 263; expected 251 for KIT-ML"):
        joints_of(np.zeros((4, 263)), KIT)
    assert KIT.skeleton is KIT21
