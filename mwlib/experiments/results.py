"""One experiment: a configuration in, its metrics out; done once, found again by hash."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import torch

from mwlib.experiments.runs import get_model, get_run
from mwlib.experiments.store import locked, runs_folder
from mwlib.experiments.systems import Data, system_of
from mwlib.files import write_json
from mwlib.settings import Settings
from mwlib.training import read_outcome
from mwlib.version import __version__


def result_file(cfg: Settings, data: Data) -> Path:
    """Where the result of this configuration on these data is kept."""
    key = "-".join([cfg.hash(), *data.fingerprints(), __version__])
    return runs_folder() / "results" / f"{key}.json"


def get_result(cfg: Settings, data: Data | None = None, progress: bool = False) -> dict[str, Any]:
    """Metrics of one configuration: its model is trained if missing, its test data are scored if missing.

    Seeds are part of the configuration (`seed` of the training, `sampling_seed`). Two processes that ask for the same
    result compute it once. A GPU is used where there is one.

    Args:
        cfg: configuration of any system.
        data: what the system's `load_data` gives, if already loaded.
        progress: show bars on stderr.

    Returns:
        What the system's `evaluate` gives: "mean" and "standard_error" by metric, "windows", and more; "seconds" of the
        sampling; "training" with loss and seconds of the run, None where no model was needed.
    """
    data = data or system_of(cfg).load_data(cfg)
    file = result_file(cfg, data)
    if not file.exists():
        with locked(file.with_suffix(".lock")):
            if not file.exists():
                write_json(file, _measure(cfg, data, progress))
    return json.loads(file.read_text(encoding="utf-8"))


def _measure(cfg: Settings, data: Data, progress: bool) -> dict[str, Any]:
    outcome: dict[str, Any] = {"training": None}

    def model() -> Any:
        outcome["training"] = read_outcome(get_run(cfg, data, progress))
        outcome["started"] = time.monotonic()
        return get_model(cfg, data).to("cuda" if torch.cuda.is_available() else "cpu")

    outcome["started"] = time.monotonic()
    found = system_of(cfg).evaluate(cfg, model, data, progress)
    return {**found, "seconds": round(time.monotonic() - outcome["started"], 1), "training": outcome["training"]}
