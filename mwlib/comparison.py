"""The main table: MotionWavelet with each guidance in turn, against the baselines, on people never trained on."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from tqdm import tqdm

from . import __version__, baselines
from .checkpoint import write_json
from .config import Config
from .data.windows import Windows, windows
from .metrics import MetricTable, multimodal_futures
from .predictor import Predictor
from .runs import Split, fingerprint, get_predictor, split_motions

METRICS = ("apd", "ade", "fde", "mmade", "mmfde", "bone_length_jitter")
HEADS = ("APD", "ADE", "FDE", "MMADE", "MMFDE", "bone jitter (mm)")  # of their columns
ACKNOWLEDGEMENTS = {
    "cmu": "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding from "
    "NSF EIA-0196217."
}
_OFF: dict[str, Any] = dict(cfg_weight=0.0, cfg_form="eq7", tabg_scale=0.0, wmsg="off")


def acknowledgement(data: str) -> dict[str, str]:
    """What the owners of a data source want said beside any result on it: one entry, or none."""
    found = [text for name, text in ACKNOWLEDGEMENTS.items() if data.startswith(name)]
    return {"acknowledgement": found[0]} if found else {}


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Args:
        name: as printed.
        model: "wavelet", "dct", or a baseline's name.
        sampling: changes to the configuration's sampling settings; empty for baselines.
    """

    name: str
    model: str
    sampling: dict[str, Any]


def rows(cfg: Config) -> list[Row]:
    """Every baseline, the conditional model alone, each guidance switched on in turn, and all of Algorithm 1."""
    s = cfg.sampling
    cfg_on = dict(cfg_weight=s.cfg_weight or 0.3)
    tabg_on = dict(cfg_on, tabg_scale=s.tabg_scale or 1.0)
    shaped = dict(wmsg="every_step")
    return [
        Row("zero velocity", "zero_velocity", {}),
        Row("constant velocity", "constant_velocity", {}),
        Row("nearest history", "nearest_history", {}),
        Row("DCT, mask completion (HumanMAC)", "dct", {**_OFF, "complete_history": True}),
        Row("MotionWavelet, conditional", "wavelet", _OFF),
        Row("MotionWavelet + CFG", "wavelet", {**_OFF, **cfg_on}),
        Row("MotionWavelet + WMSG", "wavelet", {**_OFF, **shaped}),
        Row("MotionWavelet + CFG + TABG", "wavelet", {**_OFF, **tabg_on}),
        Row("MotionWavelet + CFG + TABG + WMSG", "wavelet", {**_OFF, **tabg_on, **shaped}),
    ]


def dct_config(cfg: Config) -> Config:
    """The same network, steps and data on HumanMAC's DCT rows (20 of 125, in proportion for other lengths)."""
    return cfg.override(transform="dct", dct_rows=max(1, round(cfg.frames * 20 / 125)), target="pose")


def baseline(name: str, cfg: Config, split: Split) -> Callable[[Tensor], Tensor]:
    """Histories (N, H, C) -> futures (N, S, F, C) of an untrained predictor."""
    if name == "nearest_history":
        known = windows(split.train, cfg.data.history, cfg.data.future, cfg.data.train_stride)
        return baselines.NearestHistory(known.x, cfg.data.history, min(cfg.sampling.samples, len(known))).predict
    still = getattr(baselines, name)
    return lambda past: still(past, cfg.data.future)


def evaluate(
    predict: Callable[[Tensor, list[int]], Tensor],
    test: Windows,
    all_test: Windows,
    threshold: float,
    progress: str | None = None,
) -> dict[str, Any]:
    """Metrics of one predictor over the test windows, streamed in chunks.

    Args:
        predict: (histories, window numbers) -> (n, S, F, C).
        test: the windows that are evaluated.
        all_test: every test window; multimodal sets are drawn from all of them.
        threshold: of the multimodal sets, metres.
        progress: label of a bar; None shows none.
    """
    number = {(c, s): i for i, (c, s) in enumerate(zip(all_test.clip.tolist(), all_test.start.tolist(), strict=True))}
    ids = [number[key] for key in zip(test.clip.tolist(), test.start.tolist(), strict=True)]
    sets = multimodal_futures(all_test.past[:, -1], all_test.future, threshold)
    table = MetricTable(sets, all_test.actions, all_test.motions[0].skeleton)
    chunks = range(0, len(test), 8)
    for first in tqdm(chunks, desc=progress, disable=progress is None, leave=False):
        part = slice(first, first + 8)
        table.update(predict(test.past[part], ids[part]), test.future[part], ids[part])
    return table.summary()


def compare(
    cfg: Config, out: Path, seeds: tuple[int, ...] = (0, 1, 2), device: str = "cpu", progress: bool = False
) -> list[dict]:
    """Fill the table; every finished (row, seed) is kept in `out/parts`, so a killed comparison goes on where it was.

    Returns:
        One dictionary per row: name, mean and spread over seeds of each metric, per-action means.
    """
    split = split_motions(cfg)
    d = cfg.data
    all_test = windows(split.test, d.history, d.future, d.test_stride)
    test = all_test.thin(d.test_windows)
    models = {"wavelet": cfg, "dct": dct_config(cfg)}
    loaded: dict[str, Predictor] = {}
    found = []
    for row in rows(cfg):
        results = []
        for seed in seeds if row.model in models else seeds[:1]:
            file = out / "parts" / f"{row.name.replace(' ', '_')}-{seed}.json"
            key = f"{cfg.hash()}-{fingerprint(split.train)}-{fingerprint(split.test)}-{__version__}"
            result = _stored(file, key)
            if result is None:
                if row.model in models and row.model not in loaded:
                    loaded[row.model] = get_predictor(models[row.model], split, progress).to(device)
                started = time.time()
                predict = row_predictor(row, seed, cfg, split, loaded)
                summary = evaluate(predict, test, all_test, 0.5, f"{row.name}, seed {seed}" if progress else None)
                result = {**summary, "seconds": round(time.time() - started, 1)}
                write_json(file, {"key": key, "result": result})
            results.append(result)
        found.append({"name": row.name, "model": row.model, **_over_seeds(results)})
    return found


def row_predictor(
    row: Row, seed: int, cfg: Config, split: Split, loaded: dict[str, Predictor]
) -> Callable[[Tensor, list[int]], Tensor]:
    """(histories, window numbers) -> futures of one row of the table; `loaded` holds the trained models by kind."""
    if row.model not in loaded:
        still = baseline(row.model, cfg, split)
        return lambda past, ids: still(past)
    p = loaded[row.model]
    sampling = cfg.override(**row.sampling).sampling
    return lambda past, ids: p.predict(past, seed=seed, window_ids=ids, sampling=sampling)


def _stored(file: Path, key: str) -> dict | None:
    """A finished part with this key."""
    if not file.exists():
        return None
    part = json.loads(file.read_text())
    return part["result"] if part["key"] == key else None


def _over_seeds(results: list[dict]) -> dict[str, Any]:
    mean = {m: torch.tensor([r["mean"][m] for r in results]) for m in METRICS}
    return {
        "mean": {m: float(v.mean()) for m, v in mean.items()},
        "seed_deviation": {m: float(v.std()) if len(v) > 1 else None for m, v in mean.items()},
        "standard_error": {m: results[0]["standard_error"][m] for m in METRICS},
        "windows": results[0]["windows"]["ade"],
        "seeds": len(results),
        "seconds": sum(r["seconds"] for r in results),
        "actions": {a: {m: row["mean"][m] for m in METRICS} for a, row in results[0]["actions"].items()},
    }
