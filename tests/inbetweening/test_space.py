"""States of bodies: there and back, seen from a frame, the same wherever and whichever way they stand; files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from mwlib.body.kinematics import heading
from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.formats.bvh import write_bvh
from mwlib.data.load import load_motions
from mwlib.data.windows import Bodies
from mwlib.inbetweening.space import Placement, PositionSpace, RotationSpace, Space, space_from_json
from tests.inbetweening.sample import lafan_motion

SPACES = {"positions": lambda m: PositionSpace(Bodies.of([m])), "rotations": RotationSpace.of}
each_space = pytest.mark.parametrize("make", SPACES.values(), ids=SPACES)


def carried(motion: Motion, way: tuple[float, float, float]) -> Motion:
    """The motion elsewhere."""
    by = np.array(way)
    return replace(motion, positions=motion.positions + by.astype(np.float32), rig=replace(motion.rig, root=motion.rig.root + by))


def seen(space: Space, motion: Motion, frame: int = 0) -> torch.Tensor:
    x, offsets = space.encode(motion), space.offsets(motion)
    return space.seen_from(x, space.placement(x, offsets, frame))


@each_space
def test_positions_of_states_are_the_motions(make):
    motion = lafan_motion()
    space = make(motion)
    x = space.encode(motion)
    assert x.shape == (40, space.channels) and x.dtype == torch.float32
    np.testing.assert_allclose(space.positions(x, space.offsets(motion)), motion.positions, atol=2e-6)
    np.testing.assert_allclose(space.decode(x, motion).positions, motion.positions, atol=2e-6)
    assert space.decode(x[:7], motion).name == motion.name and len(space.decode(x[:7], motion)) == 7


@each_space
@pytest.mark.parametrize("frame", [0, 11])
def test_the_frames_root_is_above_the_origin_and_its_left_along_x(make, frame):
    motion = lafan_motion(seed=5)
    space = make(motion)
    x = seen(space, motion, frame)
    places = space.positions(x, space.offsets(motion))[frame]
    torch.testing.assert_close(places[0, :2], torch.zeros(2), atol=1e-6, rtol=0)
    assert float(x[frame, 2]) == pytest.approx(motion.positions[frame, 0, 2], abs=1e-6)
    left, right = LAFAN1.joints.index("LeftUpLeg"), LAFAN1.joints.index("RightUpLeg")
    across = places[left] - places[right]
    assert float(across[0]) > 0 and abs(float(across[1])) < 1e-6
    relative = (places[1:] - places[:1]).flatten()
    assert float(heading(relative, LAFAN1)) == pytest.approx(0, abs=1e-5)


@each_space
def test_seen_from_a_frame_and_placed_again(make):
    motions = [lafan_motion(seed=s) for s in (1, 2, 3)]
    space = make(motions[0])
    x, offsets = torch.stack([space.encode(m) for m in motions]), torch.stack([space.offsets(m) for m in motions])
    placement = space.placement(x, offsets)
    before = x.clone()
    back = space.placed(space.seen_from(x, placement), placement)
    assert torch.equal(x, before)
    torch.testing.assert_close(back, x, atol=2e-6, rtol=0)
    alone = [space.seen_from(x[i], Placement(placement.angle[i], placement.origin[i])) for i in range(3)]
    torch.testing.assert_close(torch.stack(alone), space.seen_from(x, placement), atol=1e-6, rtol=0)


@each_space
@pytest.mark.parametrize("angle, way", [(0.0, (3.0, -2.0, 0.0)), (1.1, (0.0, 0.0, 0.0)), (-2.5, (-1.0, 4.0, 0.0))])
def test_where_a_motion_happens_and_whither_it_faces_is_not_seen(make, angle, way):
    motion = lafan_motion(seed=8)
    elsewhere = carried(motion.turn(angle), way)
    space = make(motion)
    torch.testing.assert_close(seen(space, elsewhere), seen(space, motion), atol=1e-5, rtol=0)
    lifted = carried(motion, (0.0, 0.0, 0.5))  # height is seen
    assert float((seen(space, lifted) - seen(space, motion))[:, 2].min()) == pytest.approx(0.5, abs=1e-5)


def test_both_spaces_see_the_same_places():
    motion = lafan_motion(seed=4)
    places = [space.positions(seen(space, motion), space.offsets(motion)) for space in (m(motion) for m in SPACES.values())]
    torch.testing.assert_close(*places, atol=1e-5, rtol=0)


def test_rotations_are_the_rigs_against_the_world():
    motion = lafan_motion(seed=6)
    space = RotationSpace.of(motion)
    x, offsets = space.encode(motion), space.offsets(motion)
    turns = motion.rig.world()[1]
    alike = np.abs(np.sum(space.rotations(x, offsets).numpy() * turns, axis=-1))
    np.testing.assert_allclose(alike, 1.0, atol=1e-6)
    placement = space.placement(x, offsets)
    expected = Rotation.from_euler("z", -float(placement.angle)) * Rotation.from_quat(np.roll(turns[:, 7], -1, axis=-1))
    found = np.roll(space.rotations(space.seen_from(x, placement), offsets)[:, 7].numpy(), -1, axis=-1)
    np.testing.assert_allclose(Rotation.from_quat(found).as_matrix(), expected.as_matrix(), atol=1e-5)
    assert PositionSpace(Bodies.of([motion])).rotations(torch.zeros(2, 66), torch.zeros(0, 3)) is None


@each_space
def test_valid_changes_nothing_that_is_valid(make):
    motion = lafan_motion()
    space = make(motion)
    x = space.encode(motion)
    torch.testing.assert_close(space.valid(x), x, atol=1e-5, rtol=0)
    spoilt = x + 0.4 * torch.randn(x.shape, generator=torch.Generator().manual_seed(0))
    once = space.valid(spoilt)
    torch.testing.assert_close(space.valid(once), once, atol=1e-5, rtol=0)
    assert torch.equal(once[:, :3], spoilt[:, :3])
    if isinstance(space, RotationSpace):
        assert (once - spoilt).abs().max() > 0.1
        six = once[:, 3:].unflatten(-1, (-1, 2, 3))
        torch.testing.assert_close(six @ six.mT, torch.eye(2).expand(40, 22, 2, 2), atol=1e-5, rtol=0)
    places = space.positions(spoilt, space.offsets(motion))
    torch.testing.assert_close(space.positions(once, space.offsets(motion)), places, atol=1e-5, rtol=0)


def test_what_is_decoded_can_be_written_and_read_again(tmp_path):
    motion = lafan_motion(seed=9)
    space = RotationSpace.of(motion)
    made = space.decode(space.valid(space.encode(motion)), motion)
    assert made.rig is not None and write_bvh(made, tmp_path / "a.bvh").max < 1e-5
    (again,) = load_motions(tmp_path / "a.bvh", unit="cm")
    assert again.skeleton.joints == LAFAN1.joints
    np.testing.assert_allclose(again.with_up("z").positions, motion.positions, atol=1e-5)
    bare = PositionSpace(Bodies.of([motion])).decode(PositionSpace(Bodies.of([motion])).encode(motion), motion)
    assert bare.rig is None


def test_another_bodys_bones_are_used_where_the_state_has_none():
    small, large = lafan_motion(seed=1), lafan_motion(seed=2, size=1.3)
    space = RotationSpace.of(small)
    places = space.decode(space.encode(small), large).positions
    shin = np.linalg.norm(places[:, 2] - places[:, 3], axis=-1)
    np.testing.assert_allclose(shin, 1.3 * 0.424, atol=1e-5)


@each_space
def test_a_space_comes_back_from_text(make):
    motion = lafan_motion()
    space = make(motion)
    again = space_from_json(space.to_json())
    assert type(again) is type(space) and again.bodies == space.bodies and again.channels == space.channels
    x = space.encode(motion)
    assert torch.equal(again.encode(motion), x) and again.turned == space.turned
    assert torch.equal(again.positions(x, space.offsets(motion)), space.positions(x, space.offsets(motion)))


def test_what_has_no_rotations_or_another_tree_is_refused():
    motion = lafan_motion()
    space = RotationSpace.of(motion)
    bare = replace(motion, rig=None)
    for made in (lambda: RotationSpace.of(bare), lambda: space.encode(bare), lambda: space.offsets(bare)):
        with pytest.raises(ValueError, match="A0 has positions only; expected rotations, .*state=positions"):
            made()
    parents = (*LAFAN1.parents[:18], 9, *LAFAN1.parents[19:])
    other = replace(motion.rig, skeleton=replace(LAFAN1, name="other", parents=parents))
    moved = replace(motion, rig=other, positions=other.positions().astype(np.float32))
    with pytest.raises(ValueError, match="A0 has a rig of 22 joints, other; expected the 22 of LAFAN1"):
        space.encode(moved)


def test_joints_that_turn_in_one_clip_alone_are_not_lost():
    """Two rigs of one tree, of which one has no channels for the head."""
    motion = lafan_motion()
    stiff = motion.rig.rotations.copy()
    stiff[:, 13] = [1.0, 0, 0, 0]
    channels = (MOVES + ANGLES, *[ANGLES] * 12, (), *[ANGLES] * 8)
    first = replace(motion, rig=replace(motion.rig, rotations=stiff, channels=channels))
    space = RotationSpace.of(first)
    assert space.channels == 3 + 6 * 21
    np.testing.assert_allclose(space.positions(space.encode(first), space.offsets(first)), first.positions, atol=1e-5)
    with pytest.raises(ValueError, match="turns Head"):
        space.encode(motion)


def test_bones_are_rigid_unless_a_joint_amid_them_turns():
    """A skeleton without knees: its thigh and shin are one bone, which bends."""
    motion = lafan_motion()
    space = RotationSpace.of(motion)
    assert space.rigid and not PositionSpace(Bodies.of([motion])).rigid
    knee = LAFAN1.joints.index("LeftLeg")
    names = tuple(name for name in LAFAN1.joints if name != "LeftLeg")
    parents = tuple(
        LAFAN1.parents[j] if j <= knee else LAFAN1.parents[j] - (LAFAN1.parents[j] >= knee) for j in range(22) if j != knee
    )
    bent = replace(space.bodies, skeleton=Skeleton("bent", names, parents))
    points = tuple(j for j in range(22) if j != knee)
    assert not replace(space, bodies=bent, points=points).rigid
    assert replace(space, bodies=bent, points=points, turning=points).rigid


def test_a_body_without_sides_faces_nowhere():
    line = Skeleton("line", ("a", "b", "c"), (-1, 0, 1))
    space = PositionSpace(Bodies(line, 10.0, "z"))
    with pytest.raises(ValueError, match="line has no left and right joints"):
        space.placement(torch.zeros(4, 9), torch.zeros(0, 3))
