"""One experiment: a configuration in, its metrics out; done once, found again by hash."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import torch

from mwlib.experiments.origins import machine, models_used
from mwlib.experiments.runs import get_model, get_run, models_behind
from mwlib.experiments.store import locked, read_result, runs_folder
from mwlib.experiments.systems import Data, system_of
from mwlib.files import write_json
from mwlib.hashing import digest, file_hash, package_hash
from mwlib.settings import Settings
from mwlib.training import MODEL
from mwlib.version import __version__


def result_file(cfg: Settings, data: Data) -> Path:
    """Where the result of this configuration on these data is kept."""
    models = models_behind(cfg, "built_on") + models_behind(cfg, "judged_by")
    key = "-".join([cfg.hash(), *data.fingerprints(), __version__, *([digest(models)] if models else [])])
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
        sampling; "training" with loss and seconds of the run, None where no model was needed; "depends", hashes of settings,
        data, the library's sources and (by the name of its run) the model. A file that is no result is measured again.
    """
    data = data or system_of(cfg).load_data(cfg)
    file = result_file(cfg, data)
    found = _read(file)
    if found is None:
        with locked(file.with_suffix(".lock")):
            found = _read(file)
            if found is None:
                found = json.loads(json.dumps(_measure(cfg, data, progress)))
                write_json(file, found)
    models_used.update(found.get("depends", {}).get("models", {}))
    return found


def _read(file: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    return found if isinstance(found, dict) and "mean" in found else None


def _measure(cfg: Settings, data: Data, progress: bool) -> dict[str, Any]:
    outcome: dict[str, Any] = {"training": None, "models": {}}

    def model() -> Any:
        run = get_run(cfg, data, progress)
        outcome["training"], outcome["models"] = read_result(run, cfg.training_hash()), {run.name: file_hash(run / MODEL)}
        outcome["started"] = time.monotonic()
        return get_model(cfg, data).to("cuda" if torch.cuda.is_available() else "cpu")

    outcome["started"] = time.monotonic()
    found = system_of(cfg).evaluate(cfg, model, data, progress)
    seconds = round(time.monotonic() - outcome["started"], 1)
    depends = {"settings": cfg.hash(), "data": list(data.fingerprints()), "mwlib": package_hash(), "models": outcome["models"]}
    return {**found, "seconds": seconds, "training": outcome["training"], "machine": machine(), "depends": depends}
