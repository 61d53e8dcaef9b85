"""The LaFAN1 benchmark of in-betweening: windows, statistics, errors, baselines, published numbers.

Source: Harvey et al., Robust Motion In-betweening, ACM Transactions on Graphics 39(4), 2020, and the code that they published
with the data; where the two leave something open the code decides. Units: metres. The benchmark's code works in centimetres;
its three errors are the same in any unit.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from tqdm import tqdm

from mwlib.body.motion import Motion
from mwlib.body.rotation import slerp
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.inbetweening.baselines import between
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.space import UP, Placement, RotationSpace, Space, Tracks
from mwlib.inbetweening.system import Fill, Score, inside
from mwlib.inbetweening.windows import Clips, PlacedWindows

FPS = 30.0
PAST = 10  # frames before the transition
WINDOW, STRIDE, TEST_SUBJECT = 65, 40, "5"
TRAIN_WINDOW, TRAIN_STRIDE, TRAIN_SUBJECTS = 50, 20, ("1", "2", "3", "4")
LENGTHS, LONGEST = (5, 15, 30, 45), WINDOW - PAST - 1  # frames of a transition: those published, and the most
CHUNK = 256  # windows scored at once
NEAR = 0.01  # 1 - |cos| of half an angle, below which the benchmark's code interpolates quaternions linearly
ALL_WINDOWS, ALL_CLIPS = 2232, 77  # of the whole data set
BASELINES = {"zero velocity": "zero_velocity", "interpolation": "interpolation"}  # row -> pace, see `between`
TOLERANCE = {"L2Q": 5e-3, "L2P": 5e-5, "NPSS": 5e-5}  # half of the last digit published


@dataclass(frozen=True)
class Benchmark:
    """The test windows, and what scoring them takes.

    Args:
        space: what a state means: the root's place and the rotations of LAFAN1's 22 joints, z up.
        windows: of subject 5, seen from the last frame before the transition, float64; one body for all, truths and predictions.
        clip: the name of each window's clip.
        deviation: of the 66 global coordinates over the training windows, metres.
        statistics_clips: names of the training clips, the first of which gave the body.
        clips: how many clips of any subject were given.
    """

    space: RotationSpace
    windows: PlacedWindows
    clip: tuple[str, ...]
    deviation: Float[Tensor, " C"]
    statistics_clips: tuple[str, ...]
    clips: int

    def __len__(self) -> int:
        return len(self.clip)


def lafan1_benchmark(motions: Sequence[Motion], progress: bool = False) -> Benchmark:
    """Cut the test windows of subject 5 and take the statistics of subjects 1 to 4.

    Windows start at 0, 40, 80, ... < length - 65, so one that would end with the last frame is left out; all files give 2232.

    Args:
        motions: of the LaFAN1 files, as `load_motions` reads them.
        progress: show a bar on stderr.

    Raises:
        ValueError: a clip is not of LaFAN1's skeleton, not at 30 Hz, without rotations, or of another subject; no test clip or
            no training clip is long enough. The message names the clip, what was found and what was expected.
    """
    for motion in motions:
        _check_clip(motion)
    train = [m.with_up(UP) for m in motions if m.subject in TRAIN_SUBJECTS and len(m) > TRAIN_WINDOW]
    test = [m.with_up(UP) for m in motions if m.subject == TEST_SUBJECT and len(m) > WINDOW]
    for name, found, frames in (("subject 5", test, WINDOW), ("subjects 1 to 4", train, TRAIN_WINDOW)):
        if not found:
            there = f"{len(motions)} clips of subjects {', '.join(sorted({m.subject for m in motions})) or 'none'}"
            raise ValueError(f"{there}; expected a clip of {name} with more than {frames} frames, to cut the benchmark's windows")
    space = RotationSpace.of(train[0])
    clips = Clips(test, space, dtype=torch.float64)
    clips.offsets = space.offsets(train[0]).expand_as(clips.offsets)
    windows = clips.windows(WINDOW, STRIDE, PAST)
    names = tuple(test[number].name for number in windows.clip.tolist())
    return Benchmark(space, windows, names, _deviation(train, space, progress), tuple(m.name for m in train), len(motions))


def _check_clip(motion: Motion) -> None:
    if motion.skeleton != LAFAN1:
        found = f"is of skeleton {motion.skeleton.name} with {len(motion.skeleton)} joints"
    elif motion.fps != FPS:
        found = f"has {motion.fps:g} frames per second"
    elif motion.rig is None:
        found = "has positions but no rotations"
    elif motion.rig.moves is not None:
        found = "has joints other than the root that move against their parents"
    elif motion.subject not in (*TRAIN_SUBJECTS, TEST_SUBJECT):
        found = f"is of subject {motion.subject or 'unknown'!r}"
    else:
        return
    expected = f"a clip of LaFAN1: 22 joints, {FPS:g} frames per second, rotations, subject 1 to 5"
    raise ValueError(f"{motion.name or 'a clip'} {found}; expected {expected} (by a name like walk1_subject5.bvh, or clips.csv)")


def _deviation(motions: Sequence[Motion], space: RotationSpace, progress: bool) -> Float[Tensor, " C"]:
    """Of the coordinates over all frames of all windows, divided by their number, not by one less."""
    count, sums = 0, torch.zeros(2, 3 * len(LAFAN1), dtype=torch.float64)
    for motion in tqdm(motions, "statistics of subjects 1 to 4", unit="clip", disable=None if progress else True):
        seen = Clips([motion], space, dtype=torch.float64).windows(TRAIN_WINDOW, TRAIN_STRIDE, PAST)
        x = space.positions(in_frame_of_reference(space, seen.x[:, None], seen.x), seen.offsets[:, None]).flatten(0, 2).flatten(1)
        sums += torch.stack([x.sum(0), x.square().sum(0)])
        count += len(x)
    mean, square = sums / count
    return (square - mean.square()).sqrt()


def in_frame_of_reference(space: RotationSpace, x: Float[Tensor, "N S F C"], windows: Tracks) -> Float[Tensor, "N S F C"]:
    """States in the benchmark's frame of reference, y up; heights stay.

    The root's mean over all frames of the window goes to x = z = 0. Then the window is turned about the up-axis of the world,
    until the horizontal part of the root's own y-axis points along +x in frame 9, the last before the transition.

    Args:
        space: of the states.
        x: z up, in the place of the windows.
        windows: what says where that is.
    """
    ahead = windows[:, PAST - 1, 6:9]  # the second column of the root's rotation
    angle, origin = torch.atan2(ahead[:, 1], ahead[:, 0]), windows[..., :2].mean(1)
    moved = space.seen_from(x, Placement(angle, origin).of_samples())
    whole_body = moved[..., : 3 * space.turned].unflatten(-1, (-1, 3))[..., [0, 2, 1]] * x.new_tensor([1.0, 1.0, -1.0])
    return torch.cat([whole_body.flatten(-2), moved[..., 3 * space.turned :]], dim=-1)


def score(benchmark: Benchmark, fill: Fill, length: int) -> dict[str, float]:
    """Errors of what fills the transitions: "L2Q" and "L2P", means over windows and samples, and "NPSS".

    Both sides get one body's offsets, forward kinematics, and signs that go on from the last frame before the transition (see
    `mwlib.metrics.continued`): without that a network's quaternions, whose signs are free, cannot be compared. The signs of
    recorded and interpolated ones stay as they are.

    Args:
        benchmark: the test windows.
        fill: gets windows of 10 + length + 1 frames, those of the transition replaced by the one before it, and the windows'
            numbers; gives such windows again, (n, samples, frames, C). Only the transitions are scored. Windows come in chunks.
        length: frames of the transition; the published ones are 5, 15, 30 and 45.

    Raises:
        ValueError: the length does not fit into the windows, or what fills them has another shape or is not finite.
    """
    if not 1 <= length <= LONGEST:
        raise ValueError(f"length is {length}; expected 1 to {LONGEST} frames, what a window of {WINDOW} has room for")
    space, scored, parts = benchmark.space, Score(benchmark.space, benchmark.deviation, PAST), []
    for first in range(0, len(benchmark), CHUNK):
        part = benchmark.windows.pick(slice(first, first + CHUNK))
        truth = part.x[:, : PAST + length + 1]
        found = fill(_hidden(part, length), [*range(first, first + len(truth))])
        if found.shape != (len(truth), found.shape[1], *truth.shape[1:]) or not found.isfinite().all():
            raise ValueError(
                f"what fills the windows is {tuple(found.shape)}, {'' if found.isfinite().all() else 'not '}finite; "
                f"expected ({len(truth)}, samples, {', '.join(map(str, truth.shape[1:]))}), finite"
            )
        x, g = (in_frame_of_reference(space, each.to(truth)[:, :, PAST - 1 :], part.x) for each in (found, truth[:, None]))
        parts.append(scored.errors(x, g, part.offsets, *(scored.joints(each, part.offsets) for each in (x, g))))
    means = {name.upper(): float(torch.cat([each[name] for each in parts]).mean()) for name in ("l2q", "l2p")}
    return means | {"NPSS": scored.npss.value()}


def _hidden(windows: PlacedWindows, length: int) -> PlacedWindows:
    """Windows around a transition of this length, which stands still in them: what is to be found is not even there."""
    x = windows.x[:, : PAST + length + 1].clone()
    x[:, PAST:-1] = x[:, PAST - 1 : PAST]
    return windows._replace(x=x)


def baseline(space: Space, pace: str) -> Fill:
    """From the last frame before the transition to the one after it: places linearly, local rotations by `benchmark_slerp`."""
    return inside(PAST, 1, lambda x: between(space, x, pace, benchmark_slerp))


def benchmark_slerp(
    a: Float[Tensor, "*#lead 4"], b: Float[Tensor, "*#lead 4"], share: Float[Tensor, "*#lead"]
) -> Float[Tensor, "*lead 4"]:
    """`slerp`, but linear and then normalised where the two are near, as in the benchmark's code. They differ by up to 5e-5."""
    dot = (a * b).sum(dim=-1, keepdim=True)
    line = torch.lerp(a, torch.where(dot < 0, -b, b), share[..., None])
    return torch.where(1 - dot.abs() < NEAR, torch.nn.functional.normalize(line, dim=-1), slerp(a, b, share))


