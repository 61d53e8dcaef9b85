"""Systems by the names that their configurations carry, and grids of experiments, one per table."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from mwlib.hashing import code_behind
from mwlib.paths import course_folder
from mwlib.settings import Settings, Written, choice, near, of_kind, read_tree, read_yaml

if TYPE_CHECKING:  # names of types alone: listing the systems waits for no torch
    from torch import Tensor

    from mwlib.metrics import Column
    from mwlib.training import Objective


class Data(Protocol):
    """What a system trains and tests on."""

    def fingerprints(self) -> tuple[str, str]:
        """Short hashes of the training and of the test part."""
        ...


class System(Protocol):
    """What the experiments ask of a system; a module with these names will do.

    A system of motions may also have ``preview(cfg, get_model, data)``: arguments of `plots.storyboard` that show a true motion
    of the test set and what the experiment makes of it; and ``DETAILS``, columns of a second table. What ``evaluate`` gives may
    hold "values" of each window by metric, and the "clips" that the windows come from: rows are then compared in pairs.
    ``built_on(cfg)`` and ``judged_by(cfg)`` name other trained models, which training and scoring depend on: by the name that
    comes with the package, by a run's folder, or by files that other programs wrote.
    """

    Config: type[Any]  # a subclass of Settings with a group `training: TrainingConfig` and a field `sampling_seed`
    METRICS: Mapping[str, Column]

    load_data: Callable[[Any], Data]  # configuration -> data
    # Configuration, data, what the objective had learnt before -> what is trained.
    make_objective: Callable[[Any, Any, Mapping[str, Tensor]], Objective]
    # Configuration, weights, what the objective learnt, its texts -> the trained model.
    open_model: Callable[[Any, Mapping[str, Tensor], Mapping[str, Tensor], Mapping[str, str]], Any]
    # Configuration, a function that gives the model, data, whether to show a bar -> "mean", "standard_error", "windows".
    evaluate: Callable[[Any, Callable[[], Any], Any, bool], dict[str, Any]]


MODULES = {
    "prediction": "mwlib.prediction.system",
    "rebuilding": "mwlib.prediction.rebuilding",
    "inbetweening": "mwlib.inbetweening.system",
    "text_to_motion": "mwlib.text_to_motion.system",
    "matching": "mwlib.matching.system",
}
_REGISTERED: dict[str, System] = {}


def register(system: Any) -> None:
    """Make a system known under the name that its `Config.system` says; a module registers itself by ``sys.modules[__name__]``.

    Raises:
        ValueError: the name is taken by another system, or something that `System` asks for is missing.
    """
    if missing := [name for name in System.__annotations__ if not hasattr(system, name)]:
        raise ValueError(f"{system} has no {', '.join(missing)}; expected all that System asks for")
    name = system.Config.system
    if name in MODULES or _REGISTERED.get(name, system) is not system:
        raise ValueError(f"system is {name!r}, which is taken; expected another name")
    _REGISTERED[name] = system


def system(name: str) -> System:
    """A system by name.

    Raises:
        ValueError: there is none; the message lists those there are.
    """
    choice("system", name, [*MODULES, *_REGISTERED])
    found: Any = importlib.import_module(MODULES[name]) if name in MODULES else _REGISTERED[name]
    return found


def columns(kind: System) -> dict[str, Column]:
    """Columns of a system's table, and of its second one, if it has one."""
    return {**kind.METRICS, **getattr(kind, "DETAILS", {})}


def system_of(cfg: Settings) -> System:
    """The system that a configuration belongs to.

    Raises:
        ValueError: it is no configuration.
    """
    return system(of_kind("cfg", cfg, Settings, "a configuration, such as Config.preset('tiny')").system)


def code_of(system: System) -> dict[str, str]:
    """The hash of each module behind a system: of all that its module imports, see `code_behind`."""
    return code_behind(getattr(system, "__name__", system.Config.__module__))


