"""The command lafan1-benchmark."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import mean, stdev
from typing import Any

import torch

from mwlib import plots
from mwlib.cli.options import Repeated
from mwlib.data.collections import acknowledgement
from mwlib.data.load import load_motions
from mwlib.data.sources import data_fingerprint
from mwlib.experiments.results import models_used, of_older_code
from mwlib.experiments.sampling import model_of
from mwlib.inbetweening import lafan1
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.lafan1 import ALL_CLIPS, ALL_WINDOWS, LENGTHS, TOLERANCE, Benchmark
from mwlib.settings import whole
from mwlib.version import __version__

MEASURED = "measured here"
DIGITS = {"L2Q": 3, "L2P": 4, "NPSS": 4}
Models = Mapping[str, Mapping[str, Bridge]]  # by name and run


def lafan1_benchmark(
    *, data: str = "lafan1", out: Path | None = None, model: Repeated[str] = (), samples: int = 10, seed: int = 0
) -> int:
    """Measure the two baselines of the LaFAN1 benchmark of in-betweening, and trained models, on the files at hand.

    Zero velocity and interpolation are measured on the windows of subject 5, normalised by the statistics of subjects 1 to 4, as
    Harvey et al. (2020) do: L2Q, L2P and NPSS of transitions of 5, 15, 30 and 45 frames. Published numbers stand beside. With
    all 77 files, which give 2232 windows, it says whether the published digits are met (exit status 1 if not); with fewer,
    that numbers cannot be compared. A trained model (--model) is given up to ten frames of the past and the frame after the
    transition. It gets three rows: the mean of the errors of single samples, the errors of the samples' average, and those of
    what its network of the mean says, or of the curve that it departs from where it has none. The preset lafan1_official trains
    one.

    Args:
        data: folder of the BVH files, here or under MWLIB_DATA.
        out: folder that also gets benchmark.csv, with a model benchmark_model.csv.
        model: [NAME=]RUN, folder of a finished run of in-betweening, or the name of a shipped one; may be repeated; runs of one
            NAME are averaged.
        samples: of the model, for each window.
        seed: of the model's noise.
    """
    models = _models(model, samples)
    benchmark = lafan1.lafan1_benchmark(load_motions(data), progress=True)
    measured = lafan1.table(benchmark, progress=True)
    for name, runs in models.items():
        found = [lafan1.model_table(bridge, benchmark, name, samples, seed, progress=True) for bridge in runs.values()]
        measured += [_averaged(rows) for rows in zip(*found, strict=True)]
    rows = [row | {"source": MEASURED} for row in measured] + lafan1.published()
    there = f"{len(benchmark)} windows of subject 5, statistics of {len(benchmark.statistics_clips)} clips"
    print(f"Measured here: {there}. Published: all {ALL_WINDOWS} windows of the {ALL_CLIPS} files.")
    for metric in TOLERANCE:
        print(f"\n{metric} at N in-between frames (lower is better)\n{_beside(rows, metric)}")
    missed = lafan1.misses(measured) if lafan1.is_complete(benchmark) else []
    print(f"\n{_verdict(benchmark, missed)}")
    if out:
        command = f"mwlib lafan1-benchmark --data {data}"
        provenance = _provenance(benchmark, data, missed) | {"command": command}
        provenance |= _about_models(models, samples, seed, command) if models else {}
        for path in plots.save_table(rows, out, "benchmark_model" if models else "benchmark", provenance=provenance):
            print(path)
    return 1 if missed else 0


def _models(words: Sequence[str], samples: int) -> dict[str, dict[str, Bridge]]:
    """The models that are asked for, by name and run, on a GPU where there is one; refused before anything is measured."""
    whole("samples", samples, 1)
    found: dict[str, dict[str, Bridge]] = {}
    for word in words:
        name, given, run = ("", "", word) if Path(word).exists() else word.rpartition("=")
        bridge = model_of(run, Bridge, "in-betweening")
        lafan1.check_model(bridge.cfg, bridge.space)
        name = name if given else Path(run).name
        found.setdefault(name, {})[Path(run).name] = bridge.to("cuda" if torch.cuda.is_available() else "cpu")
    return found


def _averaged(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One line of several trainings: the means of the errors and, of more than one, their deviations."""
    out = dict(rows[0])
    for metric in TOLERANCE:
        values = [row[metric] for row in rows]
        if len(rows) > 1 and None not in values:
            out |= {metric: mean(values), f"{metric}, deviation": stdev(values)}
    return out | ({"trainings": len(rows)} if len(rows) > 1 else {})