def table(
    benchmark: Benchmark, fills: Mapping[str, Fill] | None = None, lengths: Sequence[int] = LENGTHS, progress: bool = False
) -> list[dict[str, Any]]:
    """Scores of several methods at several lengths.

    Args:
        benchmark: the test windows.
        fills: what fills the transitions, by name, see `score`; None = the two baselines of the benchmark.
        lengths: of transitions, frames.
        progress: show a bar on stderr.

    Returns:
        A row for each method and length: "method", "N", "windows", "L2Q", "L2P", "NPSS".

    Raises:
        ValueError: as in `score`.
    """
    fills = {name: baseline(benchmark.space, pace) for name, pace in BASELINES.items()} if fills is None else fills
    cases = tqdm([(name, n) for name in fills for n in lengths], "scoring", unit="row", disable=None if progress else True)
    return [{"method": name, "N": n, "windows": len(benchmark), **score(benchmark, fills[name], n)} for name, n in cases]


def model_table(
    bridge: Bridge,
    benchmark: Benchmark,
    name: str,
    samples: int | None = None,
    seed: int | None = None,
    lengths: Sequence[int] = LENGTHS,
    progress: bool = False,
) -> list[dict[str, Any]]:
    """Scores of a trained model at several lengths.

    The model sees the last frames of the past, as many as it was trained with, and the frame after the transition.

    Args:
        bridge: the model.
        benchmark: the test windows.
        name: of the model, for the rows.
        samples, seed: of each window; None = the settings'.
        lengths: of transitions, frames; what the model was not trained for gets None.
        progress: show bars on stderr.

    Returns:
        Rows as of `table`, three for each length: the mean of the errors of single samples; the errors of the samples' average
        (of the states, which are made rotations again); and those of `Bridge.mean`.

    Raises:
        ValueError: the model does not fit the benchmark, see `check_model`, its clips had another rig, or no length.
    """
    check_model(bridge.cfg, bridge.space)
    if bridge.space.to_json() != benchmark.space.to_json():
        raise ValueError("the model was trained on clips with another rig than the benchmark's; expected the same files' joints")
    task, count = bridge.cfg.task, samples or bridge.cfg.sampling.samples
    least = task.shortest or task.between
    fitting = [n for n in lengths if least <= n <= task.between]
    if not fitting:
        raise ValueError(f"the model is for {least} to {task.between} frames between; expected some of {[*lengths]}")
    names = "single samples", f"average of {count}", "its mean" if bridge.cfg.model.mean_width else "its curve"
    errors: dict[int, list[dict[str, float]]] = {}
    for n in fitting:
        seen = _hidden(benchmark.windows, n).x[:, PAST - task.past :].float()
        x = bridge.sample(seen, None, count, seed, progress=progress)
        found = x, x.mean(1, keepdim=True), bridge.mean(seen)[:, None]
        errors[n] = [score(benchmark, _given(each), n) for each in found]
    return [
        {"method": f"{name}, {what}", "N": n, "windows": len(benchmark)}
        | (errors[n][place] if n in errors else dict.fromkeys(TOLERANCE))
        for place, what in enumerate(names)
        for n in lengths
    ]


