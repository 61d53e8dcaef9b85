"""Kinematics of rotations and of headings; motions that carry rotations: cut, resampled, turned, mirrored, carried over."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation, Slerp

from mwlib.body.kinematics import bone_lengths, fk, forward_kinematics, heading, places, scale_bones, turn_heading
from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.rotation import continuous, euler_quaternions, from_six
from mwlib.body.skeleton import H36M17, Skeleton
from mwlib.data.collections.lafan1 import LAFAN1
from tests.inbetweening.sample import lafan_motion

# A trunk with two arms; the hands are End Sites, and the motion leaves the first joint out.
TREE = Skeleton(
    "tree", ("ground", "hip", "left_arm", "left_hand", "right_arm", "right_hand", "head"), (-1, 0, 1, 2, 1, 4, 1), (2, 3), (4, 5)
)
BODY = Skeleton("body", ("hip", "left_arm", "left_hand", "right_arm", "right_hand"), (-1, 0, 1, 0, 3), (1, 2), (3, 4))
OFFSETS = np.array([[0, 9, 0], [0, 0.9, 0.1], [0.2, 0.4, 0], [0.6, 0, 0.1], [-0.25, 0.4, 0], [-0.5, 0, 0], [0, 0.6, 0]])


def rig(frames: int = 40, moving: bool = False, seed: int = 0) -> Rig:
    """Smooth random rotations of TREE."""
    rng = np.random.default_rng(seed)
    angles = np.cumsum(rng.normal(0, 0.12, (frames, 7, 3)), axis=0) + rng.uniform(-3, 3, (7, 3))
    rotations = continuous(torch.from_numpy(euler_quaternions("zyx", angles))).numpy()
    moves = OFFSETS + np.cumsum(rng.normal(0, 0.01, (frames, 7, 3)), axis=0) if moving else None
    channels = tuple(None if joint in (3, 5) else MOVES + ANGLES for joint in range(7))
    return Rig(TREE, OFFSETS, rotations, np.cumsum(rng.normal(0, 0.02, (frames, 3)), axis=0), (1, 2, 3, 4, 5), channels, moves)


def motion(frames: int = 40, moving: bool = False, up: str = "y", fps: float = 60.0) -> Motion:
    made = rig(frames, moving)
    return Motion(made.positions().astype(np.float32), fps, BODY, name="clip", up=up, rig=made)


def agrees(found: Motion, atol: float = 1e-6) -> None:
    """The rig gives the positions in every frame, and its quaternions are unit and go on in time."""
    np.testing.assert_allclose(found.rig.positions(), found.positions, atol=atol)
    q = found.rig.rotations
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-6)
    assert np.sum(q[1:] * q[:-1], axis=-1).min() > 0


def walk_down(q, offsets, root, parents):
    """Positions and global turns of one frame, joint by joint."""
    places, turns = [root], [Rotation.from_quat(np.roll(q[0], -1))]
    for joint in range(1, len(parents)):
        places.append(places[parents[joint]] + turns[parents[joint]].apply(offsets[joint]))
        turns.append(turns[parents[joint]] * Rotation.from_quat(np.roll(q[joint], -1)))
    return np.array(places), np.array([t.as_quat() for t in turns])[:, [3, 0, 1, 2]]


@pytest.mark.parametrize("skeleton", [LAFAN1, H36M17, TREE])
def test_fk_is_a_walk_down_the_tree_and_the_kinematics_of_matrices(skeleton):
    rng, joints = np.random.default_rng(1), len(skeleton)
    q = torch.nn.functional.normalize(torch.from_numpy(rng.normal(size=(2, 3, joints, 4))), dim=-1)
    root, offsets = torch.from_numpy(rng.normal(size=(2, 3, 3))), torch.from_numpy(rng.normal(size=(2, 3, joints, 3)))
    places, turns = fk(q, offsets, root, skeleton)
    for at in np.ndindex(2, 3):
        expected = walk_down(q[at].numpy(), offsets[at].numpy(), root[at].numpy(), skeleton.parents)
        np.testing.assert_allclose(places[at].numpy(), expected[0], atol=1e-12)
        np.testing.assert_allclose(np.abs(np.sum(turns[at].numpy() * expected[1], axis=-1)), 1.0, atol=1e-12)
    matrices = Rotation.from_quat(q.numpy().reshape(-1, 4)[:, [1, 2, 3, 0]]).as_matrix().reshape(2, 3, joints, 3, 3)
    np.testing.assert_allclose(places, forward_kinematics(matrices, offsets.numpy(), root.numpy(), skeleton), atol=1e-12)
    shared = fk(q, offsets[0, 0], root, skeleton)[0]
    torch.testing.assert_close(shared, fk(q, offsets[0, 0].expand(2, 3, joints, 3), root, skeleton)[0])
    torch.testing.assert_close(fk(q[1, 2], offsets[1, 2], root[1, 2], skeleton)[0], places[1, 2])


@pytest.mark.parametrize("function, numbers", [(fk, 4), (places, 6)])
def test_kinematics_have_gradients(function, numbers):
    rng = np.random.default_rng(2)
    given = [torch.from_numpy(rng.normal(size=shape)).requires_grad_() for shape in ((2, 7, numbers), (7, 3), (2, 3))]
    given[0].data = torch.nn.functional.normalize(given[0].data, dim=-1)
    assert torch.autograd.gradcheck(lambda turns, offsets, root: function(turns, offsets, root, TREE), given)


@pytest.mark.parametrize("skeleton", [LAFAN1, H36M17, TREE, Skeleton("bone", ("a", "b"), (-1, 0))])
def test_places_of_six_numbers_are_those_of_fk_with_the_same_gradients(skeleton):
    """Six numbers as a network gives them, of no rotation; one body for all frames of a window."""
    rng, joints = np.random.default_rng(3), len(skeleton)
    shapes = {"numbers": (2, 3, joints, 6), "offsets": (2, 1, joints, 3), "root": (2, 3, 3)}
    numbers, offsets, root = (torch.from_numpy(rng.normal(size=shape)).requires_grad_() for shape in shapes.values())
    found = places(numbers, offsets, root, skeleton)
    expected, _ = fk(from_six(numbers), offsets.expand(2, 3, joints, 3), root, skeleton)
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-12)
    weights = torch.from_numpy(rng.normal(size=found.shape))
    ours, theirs = (torch.autograd.grad((x * weights).sum(), (numbers, offsets, root)) for x in (found, expected))
    torch.testing.assert_close(ours, theirs, rtol=0, atol=1e-10)
    torch.testing.assert_close(places(numbers[1, 2], offsets[1, 0], root[1, 2], skeleton), found[1, 2])
    single = places(numbers.float(), offsets.float(), root.float(), skeleton)
    torch.testing.assert_close(single.double(), found, rtol=0, atol=1e-5)


def test_a_rig_that_stands_elsewhere_is_refused():
    good = motion()
    moved = good.positions.copy()
    moved[-1, 2, 0] += 0.01
    with pytest.raises(ValueError, match="left_hand 0.01 m from its position in frame 39; expected the same place, or rig=None"):
        replace(good, positions=moved)
    replace(good, positions=moved, rig=None)
    with pytest.raises(ValueError, match="the rig has 40 frames and 5 points; expected 39 and 5"):
        replace(good, positions=good.positions[1:])


def test_a_rig_far_away_is_no_other_pose():
    """Single precision is coarser than a millimetre at ten kilometres."""
    far = replace(rig(), root=rig().root + 1e4)
    Motion(far.positions().astype(np.float32), 60.0, BODY, rig=far)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"offsets": OFFSETS[1:]}, r"offsets of the rig have shape \(6, 3\); expected \(7, 3\)"),
        ({"rotations": np.zeros((40, 7, 4))}, "length 0; expected 1"),
        ({"rotations": np.full((40, 7, 4), np.nan)}, "length nan; expected 1"),
        ({"root": np.zeros((40, 2))}, "root of the rig"),
        ({"moves": np.zeros((4, 7, 3))}, "moves of the rig"),
        ({"points": (1, 2, 3, 4, 7)}, "joints 0 to 6"),
        ({"channels": (("wrotation",),) * 7}, "wrotation"),
        ({"channels": (None,) * 7}, "End Site of the rig has children"),
    ],
)
def test_a_rig_that_makes_no_sense_is_refused(change, message, unchecked):
    with pytest.raises(ValueError, match=message):
        replace(rig(), **change)


@pytest.mark.parametrize("moving", [False, True])
def test_a_motion_agrees_with_its_rig_and_so_does_a_part(moving):
    whole = motion(moving=moving)
    for part in (whole, whole.cut(7, 20)):
        agrees(part)
    np.testing.assert_array_equal(whole.cut(7, 20).rig.rotations, whole.rig.rotations[7:20])


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("fps", [25.0, 30.0, 50.0, 144.0])
def test_resampling_slerps_and_keeps_what_it_hits(moving, fps):
    whole = motion(moving=moving)
    found = whole.resample(fps)
    agrees(found)
    time, old = np.arange(len(found)) / fps, np.arange(len(whole)) / whole.fps
    for joint in (0, 4):
        turns = Slerp(old, Rotation.from_quat(whole.rig.rotations[:, joint, [1, 2, 3, 0]]))(np.minimum(time, old[-1])).as_quat()
        alike = np.abs(np.sum(found.rig.rotations[:, joint][:, [1, 2, 3, 0]] * turns, axis=-1))
        np.testing.assert_allclose(alike, 1.0, atol=1e-12)
    for axis in range(3):
        np.testing.assert_allclose(found.rig.root[:, axis], np.interp(time, old, whole.rig.root[:, axis]), atol=1e-6)
    hits = [(i, round(t * whole.fps)) for i, t in enumerate(time) if abs(t * whole.fps - round(t * whole.fps)) < 1e-9]
    assert len(hits) >= 3
    for i, j in hits:
        np.testing.assert_array_equal(found.positions[i], whole.positions[j])
        np.testing.assert_allclose(found.rig.rotations[i], whole.rig.rotations[j], atol=1e-12)
    assert found.positions.dtype == whole.positions.dtype


def test_bones_keep_their_lengths_between_frames_only_with_a_rig():
    fast = motion(fps=10.0)
    lengths = bone_lengths(fast.positions[0], BODY)
    np.testing.assert_allclose(bone_lengths(fast.resample(33.0).positions, BODY), np.tile(lengths, (129, 1)), atol=1e-6)
    chords = bone_lengths(replace(fast, rig=None).resample(33.0).positions, BODY)
    assert (chords - lengths).min() < -1e-3


@pytest.mark.parametrize(("up", "other"), [("y", "z"), ("z", "y")])
@pytest.mark.parametrize("moving", [False, True])
def test_another_up_axis_turns_both(up, other, moving):
    turned = motion(moving=moving, up=up).with_up(other)
    agrees(turned)
    back = turned.with_up(up)
    np.testing.assert_array_equal(back.positions, motion(moving=moving).positions)
    np.testing.assert_allclose(back.rig.rotations, motion().rig.rotations, atol=1e-12)
    np.testing.assert_allclose(back.rig.offsets, OFFSETS, atol=1e-12)


@pytest.mark.parametrize("up", ["y", "z"])
def test_turning_is_the_turn_of_the_models_windows(up):
    whole = motion(up=up)
    turned = whole.turn(0.7)
    agrees(turned)
    x = torch.from_numpy(whole.root_relative())
    np.testing.assert_allclose(turned.root_relative(), turn_heading(x, torch.tensor(0.7), up).numpy(), atol=1e-6)
    height = {"y": 1, "z": 2}[up]
    np.testing.assert_array_equal(turned.positions[..., height], whole.positions[..., height])
    np.testing.assert_allclose(turned.turn(-0.7).positions, whole.positions, atol=1e-6)
    np.testing.assert_allclose(turned.turn(-0.7).rig.rotations, whole.rig.rotations, atol=1e-12)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("moving", [False, True])
def test_the_mirror_image_is_that_of_positions_and_rotations(up, moving):
    whole = motion(moving=moving, up=up)
    image = whole.mirror()
    agrees(image)
    np.testing.assert_array_equal(image.positions[:, 1], whole.positions[:, 3] * [-1, 1, 1])
    np.testing.assert_array_equal(image.positions, replace(whole, rig=None).mirror().positions)
    again = image.mirror()
    np.testing.assert_array_equal(again.positions, whole.positions)
    for name in ("rotations", "offsets", "root"):
        np.testing.assert_array_equal(getattr(again.rig, name), getattr(whole.rig, name))
    assert again.rig.channels == whole.rig.channels
    uneven = replace(whole.rig, channels=(MOVES, MOVES, ANGLES[:1], None, ANGLES, None, ()))
    assert uneven.mirrored(BODY.mirror).channels == (MOVES, MOVES, ANGLES, None, ANGLES[:1], None, ())


def test_a_rig_whose_sides_differ_has_no_mirror_image():
    other = replace(TREE, name="other", parents=(-1, 0, 1, 2, 0, 4, 1))  # the right arm hangs from the ground
    with pytest.raises(ValueError, match="left and right of other are not built alike"):
        replace(rig(), skeleton=other).mirrored(BODY.mirror)


def test_carrying_over_drops_the_rotations_and_staying_keeps_them():
    whole = lafan()
    assert whole.retarget(H36M17).rig is None and whole.retarget(LAFAN1).rig is whole.rig is not None


def test_rotations_of_the_world_are_those_of_the_chain():
    made = rig()
    places, turns = made.world()
    expected = walk_down(made.rotations[5], OFFSETS, made.root[5], TREE.parents)
    np.testing.assert_allclose(places[5], expected[0], atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(turns[5] * expected[1], axis=-1)), 1.0, atol=1e-12)


def lafan(frames: int = 12) -> Motion:
    """A body whose bones lie along the joints' x and whose sides are mirror images along z, as LaFAN1's are."""
    return lafan_motion(frames=frames, seed=3)


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_mirror_image_of_sides_along_another_axis(up):
    whole = replace(lafan(), up=up)
    assert whole.rig.across() == 2
    image = whole.mirror()
    agrees(image)
    np.testing.assert_array_equal(image.positions, replace(whole, rig=None).mirror().positions)
    np.testing.assert_allclose(image.rig.offsets[1:], whole.rig.offsets[1:], atol=1e-12)  # the same body, not its image
    again = image.mirror()
    np.testing.assert_allclose(again.positions, whole.positions, atol=1e-6)
    alike = np.abs(np.sum(again.rig.rotations * whole.rig.rotations, axis=-1))
    np.testing.assert_allclose(alike, 1.0, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_across_is_the_axis_that_the_sides_lie_along(axis):
    """The same body with its joints' frames named otherwise."""
    turn = np.roll(np.eye(3), axis - 2, axis=1)
    assert Rig(**{**vars(lafan().rig), "offsets": lafan().rig.offsets @ turn}).across() == axis
    uneven = lafan().rig.offsets.copy()
    uneven[1] += [0.0, 0.0, 0.025]
    assert replace(lafan().rig, offsets=uneven).across() == 2  # people are never quite even
    uneven[1] += [0.04, 0.04, 0.04]
    assert replace(lafan().rig, offsets=uneven).across() is None


