"""Futures cut from the inverse transform beside futures that continue the history: the same drawn coefficients, decoded twice.

    python benchmarks/decoding.py cmu

A model that comes with the package draws its samples once, for every test window; half an hour of one core for `cmu`, whose
clips must lie under MWLIB_DATA. Prints a Markdown table, and paired differences with errors over clips and over people.
"""

from __future__ import annotations

import argparse

import numpy as np
import torch
from tqdm import tqdm

from mwlib.experiments.runs import load_run
from mwlib.metrics import clustered_error
from mwlib.plots.tables import results_table
from mwlib.prediction.system import DETAILS, METRICS, evaluate, load_data, score, test_windows

SHOWN = (
    "ade", "fde", "mmade", "mmfde", "error_0.2s", "average_ade", "ade_of_mean", "speed", "seam_jerk", "first_step", "jerk",
    "median_jerk", "coverage_0.5", "coverage_0.9", "behind_still", "worst",
)  # fmt: skip
COLUMNS = METRICS | DETAILS


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?", default="cmu", help="synthetic or cmu (default cmu)")
    given = parser.parse_args()
    model = load_run(given.model)
    cfg = model.cfg
    data = load_data(cfg)
    test = test_windows(data, cfg.windows)
    with torch.inference_mode():
        drawn = model.sampled(test.x_history)
        y = torch.cat([part for part, _ in tqdm(drawn, total=-(-len(test) // model.chunk(cfg.sampling.samples)), unit="chunk")])
    found = {"truth": evaluate(cfg.override(method="truth"), lambda: model, data)}
    for way in ("inverse", "continued"):
        decoder = model.with_sampling(decoding=way)
        found[way] = score(lambda x_history, ids, by=decoder: by.decode(y[ids], x_history), test, test, cfg.evaluation)
    print(results_table([_row(name, result["mean"]) for name, result in found.items()]))
    clips = test.clip.tolist()
    people = np.array([test.motions[clip].subject for clip in clips])
    cut, continued = (found[way]["values"] for way in ("inverse", "continued"))
    for name in SHOWN:
        if name in cut:
            apart = COLUMNS[name].scale * (np.array(continued[name]) - np.array(cut[name]))
            means = [apart[people == person].mean() for person in np.unique(people)]
            error = np.std(means, ddof=1) / len(means) ** 0.5
            print(f"{name}: {apart.mean():+.4g} ± {clustered_error(apart, clips):.2g} over clips, ± {error:.2g} over people")


def _row(name: str, mean: dict[str, float]) -> dict[str, object]:
    return {"decoding": name} | {COLUMNS[m].heading: COLUMNS[m].scale * mean[m] for m in SHOWN if m in mean}


if __name__ == "__main__":
    main()
