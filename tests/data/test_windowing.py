"""Windows: where they begin, whose they are, and bodies that stay bodies when they are turned and mirrored."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
import torch

from mwlib import Motion
from mwlib.body.kinematics import bone_lengths, bones_of
from mwlib.body.skeleton import H36M17
from mwlib.data.windows import TrainingWindows, Variation, prepare, windows
from mwlib.synthetic.motions import synthetic_motions

T = 10
JOINT = {name: i for i, name in enumerate(H36M17.joints)}


def counted(frames: int, subject: str = "A", clip: int = 0) -> Motion:
    """Every coordinate of frame t of clip k is 100 k + t, the root's 0."""
    positions = np.zeros((frames, 17, 3), np.float32)
    positions[:, 1:] = (100 * clip + np.arange(frames))[:, None, None]
    return Motion(positions, 50.0, H36M17, subject=subject, name=f"{subject}{clip}")


def places(x: torch.Tensor) -> list[tuple[int, int]]:
    """Clip and first frame of windows of `counted` motions; all their frames follow each other."""
    assert torch.equal(x[:, :, 0] - x[:, :1, 0], torch.arange(T).expand(len(x), -1)) and (x == x[..., :1]).all()
    return [divmod(int(first), 100) for first in x[:, 0, 0]]


def test_windows_start_a_stride_apart_and_a_clip_of_one_window_has_none():
    motions = [counted(17, clip=0), counted(T, clip=1), counted(T + 1, clip=2), counted(16, clip=3)]
    with pytest.warns(UserWarning, match=r"1 of 4 clips give no window.*: A1 \(10 frames\); longer clips"):
        cut = windows(motions, 4, 6, 3)
    expected = [(0, 0), (0, 3), (0, 6), (2, 0), (3, 0), (3, 3)]
    assert places(cut.x) == expected == list(zip(cut.clip.tolist(), cut.start.tolist(), strict=True))
    assert cut.x_history.shape[1] == 4 and torch.equal(torch.cat([cut.x_history, cut.x_future], dim=1), cut.x)
    with pytest.raises(ValueError, match="no clip is longer than 10 frames"):
        windows([motions[1]], 4, 6, 3)


def test_thinning_keeps_the_first_and_the_last_and_spreads_the_rest():
    cut = windows([counted(T + 41)], 4, 6, 1)
    assert cut.thin(5).start.tolist() == [0, 10, 20, 30, 40] and places(cut.thin(5).x) == [(0, s) for s in range(0, 41, 10)]
    assert cut.thin(0) is cut and cut.thin(99) is cut


def test_every_window_of_every_clip_is_drawn_and_no_other():
    motions = [counted(13, clip=0), counted(T, clip=1), counted(12, clip=2)]
    source = TrainingWindows(motions, T, "uniform", "none")
    found = Counter(places(source.draw(3000, torch.Generator().manual_seed(0))))
    assert set(found) == {(0, 0), (0, 1), (0, 2), (2, 0), (2, 1)}
    assert all(abs(count - 600) < 100 for count in found.values())


def test_subject_then_clip_then_start_are_drawn_alike():
    """A has two clips, B one: windows of a short clip and of a person with few clips come more often."""
    motions = [counted(T + 1, "A", 0), counted(T + 4, "A", 1), counted(T + 2, "B", 2)]
    draw = torch.Generator().manual_seed(0)
    found = Counter(places(TrainingWindows(motions, T, "subject_action", "none").draw(8000, draw)))
    expected = {(0, 0): 1 / 4, **{(1, s): 1 / 16 for s in range(4)}, (2, 0): 1 / 4, (2, 1): 1 / 4}
    assert set(found) == set(expected)
    assert all(abs(found[place] / 8000 - share) < 0.02 for place, share in expected.items())


@pytest.fixture(scope="module")
def people() -> list[Motion]:
    return prepare(synthetic_motions(subjects=1), 10.0)


def joints_of(x: torch.Tensor) -> np.ndarray:
    """(B, T, 17, 3), the root put back."""
    return np.pad(x.numpy().reshape(*x.shape[:2], -1, 3), ((0, 0), (0, 0), (1, 0), (0, 0))).astype(np.float64)


def handedness(joints: np.ndarray) -> np.ndarray:
    """Per window: share of frames in which knees bend backward for somebody whose left is the left joints' side."""
    left = joints[..., JOINT["left_hip"], :] - joints[..., JOINT["right_hip"], :]
    bent = []
    for side in ("left", "right"):
        hip, knee, foot = (joints[..., JOINT[f"{side}_{name}"], :] for name in ("hip", "knee", "foot"))
        bent.append((left * np.cross(knee - hip, foot - knee)).sum(-1) > 0)
    return np.mean(bent, axis=(0, 2))


def sources(people: list[Motion], augment: str, up: str = "z") -> tuple[np.ndarray, np.ndarray]:
    """The same windows as they are and augmented."""
    motions = [m.with_up(up) for m in people]
    plain, changed = (TrainingWindows(motions, T, "uniform", kind) for kind in ("none", augment))
    return tuple(joints_of(source.draw(256, torch.Generator().manual_seed(0))) for source in (plain, changed))


@pytest.mark.parametrize("up", ["z", "y"])
@pytest.mark.parametrize("augment", ["heading", "heading_mirror"])
def test_bodies_stay_bodies(people, augment, up):
    """Heights, and the bones, each on its own side, are kept; knees still bend backward, with left and right in their places."""
    before, after = sources(people, augment, up)
    axis = "xyz".index(up)
    exchanged = np.abs(after[..., axis] - before[..., axis]).max((1, 2)) > 1e-4
    assert (0.35 < exchanged.mean() < 0.65) if augment == "heading_mirror" else not exchanged.any()
    whole = np.where(exchanged[:, None, None, None], before[:, :, H36M17.mirror], before)
    np.testing.assert_allclose(after[..., axis], whole[..., axis], atol=1e-5)
    np.testing.assert_allclose(bone_lengths(after, H36M17), bone_lengths(whole, H36M17), atol=1e-4)
    assert handedness(before).min() > 0.99 and handedness(after).min() > 0.99