def standing(frames: int = 12) -> Rig:
    """As Bandai-Namco's files: a joint that stays on the floor, and every joint's place in each frame."""
    body = lafan(frames).rig
    tree = body.skeleton
    joints = ("floor", *tree.joints, "prop")
    parents = (-1, 0, *[p + 1 for p in tree.parents[1:]], 0)
    left, right = (tuple(j + 1 for j in side) for side in (tree.left, tree.right))
    skeleton = Skeleton("STANDING", joints, parents, left, right)
    none = np.tile([1.0, 0, 0, 0], (frames, 1, 1))
    quarter = np.array([0.5**0.5, 0, 0, 0.5**0.5])
    rotations = np.concatenate([np.tile(quarter, (frames, 1, 1)), body.rotations, none], axis=1).astype(np.float32)
    moves = np.tile(np.concatenate([np.zeros((1, 3)), body.offsets, np.ones((1, 3))]), (frames, 1, 1))
    moves[:, 1] = body.root
    channels = ((), *[MOVES + ANGLES] * len(tree), MOVES)
    return Rig(skeleton, moves[0], rotations, np.zeros((frames, 3)), tuple(range(1, 23)), channels, moves)


def on_the_floor() -> Motion:
    """A body that hangs from such a joint."""
    rig = standing()
    return Motion(rig.positions().astype(np.float32), 10.0, LAFAN1, up="z", rig=rig)


