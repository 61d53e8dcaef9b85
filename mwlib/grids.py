"""Grids of experiments, `figures/grids.yaml`: one per table of the paper, each row a set of changes and the paper's numbers."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean, stdev
from typing import Any

import torch
import yaml

from . import __version__
from .comparison import HEADS, METRICS, acknowledgement
from .config import Config
from .experiment import get_result
from .runs import Split, split_motions

FIGURES = Path(__file__).resolve().parents[1] / "figures"
GRIDS = FIGURES / "grids.yaml"
HEAD = dict(zip(METRICS, HEADS, strict=True))


@dataclass(frozen=True)
class Row:
    """One line of a grid: its name, what it changes in the configuration, and what the paper claims for it."""

    name: str
    changes: dict[str, Any]
    paper: dict[str, float]


@dataclass(frozen=True)
class Budget:
    """What a row may cost, for configurations that train at most `until` steps.

    Args:
        until: upper limit of the configuration's `train_steps`.
        seeds: number of seeds per row.
        share: of the configuration's training steps that a row of its own training gets.
        changes: to the configuration, the same for every row.
    """

    until: float
    seeds: int
    share: float = 1.0
    changes: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Grid:
    """A table of experiments.

    Args:
        id: key in the file.
        title: what it asks.
        paper: the paper's table, or empty.
        notebook: stem of the notebook that prints it; the workflow runs the grid before it. May be empty.
        trains: every row needs a training of its own; a seed then is one of training and sampling.
        base: changes that all rows share.
        rows: the lines.
        budgets: by size of the configuration; beyond the last one nothing is cut.
    """

    id: str
    title: str
    paper: str
    notebook: str
    trains: bool
    base: dict[str, Any]
    rows: tuple[Row, ...]
    budgets: tuple[Budget, ...]

    def budget(self, cfg: Config) -> Budget:
        """What a row may cost for this configuration; three seeds and no cut for the paper's sizes."""
        return next((b for b in self.budgets if cfg.training.train_steps <= b.until), Budget(float("inf"), 3))


def read_grids(path: Path = GRIDS) -> dict[str, Grid]:
    """All grids of a file, by id.

    Raises:
        ValueError: a grid or row lacks a field or has an unknown one, two rows share a name, or a change is not a valid
            setting; the message names the file and the place.
    """
    tree = yaml.safe_load(Path(path).read_text(encoding="utf-8")) or {}
    return {name: _grid(f"{path}: {name}", name, body) for name, body in tree.get("grids", {}).items()}


def _grid(where: str, name: str, body: dict[str, Any]) -> Grid:
    _keys(where, body, {"title", "rows"}, {"paper", "notebook", "trains", "base", "budgets"})
    rows = []
    for number, row in enumerate(body["rows"], 1):
        _keys(f"{where}, row {number}", row, {"name"}, {"set", "paper"})
        rows.append(Row(str(row["name"]), row.get("set") or {}, row.get("paper") or {}))
    if len({row.name for row in rows}) < len(rows):
        raise ValueError(f"{where}: two rows have the same name; expected different ones")
    budgets = []
    for budget in body.get("budgets", ()):
        _keys(f"{where}, budgets", budget, {"until", "seeds"}, {"share", "set"})
        budgets.append(Budget(budget["until"], budget["seeds"], budget.get("share", 1.0), budget.get("set") or {}))
    grid = Grid(
        name, body["title"], body.get("paper", ""), body.get("notebook", ""), bool(body.get("trains")), body.get("base") or {},
        tuple(rows), tuple(budgets),
    )  # fmt: skip
    for row in rows:
        try:
            Config().override(**{**grid.base, **row.changes})
        except (TypeError, ValueError) as error:
            raise ValueError(f"{where}, row {row.name!r}: {error}") from None
    return grid


def _keys(where: str, found: Any, needed: set[str], allowed: set[str]) -> None:
    if not isinstance(found, dict) or not needed <= {*found} <= needed | allowed:
        raise ValueError(f"{where} has {sorted(found) if isinstance(found, dict) else found}; expected {sorted(needed)}, "
                         f"and any of {sorted(allowed)}")  # fmt: skip


def changes(grid: Grid, row: Row, cfg: Config) -> dict[str, Any]:
    """Everything that a row changes in a configuration: budget, the grid's base, and its own settings."""
    budget = grid.budget(cfg)
    out = dict(budget.changes)
    if budget.share != 1:
        steps = round(budget.share * cfg.training.train_steps)
        out |= {"train_steps": steps, "lr_milestones": [round(budget.share * m) for m in cfg.training.lr_milestones]}
    return out | grid.base | row.changes


def configs(grid: Grid, cfg: Config) -> list[Config]:
    """One configuration per row, in order, at seed 0."""
    return [cfg.override(**changes(grid, row, cfg)) for row in grid.rows]


