"""The LaFAN1 benchmark of in-betweening: which windows, in which frame of reference, against which statistics, which errors.

Source: Harvey et al., Robust Motion In-betweening, ACM Transactions on Graphics 39(4), 2020, and the code that they published
with the data; where the two leave something open the code decides. Units: metres. The benchmark's code works in centimetres;
its three errors are the same in any unit.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from tqdm import tqdm

from mwlib.body.kinematics import fk
from mwlib.body.motion import Motion
from mwlib.body.rig import Rig
from mwlib.body.rotation import multiply, rotate
from mwlib.body.skeleton import LAFAN1
from mwlib.metrics import NPSS, continued, l2p, l2q

FPS = 30.0
PAST = 10  # frames before the transition
WINDOW, STRIDE, TEST_SUBJECT = 65, 40, "5"
TRAIN_WINDOW, TRAIN_STRIDE, TRAIN_SUBJECTS = 50, 20, ("1", "2", "3", "4")
LONGEST = WINDOW - PAST - 1
CHUNK = 256  # windows scored at once


class Frames(NamedTuple):
    """Poses of many windows: local unit quaternions (w, x, y, z) of LAFAN1's 22 joints, and where the root is, metres, y up."""

    rotations: Float[Tensor, "N F J 4"]
    root: Float[Tensor, "N F 3"]

    def cut(self, start: int, stop: int) -> Frames:
        """Frames start to stop (exclusive) of each window."""
        return Frames(self.rotations[:, start:stop], self.root[:, start:stop])

    def take(self, windows: slice | Int[Tensor, "..."]) -> Frames:
        """Some of the windows."""
        return Frames(self.rotations[windows], self.root[windows])


# (the 10 frames before, the one frame after, how many frames between) -> those frames
Predictor = Callable[[Frames, Frames, int], Frames]


@dataclass(frozen=True)
class Benchmark:
    """The test windows, and what scoring them takes.

    Args:
        frames: of the test windows, in the benchmark's frame of reference (see `unified`).
        clip, start: where each window comes from: its clip's name and first frame.
        offsets: metres, from parent to joint in the parent's frame; one body for truths and predictions.
        mean, deviation: of the 66 global coordinates over the training windows, metres.
        statistics_clips: names of the training clips, the first of which gave the offsets.
        clips: how many clips of any subject were given.
    """

    frames: Frames
    clip: tuple[str, ...]
    start: Int[Tensor, " N"]
    offsets: Float[Tensor, "J 3"]
    mean: Float[Tensor, " C"]
    deviation: Float[Tensor, " C"]
    statistics_clips: tuple[str, ...]
    clips: int

    def __len__(self) -> int:
        return len(self.clip)


class Score(NamedTuple):
    """Errors of transitions of one length: L2Q and L2P of each window, NPSS over all."""

    l2q: Float[Tensor, " N"]
    l2p: Float[Tensor, " N"]
    npss: float


def lafan1_benchmark(motions: Sequence[Motion], progress: bool = False) -> Benchmark:
    """Cut the test windows of subject 5 and take the statistics of subjects 1 to 4.

    Windows start at 0, 40, 80, ... < length - 65, so one that would end with the last frame is left out; all files give 2232.

    Args:
        motions: of the LaFAN1 files, as `load_motions` reads them.
        progress: show bars on stderr.

    Raises:
        ValueError: a clip is not of LaFAN1's skeleton, not at 30 Hz, without rotations, or of another subject; no test clip or
            no training clip is long enough. The message names the clip, what was found and what was expected.
    """
    for motion in motions:
        _rig(motion)
    subjects = sorted({m.subject for m in motions})
    train = [m for m in motions if m.subject in TRAIN_SUBJECTS and len(m) > TRAIN_WINDOW]
    test = [m for m in motions if m.subject == TEST_SUBJECT and len(m) > WINDOW]
    for name, found, frames in (("subject 5", test, WINDOW), ("subjects 1 to 4", train, TRAIN_WINDOW)):
        if not found:
            there = f"{len(motions)} clips of subjects {', '.join(subjects) or 'none'}"
            raise ValueError(f"{there}; expected a clip of {name} with more than {frames} frames, to cut the benchmark's windows")
    mean, deviation = _statistics(train, progress)
    windows = [_windows(m, WINDOW, STRIDE) for m in test]
    starts = [_starts(m, WINDOW, STRIDE) for m in test]
    return Benchmark(
        Frames(torch.cat([w.rotations for w in windows]), torch.cat([w.root for w in windows])),
        tuple(m.name for m, s in zip(test, starts, strict=True) for _ in s),
        torch.cat(starts),
        _offsets(train[0]),
        mean,
        deviation,
        tuple(m.name for m in train),
        len(motions),
    )


