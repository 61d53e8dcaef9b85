"""Time of sampling that is not spent inside the network, at a preset, with all of Algorithm 1 switched on.

    python benchmarks/sampling_overhead.py [--preset laptop_paper] [--windows 2] [--rounds 5] [--threads 2]

Times the network's own evaluations with a wrapper around them; what is left is noise, guidance, projection and inverse
transform. The goal is at most 5 % of the network's time. Other programs disturb single steps, so the verdict adds up the
fastest inside and the fastest outside of every denoising step over the rounds.
"""

from __future__ import annotations

import argparse
import time

import torch

from mwlib import Config, windows
from mwlib.data.sources import Split, split_motions
from mwlib.prediction.objective import PredictionObjective
from mwlib.prediction.predictor import Predictor

SETTINGS = {
    "conditional only": dict(guidance_weight=0.0, tabg_scale=0.0, wmsg="off"),
    "CFG + TABG + WMSG": dict(guidance_weight=0.3, tabg_scale=1.0, wmsg="every_step"),
}


class Clock:
    """Splits time into what the network takes and the rest, in stretches."""

    def __init__(self, network: torch.nn.Module) -> None:
        self.evaluate, self.inside, self.last = network.evaluate, 0.0, time.perf_counter()
        network.evaluate = self.timed

    def timed(self, *arguments, **options):
        started = time.perf_counter()
        out = self.evaluate(*arguments, **options)
        self.inside += time.perf_counter() - started
        return out

    def stretch(self) -> tuple[float, float]:
        """Seconds inside and outside the network since the last call."""
        now = time.perf_counter()
        inside, outside = self.inside, now - self.last - self.inside
        self.inside, self.last = 0.0, now
        return inside, outside


def sample(predictor: Predictor, x_history: torch.Tensor, clock: Clock) -> list[tuple[float, float]]:
    """What `predict` does, one stretch for each denoising step and one for the way back to motions."""
    clock.stretch()
    stretches, last = [], None
    for step in predictor.steps(x_history):
        last = step
        stretches.append(clock.stretch())
    predictor.representation.decode(last.y, x_history)
    return [*stretches, clock.stretch()]


def main() -> None:
    """Sample with an untrained network of the preset's size; its time does not depend on its weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="laptop_paper")
    parser.add_argument("--windows", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    cfg = Config.preset(args.preset)
    motions = split_motions(cfg.data).train
    x_history = windows(motions, cfg.windows.history, cfg.windows.future, cfg.windows.test_stride).x_history[: args.windows]
    objective = PredictionObjective(cfg, Split(motions, [], []))
    clock = Clock(objective.network)
    predictor = Predictor(objective.network, objective.representation, cfg, objective.bodies)
    for name, settings in SETTINGS.items():
        guided, rounds = predictor.with_sampling(**settings), []
        for _ in range(args.rounds):
            rounds.append(sample(guided, x_history, clock))
            report(name, *map(sum, zip(*rounds[-1], strict=True)))
        fastest = [[min(times) for times in zip(*stretch, strict=True)] for stretch in zip(*rounds, strict=True)]
        report(f"{name}, fastest steps", *map(sum, zip(*fastest, strict=True)))


def report(name: str, inside: float, outside: float) -> None:
    """One line."""
    print(f"{name:32s} network {inside:6.2f} s, outside {outside:5.2f} s = {100 * outside / inside:.1f} % of it", flush=True)


if __name__ == "__main__":
    main()
