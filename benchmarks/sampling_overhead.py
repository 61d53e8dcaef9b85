"""Time of sampling that is not spent inside the network, at a preset, with all of Algorithm 1 switched on.

    python benchmarks/sampling_overhead.py [--preset laptop] [--windows 2] [--rounds 5] [--threads 2]

Times the network's own evaluations with a wrapper around them; what is left is noise, guidance, projection and inverse
transform. The goal is at most 5 % of the network's time, in the median.
"""

from __future__ import annotations

import argparse
import statistics
import time

import torch

from mwlib import Config, windows
from mwlib.data.sources import split_motions
from mwlib.prediction.objective import PredictionObjective
from mwlib.prediction.predictor import Predictor

OFF = dict(guidance_weight=0.0, tabg_scale=0.0, wmsg="off")
ON = dict(guidance_weight=0.3, tabg_scale=1.0, wmsg="every_step")


def main() -> None:
    """Sample with an untrained network of the preset's size; its time does not depend on its weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="laptop")
    parser.add_argument("--windows", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    cfg = Config.preset(args.preset)
    motions = split_motions(cfg.data).train
    x_history = windows(motions, cfg.windows.history, cfg.windows.future, cfg.windows.test_stride).x_history[: args.windows]
    objective = PredictionObjective(cfg, motions)
    inside, evaluate = [0.0], objective.network.evaluate

    def timed(*arguments, **options):
        started = time.perf_counter()
        out = evaluate(*arguments, **options)
        inside[0] += time.perf_counter() - started
        return out

    objective.network.evaluate = timed
    predictor = Predictor(objective.network, objective.representation, cfg.diffusion, cfg.sampling, objective.bodies)
    for name, options in (("conditional only", OFF), ("CFG + TABG + WMSG", ON)):
        guided, shares = predictor.with_sampling(**options), []
        for _ in range(args.rounds):
            inside[0], started = 0.0, time.perf_counter()
            guided.predict(x_history)
            total = time.perf_counter() - started
            outside = total - inside[0]
            shares.append(100 * outside / inside[0])
            print(f"{name:20s} {total:6.2f} s, outside the network {outside:5.2f} s = {shares[-1]:.1f} % of it")
        print(f"{name:20s} median {statistics.median(shares):.1f} %")


if __name__ == "__main__":
    main()
