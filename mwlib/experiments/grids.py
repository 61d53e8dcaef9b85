"""Grids of experiments, one per table: a row is a set of changes to a configuration, and what a paper claims for it."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from mwlib.experiments.systems import system
from mwlib.paths import course_folder
from mwlib.settings import Settings

NAME = re.compile(r"[a-z0-9_]+")


@dataclass(frozen=True)
class Row:
    """One line of a grid.

    Args:
        name: as printed.
        changes: to the configuration.
        paper: what the paper claims for it, by metric.
        seeds: how many; None = as the budget says. Rows that draw nothing need one.
    """

    name: str
    changes: dict[str, Any]
    paper: dict[str, float]
    seeds: int | None = None


@dataclass(frozen=True)
class Budget:
    """What a row may cost, for configurations that train at most `until` steps.

    Args:
        until: upper limit of the configuration's `train_steps`.
        seeds: number of seeds per row.
        share: of the configuration's training steps that a row of its own training gets.
        changes: to the configuration, the same for every row.
        trains: every seed is one of training, too; None = as the grid says.
    """

    until: float
    seeds: int
    share: float = 1.0
    changes: dict[str, Any] = field(default_factory=dict)
    trains: bool | None = None


@dataclass(frozen=True)
class Grid:
    """A table of experiments.

    Args:
        id: key in the file: lower-case letters, digits, underscores.
        system: whose configurations the rows change.
        title: what it asks.
        paper: the paper's table, or empty.
        notebook: stem of the notebook that prints it; the workflow runs the grid before it. May be empty.
        trains: every row needs a training of its own; a seed then is one of training and sampling.
        base: changes that all rows share.
        rows: the lines.
        budgets: by size of the configuration; beyond the last one nothing is cut.
        reference: name of the row that the others are compared with in pairs; empty = the first.
    """

    id: str
    system: str
    title: str
    paper: str
    notebook: str
    trains: bool
    base: dict[str, Any]
    rows: tuple[Row, ...]
    budgets: tuple[Budget, ...]
    reference: str = ""

    def budget(self, cfg: Settings) -> Budget:
        """What a row may cost for this configuration; three seeds and no cut for the paper's sizes."""
        return next((b for b in self.budgets if cfg.get("train_steps") <= b.until), Budget(float("inf"), 3))

    def trains_at(self, cfg: Settings) -> bool:
        """Whether the seeds of this configuration are of the training, too, or of the sampling alone."""
        said = self.budget(cfg).trains
        return self.trains if said is None else said

    def seeds(self, row: Row, cfg: Settings) -> range:
        """The seeds of a row."""
        return range(self.budget(cfg).seeds if row.seeds is None else row.seeds)


def grids_file() -> Path:
    """`figures/grids.yaml` of the course."""
    return course_folder() / "figures" / "grids.yaml"


