"""Samples that all start from noise of one deviation, and samples whose deviations differ: the shipped `cmu` on strangers.

The rows on the validation person are those among which the setting was chosen. Needs CMU's files under MWLIB_DATA; a quarter of
an hour of a core: python benchmarks/temperatures.py figures/cmu
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch

import mwlib as mw
from mwlib.data.collections import acknowledgement
from mwlib.files import write_together
from mwlib.metrics import clustered_error
from mwlib.plots.saving import as_csv
from mwlib.prediction.system import DETAILS, METRICS, evaluate, load_data

ALIKE, SPREAD, WARMER = (1.1, 0.0), (1.15, 0.25), (1.2, 0.0)  # median temperature, deviation of its logarithm
CHOSEN_ON = "1"
TRIED = {
    CHOSEN_ON: (ALIKE, (1.1, 0.2), (1.1, 0.3), (1.1, 0.4), SPREAD, (1.2, 0.3), (1.0, 0.4), WARMER),
    "2, 7, 29": (ALIKE, SPREAD, WARMER),
}
COLUMNS = METRICS | DETAILS


def measured(people: str, temperature: float, spread: float) -> tuple[dict[str, Any], list[str]]:
    """What `evaluate` says of the shipped model's samples, and whose the clips are."""
    model = mw.load_run("cmu").with_sampling(temperature=temperature, temperature_spread=spread, seam=0.0)
    others = {"test_subjects": tuple(people.split(", ")), "validation_subjects": ()}
    cfg = model.cfg.override(**others, **({"test_windows": 120} if people == CHOSEN_ON else {}))
    data = load_data(cfg)
    return evaluate(cfg, lambda: model, data, True), [motion.subject for motion in data.test]


def main() -> None:
    """Write the means, differences in pairs, and these by person."""
    torch.set_num_threads(1)
    out, means, pairs, each = Path(sys.argv[1]), [], [], []
    for people, tried in TRIED.items():
        found, whose = {}, []
        for temperature, spread in tried:
            found[temperature, spread], whose = measured(people, temperature, spread)
            row = {"people": people, "temperature": temperature, "spread": spread}
            means.append(
                row
                | {column.heading: found[temperature, spread]["mean"][name] * column.scale for name, column in COLUMNS.items()}
            )
            print(json.dumps(means[-1]), flush=True)
        if people == CHOSEN_ON:
            continue  # one clip, so that no error over clips can be given
        clips = found[ALIKE]["clips"]
        subjects = np.array([whose[clip] for clip in clips])
        for other in (SPREAD, WARMER):
            differences = {
                column.heading: (np.array(found[other]["values"][name]) - np.array(found[ALIKE]["values"][name])) * column.scale
                for name, column in sorted(COLUMNS.items())
                if name in found[ALIKE]["values"]
            }
            label = {"people": people, "temperature": other[0], "spread": other[1], "less": "temperature 1.1, spread 0"}
            told = {heading: float(d.mean()) for heading, d in differences.items()}
            told |= {f"{heading}, standard error": clustered_error(d, clips) for heading, d in differences.items()}
            pairs.append(label | told)
            for person in sorted({*subjects}, key=int):
                of = subjects == person
                row = {**label, "people": person, "windows": int(of.sum())}
                each.append(row | {heading: float(d[of].mean()) for heading, d in differences.items()})
    about = {
        "data": "cmu/asfamc", "model": "cmu, as it comes with the package", "samples": 50, "mwlib": mw.__version__,
        "command": "python benchmarks/temperatures.py figures/cmu", **acknowledgement("cmu/asfamc"),
    }  # fmt: skip
    files = {"temperatures.csv": means, "temperatures_paired.csv": pairs, "temperatures_people.csv": each}
    write_together(
        {out / name: as_csv(rows) for name, rows in files.items()} | {out / "temperatures.json": json.dumps(about, indent=1)}
    )


if __name__ == "__main__":
    main()
