"""Every CMU person is tested once: predictors, their rivals and guidance over three folds, errors over people and over clips.

Needs CMU's files under MWLIB_DATA. A unit is one training, or baselines, with all that is sampled from it; it writes a file into
the folder RAW: half an hour of two cores, four minutes of a graphics card.
python benchmarks/people_in_folds.py units                      # a line each
python benchmarks/people_in_folds.py measure RAW NUMBER [...]
python benchmarks/people_in_folds.py table RAW figures/cmu      # folds, folds_eq7, folds_alg1, each with its pairs, and people
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mwlib.data.collections import acknowledgement
from mwlib.experiments import get_result
from mwlib.experiments.grids import read_grid, row_config, system_of
from mwlib.files import write_json, write_together
from mwlib.metrics import clustered_error
from mwlib.plots.saving import as_csv
from mwlib.prediction.config import Config
from mwlib.version import __version__

FOLDS = {  # who is tested; who tells the validation loss, in no fold a person of the test
    "2, 7, 29": (("2", "7", "29"), ("1",)),
    "1, 5, 16": (("1", "5", "16"), ("2",)),
    "9, 14, 49": (("9", "14", "49"), ("1",)),
}
ROWS = {  # preset and grid -> rows; None: all
    ("cmu", "motion"): (
        "zero velocity",
        "nearest history",
        "nearest history as displacement",
        "HumanMAC's DCT, displacement, clamped, 6,000 steps",
        "our departures",
    ),
    ("cmu", "departures"): ("20 DCT rows, 5,900 steps",),
    ("cmu_paper", "table_4"): (
        "s 0, sigma 0, no WMSG",
        "s 0, sigma 0, WMSG",
        "s 1, sigma 0.5, WMSG",
        "s 1, sigma 2.5, WMSG",
    ),
    ("cmu_paper", "spellings"): (
        "Algorithm 1, w' 0.7: WMSG, s 0",
        "Algorithm 1, w' 0.7: WMSG, s 1, sigma 2.5",
    ),
}
METRICS = {  # as evaluations name them -> as tables do
    "apd": "APD",
    "ade": "ADE",
    "fde": "FDE",
    "mmade": "MMADE",
    "mmfde": "MMFDE",
    "speed": "speed (m/s)",
    "coverage_0.5": "inside 50 %",
    "coverage_0.9": "inside 90 %",
}
TABLES = {  # table -> the row that all others are compared with
    "folds": "our departures",
    "folds_eq7": "s 0, sigma 0, WMSG",
    "folds_alg1": "Algorithm 1, w' 0.7: WMSG, s 0",
}
EVERYWHERE = "zero velocity", "nearest history as displacement"  # rows of the first two tables
TABLE_OF = {"motion": "folds", "departures": "folds", "table_4": "folds_eq7", "spellings": "folds_alg1"}  # by grid


class Unit(NamedTuple):
    """What one process does: rows that share a training, in one fold."""

    fold: str
    rows: tuple[tuple[str, str, Config], ...]  # grid, row, configuration


def units() -> list[Unit]:
    """All of them, those with a training first."""
    found: dict[tuple[str, str], list[tuple[str, str, Config]]] = {}
    for fold, (test, validation) in FOLDS.items():
        for (preset, name), rows in ROWS.items():
            grid = read_grid(name)
            base = Config.preset(preset, test_subjects=test, validation_subjects=validation)
            for row in grid.rows:
                if row.name in rows:
                    cfg = row_config(grid, row, base)
                    trains = cfg.sampling.method == "diffusion"
                    found.setdefault((fold, cfg.training_hash() if trains else ""), []).append((name, row.name, cfg))
    order = sorted(found, key=lambda key: key[1] == "")
    return [Unit(fold, tuple(found[fold, key])) for fold, key in order]


def measure(raw: Path, number: int) -> None:
    """One unit: train what is missing, sample, score; a file with the values of every window."""
    unit, out = units()[number], []
    data = system_of(unit.rows[0][2]).load_data(unit.rows[0][2])
    for grid, row, cfg in unit.rows:
        found = get_result(cfg, data)
        kept = {name: found[name] for name in ("mean", "values", "clips", "training", "seconds", "machine")}
        people = {motion.name: motion.subject for motion in data.test}
        out.append({"fold": unit.fold, "grid": grid, "row": row, "settings": cfg.hash(), "people": people, **kept})
        write_json(raw / f"folds_{number:02}.json", {"rows": out})
        print(unit.fold, row, {name: round(found["mean"][name], 3) for name in METRICS}, flush=True)


class Values(NamedTuple):
    """Metrics of one row over all folds, a number for each window, and whose and of which clip they are."""

    table: str
    by_metric: dict[str, np.ndarray]
    people: np.ndarray
    clips: list[tuple[str, int]]


def read(raw: Path) -> dict[str, Values]:
    """All rows of the files in a folder."""
    found: dict[str, list[dict[str, Any]]] = {}
    for file in sorted(raw.glob("folds_*.json")):
        for row in json.loads(file.read_text(encoding="utf-8"))["rows"]:
            found.setdefault(row["row"], []).append(row)
    rows = {}
    for name, parts in found.items():
        if len(parts) != len(FOLDS):
            raise ValueError(f"{raw} has {name!r} for {len(parts)} folds; expected {len(FOLDS)}: measure the other units")
        values = {said: np.concatenate([part["values"][metric] for part in parts]) for metric, said in METRICS.items()}
        people = [list(part["people"].values())[clip] for part in parts for clip in part["clips"]]
        clips = [(part["fold"], clip) for part in parts for clip in part["clips"]]
        rows[name] = Values(TABLE_OF[parts[0]["grid"]], values, np.array(people), clips)
    return rows


def over_people(values: np.ndarray, people: np.ndarray) -> tuple[float, float, dict[str, float]]:
    """Mean of the people's means, its standard error, and these means: a person counts once, however long they were recorded."""
    each = {person: float(values[people == person].mean()) for person in sorted(set(people.tolist()), key=int)}
    means = np.array(list(each.values()))
    return float(means.mean()), float(means.std(ddof=1) / len(means) ** 0.5), each


