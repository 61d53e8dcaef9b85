"""In-betweening: ten motions between two poses; forward kinematics and the losses on bodies beside the rest of a training step.

    python benchmarks/bridging_speed.py

Kinematics in torch, all joints of one depth at once, is timed beside a loop over joints on the same windows.
"""

from __future__ import annotations

from time import perf_counter

import torch
from torch import Tensor

import mwlib as mw
from mwlib.body.fit import fit_rig
from mwlib.body.kinematics import fk
from mwlib.body.rotation import multiply, rotate
from mwlib.body.skeleton import Skeleton
from mwlib.data.sources import Split
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.objective import InbetweeningObjective

ROUNDS = 15
LOSSES = dict(diversity_weight=0.0, smoothness_weight=0.1, length_weight=1.0, angle_weight=1.0)


def median_ms(run) -> float:
    """Of several calls, after two that do not count."""
    times = []
    for _ in range(ROUNDS + 2):
        start = perf_counter()
        run()
        times.append(1000 * (perf_counter() - start))
    return sorted(times[2:])[ROUNDS // 2]


def by_joint(turns: Tensor, offsets: Tensor, root: Tensor, skeleton: Skeleton) -> Tensor:
    """Positions, one joint after the other."""
    places, world = [root], [turns[..., 0, :]]
    for joint in range(1, len(skeleton)):
        parent = skeleton.parents[joint]
        places.append(places[parent] + rotate(world[parent], offsets[..., joint, :]))
        world.append(multiply(world[parent], turns[..., joint, :]))
    return torch.stack(places, dim=-2)


def step(objective: InbetweeningObjective):
    """A function that takes a training step but for the optimiser."""
    generator = torch.Generator().manual_seed(0)
    batch = objective.draw(64, generator)

    def run() -> None:
        objective.network.zero_grad()
        objective.loss(objective.network, batch, generator).backward()

    return run


def main() -> None:
    """Print medians and ratios."""
    torch.set_num_threads(2)
    walk = mw.load_motions("synthetic", fps=30)[0]
    poses = walk.cut(0, 1), walk.cut(31, 32)
    mw.inbetween(*poses, frames=30)  # opens the model
    print(f"ten in-betweens of 30 frames, 20 steps: {median_ms(lambda: mw.inbetween(*poses, frames=30, samples=10)):.0f} ms")
    clip = fit_rig(walk).rig
    turns = torch.from_numpy(clip.rotations[:32]).float().expand(64, -1, -1, -1).contiguous()
    offsets = torch.from_numpy(clip.offsets).float().expand(*turns.shape[:-1], 3)
    root = torch.from_numpy(clip.root[:32]).float().expand(64, -1, -1)
    ours, loop = (median_ms(lambda f=f: f(turns, offsets, root, clip.skeleton)) for f in (fk, by_joint))
    print(f"kinematics of 64 windows of 32 frames: {ours:.1f} ms; {ours / loop:.2f} of a loop over joints")
    split = Split([walk], [], [walk])
    for state in ("positions", "rotations"):
        motions = [mw.Motion(walk.positions, 30.0, walk.skeleton, rig=clip)]
        split = Split(motions, [], motions)
        cfg = Config.preset("laptop", state=state, mirror=False)
        plain, full = (median_ms(step(InbetweeningObjective(c, split))) for c in (cfg, cfg.override(**LOSSES)))
        print(f"training step, {state}: {plain:.0f} ms; with the losses on bodies {full:.0f} ms, {full / plain - 1:.0%} more")


if __name__ == "__main__":
    main()
