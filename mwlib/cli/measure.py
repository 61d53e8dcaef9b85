"""Commands that train and measure: train, judge, grid-table, ship, storyboards, reproduction, lafan1-benchmark."""

import sys
from collections.abc import Mapping, Sequence
from json import dumps
from pathlib import Path
from statistics import mean, stdev
from typing import Any

import torch

from mwlib import plots
from mwlib.cli import options
from mwlib.cli.options import Repeated
from mwlib.data.collections import acknowledgement
from mwlib.data.doubts import some
from mwlib.data.load import load_motions
from mwlib.data.sources import data_fingerprint
from mwlib.experiments import claims as claiming
from mwlib.experiments import judging, report, shipped
from mwlib.experiments.grids import columns
from mwlib.experiments.grids import system as system_named
from mwlib.experiments.results import models_used, of_older_code, result_of
from mwlib.experiments.runs import get_model, get_run
from mwlib.experiments.sampling import SENTENCE_MODEL, model_of
from mwlib.experiments.tables import differences, lines, measure, provenance
from mwlib.files import write_atomic, write_json
from mwlib.inbetweening import lafan1
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.lafan1 import ALL_CLIPS, ALL_WINDOWS, LENGTHS, TOLERANCE, Benchmark
from mwlib.paths import run_folder
from mwlib.plots.lines import evidence
from mwlib.prediction.config import Config
from mwlib.prediction.predictor import Predictor
from mwlib.prediction.system import load_data
from mwlib.settings import parse_changes, whole
from mwlib.text_to_motion.config import CLIP
from mwlib.text_to_motion.judging import REAL, Protocol
from mwlib.text_to_motion.system import METRICS
from mwlib.version import __version__


def train(*, system: str = "prediction", preset: str = "laptop", set: Repeated[str] = ()) -> None:
    """Train a preset, or go on with a run that was stopped; prints the run's folder.

    Presets and settings of the system stand below.

    Args:
        system: prediction, rebuilding, inbetweening, text_to_motion or matching.
        preset: one of `mwlib.prediction.config.PRESETS` ... (default: laptop).
        set: change one setting, e.g. data=my/folder or lr=1e-3; may be repeated.
    """
    cfg = system_named(system).Config.preset(preset, **parse_changes(set))
    folder = get_run(cfg, progress=True)
    kept = result_of(folder)["depends"].get("sampling", {})
    if others := [
        f"{name} {kept[name]!r}, not {value!r}" for name, value in cfg.sampled().items() if kept.get(name, value) != value
    ]:
        told = (
            f"mwlib: this run was trained before, and keeps the settings of sampling and testing that it had: {some(others, 5)}"
        )
        print(told, file=sys.stderr)
    print(folder)


def _protocol(
    *,
    pool: int = 32,
    clips: int = 0,
    frames: int = 0,
    whole: bool = False,
    padded_words: bool = False,
    own_statistics: bool = False,
    best_of: int = 1,
    repeated: int = 100,
    repeats: int = 30,
) -> dict[str, Any]:
    """How motions are made and judged; as papers on HumanML3D do, but for what is said.

    Args:
        pool: of R-precision.
        clips: motions that are made, spread evenly over the test set; 0 = one for each clip.
        frames: of every motion that is made; 0 = as many as its clip has.
        whole: take clips from their first frame, none shortened, in place of random pieces.
        padded_words: read the padding behind a sentence as words.
        own_statistics: show the judge motions in the model's scale in place of its own.
        best_of: of each sentence keep that of so many motions which the judge likes best, as if it were the critic.
        repeated: sentences of MultiModality.
        repeats: motions of each of them.
    """
    return locals()