def score(benchmark: Benchmark, predict: Predictor, length: int) -> Score:
    """Errors of a predictor's transitions.

    Both sides get one body's offsets, forward kinematics, and signs that go on from the last frame before the transition (see
    `mwlib.metrics.continued`): without that a network's quaternions, whose signs are free, cannot be compared. The signs of
    recorded and interpolated ones stay as they are.

    Args:
        predict: gets the 10 frames before the transition, the one after it and its length, all in the benchmark's frame of
            reference, float64; gives local rotations (n, length, 22, 4) and root (n, length, 3) of the transition, in the same.
            Windows come in chunks.
        length: frames of the transition; the published ones are 5, 15, 30 and 45.

    Raises:
        ValueError: the length does not fit into the windows, or what the predictor gave has another shape, is not finite, or
            has quaternions that are not of length 1.
    """
    if not 1 <= length <= LONGEST:
        raise ValueError(f"length is {length}; expected 1 to {LONGEST} frames, what a window of {WINDOW} has room for")
    found = []
    for start in range(0, len(benchmark), CHUNK):
        frames = benchmark.frames.take(slice(start, start + CHUNK))
        predicted = predict(frames.cut(0, PAST), frames.cut(PAST + length, PAST + length + 1), length)
        found.append(_checked(predicted, frames.cut(PAST, PAST + length)))
    return score_frames(benchmark, Frames(*(torch.cat(parts) for parts in zip(*found, strict=True))), length)


def score_frames(benchmark: Benchmark, found: Frames, length: int) -> Score:
    """`score` of transitions that are there already: local rotations (N, length, 22, 4) and root (N, length, 3) of all windows.

    Raises:
        ValueError: as of `score`, of what a predictor gave.
    """
    rotation_errors, position_errors, spectrum = [], [], NPSS()
    found = _checked(found, benchmark.frames.cut(PAST, PAST + length))
    for start in range(0, len(benchmark), CHUNK):
        rows = slice(start, start + CHUNK)
        frames = benchmark.frames.take(rows)
        _, before = _world(frames.cut(PAST - 1, PAST), benchmark.offsets)
        both = (found.take(rows), frames.cut(PAST, PAST + length))
        (p, p_turns), (g, g_turns) = (_world(x, benchmark.offsets) for x in both)
        p_turns, g_turns = (continued(turns, before[:, 0]) for turns in (p_turns, g_turns))
        rotation_errors.append(l2q(p_turns, g_turns))
        position_errors.append(l2p(p.flatten(-2), g.flatten(-2), benchmark.mean, benchmark.deviation))
        spectrum.update(p_turns.flatten(-2), g_turns.flatten(-2))
    return Score(torch.cat(rotation_errors), torch.cat(position_errors), spectrum.value())


def unified(frames: Frames) -> Frames:
    """Windows moved and turned into the benchmark's frame of reference; heights stay.

    The root's mean over all frames of the window goes to x = z = 0. Then the window is turned about the y-axis of the world,
    until the horizontal part of the root's own y-axis points along +x in frame 9, the last before the transition.
    """
    level = frames.root.new_tensor([1.0, 0.0, 1.0])
    root = frames.root - level * frames.root.mean(dim=1, keepdim=True)
    facing = rotate(frames.rotations[:, PAST - 1, 0], root.new_tensor([0.0, 1.0, 0.0]).expand(len(root), 3))
    half = torch.atan2(facing[:, 2], facing[:, 0]) / 2  # turning about y by an angle takes x towards -z
    still = torch.zeros_like(half)
    turn = torch.stack([half.cos(), still, half.sin(), still], dim=-1)[:, None]
    rotations = frames.rotations.clone()
    rotations[:, :, 0] = multiply(turn, rotations[:, :, 0])
    return Frames(rotations, rotate(turn, root))


