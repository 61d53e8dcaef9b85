"""Time and memory of the metrics on a Human3.6M-sized test set, fed in chunks of random predictions.

The predictions alone would be 5.0 GB; what is measured is that they never have to be held. Last poses are drawn in clusters so
that the multimodal sets have about `--neighbours` members.

    python benchmarks/metrics_memory.py --windows 500
"""

from __future__ import annotations

import argparse
import resource
import time

import torch

from mwlib import metrics
from mwlib.body.skeleton import H36M17


def peak_gib() -> float:
    """Peak resident memory of this process (Linux counts in KiB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--windows", type=int, default=5168)
    parser.add_argument("--samples", type=int, default=50)
    parser.add_argument("--future", type=int, default=100)
    parser.add_argument("--channels", type=int, default=48)
    parser.add_argument("--chunk", type=int, default=64, help="windows predicted at once")
    parser.add_argument("--neighbours", type=int, default=60, help="members of a multimodal set")
    args = parser.parse_args()

    generator = torch.Generator().manual_seed(0)
    centres = torch.randn(max(1, args.windows // args.neighbours), args.channels, generator=generator)
    last = centres[torch.randint(len(centres), (args.windows,), generator=generator)]
    g = torch.randn(args.windows, args.future, args.channels, generator=generator)
    print(f"start: peak {peak_gib():.2f} GiB")

    begin = time.perf_counter()
    gs = metrics.multimodal_futures(last, g, threshold=0.5)
    print(
        f"multimodal sets: {time.perf_counter() - begin:.1f} s, {gs.sizes.float().mean():.1f} members, peak {peak_gib():.2f} GiB"
    )

    table = metrics.MetricTable(gs, skeleton=H36M17 if args.channels == 48 else None)
    begin, drawing = time.perf_counter(), 0.0
    for windows in torch.arange(args.windows).split(args.chunk):
        before = time.perf_counter()
        p = torch.randn(len(windows), args.samples, args.future, args.channels, generator=generator)
        drawing += time.perf_counter() - before
        table.update(p, g[windows], windows)
    print(f"metrics: {time.perf_counter() - begin - drawing:.1f} s, peak {peak_gib():.2f} GiB")
    print({name: round(value, 3) for name, value in table.summary()["mean"].items()})

    begin = time.perf_counter()
    mean = metrics.multimodal_apd(gs).mean()
    print(f"APD of the sets: {mean:.3f} m, {time.perf_counter() - begin:.1f} s, peak {peak_gib():.2f} GiB")


if __name__ == "__main__":
    main()