def judge(
    model: str | None = None,
    *,
    data: str = "",
    evaluator: str = "",
    clip_folder: str = CLIP,
    replicates: int = 20,
    seed: int = 0,
    compare: bool = False,
    json: bool = False,
    out: Path = Path("build/judged"),
    **protocol: Any,
) -> None:
    """Score a model of sentences as papers do: FID, R-precision, MM-Dist, Diversity, MultiModality, with intervals.

    Each replicate has a file of its own; a command that was stopped goes on, and one that asks for more replicates adds them.
    Intervals hold 95 %, over replicates: over noise, captions, pieces and pools, not over trainings.

    Args:
        model: a run, the name of a model that comes with the package, or a released file: MDM's model*.pt, or latest.tar of
            StableMoFusion or Free-T2M (default: sentences).
        data: people, cmu, or a folder of HumanML3D or KIT-ML (default: what the model was trained on).
        evaluator: a run, a name that comes with the package, or a folder of the published one (default: that of the data).
        clip_folder: of CLIP ViT-B/32, for a released file.
        replicates: how often all is drawn again.
        seed: of the first one; the others are 1000 apart.
        compare: tell, too, how far each known way in which scores go wrong or differ moves each of them.
        json: print JSON.
        out: gets a folder for these settings.
    """
    whole("replicates", replicates, 1)
    model, how = model or SENTENCE_MODEL, Protocol(**protocol)
    opened = judging.open_all(model, data, evaluator, clip_folder)
    folder, found = judging.replicates(opened, how, replicates, seed, out, compare, progress=True)
    scores = {name: [row[name] for row in found] for name in found[0]}
    absolute = {name: judging.with_intervals(scores.pop(name)) for name in (REAL, "model")}
    less = [row["model"] for row in found]
    moved = {name: judging.with_intervals(rows, less) for name, rows in scores.items()}
    told = {"model": model, "replicates": replicates, "scores": absolute, "moved": moved, "folder": str(folder)}
    write_json(folder / "result.json", told)
    text = repr(_scores({REAL: absolute[REAL], model: absolute["model"]}))
    if moved:
        text += f"\n\nHow far each moves the scores of {model}:\n\n{_scores(moved)}"
    write_atomic(folder / "table.md", f"{text}\n")
    over = (
        f"{replicates} replicates, 95 % intervals over them" if replicates > 1 else "one replicate, so that no interval is known"
    )
    print(dumps(told, indent=1) if json else f"{text}\n\n{over}: {folder}")


def _scores(rows: dict[str, dict[str, tuple[float, float | None]]]) -> plots.Table:
    found: list[dict[str, object]] = [{"": name} for name in rows]
    for line, row in zip(found, rows.values(), strict=True):
        for metric, column in METRICS.items():
            value, width = row.get(metric, (None, None))
            line[column.heading] = value if width is None else (value, width)
    return plots.results_table(found)


def grid_table(**choice_of: Any) -> None:
    """Write the table of a grid, computing the rows that are missing."""
    asked, preset, given, out = options.choice_of(**choice_of)
    kind = system_named(asked.system)
    cfg = kind.Config.preset(preset, **given)
    out.mkdir(parents=True, exist_ok=True)  # what cannot be written is told before hours of work
    found = measure(asked, cfg, progress=True, given=given)
    tables = {
        "": lines(found, kind.METRICS, errors=True),
        "_details": lines(found, details, errors=True) if (details := getattr(kind, "DETAILS", {})) else [],
        "_paired": differences(found, columns(kind), asked.reference),
        "_actions": [
            {"row": row["name"], "action": action, **means} for row in found for action, means in row["actions"].items()
        ],
    }
    about = provenance(asked, cfg, found, given) | {"preset": preset}
    for ending, rows in tables.items():
        if rows and len(rows[0]) > 1:
            plots.save_table(rows, out, f"{asked.id}{ending}", provenance=about)
    shown = lines(found, kind.METRICS)
    best = {column.heading: column.better for column in kind.METRICS.values() if column.better and column.heading in shown[0]}
    table = plots.results_table(shown, better=best)
    write_atomic(out / f"{asked.id}.md", f"{table}\n")
    print(table)


def ship(name: str, *, out: Path = Path("build/models")) -> None:
    """Make a model that comes with the package again: train it, measure it, write its card.

    sentences takes some hours of one core, synthetic and sentences_early about an hour, evaluators and critics some minutes, cmu
    and inbetween half an hour; names of CMU need the clips under MWLIB_DATA. A graphics card is used where there is one. A
    training that was stopped goes on. sentences begins with the weights of sentences_first, which does not come along: it is made
    first, in build/models, unless it lies there.

    Args:
        name: one of `mwlib.experiments.shipped.RECIPES`.
        out: gets a folder of that name.
    """
    title, cfg = shipped.recipe(name)
    if "start" in cfg.owners() and cfg.get("start") == shipped.FIRST and run_folder(shipped.FIRST) is None:
        ship(Path(shipped.FIRST).name, out=Path(shipped.FIRST).parent)
    (out / name).mkdir(parents=True, exist_ok=True)
    shipped.ship(cfg, out / name, title, f"mwlib ship {name}", progress=True)
    print((out / name / shipped.CARD).read_text(encoding="utf-8"), end="")


