"""In-betweening: ten motions between two poses; forward kinematics and the losses on bodies beside the rest of a training step.

    python benchmarks/bridging_speed.py

Places in torch straight from six numbers are timed beside `fk`, by quaternions, and beside a loop over joints; steps with losses
on bodies beside steps without, and diversity, for which the network sees every window twice, alone. Contestants take turns, in
one thread, by the processor's own clock: what else the machine does hardly counts.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter, process_time

import torch
from torch import Tensor

import mwlib as mw
from mwlib.body.fitting import fit_rig
from mwlib.body.kinematics import fk, places
from mwlib.body.rig import Rig
from mwlib.body.rotation import from_six, multiply, rotate, six
from mwlib.body.skeleton import Skeleton
from mwlib.data.sources import Split
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.objective import InbetweeningObjective

ROUNDS = 25
LOSSES = dict(diversity_weight=0.0, smoothness_weight=0.1, length_weight=1.0, angle_weight=1.0)
KINDS = {"plain": {}, "on bodies": LOSSES, "diversity": dict(diversity_weight=0.1), "all": LOSSES | dict(diversity_weight=0.1)}


def times(runs: dict[str, Callable[[], object]], clock: Callable[[], float] = process_time) -> dict[str, list[float]]:
    """Milliseconds of each, in turns, after two that do not count."""
    found: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(ROUNDS + 2):
        for name, run in runs.items():
            start = clock()
            run()
            found[name].append(1000 * (clock() - start))
    return {name: rows[2:] for name, rows in found.items()}


def ratio(found: dict[str, list[float]], name: str, base: str) -> float:
    """Median over the turns."""
    return median(one / other for one, other in zip(found[name], found[base], strict=True))


def by_joint(turns: Tensor, offsets: Tensor, root: Tensor, skeleton: Skeleton) -> Tensor:
    """Positions, one joint after the other."""
    found, world = [root], [turns[..., 0, :]]
    for joint in range(1, len(skeleton)):
        parent = skeleton.parents[joint]
        found.append(found[parent] + rotate(world[parent], offsets[..., joint, :]))
        world.append(multiply(world[parent], turns[..., joint, :]))
    return torch.stack(found, dim=-2)


def kinematics(clip: Rig) -> None:
    """From six numbers to places and the gradient back, three ways."""
    numbers = six(torch.from_numpy(clip.rotations[:32])).float().repeat(64, 1, 1, 1).requires_grad_()
    offsets = torch.from_numpy(clip.offsets).float().expand(*numbers.shape[:-1], 3)
    root, tree = torch.from_numpy(clip.root[:32]).float().expand(64, -1, -1), clip.skeleton
    ways = {
        "places": lambda: places(numbers, offsets, root, tree),
        "fk": lambda: fk(from_six(numbers), offsets, root, tree)[0],
        "loop": lambda: by_joint(from_six(numbers), offsets, root, tree),
    }
    found = times({name: lambda way=way: torch.autograd.grad(way().sum(), numbers) for name, way in ways.items()})
    print(
        f"kinematics of 64 windows of 32 frames and back: {median(found['places']):.1f} ms; "
        f"{ratio(found, 'places', 'fk'):.2f} of fk's time, {ratio(found, 'places', 'loop'):.2f} of a loop's over joints"
    )


def step(objective: InbetweeningObjective):
    """A function that takes a training step but for the optimiser."""
    generator = torch.Generator().manual_seed(0)
    batch = objective.draw(64, generator)

    def run() -> None:
        objective.network.zero_grad()
        objective.loss(objective.network, batch, generator).backward()

    return run


def steps(state: str, motion: mw.Motion) -> None:
    """Training steps without and with the losses."""
    split, cfg = Split([motion], [], [motion]), Config.preset("laptop", state=state, mirror=False)
    found = times({name: step(InbetweeningObjective(cfg.override(**kind), split)) for name, kind in KINDS.items()})
    bodies = ratio(found, "on bodies", "plain") - 1
    print(
        f"training step, {state}: {median(found['plain']):.0f} ms; with the losses on bodies {bodies:.0%} more, "
        f"{bodies / (1 + bodies):.0%} of that step; "
        f"with diversity alone {ratio(found, 'diversity', 'plain') - 1:.0%} more, and all of them on top of it "
        f"{ratio(found, 'all', 'diversity') - 1:.0%} more"
    )


def main() -> None:
    """Print medians and ratios."""
    torch.set_num_threads(2)
    walk = mw.load_motions("synthetic", fps=30)[0]
    poses = walk.cut(0, 1), walk.cut(31, 32)
    mw.inbetween(*poses, frames=30)  # opens the model
    whole = times({"ten": lambda: mw.inbetween(*poses, frames=30, samples=10)}, perf_counter)
    print(f"ten in-betweens of 30 frames, 20 steps: {median(whole['ten']):.0f} ms")
    torch.set_num_threads(1)
    clip = fit_rig(walk).rig
    kinematics(clip)
    for state in ("positions", "rotations"):
        steps(state, mw.Motion(walk.positions, 30.0, walk.skeleton, rig=clip))


if __name__ == "__main__":
    main()