def test_mirroring_exchanges_left_and_right(people):
    """Every window is the original turned, or its mirror image turned; distances to every joint say which."""
    before, after = sources(people, "heading_mirror")
    lifted = np.abs(after[..., 2] - before[..., 2]).max((1, 2)) > 1e-4
    image = before[:, :, H36M17.mirror] * [-1.0, 1.0, 1.0]
    whole = np.where(lifted[:, None, None, None], image, before)
    flat = whole[..., 0] + 1j * whole[..., 1]
    angle = np.angle((np.conj(flat) * (after[..., 0] + 1j * after[..., 1])).sum((1, 2)))
    turned = flat * np.exp(1j * angle)[:, None, None]
    np.testing.assert_allclose(np.stack([turned.real, turned.imag, whole[..., 2]], axis=-1), after, atol=1e-4)


@pytest.mark.parametrize("augment", ["heading", "heading_mirror"])
def test_every_window_has_an_angle_of_its_own_from_the_whole_circle(people, augment):
    before, after = sources(people[:1], augment)
    same = np.abs(after[..., 2] - before[..., 2]).max((1, 2)) < 1e-4
    flat, other = (x[same][..., 0] + 1j * x[same][..., 1] for x in (before, after))
    angle = np.angle((np.conj(flat) * other).sum((1, 2))) % (2 * math.pi)
    assert (np.histogram(angle, 4, (0, 2 * math.pi))[0] > 0.15 * len(angle)).all()
    assert len(np.unique(angle.round(4))) > 0.9 * len(angle)


def test_humanmac_changes_a_whole_batch_alike_by_three_coins(people):
    """Turned or not, each horizontal axis negated or not, joints in their places."""
    plain, source = (TrainingWindows(people, T, "uniform", kind) for kind in ("none", "humanmac"))
    kinds = Counter()
    for seed in range(160):
        before, after = (joints_of(s.draw(16, torch.Generator().manual_seed(seed))) for s in (plain, source))
        np.testing.assert_allclose(after[..., 2], before[..., 2], atol=1e-6)
        a, b = (x[..., :2].reshape(-1, 2) for x in (before, after))
        matrix = np.linalg.lstsq(a, b, rcond=None)[0].T  # one for all windows
        np.testing.assert_allclose(a @ matrix.T, b, atol=1e-4)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(2), atol=1e-4)
        signs = tuple(np.sign(np.diag(matrix)).astype(int)) if np.allclose(np.abs(matrix), np.eye(2), atol=1e-4) else "turned"
        kinds[signs] += 1
        kinds["mirrored"] += np.linalg.det(matrix) < 0
    assert {(1, 1), (1, -1), (-1, 1), (-1, -1), "turned"} <= set(kinds)
    assert all(5 < kinds[signs] < 40 for signs in [(1, 1), (1, -1), (-1, 1), (-1, -1)])
    assert abs(kinds["turned"] - 80) < 25 and abs(kinds["mirrored"] - 80) < 25


def test_other_bodies_make_the_same_movements(people):
    """Every bone keeps its direction and its share of the body: one factor for a window's bone, alike on both sides."""
    plain, source = (TrainingWindows(people, T, "uniform", "none", Variation(bones=bones)) for bones in (0.0, 0.1))
    before, after = (bones_of(s.draw(512, torch.Generator().manual_seed(0)), H36M17) for s in (plain, source))
    lengths, others = before.norm(dim=-1), after.norm(dim=-1)
    torch.testing.assert_close(after / others[..., None], before / lengths[..., None], atol=1e-4, rtol=0)
    factor = (others / lengths).double()
    assert factor.std(1).max() < 1e-4, "the same in all frames"
    factor = factor[:, 0]
    mirrored = torch.from_numpy(H36M17.mirror[1:] - 1)
    torch.testing.assert_close(factor[:, mirrored], factor, atol=1e-4, rtol=0)
    assert abs(float(factor.mean()) - 1) < 0.02 and abs(float(factor.std()) - 0.1 * 2**0.5) < 0.01
    whole = factor.mean(1).std()
    assert 0.1 < whole < 0.12, "one factor for the body beside those of the bones"


def test_clips_are_also_drawn_faster_and_slower():
    """At two speeds up to 1 + speeds, and at their inverses."""
    motion = counted(100)
    source = TrainingWindows([motion], T, "uniform", "none", Variation(speeds=0.5))
    x = source.draw(2000, torch.Generator().manual_seed(0))[:, :, 0]
    speed = (x[:, 1:] - x[:, :-1]).mean(1)
    found = sorted({round(float(v), 2) for v in speed})
    np.testing.assert_allclose(found, [1 / 1.5, 0.8, 1, 1.25, 1.5], atol=0.01)
    twice = Variation(speeds=1.0).clips([motion])[2]
    assert twice.fps == 50.0
    np.testing.assert_allclose(np.diff(twice.root_relative()[:, 0]), 2.0, atol=1e-4)


def test_too_short_clips_are_left_out_or_refused():
    source = TrainingWindows([counted(T, clip=0), counted(T + 1, clip=1)], T, "subject_action", "none")
    assert set(places(source.draw(20, torch.Generator().manual_seed(0)))) == {(1, 0)}
    with pytest.raises(ValueError, match="no training clip is longer than 10 frames"):
        TrainingWindows([counted(T)], T, "uniform", "none")