def mean(name: str, row: Values) -> dict[str, Any]:
    """A line of a table."""
    line: dict[str, Any] = {"row": name, "windows": len(row.people), "people": len(set(row.people.tolist()))}
    for metric, values in row.by_metric.items():
        line[metric], line[f"{metric}, standard error"], _ = over_people(values, row.people)
    return line


def pair(name: str, row: Values, reference: str, other: Values) -> dict[str, Any]:
    """A line of differences: over people, and over windows with the error over clips."""
    line: dict[str, Any] = {"row": f"{name} - {reference}"}
    for metric, values in row.by_metric.items():
        difference = values - other.by_metric[metric]
        line[metric], line[f"{metric}, standard error"], each = over_people(difference, row.people)
        line[f"{metric}, people below 0"] = sum(value < 0 for value in each.values())
        line[f"{metric}, over windows"] = float(difference.mean())
        line[f"{metric}, error over clips"] = clustered_error(difference, row.clips)
    return line


def table(raw: Path, out: Path) -> None:
    """Write the tables, and what they are of."""
    rows, files = read(raw), {}
    about = {
        "data": "cmu/asfamc", "preset": "cmu and cmu_paper", "seeds_of": "training and sampling a fold", "mwlib": __version__,
        "errors": "over people", "folds": list(FOLDS), "command": f"python benchmarks/people_in_folds.py table RAW {out}",
        **acknowledgement("cmu/asfamc"),
    }  # fmt: skip
    for name, reference in TABLES.items():
        own = {row: v for row, v in rows.items() if v.table == name or (row in EVERYWHERE and name == "folds_eq7")}
        files[f"{name}.csv"] = as_csv([mean(row, values) for row, values in own.items()])
        pairs = [pair(row, values, reference, own[reference]) for row, values in own.items() if row != reference]
        files[f"{name}_paired.csv"] = as_csv(pairs)
        files[f"{name}.json"] = json.dumps(about, indent=1)
    each = {
        f"{row}, {metric}": over_people(v.by_metric[metric], v.people)[2] for row, v in rows.items() for metric in ("ADE", "FDE")
    }
    who = next(iter(rows.values())).people
    people = [
        {"person": person, "windows": int((who == person).sum()), **{name: means[person] for name, means in each.items()}}
        for person in next(iter(each.values()))
    ]
    files["folds_people.csv"] = as_csv(people)
    write_together({out / name: content for name, content in files.items()})


def main(arguments: Sequence[str]) -> None:
    """The command."""
    match arguments:
        case ["units"]:
            for number, unit in enumerate(units()):
                print(number, unit.fold, *(row for _, row, _ in unit.rows), sep=" | ")
        case ["measure", raw, *numbers]:
            for number in numbers:
                measure(Path(raw), int(number))
        case ["table", raw, out]:
            table(Path(raw), Path(out))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
