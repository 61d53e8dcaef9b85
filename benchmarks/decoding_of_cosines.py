"""How much of a comparison of predictors is the decoder's: futures cut from the inverse, and futures that continue the history.

The preset `cmu` beside cosines, one training each. Needs CMU's files under MWLIB_DATA; a training takes a core
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

from mwlib.data.collections import acknowledgement
from mwlib.experiments import get_result
from mwlib.experiments.grids import read_grid, row_config, system_of
from mwlib.files import write_json, write_together
from mwlib.metrics import clustered_error
from mwlib.plots.saving import as_csv
from mwlib.prediction.config import Config
from mwlib.version import __version__

OURS = "cmu"
ROWS = {  # name -> grid, row
    OURS: ("motion", "our departures"),
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
    grid = read_grid(ROWS[name][0])
    base = row_config(grid, next(row for row in grid.rows if row.name == ROWS[name][1]), Config.preset("cmu"))
    system = system_of(base)
    data: Any = system.load_data(base)
    found: dict[str, Any] = {"people": [motion.subject for motion in data.test]}
    for decoding in DECODINGS:
        made = get_result(base.override(decoding=decoding), data, True)
        found[decoding] = {key: made[key] for key in ("mean", "values", "clips")}
        print(name, decoding, {key: round(value, 4) for key, value in made["mean"].items()}, flush=True)
    write_json(raw / f"decoding_{name}.json", found)


def table(raw: Path, out: Path) -> None:
    """Write the means, and what the decoding and the model change, in pairs."""
    found = {name: json.loads((raw / f"decoding_{name}.json").read_text(encoding="utf-8")) for name in ROWS}
    rows = {(name, decoding): found[name][decoding] for name in found for decoding in DECODINGS}
    means = [
        {"row": n, "decoding": d, **{said: row["mean"][key] for key, said in METRICS.items()}} for (n, d), row in rows.items()
    ]
    compared = {f"{name}: continued - inverse": ((name, "continued"), (name, "inverse")) for name in found}
    compared |= {f"{OURS} - {name}, {d}": ((OURS, d), (name, d)) for name in ROWS if name != OURS for d in DECODINGS}
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
    clips, people = found[OURS][DECODINGS[0]]["clips"], found[OURS]["people"]
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
        "data": "cmu/asfamc", "preset": "cmu", "seeds_of": "one training", "mwlib": __version__,
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
