"""One experiment: a configuration and a seed in, the metrics on people never seen out; done once, found again by hash."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
import yaml

from . import __version__
from .checkpoint import write_json
from .comparison import evaluate
from .config import Config
from .data.windows import windows
from .runs import Split, fingerprint, get_predictor, get_run, locked, runs_folder, split_motions

THRESHOLD = 0.5  # of the multimodal sets, metres (Human3.6M protocol)


def parse_changes(words: Sequence[str]) -> dict[str, Any]:
    """``name=value`` words, values in YAML, as changes to a `Config`: ["wavelet=haar", "ddim_steps=10"].

    Raises:
        ValueError: a word has no equals sign, or its value is not YAML.
    """
    changes = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise ValueError(f"{word!r} is not a change; expected name=value, e.g. wavelet=haar")
        try:
            changes[name] = yaml.safe_load(value)
        except yaml.YAMLError:
            raise ValueError(f"{word!r}: the value is not YAML; quote it if it holds brackets, braces or colons") from None
    return changes


def result_file(cfg: Config, split: Split) -> Path:
    """Where the result of this configuration on these data is kept."""
    key = f"{cfg.hash()}-{fingerprint(split.train)}-{fingerprint(split.test)}-{__version__}"
    return runs_folder() / "results" / f"{key}.json"


def get_result(cfg: Config, split: Split | None = None, progress: bool = False) -> dict[str, Any]:
    """Metrics of one configuration: its model is trained if missing, its futures are sampled and scored if missing.

    Seeds are part of the configuration (`seed` of the training, `sampling_seed`). Two processes that ask for the same
    result compute it once. A GPU is used where there is one.

    Args:
        cfg: configuration.
        split: the data if already loaded.
        progress: show bars on stderr.

    Returns:
        "mean" and "standard_error" (over windows) by metric, "windows", "seconds" of the sampling, "train_seconds".
    """
    split = split or split_motions(cfg)
    file = result_file(cfg, split)
    with locked(file.with_suffix(".lock")):
        if not file.exists():
            write_json(file, _measure(cfg, split, progress))
    return json.loads(file.read_text(encoding="utf-8"))


def _measure(cfg: Config, split: Split, progress: bool) -> dict[str, Any]:
    folder = get_run(cfg, split, progress)
    predictor = get_predictor(cfg, split).to("cuda" if torch.cuda.is_available() else "cpu")
    d = cfg.data
    every = windows(split.test, d.history, d.future, d.test_stride)
    test = every.thin(d.test_windows)
    started = time.time()
    summary = evaluate(
        lambda past, ids: predictor.predict(past, seed=cfg.sampling.sampling_seed, window_ids=ids),
        test, every, THRESHOLD, "sampling" if progress else None,
    )  # fmt: skip
    trained = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))["metrics"]
    return {
        "mean": summary["mean"],
        "standard_error": summary["standard_error"],
        "windows": len(test),
        "seconds": round(time.time() - started, 1),
        "train_seconds": trained["seconds"],
        "loss": trained["loss"],
    }