def read_grids(path: Path | None = None) -> dict[str, Grid]:
    """All grids of a file, by id; None = the course's.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no grids; a grid or row lacks a field or has an unknown one or one of the wrong kind, two rows
            share a name, or a change is not a valid setting; the message names the file and the place.
    """
    path = grids_file() if path is None else Path(path)
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ValueError(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(tree, dict) or not isinstance(tree.get("grids", {}), dict):
        raise ValueError(f"{path} holds {str(tree)[:40]!r}; expected a mapping with grids by id")
    return {name: _grid(f"{path}: {name}", name, body) for name, body in tree.get("grids", {}).items()}


def read_grid(name: str, path: Path | None = None) -> Grid:
    """One grid of a file; None = the course's.

    Raises:
        FileNotFoundError, ValueError: as in `read_grids`, or there is none of that name; the message lists those there are.
    """
    known = read_grids(path)
    if name not in known:
        raise ValueError(f"grid is {name!r}; {path or grids_file()} has {', '.join(known)}")
    return known[name]


# What a field of the file may hold; the first entry of a pair is what a message calls it.
MAPPING, LIST, TEXT = ("a mapping", (dict, type(None))), ("a list", (list,)), ("a text", (str,))
TRUTH = ("true or false", (bool,))
NUMBER, COUNT = ("a number", (int, float)), ("a whole number", (int, type(None)))
GRID = {"title": TEXT, "rows": LIST, "system": TEXT, "paper": TEXT, "notebook": TEXT, "trains": TRUTH,
        "base": MAPPING, "budgets": LIST, "reference": TEXT}  # fmt: skip
ROW = {"name": ("a name", (str, int, float)), "set": MAPPING, "paper": MAPPING, "seeds": COUNT}
BUDGET = {"until": NUMBER, "seeds": ("a whole number", (int,)), "share": NUMBER, "set": MAPPING, "trains": TRUTH}


def _grid(where: str, name: str, body: dict[str, Any]) -> Grid:
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ValueError(f"{where}: the id is {name!r}; expected lower-case letters, digits and underscores")
    _check(where, body, {"title", "rows"}, GRID)
    rows = []
    for number, row in enumerate(body["rows"], 1):
        _check(f"{where}, row {number}", row, {"name"}, ROW)
        rows.append(Row(str(row["name"]), row.get("set") or {}, row.get("paper") or {}, row.get("seeds")))
    if not rows or len({row.name for row in rows}) < len(rows):
        raise ValueError(f"{where}: {'two rows have the same name' if rows else 'there are no rows'}; expected different ones")
    budgets = []
    for budget in body.get("budgets", ()):
        _check(f"{where}, budgets", budget, {"until", "seeds"}, BUDGET)
        shared = (budget.get("share", 1.0), budget.get("set") or {}, budget.get("trains"))
        budgets.append(Budget(budget["until"], budget["seeds"], *shared))
    grid = Grid(
        name, body.get("system", "prediction"), body["title"], body.get("paper", ""), body.get("notebook", ""),
        bool(body.get("trains")), body.get("base") or {}, tuple(rows), tuple(budgets), body.get("reference") or rows[0].name,
    )  # fmt: skip
    if grid.reference not in {row.name for row in rows}:
        raise ValueError(f"{where}: reference is {grid.reference!r}; expected the name of a row")
    for row in rows:
        try:
            system(grid.system).Config().override(**{**grid.base, **row.changes})
        except (TypeError, ValueError) as error:
            raise ValueError(f"{where}, row {row.name!r}: {error}") from None
    return grid


def expect_fields(where: str, found: Any, needed: set[str], allowed: set[str]) -> None:
    """Refuse what was read from YAML if it is no mapping, lacks a field or has an unknown one.

    Raises:
        ValueError: the message names the place, what was found and what was expected.
    """
    if not isinstance(found, dict) or not needed <= {*found} <= needed | allowed:
        raise ValueError(f"{where} has {sorted(map(str, found)) if isinstance(found, dict) else found}; expected "
                         f"{sorted(needed)}, and any of {sorted(allowed)}")  # fmt: skip


def _check(where: str, found: Any, needed: set[str], fields: Mapping[str, tuple[str, tuple[type, ...]]]) -> None:
    """Refuse what lacks a field, has an unknown one, or one of the wrong kind."""
    expect_fields(where, found, needed, {*fields} - needed)
    for name, value in found.items():
        kind, types = fields[name]
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            raise ValueError(f"{where}: {name} is {value!r}; expected {kind}")


def changes(grid: Grid, row: Row, cfg: Settings, given: Collection[str] = ()) -> dict[str, Any]:
    """Everything that a row changes in a configuration: its own settings, then, but for those that were given, the grid's base
    and the budget.

    Args:
        grid, row: which.
        cfg: the configuration that is changed.
        given: fields that somebody set on purpose in cfg; no table overrides them.

    Raises:
        ValueError: rows of the grid differ in a given field.
    """
    varied = {name for other in grid.rows for name in other.changes}
    if clash := sorted(varied & {*given}):
        raise ValueError(
            f"{', '.join(clash)} is given, but the rows of {grid.id} differ in it; leave it out, or write a grid of your own"
        )
    budget = grid.budget(cfg)
    shared = dict(budget.changes)
    if budget.share != 1:
        shared |= _shortened(cfg, budget.share)
    shared = {name: value for name, value in (shared | grid.base).items() if name not in given}
    return shared | row.changes


def _shortened(cfg: Settings, share: float) -> dict[str, Any]:
    """Everything in a training that is counted in steps, cut to a share."""
    settings = cfg.get_group("training")
    lengths = {name: round(share * getattr(settings, name)) for name in ("train_steps", "lr_period", "warmup", "ema_start")}
    return {**lengths, "lr_milestones": [round(share * m) for m in settings.lr_milestones]}


def row_config(grid: Grid, row: Row, cfg: Settings, seed: int = 0, given: Collection[str] = ()) -> Settings:
    """A row's configuration at a seed: of the sampling, and of the training where each row has its own."""
    seeds = {"sampling_seed": seed, **({"seed": seed} if grid.trains_at(cfg) else {})}
    return cfg.override(**changes(grid, row, cfg, given)).override(**seeds)


def row_parameters(grid: Grid, row: int, seed: int, preset: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of the notebook `experiment.ipynb` that make it one row of a grid, by the row's number from 0.

    Args:
        given: settings that somebody changed in the preset on purpose.

    Raises:
        LookupError: there is no such row.
        ValueError: rows of the grid differ in a given setting.
    """
    if not 0 <= row < len(grid.rows):
        raise LookupError(f"row is {row}; {grid.id} has 0 to {len(grid.rows) - 1}")
    base = system(grid.system).Config.preset(preset, **given)
    changed = row_config(grid, grid.rows[row], base, seed, given)
    names = {**given, **changes(grid, grid.rows[row], base, given), "sampling_seed": seed, "seed": seed}
    words = [f"{name}={json.dumps(changed.get(name))}" for name in names if name != "data"]
    data = changed.get("data") if "data" in names else ""
    return {"system": grid.system, "preset": preset, "data": data, "changes": words}