def test_rooting_keeps_places_and_turns_and_leaves_out_what_does_not_hang_from_the_root():
    whole = on_the_floor()
    rig, found = whole.rig, whole.rig.rooted()
    assert found.skeleton.joints == LAFAN1.joints and found.skeleton.parents == LAFAN1.parents and found.moves is None
    assert found.skeleton.left == LAFAN1.left and found.skeleton.right == LAFAN1.right and found.points == tuple(range(22))
    np.testing.assert_allclose(found.positions(), rig.positions(), atol=1e-6)
    turns, expected = found.world()[1], rig.world()[1][:, 1:23]
    np.testing.assert_allclose(np.abs(np.sum(turns * expected, axis=-1)), 1.0, atol=1e-6)
    assert np.sum(found.rotations[1:] * found.rotations[:-1], axis=-1).min() > 0
    assert set(found.channels[0]) == {*MOVES, *ANGLES} and found.rooted() is found
    own = lafan().rig
    assert own.rooted() is own
    replace(whole, rig=found)  # whose check compares the places


def test_a_body_that_cannot_be_rooted_is_refused():
    rig = standing()
    stretched = rig.moves.copy()
    stretched[3, 6] += [0.0, 0.0, 0.05]
    with pytest.raises(ValueError, match="a joint of STANDING moves 0.05 m against its parent; expected bones of fixed length"):
        replace(rig, moves=stretched).rooted()
    with pytest.raises(ValueError, match="floor does not hang from Hips; expected all to"):
        replace(rig, points=(1, 0, *range(3, 23))).rooted()


