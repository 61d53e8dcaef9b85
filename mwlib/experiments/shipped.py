"""How the trained models that come with the package are made: by one command, each with a card that says what it can do."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from mwlib.data.known import acknowledgement
from mwlib.experiments.results import get_result
from mwlib.experiments.runs import CONFIG, get_run
from mwlib.experiments.store import read_result
from mwlib.experiments.systems import system, system_of
from mwlib.experiments.tables import details
from mwlib.files import load_tensors, save_tensors, write_together
from mwlib.metrics import Column
from mwlib.settings import Settings
from mwlib.training import MODEL
from mwlib.version import __version__

CARD, METRICS = "card.md", "metrics.json"
KEPT = ("mean", "standard_error", "windows", "multimodal_apd")  # of what an evaluation gives


RECIPES: dict[str, tuple[str, str, str, dict[str, Any]]] = {  # name -> title, system, preset, changes
    "synthetic": ("Synthetic people", "prediction", "laptop_plus", {"train_steps": 14000}),
    "cmu": ("People of the CMU motion capture database", "prediction", "cmu_plus", {}),
    "inbetween": ("In-betweens of people of the CMU motion capture database", "inbetweening", "cmu", {}),
}


def recipe(name: str) -> tuple[str, Settings]:
    """Title and configuration of a model that comes with the package.

    Raises:
        ValueError: there is none of that name; the message lists those there are.
    """
    if name not in RECIPES:
        raise ValueError(f"name is {name!r}; expected one of {', '.join(RECIPES)}")
    title, kind, preset, changes = RECIPES[name]
    return title, system(kind).Config.preset(preset, **changes)


def ship(cfg: Settings, folder: Path, title: str, command: str, progress: bool = False) -> dict[str, Any]:
    """Train a configuration (once), and write model, configuration, metrics and card into a folder.

    Weights are kept in half precision: half the size. What is measured is the run's own model, in single precision.

    Args:
        cfg: of any system whose field `method` knows "truth".
        folder: gets config.yaml, model.safetensors, metrics.json and card.md.
        title: the card's first line.
        command: that makes this model again; the card names it.
        progress: show bars on stderr.

    Returns:
        What metrics.json holds.
    """
    kind = system_of(cfg)
    data = kind.load_data(cfg)
    found = {name: get_result(c, data, progress) for name, c in (("model", cfg), ("truth", cfg.override(method="truth")))}
    run = get_run(cfg, data)
    tensors, about = load_tensors(run / MODEL)
    save_tensors(folder / MODEL, {name: t.half() if name.startswith("net.") else t for name, t in tensors.items()}, about)
    metrics: dict[str, Any] = {name: _kept(result) for name, result in found.items()}
    metrics["training"] = read_result(run, cfg.training_hash())
    metrics["about"] = {
        "settings": cfg.hash(), "data": list(data.fingerprints()), "mwlib": __version__, "measured on": found["model"]["machine"]
    }  # fmt: skip
    text = card(title, command, cfg, metrics, {**kind.METRICS, **details(kind)})
    write_together({folder / CONFIG: cfg.to_yaml(), folder / CARD: text, folder / METRICS: json.dumps(metrics, indent=1)})
    return metrics


def card(title: str, command: str, cfg: Settings, metrics: Mapping[str, Any], columns: Mapping[str, Column]) -> str:
    """What a reader must know of a model before using it, as Markdown."""
    model, truth, training, about = metrics["model"], metrics["truth"], metrics["training"], metrics["about"]
    rows = [
        f"| {column.heading} | {column.scale * model['mean'][name]:.3g} | {_of(truth, name, column.scale)} |"
        for name, column in columns.items()
        if name in model["mean"]
    ]
    source, sampling = cfg.get_group("data"), cfg.get_group("sampling")
    trained = (
        f"Trained on `{source.data}` at {source.fps:g} Hz: {training['steps']} steps of {cfg.get('batch')} windows, seed "
        f"{cfg.get('seed')}, {training['seconds']:.0f} s on {training['machine']['device']}. Weights are kept in half precision."
    )
    people = (
        f"Test people: {_names(source.test_subjects) or 'the last quarter'}; for validation: "
        f"{_names(source.validation_subjects) or 'nobody'}; trained on {_names(source.train_subjects) or 'everybody else'}."
    )
    measured = (
        f"Measured on {model['windows']} windows of the test people: {sampling.samples} samples, {sampling.ddim_steps} denoising "
        f"steps, sampling seed {sampling.sampling_seed}, {about['measured on']['device']}. Metres, unless a line says otherwise."
        + (f" The true futures of similar histories have an APD of {apd:.3g}." if (apd := model.get("multimodal_apd")) else "")
    )
    again = (
        f"`{command}` makes it again, on another machine up to the rounding of its arithmetic. All settings are in `{CONFIG}`, "
        f"standard errors over clips in `{METRICS}`."
    )
    table = "\n".join(["| metric | model | truth |", "|---|---:|---:|", *rows])
    return "\n\n".join([f"# {title}", trained, people, measured, table, again, *acknowledgement(source.data).values()]) + "\n"


def _names(subjects: Sequence[str]) -> str:
    return ", ".join(subjects)


def _of(result: Mapping[str, Any], name: str, scale: float) -> str:
    return f"{scale * result['mean'][name]:.3g}" if name in result["mean"] else "–"


def _kept(result: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of an evaluation; what could not be measured is left out."""
    return {
        key: {name: number for name, number in value.items() if isfinite(number)} if isinstance(value, dict) else value
        for key, value in result.items()
        if key in KEPT
    }