def _rig(motion: Motion) -> Rig:
    """A clip's rotations, y up; refused if it is none of LaFAN1's."""
    rig = motion.rig
    if motion.skeleton != LAFAN1:
        found = f"is of skeleton {motion.skeleton.name} with {len(motion.skeleton)} joints"
    elif motion.fps != FPS:
        found = f"has {motion.fps:g} frames per second"
    elif rig is None:
        found = "has positions but no rotations"
    elif rig.moves is not None:
        found = "has joints other than the root that move against their parents"
    elif motion.subject not in (*TRAIN_SUBJECTS, TEST_SUBJECT):
        found = f"is of subject {motion.subject or 'unknown'!r}"
    else:
        return motion.with_up("y").rig or rig
    expected = f"a clip of LaFAN1: 22 joints, {FPS:g} frames per second, rotations, subject 1 to 5"
    raise ValueError(f"{motion.name or 'a clip'} {found}; expected {expected} (by a name like walk1_subject5.bvh, or clips.csv)")


def _starts(motion: Motion, frames: int, stride: int) -> Int[Tensor, " n"]:
    return torch.arange(0, max(len(motion) - frames, 0), stride)


def _windows(motion: Motion, frames: int, stride: int) -> Frames:
    """A clip's windows, unified. End Sites stay out: their rotations are none."""
    rig = _rig(motion)
    index = _starts(motion, frames, stride)[:, None] + torch.arange(frames)
    rotations = torch.from_numpy(rig.rotations[:, rig.points].astype(np.float64))
    rotations = torch.nn.functional.normalize(rotations, dim=-1)  # the rig keeps float32
    return unified(Frames(rotations[index], torch.from_numpy(rig.root.astype(np.float64))[index]))


def _offsets(motion: Motion) -> Float[Tensor, "J 3"]:
    rig = _rig(motion)
    return torch.from_numpy(rig.offsets[list(rig.points)].astype(np.float64))


def _statistics(motions: Sequence[Motion], progress: bool) -> tuple[Float[Tensor, " C"], Float[Tensor, " C"]]:
    """Mean and deviation (divided by the number, not by one less) of the coordinates over all frames of all windows."""
    means, variances, counts = [], [], []
    for motion in tqdm(motions, "statistics of subjects 1 to 4", unit="clip", disable=is_quiet(progress)):
        places, _ = _world(_windows(motion, TRAIN_WINDOW, TRAIN_STRIDE), _offsets(motion))
        x = places.flatten(0, 1).flatten(1)
        means.append(x.mean(0))
        variances.append(x.var(0, correction=0))
        counts.append(len(x))
    weight = torch.tensor(counts, dtype=torch.float64)[:, None] / sum(counts)
    mean = (weight * torch.stack(means)).sum(0)
    variance = (weight * (torch.stack(variances) + (torch.stack(means) - mean) ** 2)).sum(0)
    return mean, variance.sqrt()


def _world(frames: Frames, offsets: Float[Tensor, "J 3"]) -> tuple[Float[Tensor, "N F J 3"], Float[Tensor, "N F J 4"]]:
    return fk(frames.rotations, offsets, frames.root, LAFAN1)


def _checked(found: Frames, truth: Frames) -> Frames:
    """What a predictor gave, in float64; refused if it cannot be scored."""
    for name, x, g in zip(Frames._fields, found, truth, strict=True):
        if x.shape != g.shape or not x.isfinite().all():
            is_finite = "finite" if x.isfinite().all() else "not finite"
            raise ValueError(f"{name} of the predictor are {tuple(x.shape)}, {is_finite}; expected {tuple(g.shape)}, finite")
    lengths = found.rotations.norm(dim=-1)
    if not ((lengths - 1).abs() < 1e-3).all():
        worst = float(lengths.flatten()[(lengths - 1).abs().argmax()])
        raise ValueError(f"a quaternion of the predictor has length {worst:.4g}; expected 1")
    return Frames(*(x.detach().to(g) for x, g in zip(found, truth, strict=True)))


def is_quiet(progress: bool) -> bool:
    """Whether a bar would help nobody."""
    return not progress or not sys.stderr.isatty()