@pytest.mark.parametrize("unrooted", [False, True])
def test_rooting_and_mirroring_can_be_exchanged(unrooted):
    """A floor joint and places in every frame do not hide along which axis the sides lie."""
    rig = standing() if unrooted else lafan().rig
    order = LAFAN1.mirror
    one, other = rig.mirrored(order).rooted(), rig.rooted().mirrored(order)
    np.testing.assert_allclose(one.positions(), other.positions(), atol=1e-5)
    np.testing.assert_allclose(one.offsets[1:], other.offsets[1:], atol=1e-6)


def test_turn():
    x = torch.tensor([[1.0, 2.0, 3.0]])
    quarter = torch.tensor(math.pi / 2)
    torch.testing.assert_close(turn_heading(x, quarter), torch.tensor([[-2.0, 1.0, 3.0]]))
    torch.testing.assert_close(turn_heading(x, quarter, up="y"), torch.tensor([[-3.0, 2.0, 1.0]]))


@pytest.mark.parametrize("up", ["z", "y"])
def test_the_heading_turns_with_the_body(up):
    """It is that of the hips, the sides nearest the root, and no other joint's."""
    generator = torch.Generator().manual_seed(0)
    pose, angle = torch.randn(40, 48, generator=generator), torch.linspace(-3, 3, 40)
    turned = turn_heading(pose[:, None], angle, up)[:, 0]
    found = heading(turned, H36M17, up) - heading(pose, H36M17, up) - angle
    assert ((found + math.pi) % (2 * math.pi) - math.pi).abs().max() < 1e-4
    ahead = turn_heading(pose[:, None], -heading(pose, H36M17, up), up)[:, 0].unflatten(-1, (-1, 3))
    hips = ahead[:, H36M17.joints.index("left_hip") - 1] - ahead[:, H36M17.joints.index("right_hip") - 1]
    assert hips[:, 0].min() > 0 and hips[:, {"z": 1, "y": 2}[up]].abs().max() < 1e-4
    with pytest.raises(ValueError, match="stick has no left and right joints"):
        heading(torch.zeros(3), Skeleton("stick", ("root", "tip"), (-1, 0)))


def test_scaled_bones_by_hand():
    """A joint comes to lie where its own bone and all those above it put it."""
    x = torch.randn(5, 48, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    factor = torch.rand(16, generator=torch.Generator().manual_seed(1), dtype=torch.float64) + 0.5
    joints = torch.cat([torch.zeros(5, 1, 3, dtype=torch.float64), x.unflatten(-1, (-1, 3))], dim=1)
    expected = torch.zeros_like(joints)
    for joint, parent in enumerate(H36M17.parents):
        if parent >= 0:
            expected[:, joint] = expected[:, parent] + factor[joint - 1] * (joints[:, joint] - joints[:, parent])
    torch.testing.assert_close(scale_bones(x, factor[None], H36M17), expected[:, 1:].flatten(1))
    torch.testing.assert_close(scale_bones(x, torch.ones(1, 16, dtype=torch.float64), H36M17), x)