def seeded(grid: Grid, cfg: Config, seed: int) -> Config:
    """A row's configuration with another seed: of the sampling, and of the training where each row has its own."""
    return cfg.override(sampling_seed=seed, **({"seed": seed} if grid.trains else {}))


def measure(grid: Grid, cfg: Config, progress: bool = False, split: Split | None = None) -> list[dict[str, Any]]:
    """Results of all rows over their seeds; what is there already is read, what is missing is computed.

    Args:
        grid: which.
        cfg: the configuration that the rows change.
        progress: show bars on stderr.
        split: the data if already loaded.

    Returns:
        Per row: "name", "paper", "seeds", "windows", "seconds", and by metric "mean" over seeds, "seed_deviation" (None for
        one seed), "standard_error" over windows (of the first seed).
    """
    split = split or split_motions(cfg)
    found = []
    for row, row_cfg in zip(grid.rows, configs(grid, cfg), strict=True):
        seeds = range(grid.budget(cfg).seeds)
        results = [get_result(seeded(grid, row_cfg, seed), split, progress) for seed in seeds]
        found.append({"name": row.name, "paper": row.paper, **_over_seeds(results)})
    return found


def _over_seeds(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    values = {m: [r["mean"][m] for r in results] for m in METRICS}
    return {
        "mean": {m: mean(v) for m, v in values.items()},
        "seed_deviation": {m: stdev(v) if len(v) > 1 else None for m, v in values.items()},
        "standard_error": {m: results[0]["standard_error"][m] for m in METRICS},
        "windows": results[0]["windows"],
        "seeds": len(results),
        "seconds": sum(r["seconds"] for r in results),
    }


def lines(found: Sequence[dict[str, Any]], metrics: Sequence[str] = METRICS[:5], errors: bool = False) -> list[dict[str, object]]:
    """Rows for `plots.results_table` and `plots.save_table`: the paper's number (if any row has one) beside the measured.

    A measured value with several seeds is a pair (mean, deviation over seeds). Bone jitter is in millimetres a frame.

    Args:
        found: what `measure` returned.
        metrics: which, in order.
        errors: add the standard error over windows of each metric, and the numbers of seeds and windows.
    """
    out = []
    for row in found:
        line: dict[str, object] = {"row": row["name"]}
        for m in metrics:
            scale, head = 1000 if m == "bone_length_jitter" else 1, HEAD[m]
            if any(m in other["paper"] for other in found):
                line[f"{head}, paper"] = row["paper"].get(m)
            spread = row["seed_deviation"][m]
            value = scale * row["mean"][m]
            line[head] = value if spread is None else (value, scale * spread)
            if errors:
                line[f"{head}, standard error"] = scale * row["standard_error"][m]
        out.append(line | ({"seeds": row["seeds"], "windows": row["windows"]} if errors else {}))
    return out


def committed(name: str, metrics: Sequence[str] = METRICS[:3], folder: Path = FIGURES / "cmu") -> list[dict[str, object]]:
    """A grid as measured on real people, read from the table that `grid-table` wrote, in the form of `lines`.

    Raises:
        FileNotFoundError: there is no such table in the folder.
    """
    heads = [HEAD[m] for m in metrics]
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    out = []
    for row in rows:
        number = {head: float(value) for head, value in row.items() if head != "row" and value}
        line: dict[str, object] = {"row": row["row"]}
        for head in heads:
            if f"{head}, paper" in row:
                line[f"{head}, paper"] = number.get(f"{head}, paper")
            spread = number.get(f"{head}, deviation")
            line[head] = number[head] if spread is None else (number[head], spread)
        out.append(line)
    return out


def provenance(grid: Grid, cfg: Config, found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What a reader must know to trust the numbers of a grid."""
    first = configs(grid, cfg)[0]
    return {
        "data": cfg.data.data, "grid": grid.id, "paper": grid.paper or "not in the paper",
        "seeds": list(range(found[0]["seeds"])), "seeds_of": "training and sampling" if grid.trains else "sampling",
        "train_steps": first.training.train_steps, "batch": first.training.batch, "test_windows": found[0]["windows"],
        "samples": first.sampling.samples, "ddim_steps": first.sampling.ddim_steps,
        "rows": {row.name: changes(grid, row, cfg) for row in grid.rows},
        "standard_error_over_windows": {row["name"]: row["standard_error"] for row in found},
        "seconds_of_sampling": {row["name"]: row["seconds"] for row in found},
        "multimodal_threshold_m": 0.5, "mwlib": __version__, "torch": torch.__version__.split("+")[0],
        "device": "cuda" if torch.cuda.is_available() else "cpu",
    } | acknowledgement(cfg.data.data)  # fmt: skip