def _about_models(models: Models, samples: int, seed: int, command: str) -> dict[str, Any]:
    """What the rows of models depend on."""
    found = [
        {
            "name": name, "run": run, "file": models_used.get(run), "settings": cfg.hash(), "past": cfg.task.past,
            "train_steps": cfg.training.train_steps, "training_seed": cfg.training.seed,
            "people": {part: cfg.get(f"{part}_subjects") for part in ("train", "validation", "test")},
            "samples": samples, "ddim_steps": cfg.sampling.ddim_steps, "temperature": cfg.sampling.temperature,
        }
        for name, runs in models.items()
        for run, cfg in ((run, bridge.cfg) for run, bridge in runs.items())
    ]  # fmt: skip
    words = [command, *(f'--model "{each["name"]}={each["run"]}"' for each in found), f"--samples {samples} --seed {seed}"]
    return {"models": found, "seeds": f"{seed}, of the models' noise", "command": " ".join(words)}


def _verdict(benchmark: Benchmark, missed: Sequence[str]) -> str:
    """What the numbers may be compared with; `missed`: where a complete benchmark's digits are not the published ones."""
    if not lafan1.is_complete(benchmark):
        found = f"{len(benchmark)} of {ALL_WINDOWS} windows, {benchmark.clips} of {ALL_CLIPS} files"
        return f"NOT COMPARABLE with the published numbers: {found}. Rows measured here may be compared with each other."
    if missed:
        return "\n  ".join(["The published digits are NOT met:", *missed])
    return "All published digits of the two baselines are met."


def _beside(rows: Sequence[Mapping[str, Any]], metric: str) -> plots.Table:
    """One metric of all methods, a column for each number of frames; what was measured and published of a method together."""
    lines: dict[tuple[str, str], list[float | None]] = {}
    for row in rows:
        lines.setdefault((row["method"], row["source"]), []).append(row[metric])
    methods = list(dict.fromkeys(method for method, _ in lines))
    keys = sorted((key for key, values in lines.items() if set(values) != {None}), key=lambda key: methods.index(key[0]))
    cells = tuple((*key, *_numbers(lines[key], None if key[1] != MEASURED else DIGITS[metric])) for key in keys)
    return plots.Table(("method", "source", *(f"N={n}" for n in LENGTHS)), cells, (False, False, *[True] * len(LENGTHS)))


def _numbers(values: Sequence[float | None], digits: int | None) -> list[str]:
    """With so many digits after the point; None = as many as were published."""
    if digits is None:
        digits = max(len(str(value).partition(".")[2]) for value in values if value is not None)
    return ["–" if value is None else f"{value:.{digits}f}" for value in values]


def _provenance(benchmark: Benchmark, data: str, missed: Sequence[str]) -> dict[str, Any]:
    """What a reader must know to trust the table."""
    return {
        "data": data, "data_fingerprint": data_fingerprint(data), "clips": benchmark.clips, "clips_of_all": ALL_CLIPS,
        "test_windows": {name: benchmark.clip.count(name) for name in dict.fromkeys(benchmark.clip)},
        "test_windows_of_all": ALL_WINDOWS, "verdict": _verdict(benchmark, missed),
        "protocol": {
            "test_subject": lafan1.TEST_SUBJECT, "test_window": lafan1.WINDOW, "test_stride": lafan1.STRIDE,
            "statistics_subjects": lafan1.TRAIN_SUBJECTS, "statistics_window": lafan1.TRAIN_WINDOW,
            "statistics_stride": lafan1.TRAIN_STRIDE, "statistics_clips": list(benchmark.statistics_clips),
            "frames_before": lafan1.PAST, "fps": lafan1.FPS,
        },
        "columns": "L2Q, L2P and NPSS have no unit; N is in frames; an empty cell was not published",
        "sources": "quoted: from a thread of users of the code; other export: their data went through another tool, which "
        "moves the baselines by about 1 %",
        "seeds": "none: nothing is drawn", "mwlib": __version__
    } | of_older_code() | acknowledgement("lafan1")  # fmt: skip
