"""How much of a comparison of predictors is the decoder's: futures cut from the inverse, and futures that continue the history.

The shipped `cmu` beside cosines, one training each. Needs CMU's files under MWLIB_DATA; a training takes a core
an hour: python benchmarks/decoding_of_cosines.py measure RAW ROW [...], where ROW is cmu, HumanMAC or cosines; then
python benchmarks/decoding_of_cosines.py table RAW figures/cmu
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import mwlib as mw
from mwlib.data.collections import acknowledgement
from mwlib.experiments import get_result
from mwlib.experiments.grids import read_grid, row_config, system_of
from mwlib.files import write_json, write_together
from mwlib.metrics import clustered_error
from mwlib.plots.saving import as_csv
from mwlib.prediction.config import Config

SHIPPED = "cmu"
TRAINED = {  # name -> grid, row
    "HumanMAC": ("motion", "HumanMAC's DCT, displacement, clamped, 6,000 steps"),
    "cosines": ("departures", "20 DCT rows, 5,900 steps"),
}
DECODINGS = "inverse", "continued"
METRICS = {
    "apd": "APD",
    "ade": "ADE",
    "fde": "FDE",
    "seam_jerk": "jerk across the seam (m/s³)",
    "speed": "speed (m/s)",
    "jerk": "jerk (m/s³)",
}


def measure(raw: Path, name: str) -> None:
    """One model under both decodings: a file with the values of every window."""
    base = Config.preset("cmu")
    if name != SHIPPED:
        grid = read_grid(TRAINED[name][0])
        base = row_config(grid, next(row for row in grid.rows if row.name == TRAINED[name][1]), base)
    system = system_of(base)
    data: Any = system.load_data(base)
    found: dict[str, Any] = {"people": [motion.subject for motion in data.test]}
    for decoding in DECODINGS:
        cfg = base.override(decoding=decoding)
        if name == SHIPPED:
            model = mw.load_run(SHIPPED).with_sampling(decoding=decoding)
            made = system.evaluate(cfg, lambda: model, data, True)  # noqa: B023  (called at once)
        else:
            made = get_result(cfg, data, True)
        found[decoding] = {key: made[key] for key in ("mean", "values", "clips")}
        print(name, decoding, {key: round(value, 4) for key, value in made["mean"].items()}, flush=True)
    write_json(raw / f"decoding_{name}.json", found)


def table(raw: Path, out: Path) -> None:
    """Write the means, and what the decoding and the model change, in pairs."""
    found = {name: json.loads((raw / f"decoding_{name}.json").read_text(encoding="utf-8")) for name in (SHIPPED, *TRAINED)}
    rows = {(name, decoding): found[name][decoding] for name in found for decoding in DECODINGS}
    means = [
        {"row": n, "decoding": d, **{said: row["mean"][key] for key, said in METRICS.items()}} for (n, d), row in rows.items()
    ]
    compared = {f"{name}: continued - inverse": ((name, "continued"), (name, "inverse")) for name in found}
    compared |= {f"{SHIPPED} - {name}, {d}": ((SHIPPED, d), (name, d)) for name in TRAINED for d in DECODINGS}
    pairs = []
    for label, (one, other) in compared.items():
        line: dict[str, float | str] = {"compared": label}
        for key, said in METRICS.items():
            difference = np.array(rows[one]["values"][key]) - np.array(rows[other]["values"][key])
            line[said], line[f"{said}, standard error"] = (
                float(difference.mean()),
                clustered_error(difference, rows[one]["clips"]),
            )
        pairs.append(line)
    clips, people = found[SHIPPED][DECODINGS[0]]["clips"], found[SHIPPED]["people"]
    whose = np.array([people[clip] for clip in clips])
    each = []
    for person in sorted({*people}, key=int):
        line = {"person": person, "windows": int((whose == person).sum())}
        for label, (one, other) in compared.items():
            for metric in ("ade", "fde"):
                values = (np.array(rows[row]["values"][metric])[whose == person].mean() for row in (one, other))
                line[f"{label}, {METRICS[metric]}"] = float(np.subtract(*values))
        each.append(line)
    about = {
        "data": "cmu/asfamc", "preset": "cmu", "seeds_of": "one training", "mwlib": mw.__version__,
        "command": "python benchmarks/decoding_of_cosines.py table RAW figures/cmu", **acknowledgement("cmu/asfamc"),
    }  # fmt: skip
    files = {"decoding.csv": as_csv(means), "decoding_paired.csv": as_csv(pairs), "decoding_people.csv": as_csv(each)}
    files["decoding.json"] = json.dumps(about, indent=1)
    write_together({out / name: content for name, content in files.items()})


def main(arguments: Sequence[str]) -> None:
    """The command."""
    match arguments:
        case ["measure", raw, *names]:
            for name in names:
                measure(Path(raw), name)
        case ["table", raw, out]:
            table(Path(raw), Path(out))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
