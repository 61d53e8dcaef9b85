"""Share of sampling time that is not spent inside the network, at a preset, with all of Algorithm 1 switched on.

    python benchmarks/sampling_overhead.py [--preset laptop] [--windows 2] [--threads 2]

Times the network's own evaluations with a wrapper around them; what is left is noise, guidance, projection and inverse
transform. The goal is at most 5 %.
"""

from __future__ import annotations

import argparse
import time

import torch

from mwlib.config import Config
from mwlib.data.windows import windows
from mwlib.predictor import Predictor, make_network, make_transform
from mwlib.runs import split_motions
from mwlib.training import fit_scales


def main() -> None:
    """Sample with an untrained network of the preset's size; its time does not depend on its weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="laptop")
    parser.add_argument("--windows", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    cfg = Config.preset(args.preset)
    x = windows(split_motions(cfg).train, cfg.data.history, cfg.data.future, cfg.data.test_stride)
    base = make_transform(cfg, x.x.shape[-1])
    net = make_network(cfg, base.shape)
    inside, evaluate = [0.0], net.evaluate

    def timed(*arguments, **options):
        started = time.perf_counter()
        out = evaluate(*arguments, **options)
        inside[0] += time.perf_counter() - started
        return out

    net.evaluate = timed
    predictor = Predictor(cfg, net, fit_scales(cfg, base, x.x), x.x.shape[-1])
    off = dict(cfg_weight=0.0, tabg_scale=0.0, wmsg="off")
    on = dict(cfg_weight=0.3, tabg_scale=1.0, wmsg="every_step")
    for name, options in (("conditional only", off), ("CFG + TABG + WMSG", on)):
        for _ in range(args.rounds):
            inside[0], started = 0.0, time.perf_counter()
            predictor.predict(x.past[: args.windows], sampling=predictor.with_sampling(**options))
            total = time.perf_counter() - started
            outside = total - inside[0]
            print(f"{name:20s} {total:6.2f} s, outside the network {outside:5.2f} s = {100 * outside / inside[0]:.1f} % of it")


if __name__ == "__main__":
    main()
