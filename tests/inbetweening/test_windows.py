"""Windows against slow loops: all of them, drawn, mirrored; keyframes and the lines between them against NumPy."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
import torch

from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.inbetweening.space import Placement, PositionSpace, RotationSpace
from mwlib.inbetweening.windows import (
    Clips,
    coasting,
    draw_keyframes,
    given,
    interpolated,
    make_space,
    mirror_images,
    parted,
    ready,
)
from tests.inbetweening.sample import dancers, lafan_motion, people

LENGTHS = (20, 9, 8, 31, 3)


def clips(state: str = "positions") -> Clips:
    motions = [lafan_motion(n, seed=n) for n in LENGTHS]
    return Clips(motions, make_space(motions, state))


@pytest.mark.parametrize("state", ["positions", "rotations"])
@pytest.mark.parametrize("frames, stride", [(8, 1), (8, 5), (3, 4), (30, 40)])
def test_all_windows_are_those_of_a_slow_loop(state, frames, stride):
    found = clips(state)
    windows, at = found.windows(frames, stride), 0
    for number, motion in enumerate(found.motions):
        start = 0
        while start + frames < len(motion):  # strictly, as LaFAN1's code has it
            part = motion.cut(start, start + frames)
            x, offsets = found.space.encode(part), found.space.offsets(part)
            place = found.space.placement(x, offsets)
            assert (int(windows.clip[at]), int(windows.start[at])) == (number, start)
            torch.testing.assert_close(windows.x[at], found.space.seen_from(x, place), atol=1e-5, rtol=0)
            torch.testing.assert_close(windows.offsets[at], offsets)
            here = Placement(windows.placement.angle[at], windows.placement.origin[at])
            np.testing.assert_allclose(
                found.space.positions(found.space.placed(windows.x[at], here), offsets), part.positions, atol=1e-5
            )
            at, start = at + 1, start + stride
    assert at == len(windows.x) == len(windows.clip) == len(windows.start)


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_windows_with_a_past_are_seen_from_its_last_frame(state):
    found = clips(state)
    alone, whole = found.windows(8, 5), found.windows(11, 5, past=4)
    for number, (clip, start) in enumerate(zip(whole.clip.tolist(), whole.start.tolist(), strict=True)):
        later = found.at(torch.tensor([clip]), torch.tensor([start + 3]), 8)
        torch.testing.assert_close(whole.x[number, 3:], later.x[0])
        torch.testing.assert_close(whole.placement.origin[number], later.placement.origin[0])
    assert whole.x[:, 3, :2].abs().max() < 1e-6 < whole.x[:, 0, :2].abs().max() and alone.x[:, 0, :2].abs().max() < 1e-6
    drawn = found.draw(9, 11, torch.Generator().manual_seed(1), past=4)
    torch.testing.assert_close(drawn.x, found.at(drawn.clip, drawn.start, 11, 4).x)


def test_lafans_count_of_windows():
    """`while start + 65 < frames`, stride 40."""
    lengths = [65, 66, 105, 106, 300]
    motions = [people().train[0].resample(10.0) for _ in lengths]
    motions = [
        replace(m, positions=np.resize(m.positions, (n, *m.positions.shape[1:]))) for m, n in zip(motions, lengths, strict=True)
    ]
    clip, start = Clips(motions, make_space(motions, "positions")).starts(65, 40)
    expected = [(i, s) for i, n in enumerate(lengths) for s in range(0, n, 40) if s + 65 < n]
    assert [*zip(clip.tolist(), start.tolist(), strict=True)] == expected


def test_every_window_is_drawn_as_often_as_another(generator):
    found = clips()
    windows = found.draw(5200, 8, generator)
    pairs = list(zip(windows.clip.tolist(), windows.start.tolist(), strict=True))
    clip, start = found.starts(8, 1)
    everyone = [*zip(clip.tolist(), start.tolist(), strict=True)]
    assert {*pairs} == {*everyone}
    counts = np.array([pairs.count(pair) for pair in everyone])
    expected = 5200 / len(everyone)
    assert ((counts - expected) ** 2 / expected).sum() < len(everyone) + 5 * np.sqrt(2 * len(everyone))
    again = found.at(windows.clip[:9], windows.start[:9], 8)
    torch.testing.assert_close(again.x, windows.x[:9])
    same = found.draw(50, 8, torch.Generator().manual_seed(3))
    assert torch.equal(same.x, found.draw(50, 8, torch.Generator().manual_seed(3)).x)


@pytest.mark.parametrize("ask", ["windows", "draw"])
def test_clips_that_are_too_short_are_refused(ask, generator):
    found = clips()
    given = {"windows": (31, 5), "draw": (4, 31, generator)}[ask]
    with pytest.raises(ValueError, match="no clip is longer than 31 frames, .*the longest has 31; longer clips"):
        getattr(found, ask)(*given)


@pytest.mark.parametrize("state", ["positions", "rotations"])
def test_mirror_images_are_the_same_windows_mirrored(state):
    motions = [lafan_motion(20, seed=s) for s in (1, 2)]
    space = make_space(motions, state)
    found = Clips(motions, space, mirror=True)
    assert len(found.motions) == 4
    windows = found.windows(8, 6)
    half = len(windows.x) // 2
    torch.testing.assert_close(windows.offsets[half:], windows.offsets[:half], atol=1e-6, rtol=0)
    places = space.positions(windows.x, windows.offsets)
    order = torch.from_numpy(LAFAN1.mirror)
    expected = places[:half][..., order, :] * torch.tensor([-1.0, 1.0, 1.0])
    torch.testing.assert_close(places[half:], expected, atol=1e-5, rtol=0)


def test_what_cannot_be_mirrored_is_left_out_with_a_warning():
    motions = [lafan_motion(20, seed=1)]
    offsets = motions[0].rig.offsets.copy()
    offsets[1] += 0.1
    rig = replace(motions[0].rig, offsets=offsets)
    uneven = [replace(motions[0], rig=rig, positions=rig.positions().astype(np.float32))]
    with pytest.warns(UserWarning, match="does not mirror: left and right joints of LAFAN1 are not turned alike"):
        assert mirror_images(uneven, RotationSpace.of(uneven[0])) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(mirror_images(uneven, make_space(uneven, "positions"))) == 1


def test_spaces_by_name_and_motions_made_ready():
    split = dancers()
    assert isinstance(make_space(split.train, "positions"), PositionSpace)
    assert isinstance(make_space(split.train, "rotations"), RotationSpace)
    (made,) = ready([replace(lafan_motion(fps=30.0), up="y")], 10.0)
    assert made.up == "z" and made.fps == 10.0 and made.rig is not None and made.skeleton == LAFAN1
    with pytest.raises(ValueError, match="expected one and the same"):
        make_space([split.train[0], replace(split.train[0], fps=11.0)], "positions")


def test_windows_are_thinned_evenly_and_picked():
    windows = clips().windows(8, 1)
    assert all(torch.equal(windows.thin(count).x, windows.x) for count in (0, 10**6))
    few = windows.thin(5)
    rows = np.round(np.linspace(0, len(windows.x) - 1, 5)).astype(int)
    assert torch.equal(few.x, windows.x[rows]) and torch.equal(few.placement.origin, windows.placement.origin[rows])
    part = windows.pick(slice(2, 4))
    assert torch.equal(part.start, windows.start[2:4]) and torch.equal(part.placement.angle, windows.placement.angle[2:4])


def test_drawn_keyframes(generator):
    assert torch.equal(draw_keyframes(3, 5, 0, generator), torch.tensor([[1, 0, 0, 0, 1]] * 3).bool())
    mask = draw_keyframes(4000, 30, 3, generator)
    assert mask[:, [0, -1]].all()
    more = mask[:, 1:-1].sum(1)
    assert int(more.max()) == 3 and abs(float((more == 0).double().mean()) - 0.5) < 0.1
    where = mask[:, 1:-1].double().mean(0)
    assert (where / where.mean() - 1).abs().max() < 0.5  # everywhere
    one, other = (draw_keyframes(9, 30, 3, torch.Generator().manual_seed(1)) for _ in "ab")
    assert torch.equal(one, other)


def test_what_is_given():
    assert given(5).tolist() == [True, False, False, False, True]
    assert given(6, 3).tolist() == [True, True, True, False, False, True]


def test_keyframes_are_drawn_after_the_past(generator):
    assert torch.equal(draw_keyframes(3, 6, 0, generator, 3), given(6, 3).expand(3, -1))
    mask = draw_keyframes(4000, 33, 3, generator, 4)
    assert mask[:, :4].all() and mask[:, -1].all() and int(mask[:, 4:-1].sum(1).max()) == 3
    alone = draw_keyframes(50, 30, 3, torch.Generator().manual_seed(1))
    assert torch.equal(draw_keyframes(50, 33, 3, torch.Generator().manual_seed(1), 4)[:, 3:], alone)


def test_coasting_leaves_with_the_velocity_of_the_past_and_meets_every_keyframe():
    """By hand, and in each window up to its own next keyframe."""
    x, before = torch.zeros(2, 7, 1), torch.tensor([[-9.0], [-1.0]]).expand(2, 2, 1)
    mask = torch.tensor([[1, 0, 0, 0, 0, 0, 1], [1, 0, 0, 1, 0, 0, 1]]).bool()
    found = coasting(torch.where(mask[..., None], x, torch.nan), before, mask, 2.0)[..., 0]
    for row, until in zip(found.tolist(), (6, 3), strict=True):
        assert row == pytest.approx([k * np.exp(-k / 2) * max(1 - k / until, 0) for k in range(7)], abs=1e-6)
    x[:, -1] = 6.0  # a body that goes on as it went needs no correction
    steady = coasting(x, before, given(7), 4.0)
    torch.testing.assert_close(steady[0, :, 0], torch.arange(7.0))
    torch.testing.assert_close(coasting(x, before - 3, given(7), 1e-3), interpolated(x, given(7)), atol=1e-6, rtol=0)
    slow = coasting(x.double(), before.double() + 0.5, given(7), 1e6)  # half the velocity, hardly forgotten
    assert float(slow[0, 1, 0]) == pytest.approx(1 - 0.5 * 5 / 6, abs=1e-4)


def lines(x: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Channel by channel with NumPy."""
    at = np.flatnonzero(mask)
    return np.stack([np.interp(np.arange(len(x)), at, x[at, c]) for c in range(x.shape[1])], axis=1)