def storyboards(
    *,
    preset: str = "laptop",
    set: Repeated[str] = (),
    run: str = "",
    clips: Sequence[str] = (),
    out: Path = Path("build/storyboards"),
) -> None:
    """Draw predictions of people never seen, their end poses, and the loss curves; trains the model if it is missing.

    Args:
        preset: one of `mwlib.prediction.config.PRESETS` (default: laptop).
        set: change one setting, e.g. data=my/folder or lr=1e-3; may be repeated.
        run: a finished run, or the name of a model that comes with the package, instead of a preset; draws no loss curves.
        clips: test clips (default: three windows).
        out: folder.
    """
    if run and set:
        raise ValueError("both --run and --set are given; expected one of them: a finished run has its settings")
    finished = model_of(run, Predictor, "prediction") if run else None
    cfg = finished.cfg if finished else Config.preset(preset, **parse_changes(set))
    split = load_data(cfg)
    predictor = finished or get_model(cfg, split, progress=True)
    if not finished:
        report.write_curves(cfg, split, out)
    report.write_storyboards(cfg, split, predictor, out, clips)
    report.write_ends(cfg, split, predictor, out, clips)
    print(out)


EVIDENCE = (
    "A strip of marks for each theme of claims: blue ones to the right of a grey band came out as the paper says, orange ones to "
    "the left the other way, grey ones inside it are undecided."
)


def reproduction(*, claims: Path | None = None, tables: Path | None = None, out: Path = Path("REPRODUCTION.md")) -> None:
    """Write the report on the paper's claims: what holds, what does not, what cannot be tested, and where to look.

    Numbers come from measured tables, verdicts from conditions over them. A verdict that no longer follows from its table is
    refused, and so is a link to a section that a notebook does not have; the message names the claim, what was found and what was
    expected.

    Args:
        claims: their file (default: figures/claims.yaml).
        tables: folder of measured tables (default: figures/cmu).
        out: the page; its picture goes to figures/verdicts.png beside it.
    """
    claims, measured = claims or claiming.claims_file(), claiming.Tables(tables)
    found = claiming.findings(claims, measured)
    write_atomic(out, claiming.reproduction(claims, measured, found))
    strips: dict[str, list[float]] = {}
    for row in (rows := claiming.scores(found)):
        strips.setdefault(row["theme"], []).append(row["errors"])
    if rows:
        figure, _ = evidence(strips, beyond=claiming.BEYOND)
        origin = {"command": "mwlib reproduction"}
        plots.save(figure, out.parent / "figures", "verdicts", data=rows, alt=EVIDENCE, provenance=origin)
    print(out)


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
        name, _, run = ("", "", word) if Path(word).exists() else word.rpartition("=")
        bridge = model_of(run, Bridge, "in-betweening")
        lafan1.check_model(bridge.cfg, bridge.space)
        own = Path(run).name
        found.setdefault(name or own, {})[own] = bridge.to("cuda" if torch.cuda.is_available() else "cpu")
    return found


def _averaged(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One line of several trainings: the means of the errors and, of more than one, their deviations."""
    if len(rows) == 1:
        return dict(rows[0])
    out = dict(rows[0]) | {"trainings": len(rows)}
    for metric in TOLERANCE:
        values = [row[metric] for row in rows]
        if None not in values:
            out |= {metric: mean(values), f"{metric}, deviation": stdev(values)}
    return out


def _about_models(models: Models, samples: int, seed: int, command: str) -> dict[str, Any]:
    """What the rows of models depend on."""
    found = [
        {
            "name": name, "run": run, "file": models_used.get(run), "settings": cfg.hash(), "past": cfg.task.past,
            "train_steps": cfg.training.train_steps, "training_seed": cfg.training.seed,
            "people": {part: cfg.get(f"{part}_subjects") for part in ("train", "validation", "test")},
            "samples": samples, "ddim_steps": cfg.sampling.ddim_steps, "temperature": cfg.sampling.temperature,
        }
        for name, runs in models.items() for run, bridge in runs.items() for cfg in [bridge.cfg]
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
    order, found = [row["method"] for row in rows], {}
    for row in sorted(rows, key=lambda row: order.index(row["method"])):
        found.setdefault((row["method"], row["source"]), []).append(row[metric])
    cells = []
    for (method, source), values in found.items():
        if known := [value for value in values if value is not None]:
            digits = DIGITS[metric] if source == MEASURED else max(len(str(value).partition(".")[2]) for value in known)
            cells.append((method, source, *("–" if value is None else f"{value:.{digits}f}" for value in values)))
    return plots.Table(("method", "source", *(f"N={n}" for n in LENGTHS)), tuple(cells), (False, False, *[True] * len(LENGTHS)))


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