def read_config(file: Path) -> Settings:
    """The configuration in a run's config.yaml, of whichever system.

    Raises:
        ValueError: it is none, was written by a version before 0.2, holds an unknown setting, or lacks one.
    """
    name = read_tree(file)["system"]
    try:
        config = system(name).Config
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    return config.from_yaml(file)


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
        ValueError: the file holds no grids, a key twice or an unknown one; a grid, row or budget lacks a field, or one holds
            what it must not; two rows share a name or all settings; budgets do not rise; the paper's number is of no metric of
            the system; or a change, of a row or a budget, is not a valid setting. The message names file, line and place.
    """
    path = Path(path or grids_file())
    tree = read_yaml(path)
    aside = [name for name in tree if str(name).startswith("x-")] if isinstance(tree, dict) else []
    fields = dict.fromkeys(aside, ("anything", lambda _: True)) | {"grids": ("a mapping", _is(dict))}
    check_fields(Place(path, "the top, but for x- and any name,"), tree, {"grids"}, fields)
    return {name: _grid(Place(path, str(name)).of(tree["grids"], name), name, body) for name, body in tree["grids"].items()}


def read_grid(name: str, path: Path | None = None) -> Grid:
    """One grid of a file; None = the course's.

    Raises:
        FileNotFoundError, ValueError: as in `read_grids`, or there is none of that name; the message lists those there are.
    """
    known = read_grids(path)
    if name not in known:
        raise ValueError(f"grid is {name!r}{near(name, known)}; {path or grids_file()} has {', '.join(known)}")
    return known[name]


class Place(NamedTuple):
    """Where something stands: what messages begin with."""

    file: Path
    words: str
    line: int = 0  # 0 = not known

    def __str__(self) -> str:
        return f"{self.file}{f', line {self.line}' if self.line else ''}: {self.words}"

    def of(self, found: Any, name: object = None, words: str = "") -> Place:
        """A part: the line of a key, or else where the mapping begins; words are added after a comma."""
        found = found if isinstance(found, Written) else Written()
        line = found.lines.get(name) or found.line or self.line
        return Place(self.file, ", ".join(filter(None, (self.words, words))), line)


Fits = Callable[[Any], bool]  # whether a value may stand in a field


def _is(*types: type) -> Fits:
    return lambda value: isinstance(value, types) and (bool in types or not isinstance(value, bool))


def _within(low: float, *types: type) -> Fits:
    """Of one of these types, more than low, and finite."""
    return lambda value: _is(*types)(value) and low < value < float("inf")


def one_of(choices: Collection[str]) -> tuple[str, Fits]:
    """A field that holds one of some texts, as `check_fields` takes it."""
    return f"one of {', '.join(choices)}", lambda value: isinstance(value, str) and value in choices


# What a field of the file may hold; the first entry of a pair is what a message calls it.
MOST_SEEDS = 1000  # of a row: own choice, far more than anybody waits for
MAPPING, LIST, TEXT = ("a mapping", _is(dict, type(None))), ("a list", _is(list)), ("a text", _is(str))
WORDS = "a text", lambda value: isinstance(value, str) and value.strip() != ""
HYPHENED = "lower-case words with hyphens", lambda value: bool(WORDS[1](value) and re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", value))
TRUTH, NUMBER = ("true or false", _is(bool)), ("a finite number", _within(float("-inf"), int, float))
POSITIVE = ("a number above 0, finite", _within(0, int, float))
COUNT = (f"a whole number from 1 to {MOST_SEEDS}", lambda value: _within(0, int)(value) and value <= MOST_SEEDS)
GRID = dict.fromkeys(["title", "paper", "notebook", "reference"], TEXT) | {
    "rows": ("a list of rows", lambda value: _is(list)(value) and value != []), "base": MAPPING, "trains": TRUTH,
    "unmeasured": LIST, "budgets": LIST,
}  # fmt: skip
ROW = {
    "name": ("a name, in one line without blanks around it",  # which nobody would see in a cell of a table
             lambda value: _is(str, int, float)(value) and (text := str(value)).isprintable() and text == text.strip() != ""),
    "set": MAPPING, "paper": MAPPING, "seeds": (COUNT[0], lambda value: value is None or COUNT[1](value)),
}  # fmt: skip
BUDGET = {"until": POSITIVE, "seeds": COUNT, "share": POSITIVE, "set": MAPPING, "trains": TRUTH}


def _grid(where: Place, name: str, body: Any) -> Grid:
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ValueError(f"{where}: the id is {name!r}; expected lower-case letters, digits and underscores")
    check_fields(where, body, {"title", "rows"}, GRID | {"system": one_of([*MODULES, *_REGISTERED])})
    kind = system(body.get("system", "prediction"))
    metrics = [*columns(kind), *map(str, body.get("unmeasured", ()))]
    plain, base, counted = kind.Config(), body.get("base") or {}, ("sampling_seed", "seed")[: 1 + bool(body.get("trains"))]
    rows: list[Row] = []
    for number, read in enumerate(body["rows"], 1):
        row = _row(where.of(body, "rows", f"row {number}"), read, metrics)
        place = where.of(read, words=f"row {row.name!r}")
        _fit(place, plain, counted, base, read.get("set") or {})
        for other in rows:
            if other.name == row.name or other.changes == row.changes:
                same = "name" if other.name == row.name else "settings"
                raise ValueError(f"{place}: the same {same} as {other.name!r}; expected rows that differ")
        rows.append(row)
    budgets: list[Budget] = []
    for number, read in enumerate(body.get("budgets", ()), 1):
        place = where.of(body, "budgets").of(read, words=f"budget {number}")
        budgets.append(_budget(place, read, budgets))
        row = next((row for row in rows if not {*row.changes} & {*budgets[-1].changes}), rows[0])
        _fit(place, plain, counted, read.get("set") or {}, base, row.changes)  # in the order of `changes`
    grid = Grid(
        name, body.get("system", "prediction"), body["title"], body.get("paper", ""), body.get("notebook", ""),
        bool(body.get("trains")), dict(base), tuple(rows), tuple(budgets), body.get("reference") or rows[0].name,
    )  # fmt: skip
    if grid.reference not in (known := [row.name for row in rows]):
        found = f"reference is {grid.reference!r}; expected the name of a row{near(grid.reference, known)}"
        raise ValueError(f"{where.of(body, 'reference')}: {found}")
    return grid


def _row(where: Place, row: Any, metrics: Collection[str]) -> Row:
    check_fields(where, row, {"name"}, ROW)
    paper = row.get("paper") or {}
    check_fields(where.of(row, "paper", "paper"), paper, set(), dict.fromkeys(metrics, NUMBER))
    return Row(str(row["name"]), dict(row.get("set") or {}), dict(paper), row.get("seeds"))


def _budget(where: Place, body: Any, before: Sequence[Budget]) -> Budget:
    check_fields(where, body, {"until", "seeds"}, BUDGET)
    if before and body["until"] <= before[-1].until:
        raise ValueError(
            f"{where.of(body, 'until')}: until is {body['until']}; expected more than the {before[-1].until} of the one before"
        )
    return Budget(body["until"], body["seeds"], body.get("share", 1.0), dict(body.get("set") or {}), body.get("trains"))


def _fit(where: Place, plain: Settings, counted: Collection[str], *parts: Mapping[str, Any]) -> None:
    """Refuse settings that the configuration does not take, the last of each name; the line is that of the one it names."""
    every = [(part, name) for part in parts for name in part]
    for part, name in every:
        if name in counted or not isinstance(name, str):
            expected = "seeds, which says how many are drawn" if name in counted else "names of settings"
            raise ValueError(f"{where.of(part, name)}: set has {name!r}; expected {expected}")
    try:
        plain.override(**{name: part[name] for part, name in every})
    except (TypeError, ValueError) as error:
        for part, name in every:
            if str(error).startswith((f"{name} is ", f"unknown setting {name!r}", f"{name!r} is ")):
                where = where.of(part, name)
        raise ValueError(f"{where}: {error}") from None


def check_fields(where: Place, found: Any, needed: set[str], fields: Mapping[str, tuple[str, Fits]]) -> None:
    """Refuse what was read from YAML if it is no mapping, lacks a field, has an unknown one, or one that holds what it must not.

    Args:
        where: it stands.
        found: what was read.
        needed: names of the fields that it must have.
        fields: all that it may have, by name: what may stand there, in words, and whether a value is such.

    Raises:
        ValueError: the message names the place, what was found and what was expected.
    """
    unknown = [name for name in found if name not in fields] if isinstance(found, dict) else []
    if not isinstance(found, dict) or unknown or not needed <= {*found}:
        meant = near(unknown[0], fields) if unknown else ""
        raise ValueError(f"{where.of(found, *unknown[:1])} has {sorted(map(str, found)) if isinstance(found, dict) else found}; "
                         f"expected {sorted(needed)}, and any of {sorted({*fields} - needed)}{meant}")  # fmt: skip
    for name, value in found.items():
        kind, fits = fields[name]
        if not fits(value):
            raise ValueError(f"{where.of(found, name)}: {name} is {value!r}; expected {kind}")


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
    shared = budget.changes | (_shortened(cfg, budget.share) if budget.share != 1 else {})
    shared = {name: value for name, value in (shared | grid.base).items() if name not in given}
    return shared | row.changes


def _shortened(cfg: Settings, share: float) -> dict[str, Any]:
    """Everything in a training that is counted in steps, cut to a share."""
    settings = cfg.get_group("training")

    def cut(steps: int) -> int:
        """The share of the steps, one at least."""
        return max(round(share * steps), min(steps, 1))

    lengths = {name: cut(getattr(settings, name)) for name in ("train_steps", "lr_period", "warmup", "ema_start")}
    return {**lengths, "lr_milestones": [*map(cut, settings.lr_milestones)]}


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