def _given(x: Float[Tensor, "N S F C"]) -> Fill:
    """A filling with states that are there already, perhaps of the last frames of the past alone."""

    def fill(seen: PlacedWindows, ids: list[int]) -> Tensor:
        """Samples that are there already, behind the observed frames."""
        before = seen.x[:, None, : seen.x.shape[1] - x.shape[2]].expand(-1, x.shape[1], -1, -1)
        return torch.cat([before, x[ids].to(before)], dim=2)

    return fill


def check_model(cfg: Config, space: Space) -> None:
    """Refuse a model of which the benchmark cannot be asked.

    Raises:
        ValueError: it has no rotations, another skeleton or rate, needs a longer past than the benchmark gives, or was trained
            on the test person.
    """
    data, bodies = cfg.data, space.bodies
    if bodies.skeleton != LAFAN1:
        found = f"is of skeleton {bodies.skeleton.name} with {len(bodies.skeleton)} joints"
    elif not isinstance(space, RotationSpace) or sorted(space.turning) != sorted(space.points):
        found = "has places or other rotations"
    elif bodies.fps != FPS:
        found = f"has {bodies.fps:g} frames per second"
    elif cfg.task.past > PAST:
        found = f"is given {cfg.task.past} frames of the past"
    elif TEST_SUBJECT in data.train_subjects or (
        data.test_subjects and not data.train_subjects and TEST_SUBJECT not in (*data.validation_subjects, *data.test_subjects)
    ):
        found = f"was trained on subject {TEST_SUBJECT}"
    else:
        return
    expected = f"one of LaFAN1's 22 joints with rotations, at {FPS:g} Hz, with a past of at most {PAST} frames"
    raise ValueError(f"the model {found}; expected {expected}, trained on subjects 1 to 4 (preset lafan1_official)")


