"""A trained model on the LaFAN1 benchmark: its windows as the model's states, and the model's samples as its frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.rotation import multiply, rotate, six
from mwlib.body.skeleton import LAFAN1
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.lafan1 import FPS, PAST, TEST_SUBJECT, Benchmark, Frames, is_quiet, score_frames
from mwlib.inbetweening.lafan1_table import LENGTHS
from mwlib.inbetweening.space import Placement, RotationSpace, Space

UPRIGHT = (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # the quarter turn about x that takes y to z, as `Motion.with_up` has it


def model_table(
    bridge: Bridge,
    benchmark: Benchmark,
    name: str,
    samples: int | None = None,
    seed: int | None = None,
    lengths: Sequence[int] = LENGTHS,
    progress: bool = False,
) -> list[dict[str, Any]]:
    """Scores of a trained model at several lengths, on the windows and by the errors of `lafan1.score`.

    The model sees the last frames of the past, as many as it was trained with, and the frame after the transition.

    Args:
        bridge: the model.
        benchmark: the test windows.
        name: of the model, for the rows.
        samples, seed: of each window; None = the settings'.
        lengths: of transitions, frames; what the model was not trained for gets None.
        progress: show bars on stderr.

    Returns:
        Rows as of `lafan1_table.table`, two for each length: the mean of the errors of single samples, and the errors of the
        samples' average (of the states; `to_frames` makes rotations of them again).

    Raises:
        ValueError: the model does not fit the benchmark, see `check_model`, or no length.
    """
    space = check_model(bridge.cfg, bridge.space)
    task, count = bridge.cfg.task, samples or bridge.cfg.sampling.samples
    fitting = [n for n in lengths if task.fewest <= task.past + n + 1 <= task.frames]
    if not fitting:
        least = task.shortest or task.between
        raise ValueError(f"the model is for {least} to {task.between} frames between; expected some of {[*lengths]}")
    rows: dict[str, list[dict[str, Any]]] = {f"{name}, single samples": [], f"{name}, average of {count}": []}
    for n in lengths:
        errors: list[dict[str, float | None]] = [dict.fromkeys(("L2Q", "L2P", "NPSS"))] * 2
        if n in fitting:
            x = fill(bridge, space, benchmark, n, count, seed, not is_quiet(progress))
            errors = [_errors(benchmark, space, each, n) for each in (x.unbind(1), [x.mean(1)])]
        for (method, of), found in zip(rows.items(), errors, strict=True):
            of.append({"method": method, "N": n, "windows": len(benchmark), **found})
    return [row for of in rows.values() for row in of]


def check_model(cfg: Config, space: Space) -> RotationSpace:
    """The model's space, if the benchmark can be asked of it.

    Raises:
        ValueError: the model has no rotations, another skeleton or rate, needs a longer past than the benchmark gives, or was
            trained on the test person.
    """
    data, bodies = cfg.data, space.bodies
    found = ""
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
    if found or not isinstance(space, RotationSpace):
        expected = f"one of LaFAN1's 22 joints with rotations, at {FPS:g} Hz, with a past of at most {PAST} frames"
        raise ValueError(f"the model {found}; expected {expected}, trained on subjects 1 to 4 (preset lafan1_official)")
    return space


def fill(
    bridge: Bridge,
    space: RotationSpace,
    benchmark: Benchmark,
    length: int,
    samples: int,
    seed: int | None,
    progress: bool = False,
) -> Float[Tensor, "N S length C"]:
    """Samples of the transitions as states in the benchmark's place, z up; what is to be found is not looked at.

    Args:
        as in `model_table`.
    """
    past = bridge.cfg.task.past
    x = to_states(space, benchmark.frames.cut(PAST - past, PAST + length + 1)).float()
    x[:, past:-1] = x[:, past - 1 : past]  # what is to be found is not even there
    offsets = torch.zeros(len(space.tree), 3)
    offsets[list(space.points)] = benchmark.offsets.float()
    place = space.placement(x, offsets.expand(len(x), -1, -1), past - 1)
    found = bridge.sample(space.seen_from(x, place), None, samples, seed, progress=progress)
    there = Placement(place.angle[:, None].expand(-1, samples), place.origin[:, None].expand(-1, samples, -1))
    return space.placed(found, there)[:, :, past:-1]


def to_states(space: RotationSpace, frames: Frames) -> Float[Tensor, "N F C"]:
    """Poses of the benchmark, y up, as states, z up, metres."""
    upright = frames.rotations.new_tensor(UPRIGHT)
    turns = frames.rotations.clone()
    turns[..., 0, :] = multiply(upright.expand_as(turns[..., 0, :]), turns[..., 0, :])
    order = [space.points.index(joint) for joint in space.turning]
    root = rotate(upright.expand(*frames.root.shape[:-1], 4), frames.root)
    return torch.cat([root, six(turns[..., order, :]).flatten(-2)], dim=-1)


def to_frames(space: RotationSpace, x: Float[Tensor, "N F C"]) -> Frames:
    """Inverse of `to_states`, float64."""
    x = x.double()
    down = x.new_tensor(UPRIGHT) * x.new_tensor([1.0, -1.0, -1.0, -1.0])
    turns = space.local(x)[..., list(space.points), :]
    turns[..., 0, :] = multiply(down.expand_as(turns[..., 0, :]), turns[..., 0, :])
    return Frames(turns, rotate(down.expand(*x.shape[:-1], 4), x[..., :3]))


def _errors(
    benchmark: Benchmark, space: RotationSpace, each: Sequence[Float[Tensor, "N F C"]], length: int
) -> dict[str, float | None]:
    """Mean errors of one or more fillings of all windows."""
    found = [score_frames(benchmark, to_frames(space, x), length) for x in each]
    sums = {"L2Q": [s.l2q.mean() for s in found], "L2P": [s.l2p.mean() for s in found], "NPSS": [s.npss for s in found]}
    return {name: float(sum(values)) / len(found) for name, values in sums.items()}