def test_interpolation_is_numpys_for_any_mask(generator):
    x = torch.randn(60, 9, 4, dtype=torch.float64, generator=generator)
    mask = torch.rand(60, 9, generator=generator) < 0.3
    mask[mask.sum(1) == 0, 4] = True
    mask[0], mask[1] = True, torch.arange(9) == 6  # all, and one
    expected = np.stack([lines(a, b) for a, b in zip(x.numpy(), mask.numpy(), strict=True)])
    np.testing.assert_allclose(interpolated(x, mask), expected, atol=1e-12)
    ends = torch.arange(9) % 8 == 0
    shared = np.stack([lines(a, ends.numpy()) for a in x.numpy()])
    np.testing.assert_allclose(interpolated(x, ends), shared, atol=1e-12)
    np.testing.assert_allclose(
        interpolated(x.reshape(6, 10, 9, 4), mask.reshape(6, 10, 9)).reshape(60, 9, 4), expected, atol=1e-12
    )
    np.testing.assert_allclose(
        interpolated(x.reshape(6, 10, 9, 4), mask[:6, None])[2], interpolated(x[20:30], mask[2]), atol=1e-12
    )


def test_interpolation_keeps_keyframes_to_the_bit_and_looks_at_nothing_else(generator):
    x = torch.randn(5, 9, 4, generator=generator)
    mask = torch.tensor([0, 1, 0, 0, 1, 0, 0, 1, 0]).bool()
    blind = torch.where(mask[:, None], x, torch.nan)
    found = interpolated(blind, mask)
    assert found.isfinite().all() and torch.equal(found[:, mask], x[:, mask])
    assert torch.equal(found[:, 0], x[:, 1]) and torch.equal(found[:, 8], x[:, 7])


def test_with_a_future_the_line_arrives_as_it_leaves(generator):
    """Hermite's cubic, where nothing is forgotten; and time reversed it is the same."""
    motion = torch.linspace(0, 1, 12)[:, None] ** torch.tensor([1.0, 2.0, 3.0])  # cubics are their own Hermite curve
    before, x, after = parted(motion, 2, 2)
    mask = given(len(x))
    steep = coasting(x, before, mask, 1e6, after)
    line = interpolated(x, mask)
    assert (steep - x).abs().max() < 0.25 * (line - x).abs().max()
    assert torch.equal(steep[[0, -1]], x[[0, -1]])
    back = coasting(x.flip(0), after.flip(0), mask, 9.0, before.flip(0)).flip(0)
    torch.testing.assert_close(coasting(x, before, mask, 9.0, after), back)
    unknown = torch.full_like(before, torch.nan)
    torch.testing.assert_close(coasting(x, unknown, mask, 9.0, unknown), line)
