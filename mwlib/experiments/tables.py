"""Tables of grids: measured, arranged, with what a reader must know to trust them."""

import warnings
from collections.abc import Collection, Mapping, Sequence
from math import isfinite, nan
from pathlib import Path
from statistics import mean, stdev
from typing import Any

import numpy as np

from mwlib.data.collections import acknowledgement
from mwlib.experiments.grids import Data, Grid, changes, columns, row_config, system
from mwlib.experiments.results import committed_folder, read_table
from mwlib.experiments.runs import get_result
from mwlib.hashing import digest
from mwlib.metrics import Column, clustered_error
from mwlib.settings import Settings, choice
from mwlib.version import __version__

Columns = Mapping[str, Column]
Found = Sequence[dict[str, Any]]  # what `measure` gives: an entry for each row
Lines = list[dict[str, object]]  # column -> value, as `plots.results_table` takes them


def measure(grid: Grid, cfg: Settings, progress: bool = False, data: Data | None = None, given: Collection[str] = ()) -> Found:
    """Results of all rows over their seeds; what is there already is read, what is missing is computed.

    Args:
        grid: which.
        cfg: the configuration that the rows change.
        progress: show bars on stderr.
        data: what the system's `load_data` gives, if already loaded.
        given: fields that somebody set on purpose in cfg; the grid leaves them alone.

    Returns:
        Per row: "name", "paper", "seeds", "windows", "seconds", and by metric "mean" over seeds, "seed_deviation" (None for
        one seed), "standard_error" (of the first seed; None where there is none) and "values", one per window, means over seeds;
        "clips" of the windows; "actions", the first seed's means of each action.

    Raises:
        ValueError: rows of the grid differ in a given field.

    Warns:
        of one test clip, before anything is trained: its windows are no independent draws.
    """
    kind = system(grid.system)
    data = data or kind.load_data(cfg)
    if len(getattr(data, "test", ())) == 1:
        warnings.warn("one test clip: the table will have no standard errors; two or more would do", stacklevel=2)
    found = []
    for row in grid.rows:
        configs = [row_config(grid, row, cfg, seed, given) for seed in grid.seeds(row, cfg)]
        results = [get_result(changed, data, progress) for changed in configs]
        found.append({"name": row.name, "paper": row.paper, **_over_seeds(results, columns(kind))})
    return found


def _over_seeds(results: Sequence[dict[str, Any]], metrics: Columns) -> dict[str, Any]:
    values = {m: [r["mean"][m] for r in results] for m in metrics if isfinite(results[0]["mean"].get(m, nan))}
    windows, depends = ([r.get(entry, {}) for r in results] for entry in ("values", "depends"))
    return {
        "mean": {m: mean(v) for m, v in values.items()},
        "seed_deviation": {m: stdev(v) if len(v) > 1 else None for m, v in values.items()},
        "standard_error": {m: results[0]["standard_error"].get(m) for m in values},
        "values": {m: np.mean([w[m] for w in windows], axis=0).tolist() for m in values if m in windows[0]},
        "clips": results[0].get("clips", []),
        "windows": results[0]["windows"],
        "seeds": len(results),
        "seconds": sum(r["seconds"] for r in results),
        "training_seconds": sum((r.get("training") or {"seconds": 0.0})["seconds"] for r in results),
        "machines": sorted({" with torch ".join(r["machine"].values()) for r in results if "machine" in r}),
        "code": sorted({digest(d["code"]) for d in depends if "code" in d}),
        "older_code": sorted({name for d in depends for name in d.get("older_code", ())}),
        "actions": results[0].get("actions", {}),
    }


def lines(found: Found, metrics: Columns, *, errors: bool = False, first: str = "row") -> Lines:
    """Rows for `plots.results_table` and `plots.save_table`: the paper's number (if any row has one) beside the measured.

    A measured value with several seeds is a pair (mean, deviation over seeds), in the unit of its column.

    Args:
        found: what `measure` returned.
        metrics: columns, in order.
        errors: add the standard error over windows of each metric, and the numbers of seeds and windows.
        first: heading of the rows' names.
    """
    out = []
    for row in found:
        line: dict[str, object] = {first: row["name"]}
        for m, column in metrics.items():
            if m not in row["mean"]:
                continue
            heading, scale = column.heading, column.scale
            if any(m in other["paper"] for other in found):
                line[f"{heading}, paper"] = row["paper"].get(m)
            spread = row["seed_deviation"][m]
            value = scale * row["mean"][m]
            line[heading] = value if spread is None else (value, scale * spread)
            if errors and (error := row["standard_error"][m]) is not None:
                line[f"{heading}, standard error"] = scale * error
        out.append(line | ({"seeds": row["seeds"], "windows": row["windows"]} if errors else {}))
    return out


