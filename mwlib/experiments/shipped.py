"""The trained models that come with the package: made by one command, each with a card that says what it can do."""

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from mwlib.data.collections import acknowledgement
from mwlib.experiments.grids import columns, system, system_of
from mwlib.experiments.results import of_older_code, read_result, rendered
from mwlib.experiments.runs import get_model, get_result, get_run
from mwlib.files import sweep, write_together
from mwlib.hashing import digest
from mwlib.paths import CONFIG
from mwlib.settings import Settings, choice
from mwlib.training import MODEL
from mwlib.training.checkpoint import load_tensors, packed
from mwlib.version import __version__

CARD, METRICS = "card.md", "metrics.json"
KEPT = ("mean", "standard_error", "windows", "multimodal_apd")  # of what an evaluation gives


FIRST = "build/models/sentences_first"  # where the second training of sentences looks for the first
_SENTENCES: dict[str, Any] = {"clips": 12_000, "width": 256, "feedforward": 1024, "test_clips": 360}  # five times the clips
RECIPES: dict[str, tuple[str, str, str, dict[str, Any]]] = {  # name -> title, system, preset, changes
    "synthetic": ("Synthetic people", "prediction", "laptop", {"train_steps": 14000}),
    "cmu": (  # of those tried on the validation person: least in ADE with 0.45 to 0.55 and 0.85 to 0.95 inside the bands
        "People of the CMU motion capture database",
        "prediction",
        "cmu",
        {"condition_scale": "coefficient", "temperature": 1.15, "temperature_spread": 0.25, "seam": 0.045},
    ),
    "inbetween": (
        "In-betweens of people of the CMU motion capture database",
        "inbetweening",
        "cmu",
        {"more_data": ("cmu/bvh",), "temperature": 0.4},  # of the validation person's jerk least is missed at 0.4
    ),
    "evaluator": ("Judge of motions made from sentences, for synthetic people", "matching", "laptop", {}),
    "critic": ("Critic for the semantic loss, for synthetic people", "matching", "laptop", {"half": "critic", "seed": 1}),
    "cmu_evaluator": ("Judge of motions made from sentences, for CMU's people and captions", "matching", "cmu", {}),
    "cmu_critic": ("Critic for the semantic loss, for CMU's people and captions", "matching", "cmu", {"seed": 1}),
    "sentences": (
        "Synthetic people who do what a sentence says",
        "text_to_motion",
        "laptop",
        _SENTENCES
        | {  # goes on where the first training ended, with what corrects single frames; the steps of an hour of two cores
            "start": FIRST,
            "detail": 384,
            "level_weight": "root_snr",
            "train_steps": 5200,
            "lr": 5e-4,
            "guidance_above": 0.5,
        },
    ),
    "sentences_first": (
        "Synthetic people who do what a sentence says: where the training of sentences begins",
        "text_to_motion",
        "laptop",
        _SENTENCES | {"train_steps": 13_493, "lr_schedule": "multistep", "lr_milestones": (9382, 11_843)},
    ),
    "sentences_early": (
        "Synthetic people who do less of what a sentence says: where the tables of losses begin",
        "text_to_motion",
        "laptop",
        {"schedule": "cosine", "dropout": 0.1},
    ),
}


def recipe(name: str) -> tuple[str, Settings]:
    """Title and configuration of a model that comes with the package.

    Raises:
        ValueError: there is none of that name; the message lists those there are.
    """
    choice("name", name, RECIPES)
    title, kind, preset, changes = RECIPES[name]
    return title, system(kind).Config.preset(preset, **changes)


def ship(cfg: Settings, folder: Path, title: str, command: str, progress: bool = False) -> dict[str, Any]:
    """Train a configuration (once), and write model, configuration, metrics and card into a folder.

    Weights are kept in half precision: half the size. What is measured is the run's own model, in single precision.

    Args:
        cfg: of any system; where it has a field `method`, that knows "truth".
        folder: gets config.yaml, model.safetensors, metrics.json and card.md.
        title: the card's first line.
        command: that makes this model again; the card names it.
        progress: show bars on stderr.

    Returns:
        What metrics.json holds.
    """
    kind = system_of(cfg)
    data: Any = kind.load_data(cfg)
    sweep(folder)
    found = {"model": get_result(cfg, data, progress)}
    if "method" in cfg.owners():
        found["truth"] = get_result(cfg.override(method="truth"), data, progress)
    run = get_run(cfg, data)
    tensors, about = load_tensors(run / MODEL)
    tensors = {name: t.half() if name.startswith("net.") and t.is_floating_point() else t for name, t in tensors.items()}
    metrics: dict[str, Any] = {name: _kept(result) for name, result in found.items()}
    if more_rows := getattr(kind, "more_rows", None):
        metrics["more"] = more_rows(get_model(cfg, data), data.test, found["model"])
    metrics["training"] = read_result(run, cfg.training_hash())
    metrics["about"] = {
        "settings": cfg.hash(), "data": list(data.fingerprints()), "mwlib": __version__, "measured on": found["model"]["machine"],
        "code": digest(found["model"]["depends"]["code"]), **of_older_code(),
    }  # fmt: skip
    files = {MODEL: packed(tensors, about), CONFIG: cfg.to_yaml(), CARD: card(title, command, cfg, metrics)}
    files[METRICS] = json.dumps(metrics, indent=1)  # last, as it proves that the others are there
    write_together({folder / name: content for name, content in files.items()})
    return metrics


def card(title: str, command: str, cfg: Settings, metrics: Mapping[str, Any]) -> str:
    """What a reader must know of a model before using it, as Markdown."""
    kind: Any = system_of(cfg)
    return rendered(
        "experiments/card.md.jinja",
        title=title,
        command=command,
        places=(CONFIG, METRICS),
        cfg={name: cfg.get(name) for name in cfg.owners()},
        columns=columns(kind),
        found={name: metrics[name] for name in ("model", "truth") if name in metrics},
        training=metrics["training"],
        about=metrics["about"],
        more=kind.more_of_card(metrics["more"]) if metrics.get("more") else [],
        owners=acknowledgement(cfg.get("data")).values(),
    )


def _kept(result: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of an evaluation; what could not be measured is left out."""
    return {
        key: {name: number for name, number in value.items() if isfinite(number)} if isinstance(value, dict) else value
        for key, value in result.items()
        if key in KEPT
    }