def is_complete(benchmark: Benchmark) -> bool:
    """True for all test windows of all clips, whose numbers alone may be compared with published ones."""
    return len(benchmark) == ALL_WINDOWS and benchmark.clips == ALL_CLIPS


def published() -> list[dict[str, Any]]:
    """Published rows in the form of `table`, with their "source"; an error that was not published is None."""
    with Path(__file__).with_suffix(".csv").open(encoding="utf-8") as file:
        rows: list[dict[str, Any]] = [*csv.DictReader(file)]
    for row in rows:
        row |= {name: int(row[name]) for name in ("N", "windows")}
        row |= {name: float(row[name]) if row[name] else None for name in TOLERANCE}
    return rows


def misses(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Errors of the baselines that differ from the published digits, as sentences; of all windows alone they mean anything.

    Args:
        rows: from `table`.

    Returns:
        One for each error that is off by more than `TOLERANCE`; none if all digits are met.
    """
    expected = {(row["method"], row["N"]): row for row in published() if row["method"] in BASELINES}
    found = []
    for row in rows:
        known = expected.get((row["method"], row["N"]), {})
        for name in TOLERANCE.keys() & known.keys():
            if not abs(row[name] - known[name]) <= TOLERANCE[name]:  # True for nan
                found.append(f"{name} of {row['method']} at {row['N']} frames is {row[name]:.5f}, published {known[name]:g}")
    return sorted(found)