def differences(found: Found, metrics: Columns, reference: str, *, first: str = "row") -> Lines:
    """How far each row is from one of them, window by window: mean differences and their standard errors over clips.

    Both rows see the same windows; what makes a window hard for both goes out of the difference.

    Args:
        found: what `measure` returned.
        metrics: columns, in order.
        reference: name of the row that the others are compared with.
        first: heading of the rows' names.

    Returns:
        A line for each other row that was measured on the same windows.

    Raises:
        ValueError: no row is called so.
    """
    rows = {row["name"]: row for row in found}
    choice("reference", reference, rows)
    base, out = rows.pop(reference), []
    for name, row in rows.items():
        if not row["clips"] or row["clips"] != base["clips"]:
            continue
        line: dict[str, object] = {first: f"{name} - {reference}"}
        for m, column in metrics.items():
            if m in row["values"] and m in base["values"]:
                apart = column.scale * np.subtract(row["values"][m], base["values"][m])
                line[column.heading] = float(np.nanmean(apart)) if np.isfinite(apart).any() else float("nan")
                line[f"{column.heading}, standard error"] = clustered_error(apart, row["clips"])
        out.append(line)
    return out


def committed(name: str, metrics: Columns, folder: Path | None = None) -> Lines:
    """A grid as measured on real people, read from the table that `mwlib grid-table` wrote, in the form of `lines`.

    Args:
        name: the grid's id.
        metrics: columns, in order.
        folder: of the tables; None = the course's `figures/cmu`.

    Raises:
        FileNotFoundError: there is no such table in the folder.
    """
    out = []
    for row in _committed(name, folder):
        line: dict[str, object] = {"row": row["row"]}
        for heading in (column.heading for column in metrics.values() if column.heading in row):  # of places no L2Q
            if f"{heading}, paper" in row:
                line[f"{heading}, paper"] = row[f"{heading}, paper"]
            value, spread = row[heading], row.get(f"{heading}, deviation")
            line[heading] = value if spread is None else (value, spread)
        out.append(line)
    return out


def _committed(stem: str, folder: Path | None) -> list[dict[str, Any]]:
    """The lines of a committed table: their names under "row", numbers elsewhere, None where a cell is empty."""
    lines = read_table((folder or committed_folder()) / f"{stem}.csv")
    return [{name: cell if name == "row" else float(cell) if cell else None for name, cell in line.items()} for line in lines]


def committed_pairs(name: str, metrics: Columns, folder: Path | None = None) -> Lines:
    """A grid's differences of paired windows, read from the table that `mwlib grid-table` wrote.

    Args:
        name, metrics, folder: as for `committed`.

    Returns:
        Per row but that of reference: "row", "against" (the row of reference), and by heading (difference, its standard error
        over clips).

    Raises:
        FileNotFoundError: there is no such table in the folder.
    """
    out = []
    for row in _committed(f"{name}_paired", folder):
        first, _, against = row["row"].rpartition(" - ")
        line: dict[str, object] = {"row": first, "against": against}
        for heading in (column.heading for column in metrics.values() if column.heading in row):
            apart = row[heading]  # rounding leaves some 6e-19 of a difference that is none
            line[heading] = (apart if apart is None else round(apart, 12), row.get(f"{heading}, standard error"))
        out.append(line)
    return out


def committed_motion(stem: str, name: str = "truth", folder: Path | None = None) -> np.ndarray:
    """One motion of a committed picture, read from the table that was saved beside it.

    Args:
        stem: of the picture's files.
        name: of the motion; its columns are called so, with a number.
        folder: of the files; None = the course's `figures/cmu`.

    Returns:
        (T, C), metres, float32.

    Raises:
        FileNotFoundError: there is no such table in the folder.
        ValueError: it holds no motion of that name.
    """
    rows = _committed(stem, folder)
    heads = {head: head.rpartition("_")[0] for head in rows[0]}
    choice("name", name, dict.fromkeys(heads.values()))
    return np.array([[row[head] for head in heads if heads[head] == name] for row in rows], dtype=np.float32)


def provenance(grid: Grid, cfg: Settings, found: Found, given: Collection[str] = ()) -> dict[str, Any]:
    """What a reader must know to trust the numbers of a grid."""
    budget, data = grid.budget(cfg), cfg.get("data")
    kinds = {kind: sorted({name for row in found for name in row[kind]}) for kind in ("machines", "code", "older_code")}
    first = row_config(grid, grid.rows[0], cfg, given=given)
    return {
        "data": data, "grid": grid.id, "paper": grid.paper or "not in the paper",
        "seeds": list(range(max(row["seeds"] for row in found))),
        "seeds_of": "training and sampling" if grid.trains_at(cfg) else "sampling",
        "budget_share": budget.share, "settings_of_the_first_row": first.changed_from(type(first)()),
        "rows": {row.name: changes(grid, row, cfg, given) for row in grid.rows},
        "test_windows": found[0]["windows"],
        "standard_error_over_clips": {row["name"]: row["standard_error"] for row in found},
        "seconds_of_sampling": {row["name"]: row["seconds"] for row in found},
        "seconds_of_training": {row["name"]: row["training_seconds"] for row in found},
        "mwlib": __version__,
        **{kind: names for kind, names in kinds.items() if names},
    } | acknowledgement(data)  # fmt: skip
