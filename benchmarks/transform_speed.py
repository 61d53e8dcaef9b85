"""Forward and inverse transform of a (400, 125, 48) batch beside PyWavelets and ptwt, in turn, in one process.

    python benchmarks/transform_speed.py [--rounds 15] [--threads 2]

Prints the median of each and the ratios; the goal is at most 0.10 of ptwt and 0.40 of PyWavelets.
"""

from __future__ import annotations

import argparse
import statistics
import time

import ptwt
import pywt
import torch

from mwlib.transforms import WaveletTransform

WAVELET, MODE = "bior2.8", "zero"


def main() -> None:
    """Time one forward and one inverse pass per round, all peers in every round."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    x = torch.randn(400, 125, 48, generator=torch.Generator().manual_seed(0))
    tf, signal = WaveletTransform(125, 48, WAVELET, MODE), x.numpy()
    y = tf(x)
    peers = {
        "mwlib": lambda: tf.inverse(tf(x)),
        "mwlib, projection alone": lambda: tf.project(y),
        "PyWavelets": lambda: pywt.idwt2(pywt.dwt2(signal, WAVELET, MODE), WAVELET, MODE),
        "ptwt": lambda: ptwt.waverec2(ptwt.wavedec2(x, WAVELET, mode=MODE, level=1), WAVELET),
    }
    times: dict[str, list[float]] = {name: [] for name in peers}
    for round_ in range(args.rounds + 2):
        for name, call in peers.items():
            started = time.perf_counter()
            call()
            if round_ >= 2:  # the first rounds warm up
                times[name].append(1e3 * (time.perf_counter() - started))
    ours = statistics.median(times["mwlib"])
    for name, values in times.items():
        median = statistics.median(values)
        print(f"{name:26s} {median:8.1f} ms   (min {min(values):.1f}, max {max(values):.1f})   mwlib / this: {ours / median:.3f}")


if __name__ == "__main__":
    main()
