"""The systems that can be trained and compared: one module each, found by the name that its configuration carries."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mwlib.hashing import code_behind
from mwlib.settings import Settings, read_tree, shown

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

    @property
    def load_data(self) -> Callable[[Any], Data]:
        """Configuration -> data."""
        ...

    @property
    def make_objective(self) -> Callable[[Any, Any, Mapping[str, Tensor]], Objective]:
        """Configuration, data, what the objective had learnt before -> what is trained."""
        ...

    @property
    def open_model(self) -> Callable[[Any, Mapping[str, Tensor], Mapping[str, Tensor], Mapping[str, str]], Any]:
        """Configuration, weights, what the objective learnt, its texts -> the trained model."""
        ...

    @property
    def evaluate(self) -> Callable[[Any, Callable[[], Any], Any, bool], dict[str, Any]]:
        """Configuration, a function that gives the model, data, whether to show a bar -> "mean", "standard_error", "windows"."""
        ...


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
    missing = [
        name
        for name in ("Config", "METRICS", "load_data", "make_objective", "open_model", "evaluate")
        if not hasattr(system, name)
    ]
    if missing:
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
    if not isinstance(name, str):
        raise ValueError(f"system is {shown(name)}; expected one of {', '.join([*MODULES, *_REGISTERED])}")
    if name in MODULES:
        return importlib.import_module(MODULES[name])  # pyright: ignore[reportReturnType]  (checked by a test)
    if name not in _REGISTERED:
        raise ValueError(f"system is {name!r}; expected one of {', '.join([*MODULES, *_REGISTERED])}")
    return _REGISTERED[name]


def system_of(cfg: Settings) -> System:
    """The system that a configuration belongs to."""
    return system(cfg.system)


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
    return config.from_yaml(file, whole=True)
