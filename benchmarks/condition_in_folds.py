"""A history whose coefficients each have a scale of their own, on every CMU person, tested once.

Needs CMU's files under MWLIB_DATA, and the table of `people_in_folds.py`, whose folds, settings and seeds it shares; an hour and
a half of a core: python benchmarks/condition_in_folds.py figures/cmu
"""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import numpy as np
from people_in_folds import FOLDS, METRICS, over_people

from mwlib.data.collections import acknowledgement
from mwlib.experiments import get_result
from mwlib.files import write_together
from mwlib.plots.saving import as_csv
from mwlib.prediction.config import Config
from mwlib.prediction.system import load_data
from mwlib.version import __version__

OTHERS = {  # rows of the other table -> as they are named here
    "our departures": "cmu",
    "20 DCT rows, 5,900 steps": "cosines with all settings of cmu",
    "HumanMAC's DCT, displacement, clamped, 6,000 steps": "HumanMAC's cosines",
    "nearest history as displacement": "nearest history as displacement",
    "zero velocity": "zero velocity",
}
PAIRED = "ADE", "FDE"


def main() -> None:
    """Write the means over people, the differences to the other rows, and each person's."""
    out, values, whose = Path(sys.argv[1]), {name: list[float]() for name in METRICS}, list[str]()
    for test, validation in FOLDS.values():
        cfg = Config.preset("cmu", condition_scale="coefficient", test_subjects=test, validation_subjects=validation)
        data = load_data(cfg)
        found = get_result(cfg, data, True)
        for name in METRICS:
            values[name] += found["values"][name]
        whose += [data.test[clip].subject for clip in found["clips"]]
    of = {METRICS[name]: over_people(np.array(each), np.array(whose)) for name, each in values.items()}
    mean = {"row": "cmu, history scaled", "windows": len(whose), "people": len({*whose})}
    for metric, (average, error, _) in of.items():
        mean |= {metric: average, f"{metric}, standard error": error}
    with (out / "folds_people.csv").open(encoding="utf-8") as file:
        known = {row["person"]: row for row in csv.DictReader(file)}
    pairs, each = [], [{"person": person, **{metric: of[metric][2][person] for metric in PAIRED}} for person in known]
    for row, name in OTHERS.items():
        pair = {"row": f"cmu, history scaled - {name}"}
        for metric in PAIRED:
            less = np.array([of[metric][2][person] - float(known[person][f"{row}, {metric}"]) for person in known])
            error = less.std(ddof=1) / len(less) ** 0.5
            pair |= {metric: less.mean(), f"{metric}, standard error": error, f"{metric}, people below 0": int((less < 0).sum())}
        pairs.append(pair)
    about = {
        "data": "cmu/asfamc", "preset": "cmu", "seeds_of": "training and sampling a fold", "mwlib": __version__,
        "errors": "over people", "folds": list(FOLDS), "command": f"python benchmarks/condition_in_folds.py {out}",
        **acknowledgement("cmu/asfamc"),
    }  # fmt: skip
    files = {"condition.csv": [mean], "condition_paired.csv": pairs, "condition_people.csv": each}
    write_together(
        {out / name: as_csv(rows) for name, rows in files.items()} | {out / "condition.json": json.dumps(about, indent=1)}
    )


if __name__ == "__main__":
    main()
